"""Density grids from OpenVDB files.

Model: the box of a grid's active voxels becomes a dense array, padded by one voxel of the background, so that it fades
out as OpenVDB's own trilinear sampler has it. Read by OpenVDB's module (`openvdb` or `pyopenvdb`) where Python has one,
else by the package tinyvdb (extra `volumes`).
Units: the file's own; its transform maps voxels to the frame of the mesh that is filled.
Not: level sets (negative inside), vectors, frustum transforms.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from ._frazil import Density

__all__ = ["read_density"]

_MOST_VOXELS = 512**3


def read_density(path: str | Path, grid: str = "density", **changes: Any) -> Density:
    """The density that a grid of an OpenVDB file tells.

    Parameters
    ----------
    path : str or Path
        A .vdb file.
    grid : str
        The name of a grid of floats in it.
    **changes
        Arguments of Density other than values, matrix and outside: scale, absorption.

    Returns
    -------
    Density

    Raises
    ------
    OSError
        For a file that is missing or broken.
    KeyError
        For an unknown grid; the message has the names of the file's.
    ValueError
        For a grid that is no density, or too large: more than 512^3 voxels from corner to corner.
    ImportError
        Without a library that reads OpenVDB.
    """
    path = Path(path)
    with path.open("rb") as file:
        if file.read(4) != b" BDV":
            raise OSError(f"{path}: must be an OpenVDB file, got another kind.")
    for name in ("openvdb", "pyopenvdb"):
        try:
            values, corner, matrix, outside = _read_openvdb(importlib.import_module(name), path, grid)
            break
        except ImportError:
            continue
    else:
        values, corner, matrix, outside = _read_tinyvdb(path, grid)
    if not (np.isfinite(values).all() and values.min() >= 0.0 and outside >= 0.0):
        raise ValueError(
            f"{path}: grid '{grid}' must be >= 0 and finite, got {min(values.min(), outside):g}. "
            "Convert a level set to a fog volume first."
        )
    move = np.eye(4)
    move[3, :3] = corner
    return Density(np.ascontiguousarray(values, np.float32), move @ matrix, outside=outside, **changes)


def _no_grid(path: Path, grid: str, names: list[str]) -> KeyError:
    return KeyError(f"{path}: has no grid '{grid}' of floats. It has {', '.join(sorted(names)) or 'none'}.")


def _no_voxels(path: Path, grid: str) -> ValueError:
    return ValueError(f"{path}: grid '{grid}' must have active voxels, got none.")


def _bent(path: Path, grid: str, kind: str) -> ValueError:
    return ValueError(f"{path}: grid '{grid}' must have an affine transform, got {kind}. Resample it.")


def _padded_box(path: Path, grid: str, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corner and the size of a box of voxels, one wider on each side."""
    size = np.maximum(high - low + 1, 1).astype(np.int64) + 2
    if size.prod() > _MOST_VOXELS:
        raise ValueError(
            f"{path}: grid '{grid}' must have at most {_MOST_VOXELS} voxels from corner to corner, got "
            f"{' x '.join(map(str, size))}. Resample it to larger voxels."
        )
    return low - 1, size


def _read_openvdb(vdb: Any, path: Path, grid: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    def asked(question: Any, *values: str) -> Any:
        try:
            return question(str(path), *values)
        except (RuntimeError, ValueError, LookupError, OSError, TypeError) as error:
            raise OSError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error

    names = [g.name for g in asked(vdb.readAllGridMetadata) if g.valueTypeName == "float"]
    if grid not in names:
        raise _no_grid(path, grid, names)
    found = asked(vdb.read, grid)
    if found.activeVoxelCount() == 0:
        raise _no_voxels(path, grid)
    if not found.transform.isLinear:
        raise _bent(path, grid, found.transform.typeName)
    low, high = (np.array(corner) for corner in found.evalActiveVoxelBoundingBox())
    corner, size = _padded_box(path, grid, low, high)
    values = np.empty(size, np.float32)
    found.copyToArray(values, ijk=tuple(int(c) for c in corner))
    frame = [found.transform.indexToWorld(tuple(map(float, p))) for p in ((0, 0, 0), *np.eye(3))]
    matrix = np.eye(4)
    matrix[3, :3] = frame[0]
    matrix[:3, :3] = np.subtract(frame[1:], frame[0])
    return values, corner, matrix, float(found.background)


def _read_tinyvdb(path: Path, grid: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    try:
        import tinyvdb
    except ImportError as error:
        raise ImportError(f"{path}: needs a library that reads OpenVDB. pip install tinyvdb.") from error
    try:
        with tinyvdb.open(str(path)) as file:
            names = [file.grid_name(i) for i in range(file.grid_count) if "float" in file.grid_type_name(i)]
            if grid not in names:
                raise _no_grid(path, grid, names)
            file.read_grids()
            found = next(file.grid(i) for i in range(file.grid_count) if file.grid_name(i) == grid)
            sparse, transform, outside = found.to_sparse(), found.transform, float(found.float_background())
            written = found.metadata.get("file_voxel_count")
    except tinyvdb.VDBError as error:
        raise OSError(f"{path}: cannot be read: {' '.join(str(error).split())}") from error
    count = sparse["count"]
    if written is not None and written != count:
        # tinyvdb tells voxels, but not nodes that are of one value.
        raise ValueError(
            f"{path}: grid '{grid}' must have no constant tiles to be read by tinyvdb, got {written - count} voxels in "
            "such. Voxelize its tiles, or install OpenVDB's own module."
        )
    if count == 0:
        raise _no_voxels(path, grid)
    places = np.frombuffer(sparse["coords"], np.int32).reshape(-1, 3)
    corner, size = _padded_box(path, grid, places.min(0), places.max(0))
    values = np.full(size, outside, np.float32)
    values[tuple((places - corner).T)] = np.frombuffer(sparse["values"], np.float32)
    return values, corner, _matrix(path, grid, transform), outside


def _matrix(path: Path, grid: str, transform: dict[str, Any]) -> np.ndarray:
    """Voxels to the file's frame, (4, 4) for row vectors."""
    kind = str(transform["type"])
    if kind == "affine":
        return np.array(transform["matrix"], float)
    if kind not in ("uniform_scale", "uniform_scale_translate", "scale", "scale_translate"):
        raise _bent(path, grid, kind)
    matrix = np.diag([*transform["scale"], 1.0])
    matrix[3, :3] = transform["translation"]
    return matrix
