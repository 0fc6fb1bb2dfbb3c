"""The `frazil` command: render, points, info.

Model: each command is one module; this one assembles them and turns what goes wrong into one line and an exit status:
0 done, 1 failed, 2 misused, 130 stopped by Ctrl-C, 143 by SIGTERM.
Valid: nothing heavy is imported before a command needs it, so that `frazil --help` answers at once.
Not: logic that Python users would miss.
"""

import signal
import sys
import warnings
from collections.abc import Sequence
from typing import Any

__all__ = ["main"]

DONE, FAILED, MISUSED = 0, 1, 2
_STOPPED_BY = 128  # plus the number of the signal, as shells report it


class _Stopped(BaseException):
    """A signal asked to stop; its number is the argument. Not a KeyboardInterrupt, which the parser would swallow."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process if not given.
    """
    from .app import app

    arguments = list(sys.argv[1:] if arguments is None else arguments)
    previous = {number: signal.signal(number, _stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with warnings.catch_warnings():
            _print_warnings()
            return app()(args=arguments, prog_name="frazil", standalone_mode=False) or DONE
    except _Stopped as stop:
        _say("error", "stopped. Nothing half-written is left.")
        return _STOPPED_BY + int(stop.args[0])
    except BrokenPipeError:
        sys.stdout = None  # the reader has left; there is nobody to flush to
        return FAILED
    except Exception as error:
        return _report(error)
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _stop(number: int, frame: Any) -> None:
    raise _Stopped(number)


def _report(error: Exception) -> int:
    """Say what went wrong in one line and give the exit status."""
    if hasattr(error, "format_message"):  # the parser's: an option or argument is wrong
        _say("error", error.format_message())
        return getattr(error, "exit_code", MISUSED)
    if isinstance(error, MemoryError):
        _say("error", str(error) or "memory is exhausted. Lower --resolution or raise --spacing.")
    elif isinstance(error, OSError) and error.filename is not None:
        _say("error", f"{error.filename}: {error.strerror}.")
    elif isinstance(error, KeyError):
        _say("error", str(error.args[0]) if error.args else "unknown name.")
    elif isinstance(error, OSError | ValueError | RuntimeError):
        _say("error", str(error))
    else:
        raise error
    return FAILED


def _print_warnings() -> None:
    """One line on stderr for each of our warnings, each only once; those of libraries stay silent."""
    from ..warning import FrazilWarning

    said = set()

    def show(message: Warning | str, category: type, *_: Any) -> None:
        if str(message) not in said:
            said.add(str(message))
            _say("warning", str(message))

    warnings.simplefilter("ignore")
    warnings.simplefilter("always", FrazilWarning)
    warnings.showwarning = show


def _say(kind: str, message: str) -> None:
    print(f"frazil: {kind}: {' '.join(message.split())}", file=sys.stderr, flush=True)
