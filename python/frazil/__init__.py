"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

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

__all__ = [
    "Dipole",
    "Medium",
    "Mesh",
    "PointSet",
    "PointTree",
    "Ramp",
    "area_compensation",
    "fresnel_average",
    "fresnel_dielectric",
    "poisson_points",
    "tessellated_points",
]
