"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

from ._frazil import (
    Dipole,
    Medium,
    Mesh,
    PointTree,
    Ramp,
    area_compensation,
    fresnel_average,
    fresnel_dielectric,
)

__all__ = [
    "Dipole",
    "Medium",
    "Mesh",
    "PointTree",
    "Ramp",
    "area_compensation",
    "fresnel_average",
    "fresnel_dielectric",
]
