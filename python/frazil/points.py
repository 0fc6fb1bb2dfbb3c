"""Poisson points from any kind of spacing: a number, one per vertex, a function of position, a texture, a camera."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike

import numpy as np

from . import _frazil
from ._frazil import Mesh, PointSet

SpacingFunction = Callable[[np.ndarray], np.ndarray]


def poisson_points(
    mesh: Mesh,
    spacing: float | np.ndarray | SpacingFunction | None = None,
    seed: int = 0,
    *,
    count: int | None = None,
    thin_walls: bool = True,
    max_points: int = 0,
    threads: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> PointSet:
    """Poisson-disk points on any mesh: evenly random, never too near, no surface left out.

    Parameters
    ----------
    mesh : Mesh
        Any triangle soup with some area.
    spacing : float, (V,) array or callable
        The distance that points keep, metres, > 0. An array gives one value per vertex, linear over each triangle. A
        callable takes (N, 3) positions and returns (N,) values; where it bends inside a triangle it is sampled finer.
    seed : int
        The points depend on (mesh, spacing, seed) alone, whatever the number of threads.
    count : int, optional
        Ask for this many points (within 0.5 %) instead of a spacing.
    thin_walls : bool
        True gives each side of a sheet thinner than `spacing` its own points; False keeps any two points apart.
    max_points : int
        Refuse to make more than these; 0 allows what fits into free memory.
    threads : int
        0 takes all cores.
    progress : callable, optional
        Called as progress(stage, fraction).

    Returns
    -------
    PointSet
        About 0.7 area / spacing² points with positions, normals, areas, triangles and barycentrics.

    Raises
    ------
    ValueError
        For a spacing that is not > 0 and finite or would need too many points, and for a mesh without area.

    Examples
    --------
    >>> import frazil as fz, numpy as np
    >>> square = fz.Mesh(np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.int32([[0, 1, 2], [0, 2, 3]]))
    >>> points = fz.poisson_points(square, 0.1)
    >>> bool(abs(points.areas.sum() - 1) < 1e-4)
    True
    """
    if not isinstance(mesh, Mesh):
        raise TypeError(f"poisson_points: mesh must be a frazil.Mesh, got {type(mesh).__name__}. Make one of arrays.")
    if (spacing is None) == (count is None):
        raise ValueError("poisson_points: spacing or count must be given, and not both. Give one of them.")
    options = (seed, thin_walls, max_points, threads, progress)
    if count is not None:
        if count <= 0:
            raise ValueError(f"poisson_points: count must be > 0, got {count}. Ask for one point or more.")
        return _frazil.poisson_points_by_count(mesh, count, *options)
    if callable(spacing):
        return _points_from_function(mesh, spacing, options)
    if np.ndim(spacing) == 0:
        return _frazil.poisson_points_constant(mesh, spacing, *options)
    values = np.asarray(spacing)
    if values.ndim != 1:
        raise ValueError(f"poisson_points: spacing must have shape (V,), got {values.shape}. Give one a vertex.")
    return _frazil.poisson_points_varying(mesh, np.ascontiguousarray(values, np.float32), *options)


def spacing_from_texture(mesh: Mesh, uvs: np.ndarray, image: np.ndarray | str | PathLike, low: float, high: float):
    """Spacing per vertex from a texture: `low` metres where it is black, `high` where it is white.

    Parameters
    ----------
    mesh : Mesh
    uvs : (V, 2) array
        Texture coordinates per vertex, v pointing up; they repeat.
    image : (H, W) or (H, W, C) array in [0, 1], or a path that OpenImageIO reads
        The first channel counts.
    low, high : float
        Metres, > 0.

    Returns
    -------
    (V,) float32 array for `poisson_points`.
    """
    if isinstance(image, (str, PathLike)):
        import OpenImageIO as oiio

        buffer = oiio.ImageBuf(str(image))
        if buffer.has_error:
            raise OSError(f"{image}: file must be an image, got: {buffer.geterror()}")
        image = buffer.get_pixels(oiio.FLOAT)
    image = np.asarray(image, np.float32)
    image = image[..., 0] if image.ndim == 3 else image
    uvs = np.asarray(uvs, np.float32)
    if uvs.shape != (len(mesh.positions), 2):
        raise ValueError(f"spacing_from_texture: uvs must have shape ({len(mesh.positions)}, 2), got {uvs.shape}.")
    height, width = image.shape
    # Bilinear, pixel centres at (i + 1/2) / size.
    x, y = uvs[:, 0] * width - 0.5, (1 - uvs[:, 1]) * height - 0.5
    x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = x - x0, y - y0

    def at(dx, dy):
        return image[(y0 + dy) % height, (x0 + dx) % width]

    value = (at(0, 0) * (1 - fx) + at(1, 0) * fx) * (1 - fy) + (at(0, 1) * (1 - fx) + at(1, 1) * fx) * fy
    return (low + (high - low) * value).astype(np.float32)


def spacing_from_camera(
    position: np.ndarray, pixel_angle: float, pixels: float = 1.0, least: float = 0.0, most: float = np.inf
) -> SpacingFunction:
    """Spacing that looks the same from a camera: `pixels` pixels wide at every distance.

    Parameters
    ----------
    position : (3,) array, metres
    pixel_angle : float, radians
        The angle of one pixel: about field of view / resolution.
    pixels : float
    least, most : float, metres
        Bounds of the spacing; `least` keeps points finite where the camera touches the mesh.

    Returns
    -------
    A callable for `poisson_points`.
    """
    position = np.asarray(position, np.float64)
    scale = pixel_angle * pixels
    if not scale > 0:
        raise ValueError(f"spacing_from_camera: pixel_angle * pixels must be > 0, got {scale}. Both are positive.")

    def spacing(places: np.ndarray) -> np.ndarray:
        return np.clip(np.linalg.norm(places - position, axis=1) * scale, max(least, 1e-30), most)

    return spacing


def _evaluate(function: SpacingFunction, places: np.ndarray) -> np.ndarray:
    values = np.asarray(function(places), np.float64)
    if values.shape != (len(places),):
        raise ValueError(
            f"poisson_points: spacing(positions) must return shape ({len(places)},), got {values.shape}. "
            "Return one value per position."
        )
    if not np.all(np.isfinite(values) & (values > 0)):
        bad = values[~(np.isfinite(values) & (values > 0))][0]
        raise ValueError(f"poisson_points: spacing must be > 0 and finite, got {bad}. It is in metres.")
    return values


def _points_from_function(mesh: Mesh, function: SpacingFunction, options: tuple) -> PointSet:
    """Cut triangles in four until the function is near linear on each, place points, and name the old triangles."""
    triangles = mesh.triangles
    corners = mesh.positions.astype(np.float64)[triangles]  # (F, 3, 3)
    weights = np.broadcast_to(np.eye(3), corners.shape)  # of the corners in their old triangle
    parents = np.arange(len(triangles))
    done = []
    for depth in range(12):
        if len(parents) == 0:
            break
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        at_corners = _evaluate(function, corners.reshape(-1, 3)).reshape(-1, 3)
        at_middles = _evaluate(function, middles.reshape(-1, 3)).reshape(-1, 3)
        bend = np.abs(at_middles - 0.5 * (at_corners + np.roll(at_corners, -1, axis=1))) / at_middles
        edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
        # Long triangles are sampled anyway, as a function may turn between its samples.
        split = ((bend.max(axis=1) > 0.05) | (edges > 32 * at_corners.min(axis=1))) & (edges > at_corners.min(axis=1))
        split &= depth < 11
        done.append((corners[~split], weights[~split], parents[~split], at_corners[~split]))
        c, w, p = corners[split], weights[split], parents[split]
        cm, wm = 0.5 * (c + np.roll(c, -1, axis=1)), 0.5 * (w + np.roll(w, -1, axis=1))

        def parts(x, m):
            return np.concatenate(
                [
                    np.stack([x[:, 0], m[:, 0], m[:, 2]], axis=1),
                    np.stack([m[:, 0], x[:, 1], m[:, 1]], axis=1),
                    np.stack([m[:, 2], m[:, 1], x[:, 2]], axis=1),
                    m,
                ]
            )

        corners, weights, parents = parts(c, cm), parts(w, wm), np.tile(p, 4)
    corners, weights, parents, values = (np.concatenate(x) for x in zip(*done, strict=True))
    order = np.argsort(parents, kind="stable")
    corners, weights, parents, values = corners[order], weights[order], parents[order], values[order]
    refined = Mesh(
        np.ascontiguousarray(corners.reshape(-1, 3), np.float32),
        np.arange(3 * len(parents), dtype=np.int32).reshape(-1, 3),
    )
    points = _frazil.poisson_points_varying(refined, values.reshape(-1).astype(np.float32), *options)
    part = points.triangles.copy()
    u, v = points.barycentrics.T.astype(np.float64)
    own = np.stack([1 - u - v, u, v], axis=1)
    points.barycentrics[:] = np.einsum("nk,nkj->nj", own, weights[part])[:, 1:]
    points.triangles[:] = parents[part]
    first, second, third = (mesh.positions.astype(np.float64)[triangles[:, k]] for k in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(second - first, third - first), axis=1)
    points.triangle_areas[:] = areas[points.triangles]
    return points
