"""Procedural ice to start from: formations as plain data, and written as USD.

Model: each formation is a function of its parameters and a seed; the same arguments give the same bits.
Units: metres, y up.

    >>> import frazil as fz
    >>> tips = fz.formations.ice_tips(seed=3, triangles=20_000)
    >>> tips.collections["ice"], tips.part("Ice").positions.shape[1]
    (['Ice'], 3)
"""

from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

from .breath import breath_burst
from .cathedral import cathedral
from .formation import CameraRow, Formation, LightRow, MaterialRow, Part
from .glacier_front import glacier_front
from .iceberg import iceberg
from .icicles import icicles
from .pack_ice import pack_ice
from .spires import ice_tips, spire_cluster
from .usd import write_formation

__all__ = [
    "FORMATIONS",
    "CameraRow",
    "Formation",
    "LightRow",
    "MaterialRow",
    "Part",
    "breath_burst",
    "cathedral",
    "glacier_front",
    "ice_tips",
    "iceberg",
    "icicles",
    "make_formation",
    "pack_ice",
    "spire_cluster",
    "write_formation",
]

FORMATIONS: dict[str, Callable[..., Formation]] = {
    made.__name__: made
    for made in (spire_cluster, ice_tips, cathedral, iceberg, glacier_front, breath_burst, icicles, pack_ice)
}


def make_formation(name: str, **parameters: Any) -> Formation:
    """The formation of that name.

    Parameters
    ----------
    name : str
        A key of FORMATIONS.
    **parameters
        Those of the function: scale, age, seed, detail, triangles, and its own.

    Returns
    -------
    Formation

    Raises
    ------
    KeyError
        For an unknown name; the message has the nearest.
    ValueError
        For a parameter out of range.
    """
    if name not in FORMATIONS:
        nearest = get_close_matches(name, FORMATIONS, n=1, cutoff=0.0)[0]
        known = ", ".join(FORMATIONS)
        raise KeyError(f"formations: name must be one of {known}, got {name!r}. Did you mean {nearest!r}?")
    return FORMATIONS[name](**parameters)
