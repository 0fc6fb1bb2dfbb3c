"""Analytic surfaces as points with areas, for checks whose answers are known in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, Voronoi


@dataclass
class Points:
    """What PointTree needs of a PointSet."""

    positions: np.ndarray
    normals: np.ndarray
    areas: np.ndarray
    spacing: float = 0.0


def sphere(count: int, radius: float = 1.0) -> Points:
    """Fibonacci points: equal areas to within a few parts in 1e4."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    angle = np.pi * (1.0 + 5.0**0.5) * k
    rho = np.sqrt(1.0 - z * z)
    n = np.stack([rho * np.cos(angle), rho * np.sin(angle), z], axis=1)
    area = 4.0 * np.pi * radius**2 / count
    return Points(n * radius, n, np.full(count, area), area**0.5)


def polar_sector(rings: int, inner: float, outer: float, opening: float, slices: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) and areas of a flat sector about its tip, rings growing with distance."""
    edges = np.concatenate([[0.0], np.geomspace(inner, outer, rings)])
    mean = 2.0 / 3.0 * (edges[1:] ** 3 - edges[:-1] ** 3) / (edges[1:] ** 2 - edges[:-1] ** 2)
    phi = (np.arange(slices) + 0.5) / slices * opening
    area = 0.5 * opening / slices * (edges[1:] ** 2 - edges[:-1] ** 2)
    r, a = np.meshgrid(mean, phi, indexing="ij")
    return np.stack([r * np.cos(a), r * np.sin(a)], -1).reshape(-1, 2), np.repeat(area, slices)


def cone(half_angle: float, rings: int, inner: float, outer: float, slices: int = 64) -> Points:
    """A cone with its apex at the origin, opening along -z: the development of a flat sector."""
    s, c = np.sin(half_angle), np.cos(half_angle)
    flat, areas = polar_sector(rings, inner, outer, 2.0 * np.pi * s, slices)
    r = np.linalg.norm(flat, axis=1)
    phi = np.tile((np.arange(slices) + 0.5) / slices * 2.0 * np.pi, rings)
    positions = np.stack([r * s * np.cos(phi), r * s * np.sin(phi), -r * c], axis=1)
    normals = np.stack([c * np.cos(phi), c * np.sin(phi), np.full_like(phi, s)], axis=1)
    return Points(positions, normals, areas, 0.0)


def plane(spacing: float, half: float, seed: int | None = None) -> Points:
    """A square grid in z = 0, or a jittered one with the areas of its Voronoi cells where a seed is given."""
    n = int(round(2 * half / spacing))
    x = (np.arange(n) + 0.5) * spacing - half
    xy = np.stack(np.meshgrid(x, x, indexing="ij"), -1).reshape(-1, 2)
    areas = np.full(len(xy), spacing**2)
    if seed is not None:
        xy = xy + np.random.default_rng(seed).uniform(-0.3, 0.3, xy.shape) * spacing
        cells = Voronoi(xy)
        for k, region in enumerate(cells.point_region):
            corners = cells.regions[region]
            if np.abs(xy[k]).max() < half - 2 * spacing and -1 not in corners:
                areas[k] = ConvexHull(cells.vertices[corners]).volume
    positions = np.concatenate([xy, np.zeros((len(xy), 1))], axis=1)
    normals = np.broadcast_to([0.0, 0.0, 1.0], positions.shape)
    return Points(positions, normals, areas, spacing)


def corner(rings: int, inner: float, outer: float, slices: int = 32) -> Points:
    """Three quarter planes that meet in the origin at right angles: a cube's vertex."""
    flat, areas = polar_sector(rings, inner, outer, 0.5 * np.pi, slices)
    positions, normals = [], []
    for axis in range(3):
        p = np.zeros((len(flat), 3))
        p[:, (axis + 1) % 3], p[:, (axis + 2) % 3] = -flat[:, 0], -flat[:, 1]
        n = np.zeros_like(p)
        n[:, axis] = 1.0
        positions.append(p)
        normals.append(n)
    return Points(np.concatenate(positions), np.concatenate(normals), np.tile(areas, 3), 0.0)
