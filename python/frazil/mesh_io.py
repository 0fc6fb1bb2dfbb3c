"""Meshes from files: OBJ, PLY, STL, glTF and what else trimesh reads; USD through frazil.usd."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ._frazil import Mesh

USD_SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}


def read_mesh(path: str | PathLike, frame: float | None = None) -> Mesh:
    """Read all meshes of a file as one, in world space.

    Parameters
    ----------
    path : path to a USD, OBJ, PLY, STL, OFF or glTF file
    frame : the time code to read of a USD file

    Returns
    -------
    Mesh
        Positions in the file's unit; USD files are in metres.

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

        meshes = [mesh for _, mesh in read_meshes(str(path), frame=frame)]
        if not meshes:
            raise OSError(f"{path}: file must hold a mesh, got none. Check the purpose and visibility of its prims.")
        return join([(mesh.positions, mesh.triangles) for mesh in meshes])

    import trimesh

    try:
        # Vertices stay as they are in the file: welding them would change ids.
        loaded = trimesh.load(path, process=False)
        parts = loaded.dump() if isinstance(loaded, trimesh.Scene) else [loaded]
        arrays = [(p.vertices, p.faces) for p in parts if isinstance(p, trimesh.Trimesh) and len(p.faces)]
    except Exception as error:  # trimesh raises whatever its readers do
        raise OSError(f"{path}: file must be a mesh that trimesh reads, got: {error}. Convert it.") from error
    if not arrays:
        raise OSError(f"{path}: file must hold triangles, got none. Is it a point cloud?")
    return join(arrays)


def join(parts: list[tuple[np.ndarray, np.ndarray]]) -> Mesh:
    """One mesh of several (positions, triangles)."""
    first = np.cumsum([0] + [len(positions) for positions, _ in parts])
    positions = np.concatenate([np.asarray(positions, np.float32).reshape(-1, 3) for positions, _ in parts])
    triangles = np.concatenate([np.asarray(t, np.int32) + f for (_, t), f in zip(parts, first, strict=False)])
    return Mesh(np.ascontiguousarray(positions), np.ascontiguousarray(triangles, np.int32))
