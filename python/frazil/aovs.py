"""The core's AOV table, and how names that are asked for are found in it.

Model: one table (src/frazil/render/aov.cpp) drives film, EXR, command line, UsdRenderVar and docs/aovs.md.
Not: making the layers.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

__all__ = ["ALL", "aov_names", "aov_table", "chosen_aovs", "layers_of", "unknown_name"]

ALL = "all"  # stands for every AOV that is made without being asked for


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
        if name == ALL:
            continue
        if name not in known:
            raise KeyError(unknown_name("aovs", name, known))
        if name in chosen:
            raise ValueError(f"aovs: names must differ from each other, got {name!r} twice.")
        chosen.append(name)
    return chosen


def layers_of(names: Iterable[str], film: Mapping[str, Any]) -> list[str]:
    """The layers of a film that AOVs stand for: themselves, and by light group, knot of a ramp, rank of a Cryptomatte;
    with ramps and compensations, what is seen of that ice by way of other lobes.

    Raises
    ------
    KeyError
        For an AOV of which the film has nothing.
    """
    groups = getattr(film, "metadata", {}).get("frazil:light_groups") or []
    tails = ["", *(f"_{group}" for group in groups)]
    layers: dict[str, None] = {}
    for name in names:
        # Ramps and compensations come with the light of ice that is seen by way of other lobes.
        own_name = re.escape(name)
        if name.startswith(("translucency_ramp", "compensation_")):
            own_name = f"(?:indirect_)?{own_name}|indirect_translucency"
        if name in ("matte", "refracted_matte"):
            own_name += r"(?:\.\w+)?"
        if name == "overlay":
            own_name = r"overlay_\w+"
        pattern = re.compile(rf"(?:{own_name})\d*({'|'.join(map(re.escape, tails))})")
        own = [layer for layer in film if pattern.fullmatch(layer)]
        if not own:
            raise KeyError(unknown_name("Film: layer", name, list(film)))
        layers |= dict.fromkeys(own)
    return list(layers)


def unknown_name(what: str, name: str, known: Sequence[str]) -> str:
    """The message for a name that is none of the known ones, with the nearest of them."""
    nearest = get_close_matches(str(name), known, n=3)
    hint = f" Did you mean {' or '.join(repr(other) for other in nearest)}?" if nearest else ""
    return f"{what}: must be one of {', '.join(known)}, got {name!r}.{hint}"
