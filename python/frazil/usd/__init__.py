"""USD stages as scenes: ``load_usd`` for rendering, ``read_meshes`` for the points tool."""

from .stage import UsdScene, add_motion, load_usd, read_meshes

__all__ = ["UsdScene", "add_motion", "load_usd", "read_meshes"]
