"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

import importlib
from typing import Any

from ._frazil import (
    Dipole,
    Medium,
    Mesh,
    PointSet,
    PointTree,
    Ramp,
    area_compensation,
    fresnel_average,
    fresnel_dielectric,
    poisson_points,
    tessellated_points,
)
from .warning import FrazilWarning

# Names that need more than the core, and where they live: imported when first asked for.
_LAZY = {"Film": ".film", "load_usd": ".usd", "render": ".rendering"}

__all__ = [
    "Dipole",
    "Film",
    "FrazilWarning",
    "Medium",
    "Mesh",
    "PointSet",
    "PointTree",
    "Ramp",
    "area_compensation",
    "fresnel_average",
    "fresnel_dielectric",
    "load_usd",
    "poisson_points",
    "render",
    "tessellated_points",
]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(importlib.import_module(_LAZY[name], __name__), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'frazil' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
