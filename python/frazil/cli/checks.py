"""What every command refuses before it starts: values out of range, unknown names, files out of reach."""

import math
from difflib import get_close_matches
from pathlib import Path

import typer

from .frames import parse_resolution

__all__ = ["checked_resolution", "misused", "one_of", "positive", "refuse_unreadable", "refuse_unwritable", "within"]


def misused(option: str, message: str) -> typer.BadParameter:
    return typer.BadParameter(message, param_hint=option)


def one_of(option: str, value: str, known: tuple[str, ...]) -> str:
    """The value, where it is known; else the error with the nearest."""
    if value in known:
        return value
    nearest = get_close_matches(value, known, n=1)
    hint = f" Did you mean {nearest[0]}?" if nearest else ""
    raise misused(option, f"must be one of {', '.join(known)}, got '{value}'.{hint}")


def positive(option: str, value: float, may_be_zero: bool = False) -> None:
    if math.isfinite(value) and (value > 0 or (may_be_zero and value == 0)):
        return
    raise misused(option, f"must be {'>=' if may_be_zero else '>'} 0 and finite, got {value}.")


def within(option: str, value: int, low: int, high: int) -> None:
    if not low <= value <= high:
        raise misused(option, f"must be from {low} to {high}, got {value}.")


def checked_resolution(text: str) -> tuple[int, int]:
    """`--resolution` as (width, height)."""
    try:
        return parse_resolution(text)
    except ValueError as error:
        raise misused("--resolution", str(error)) from None


def refuse_unreadable(scene: Path) -> None:
    if not scene.exists():
        raise FileNotFoundError(f"{scene}: file must exist. Check the path.")


def refuse_unwritable(*paths: Path | None) -> None:
    from ..replacing import check_writable

    for path in paths:
        if path is not None:
            check_writable(path)
