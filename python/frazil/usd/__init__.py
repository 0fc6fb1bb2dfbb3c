"""USD stages as scenes: ``load_usd`` for rendering, ``read_meshes`` for the points tool."""

from .stage import UsdScene, load_usd, read_meshes

__all__ = ["UsdScene", "load_usd", "read_meshes"]
