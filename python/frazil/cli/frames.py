"""What `--resolution`, `--frames` and patterns in file names mean.

Valid: ``WxH`` from 1x1 to 65536x65536; ``A``, ``A-B``, ``A-BxSTEP``, comma between several; ``####``, ``$F4``, ``$F``,
``<F4>`` and ``%04d`` in names.
Not: views and other tokens.
"""

import re
from pathlib import Path
from typing import Any

__all__ = ["authored_resolution", "fill_pattern", "has_pattern", "parse_frames", "parse_resolution"]

DEFAULT_RESOLUTION = (960, 540)
MAX_SIZE = 65536
MAX_FRAMES = 1_000_000

_PATTERN = re.compile(r"#+|\$F(\d*)|<F(\d*)>|%0?(\d*)d")


def parse_resolution(text: str) -> tuple[int, int]:
    """``WxH`` as (width, height); ValueError for anything else."""
    match = re.fullmatch(r"(\d{1,9})[xX*](\d{1,9})", text.strip())
    if match is None:
        raise ValueError(f"must be WIDTHxHEIGHT in pixels, got '{text}'. For example 960x540.")
    width, height = int(match[1]), int(match[2])
    if not (1 <= width <= MAX_SIZE and 1 <= height <= MAX_SIZE):
        raise ValueError(f"must be from 1x1 to {MAX_SIZE}x{MAX_SIZE}, got '{text}'.")
    return width, height


def authored_resolution(scene: Any) -> tuple[int, int]:
    """The resolution that a loaded stage's render settings ask for, else the default."""
    settings = scene.render_settings
    return (settings and settings.product.resolution) or DEFAULT_RESOLUTION


def parse_frames(text: str) -> list[int]:
    """The frames of a range such as ``1-10``, ``1-10x2`` or ``1,5,20-30``, in the order given, each once."""
    frames: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(-?\d{1,9})(?:-(-?\d{1,9}))?(?:x(\d{1,9}))?\s*", part)
        if match is None:
            raise ValueError(f"must be A-B, A-BxSTEP or a list of these, got '{text}'. For example 1-100x2.")
        first = int(match[1])
        last = int(match[2]) if match[2] else first
        step = int(match[3]) if match[3] else 1
        if step < 1 or last < first:
            raise ValueError(f"must run upwards with a step of 1 or more, got '{part}'.")
        if (last - first) // step >= MAX_FRAMES:
            raise ValueError(f"must be at most {MAX_FRAMES} frames, got '{part}'.")
        frames.extend(range(first, last + 1, step))
    return list(dict.fromkeys(frames))


def has_pattern(path: Path | str) -> bool:
    """Whether a file name has a place for the frame's number."""
    return _PATTERN.search(Path(path).name) is not None


def fill_pattern(path: Path, frame: float | None) -> Path:
    """The path with the frame's number in place of its pattern; the path itself where it has none."""
    if not has_pattern(path):
        return path
    if frame is None:
        raise ValueError(f"{path}: a name with a frame pattern needs a frame. Give --frame or --frames.")
    number = round(frame)

    def digits(match: re.Match) -> str:
        width = len(match[0]) if match[0].startswith("#") else int(match[1] or match[2] or match[3] or 1)
        return f"{'-' if number < 0 else ''}{abs(number):0{width}d}"

    return path.with_name(_PATTERN.sub(digits, path.name))
