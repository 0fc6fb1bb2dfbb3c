"""How far a render is: a bar with the time left, lines for a render farm, or nothing.

Model: the core reports (stage, fraction); stages are weighed by what they usually cost, so that one number grows from
0 to 1 over all frames. Each reporter is a context manager that is called with stage and fraction, from any thread.
Units: fractions in [0, 1].
Valid: the number never shrinks.
Not: exact; the weights are a guess of the time left, not a promise.
"""

import sys
import threading
from collections.abc import Callable
from typing import Any

__all__ = ["PROGRESS_KINDS", "make_progress"]

PROGRESS_KINDS = ("bar", "farm", "none")

# In the order in which they run; a stage that is not named here leaves the number as it is.
_WEIGHTS = {
    "load": 3.0,
    "scene": 2.0,
    "points": 4.0,
    "areas": 2.0,
    "bake": 10.0,
    "bounce": 6.0,
    "tree": 1.0,
    "render": 70.0,
    "save": 2.0,
}


class _Overall:
    """One fraction from the fractions of stages and the number of frames."""

    def __init__(self, frames: int):
        self._frames = max(1, frames)
        self._frame = 0
        self._value = 0.0
        self._lock = threading.Lock()

    def next_frame(self) -> None:
        self._frame += 1

    def update(self, stage: str, fraction: float) -> float:
        before = 0.0
        for name, weight in _WEIGHTS.items():
            if name == stage:
                before += weight * min(1.0, max(0.0, fraction))
                break
            before += weight
        else:
            before = 0.0
        value = (self._frame + before / sum(_WEIGHTS.values())) / self._frames
        with self._lock:
            self._value = max(self._value, min(1.0, value))
            return self._value


class Silent:
    """Says nothing."""

    def __init__(self, frames: int = 1):
        self.overall = _Overall(frames)

    def __enter__(self) -> "Silent":
        return self

    def __exit__(self, *_: Any) -> None:
        pass

    def __call__(self, stage: str, fraction: float) -> None:
        self.show(stage, self.overall.update(stage, fraction))

    def frame_done(self) -> None:
        """The next reports are those of the next frame."""
        self("save", 1.0)
        self.overall.next_frame()

    def show(self, stage: str, value: float) -> None:
        """Tell the overall value in [0, 1]."""


class Lines(Silent):
    """One line each time that another `step` percent are done."""

    def __init__(self, frames: int, step: int, write: Callable[[str, int], None]):
        super().__init__(frames)
        self._step, self._write, self._last = step, write, -step
        self._lock = threading.Lock()

    def show(self, stage: str, value: float) -> None:
        percent = int(100 * value + 1e-9)
        with self._lock:
            if percent >= self._last + self._step:
                self._last = percent - percent % self._step
                self._write(stage, percent)


class Bar(Silent):
    """A bar with the stage and the time left, on stderr."""

    def __init__(self, frames: int):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

        super().__init__(frames)
        self._bar = Progress(
            TextColumn("{task.description:>8}"),
            BarColumn(),
            TaskProgressColumn(),
            TimeRemainingColumn(compact=True),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task("load", total=1.0)

    def __enter__(self) -> "Bar":
        self._bar.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self._bar.stop()

    def show(self, stage: str, value: float) -> None:
        self._bar.update(self._task, description=stage, completed=value)


def _write_farm(stage: str, percent: int) -> None:
    print(f"ALF_PROGRESS {percent}%", flush=True)


def _write_plain(stage: str, percent: int) -> None:
    print(f"frazil: {percent:3d}% {stage}", file=sys.stderr, flush=True)


def make_progress(kind: str, frames: int = 1) -> Silent:
    """The reporter of that kind (see `PROGRESS_KINDS`); a bar becomes a line each 10 % where stderr is no terminal."""
    if kind == "farm":
        return Lines(frames, 1, _write_farm)
    if kind == "bar":
        return Bar(frames) if sys.stderr.isatty() else Lines(frames, 10, _write_plain)
    return Silent(frames)
