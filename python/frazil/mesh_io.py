"""Meshes from files: OBJ, PLY, STL, glTF and what else trimesh reads; USD through frazil.usd."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ._frazil import Mesh
from .points import corner_uvs

USD_SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}


def read_mesh(path: str | PathLike, frame: float | None = None, rest_frame: float | None = None) -> Mesh:
    """Read all meshes of a file as one, in world space.

    Parameters
    ----------
    path : path to a USD, OBJ, PLY, STL, OFF or glTF file
    frame : the time code to read of a USD file
    rest_frame : the time code whose shapes are the rest pose of meshes without a rest primvar

    Returns
    -------
    Mesh
        Positions in the file's unit; USD files are in metres. With texture coordinates where all parts have them, and
        rest positions where a part has some.

    Raises
    ------
    OSError
        Where the file does not exist, cannot be read, or holds no triangles.
    """
    path = Path(path)
    if not path.is_file():
        raise OSError(f"{path}: file must be readable, got none. Check the path.")
    if path.suffix.lower() in USD_SUFFIXES:
        from .usd import read_meshes

        meshes = [mesh for _, mesh in read_meshes(str(path), frame=frame, rest_frame=rest_frame)]
        if not meshes:
            raise OSError(f"{path}: file must hold a mesh, got none. Check the purpose and visibility of its prims.")
        return join(meshes)

    import trimesh

    try:
        # Vertices stay as they are in the file: welding them would change ids.
        loaded = trimesh.load(path, process=False)
        parts = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
        meshes = [_from_trimesh(part) for part in parts if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    except Exception as error:  # trimesh raises whatever its readers do
        raise OSError(f"{path}: file must be a mesh that trimesh reads, got: {error}. Convert it.") from error
    if not meshes:
        raise OSError(f"{path}: file must hold triangles, got none. Is it a point cloud?")
    return join(meshes)


def _from_trimesh(part) -> Mesh:
    mesh = Mesh(np.float32(part.vertices), np.int32(part.faces))
    uvs = getattr(part.visual, "uv", None)
    if uvs is not None and np.shape(uvs) == (len(part.vertices), 2) and np.isfinite(uvs).all():
        mesh.set_uvs(np.float32(uvs), "vertex")
    return mesh


def join(parts: list[Mesh]) -> Mesh:
    """One mesh of several, with texture coordinates where all have some and rest positions where one has."""
    first = np.cumsum([0] + [len(part.positions) for part in parts])
    triangles = [part.triangles + np.int32(start) for part, start in zip(parts, first, strict=False)]
    mesh = Mesh(np.concatenate([part.positions for part in parts]), np.concatenate(triangles))
    if all(part.uvs is not None for part in parts):
        mesh.set_uvs(np.concatenate([corner_uvs(part).reshape(-1, 2) for part in parts]).astype(np.float32), "corner")
    if any(part.rest is not None for part in parts):
        mesh.set_rest(np.concatenate([part.positions if part.rest is None else part.rest for part in parts]))
    return mesh
