"""Frazil: renderer and look-development toolkit for glacier ice and other translucent matter."""

from ._frazil import (
    Camera,
    ControlMesh,
    DiskLight,
    DistantLight,
    DomeLight,
    IceMaterial,
    Light,
    Material,
    Mesh,
    Object,
    RectLight,
    Scene,
    SphereLight,
    StandardMaterial,
    Texture,
    TextureLookup,
    subdivide,
    triangulate,
)
from .usd import UsdScene, load_usd, read_meshes
from .warning import FrazilWarning
