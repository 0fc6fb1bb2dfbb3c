"""The core's AOV table, and how names that are asked for are found in it.

Model: one table (src/frazil/render/aov.cpp) drives film, EXR, command line, UsdRenderVar and docs/aovs.md.
Not: making the layers.
"""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches
from typing import Any

__all__ = ["aov_names", "aov_table", "chosen_aovs", "unknown_name"]


def aov_table() -> list[dict[str, Any]]:
    """The rows: name, channels, meaning, filter, is_additive, is_half, is_default."""
    from . import _frazil

    return _frazil.aov_table()


def aov_names() -> list[str]:
    """The names of all rows, in the table's order."""
    return [row["name"] for row in aov_table()]


def chosen_aovs(names: Iterable[str]) -> list[str]:
    """The names, checked.

    Raises
    ------
    KeyError
        For a name that is not in the table; the message has the nearest.
    ValueError
        For a name that is there twice.
    """
    known = aov_names()
    chosen: list[str] = []
    for name in names:
        if name not in known:
            raise KeyError(unknown_name("aovs", name, known))
        if name in chosen:
            raise ValueError(f"aovs: names must differ from each other, got {name!r} twice.")
        chosen.append(name)
    return chosen


def unknown_name(what: str, name: str, known: Sequence[str]) -> str:
    """The message for a name that is none of the known ones, with the nearest of them."""
    nearest = get_close_matches(str(name), known, n=3)
    hint = f" Did you mean {' or '.join(repr(other) for other in nearest)}?" if nearest else ""
    return f"{what}: must be one of {', '.join(known)}, got {name!r}.{hint}"
