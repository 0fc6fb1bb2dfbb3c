"""Mattes: named sets of objects, and how much of each pixel shows them, directly and through ice.

Model: a set holds every object at or below one of its paths; sets may overlap. The core makes layers ``matte.NAME`` and
``refracted_matte.NAME`` of each (docs/aovs.md).
Not: ids of single objects (cryptomatte.py).
"""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any

__all__ = ["resolve_mattes"]


def resolve_mattes(scene: Any, mattes: Mapping[str, Sequence[str]] | None) -> list[tuple[str, list[int]]]:
    """The sets with the indices of their objects: those of the stage (``scene.mattes``), and these in their stead.

    Parameters
    ----------
    scene : Scene
        Its objects' paths are looked up.
    mattes : mapping of str to sequence of str
        The paths of each set; a path stands for all objects at and below it.

    Raises
    ------
    KeyError
        For a path at and below which there is no object; the message has the nearest.
    """
    sets: dict[str, list[int]] = dict(getattr(scene, "mattes", {}))
    paths = [item.path for item in scene.objects]
    for name, members in (mattes or {}).items():
        if isinstance(members, str):
            raise TypeError(f"matte {name}: paths must be a sequence of paths, got one text {members!r}.")
        chosen: set[int] = set()
        for member in members:
            root = member.rstrip("/")
            found = [i for i, path in enumerate(paths) if path == root or path.startswith(f"{root}/")]
            if not found:
                nearest = get_close_matches(root, paths, n=1, cutoff=0.0)
                hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
                raise KeyError(f"matte {name}: path must be at or above an object, got {member!r}.{hint}")
            chosen.update(found)
        sets[name] = sorted(chosen)
    return list(sets.items())
