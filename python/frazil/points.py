"""Poisson points from any kind of spacing: a number, one per vertex, a function of position, a texture, a camera."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral, Real
from os import PathLike, fspath

import numpy as np

from . import _frazil
from ._frazil import Camera, Mesh, PointSet

SpacingFunction = Callable[[np.ndarray], np.ndarray]


def poisson_points(
    mesh: Mesh,
    spacing: float | np.ndarray | SpacingFunction | TextureSpacing | None = None,
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
        Any triangle soup with some area. Where it has `rest` positions the points are placed on that pose, with its
        spacing, and moved to the mesh: so they are the same in every pose.
    spacing : float, (V,) array, callable or TextureSpacing
        The distance that points keep, metres, > 0. An array gives one value per vertex, linear over each triangle. A
        callable takes (N, 3) positions and returns (N,) values, each of its own position alone: it is asked for
        thousands at once, on pieces of the mesh that are at most two spacings wide, and one where it bends. See
        `spacing_from_texture` and `spacing_from_camera`.
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
    if not (isinstance(seed, Integral) and 0 <= seed < 2**32):
        raise ValueError(f"poisson_points: seed must be a whole number from 0 to 4294967295, got {seed!r}. Use 0.")
    options = (int(seed), thin_walls, max_points, threads, progress)
    if count is not None:
        if count <= 0:
            raise ValueError(f"poisson_points: count must be > 0, got {count}. Ask for one point or more.")
        return _frazil.poisson_points_by_count(mesh, count, *options)
    if isinstance(spacing, TextureSpacing):
        return _frazil.poisson_points_sampled(mesh, spacing.on(mesh), *options)
    if callable(spacing):
        return _frazil.poisson_points_sampled(mesh, lambda positions, *_: spacing(positions), *options)
    if np.ndim(spacing) == 0:
        spacing = spacing.item() if isinstance(spacing, np.ndarray) else spacing
        if not isinstance(spacing, Real):
            kind = type(spacing).__name__
            raise TypeError(
                f"poisson_points: spacing must be a number, an array or a function, got {kind}. Give metres."
            )
        return _frazil.poisson_points_constant(mesh, spacing, *options)
    values = np.asarray(spacing)
    if values.ndim != 1:
        raise ValueError(f"poisson_points: spacing must have shape (V,), got {values.shape}. Give one a vertex.")
    return _frazil.poisson_points_varying(mesh, np.ascontiguousarray(values, np.float32), *options)


@dataclass(frozen=True)
class TextureSpacing:
    """Spacing from an image: `low` metres where it is 0, `high` where it is 1. Made by `spacing_from_texture`."""

    image: np.ndarray  # (H, W) float32
    low: float
    high: float

    def at(self, uvs: np.ndarray) -> np.ndarray:
        """Spacing (N,) at texture coordinates (N, 2): bilinear, repeating, v pointing up."""
        height, width = self.image.shape
        # Pixel centres at (i + 1/2) / size.
        x, y = uvs[:, 0] * width - 0.5, (1 - uvs[:, 1]) * height - 0.5
        x0, y0 = np.floor(x).astype(int), np.floor(y).astype(int)
        fx, fy = x - x0, y - y0

        def pixel(dx, dy):
            return self.image[(y0 + dy) % height, (x0 + dx) % width]

        below, above = pixel(0, 1) * (1 - fx) + pixel(1, 1) * fx, pixel(0, 0) * (1 - fx) + pixel(1, 0) * fx
        return self.low + (self.high - self.low) * np.clip(above * (1 - fy) + below * fy, 0, 1)

    def on(self, mesh: Mesh) -> Callable:
        """Spacing on the mesh by its texture coordinates, as a function of (positions, triangles, barycentrics)."""
        if mesh.uvs is None:
            raise ValueError("Mesh: uvs must be given for a texture of spacing, got none. Unwrap the mesh.")
        corners = corner_uvs(mesh)

        def spacing(_, triangles, barycentrics):
            a, b, c = np.moveaxis(corners[triangles], 1, 0)
            u, v = barycentrics[:, :1], barycentrics[:, 1:]
            return self.at(a + (b - a) * u + (c - a) * v)

        return spacing


def corner_uvs(mesh: Mesh) -> np.ndarray:
    """The texture coordinates (F, 3, 2) of every triangle's corners, whatever their interpolation."""
    uvs, kind = mesh.uvs.astype(np.float64), mesh.uvs_interpolation
    if kind == "corner":
        return uvs.reshape(-1, 3, 2)
    if kind == "vertex":
        return uvs[mesh.triangles]
    rows = np.arange(len(mesh.triangles)) if kind == "uniform" else np.zeros(len(mesh.triangles), int)
    return np.repeat(uvs[rows][:, None], 3, axis=1)


def spacing_from_texture(image: np.ndarray | str | PathLike, low: float, high: float) -> TextureSpacing:
    """Spacing from a texture on the mesh's texture coordinates: `low` where it is black, `high` where it is white.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array in [0, 1], or a path that OpenImageIO reads
        The first channel counts, as stored; it repeats.
    low, high : float
        Metres, > 0; either may be the larger.

    Returns
    -------
    TextureSpacing for `poisson_points`. Detail finer than a triangle is found; finer than the spacing it is not.

    Raises
    ------
    ValueError
        For distances that are not > 0 and finite, or an image without pixels.
    OSError
        For a file that cannot be read.
    """
    for name, value in (("low", low), ("high", high)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"spacing_from_texture: {name} must be > 0 and finite, got {value}. It is in metres.")
    if isinstance(image, str | PathLike):
        import OpenImageIO as oiio

        path = fspath(image)
        buffer = oiio.ImageBuf(path)
        image = None if buffer.has_error else buffer.get_pixels(oiio.FLOAT)
        if image is None or buffer.has_error:
            raise OSError(f"{path}: file must be an image, got: {buffer.geterror().splitlines()[0]}. Check the path.")
    pixels = np.asarray(image, np.float32)
    pixels = pixels[..., 0] if pixels.ndim == 3 else pixels
    if pixels.ndim != 2 or pixels.size == 0 or not np.isfinite(pixels).all():
        raise ValueError(
            f"spacing_from_texture: image must have shape (H, W) or (H, W, C) and be finite, got {pixels.shape}."
        )
    return TextureSpacing(np.ascontiguousarray(pixels), float(low), float(high))


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


def pixel_angle(camera: Camera, resolution: tuple[int, int]) -> float:
    """The angle of a pixel in the middle of a perspective camera's picture, radians.

    Raises
    ------
    ValueError
        For an orthographic camera, whose pixels are of one size everywhere: give a number as spacing.
    """
    if camera.is_orthographic:
        raise ValueError(f"{camera.path}: camera must be a perspective one, got orthographic. Give a constant spacing.")
    width, height = resolution
    aperture = max(camera.horizontal_aperture, camera.vertical_aperture * width / height)
    return aperture / camera.focal_length / width
