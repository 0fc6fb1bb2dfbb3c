"""Long work of the core beside the main thread, so that Ctrl-C is heard while it runs and stops it.

Not: threads of the core itself.
"""

import threading
from collections.abc import Callable
from typing import Any

__all__ = ["Progress", "run_stoppable"]

Progress = Callable[[str, float], None]


def run_stoppable(work: Callable[[Progress], Any], progress: Progress | None) -> Any:
    """Run ``work(report)`` in a thread of its own; after an exception here report() raises, which stops the work.

    Signals are heard only by the main thread while it runs Python, so it must not be the one that computes.
    """
    stop, done = threading.Event(), threading.Event()
    outcome: dict[str, Any] = {}

    def report(stage: str, fraction: float) -> None:
        if stop.is_set():
            raise KeyboardInterrupt
        if progress is not None:
            progress(stage, fraction)

    def run() -> None:
        try:
            outcome["result"] = work(report)
        except BaseException as error:
            outcome["error"] = error
        finally:
            done.set()

    worker = threading.Thread(target=run, name="frazil render", daemon=True)
    worker.start()
    try:
        done.wait()  # not join(): interrupted, that takes a running thread for a stopped one
    except BaseException:
        stop.set()
        done.wait()
        raise
    finally:
        worker.join()
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]
