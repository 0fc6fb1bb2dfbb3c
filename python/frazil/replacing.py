"""Files that are replaced whole or not at all.

Model: the new file is written beside its target under a temporary name, flushed to the disk and renamed, so that a
reader, a power cut, a kill or a full disk meets the old file or the new one, never half of one.
Valid: any local or network file system with an atomic rename within a folder.
Not: locks; of two writers of one file the later wins, whole.
"""

import contextlib
import os
import socket
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

__all__ = ["DAMAGED_ARCHIVE", "check_writable", "replacing"]

# What zipfile and numpy raise where an archive of arrays is damaged or not ours: also for what a damaged header
# says of encryption, methods and sizes.
DAMAGED_ARCHIVE = (
    zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, SyntaxError, NotImplementedError, RuntimeError,
    KeyError, ValueError, EOFError, OverflowError, MemoryError, TypeError,
)  # fmt: skip


@contextlib.contextmanager
def replacing(path: str | os.PathLike) -> Iterator[Path]:
    """Give the path of a temporary file beside `path`; rename it to `path` when the block ends well.

    Parameters
    ----------
    path : path-like
        The file to write. A link is followed, so that the link stays one.

    Yields
    ------
    Path
        Where the block must write. On an error it is removed and `path` is what it was.

    Raises
    ------
    OSError
        Naming `path`, where the folder cannot be written or the disk is full.
    """
    target = Path(path).resolve()
    check_writable(target)
    _remove_leftovers(target)
    temporary = target.with_name(f"{_temporary_prefix(target)}{os.getpid()}.tmp")
    try:
        yield temporary
        _flush(temporary)
        os.replace(temporary, target)
        _flush(target.parent)
    except OSError as error:
        if error.filename in (None, str(temporary)):
            raise OSError(
                f"{path}: cannot be written: {error.strerror or error}. The old file, if any, is whole."
            ) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: str | os.PathLike) -> None:
    """Refuse a path where no file can be made, before work is spent on what would be lost.

    Raises
    ------
    OSError
        Naming `path` and the remedy: the folder is missing or read-only, or the path is not that of a file.
    """
    target = Path(path).resolve()
    folder = target.parent
    if target.exists() and not target.is_file():
        kind = "a folder" if target.is_dir() else "a device"
        raise OSError(f"{path}: output must be a file, got {kind}. Name a file in it.")
    if not folder.is_dir():
        raise OSError(f"{path}: folder must exist, got '{folder}'. Create it first.")
    probe = target.with_name(f"{_temporary_prefix(target)}{os.getpid()}.probe")
    try:
        probe.touch()
    except OSError as error:
        raise OSError(f"{path}: folder must be writable, got '{folder}' ({error.strerror}).") from error
    finally:
        with contextlib.suppress(OSError):
            probe.unlink(missing_ok=True)


def _temporary_prefix(target: Path) -> str:
    return f".{target.name}.{socket.gethostname()}-"


def _remove_leftovers(target: Path) -> None:
    # A process that was killed leaves its temporary or its probe; only this machine can tell that the process is gone.
    prefix = _temporary_prefix(target)
    for leftover in target.parent.glob(f"{_escaped(prefix)}*"):
        pid, _, kind = leftover.name[len(prefix) :].partition(".")
        if kind in ("tmp", "probe") and pid.isdigit() and not Path(f"/proc/{pid}").exists():
            leftover.unlink(missing_ok=True)


def _escaped(name: str) -> str:
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)


def _flush(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
