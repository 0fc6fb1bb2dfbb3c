"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

import importlib
from typing import Any

from ._frazil import (
    Bake,
    BetterDipole,
    Camera,
    ControlMesh,
    CylinderLight,
    Dipole,
    DiskLight,
    DistantLight,
    DomeLight,
    IceMaterial,
    Light,
    Material,
    Medium,
    Mesh,
    MeshLight,
    Object,
    ObjectSet,
    PointSet,
    PointStatistics,
    PointTree,
    Ramp,
    RayScene,
    RectLight,
    Scene,
    ShadowRules,
    Shaping,
    SphereLight,
    StandardMaterial,
    Texture,
    TextureLookup,
    area_compensation,
    bake_irradiance,
    bake_occlusion,
    fresnel_average,
    fresnel_dielectric,
    light_groups,
    point_occlusion,
    point_statistics,
    subdivide,
    tessellated_points,
    triangulate,
)
from .warning import FrazilWarning

# Names that need more than the core, and where they live: imported when first asked for.
_LAZY = {
    "Film": ".film",
    "Recipe": ".grade_recipe",
    "UsdScene": ".usd",
    "grade": ".grading",
    "bake": ".baking",
    "load_bake": ".baking",
    "load_usd": ".usd",
    "match": ".matching",
    "poisson_points": ".points",
    "read_meshes": ".usd",
    "render": ".rendering",
    "save_bake": ".baking",
}

__all__ = [
    "Bake",
    "BetterDipole",
    "Camera",
    "ControlMesh",
    "CylinderLight",
    "Dipole",
    "DiskLight",
    "DistantLight",
    "DomeLight",
    "Film",
    "FrazilWarning",
    "IceMaterial",
    "Light",
    "Material",
    "Medium",
    "Mesh",
    "MeshLight",
    "Object",
    "ObjectSet",
    "PointSet",
    "PointStatistics",
    "PointTree",
    "Ramp",
    "RayScene",
    "Recipe",
    "RectLight",
    "Scene",
    "ShadowRules",
    "Shaping",
    "SphereLight",
    "StandardMaterial",
    "Texture",
    "TextureLookup",
    "UsdScene",
    "area_compensation",
    "bake",
    "bake_irradiance",
    "bake_occlusion",
    "fresnel_average",
    "fresnel_dielectric",
    "grade",
    "light_groups",
    "load_bake",
    "load_usd",
    "point_occlusion",
    "match",
    "point_statistics",
    "poisson_points",
    "read_meshes",
    "render",
    "save_bake",
    "subdivide",
    "tessellated_points",
    "triangulate",
]


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(importlib.import_module(_LAZY[name], __name__), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'frazil' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LAZY})
