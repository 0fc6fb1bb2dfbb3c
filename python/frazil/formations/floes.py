"""Cells of a plane, as ice breaks into: floes and the columns of a calving front.

Model: Voronoi cells of jittered points, clipped to a rectangle, each drawn in by a gap.
Units: metres; the plane is (x, z).
"""

from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold
from scipy.spatial import Voronoi


@dataclass(frozen=True)
class Cell:
    """One convex cell: its outline (K, 2) drawn in by the gap, its centre, and the points of its neighbours."""

    outline: np.ndarray
    center: np.ndarray
    neighbours: tuple[int, ...]


def cells(rng: np.random.Generator, low, high, count: int, gap, evenness: float = 0.5) -> list[Cell]:
    """About `count` cells between `low` and `high` (2,); `gap(center)` is the metres between neighbours."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    points = rng.uniform(low, high, (count, 2))
    for _ in range(2):
        centers = np.array([_polygon(v, k).mean(0) for v in [_mirrored(points, low, high)] for k in range(count)])
        points = points + evenness * (centers - points)
    diagram = _mirrored(points, low, high)
    around: list[set[int]] = [set() for _ in range(count)]
    for a, b in diagram.ridge_points:
        if a < count and b < count:
            around[a].add(int(b))
            around[b].add(int(a))
    found = []
    for k in range(count):
        outline = _polygon(diagram, k)
        center = outline.mean(0)
        found.append(Cell(_drawn_in(outline, 0.5 * gap(center)), center, tuple(sorted(around[k]))))
    return found


def prism(outline: np.ndarray, bottom: float, top, outset: float = 0.0) -> Manifold:
    """The convex outline (K, 2) raised from `bottom` to `top` (a number or one for each corner), wider below."""
    center = outline.mean(0)
    below = center + (outline - center) * (1.0 + outset)
    corners = np.concatenate([
        np.column_stack([below[:, 0], np.full(len(outline), bottom), below[:, 1]]),
        np.column_stack([outline[:, 0], np.broadcast_to(top, len(outline)), outline[:, 1]]),
    ])  # fmt: skip
    return Manifold.hull_points(corners)


def _mirrored(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> Voronoi:
    # Mirror images across the borders clip the cells to the rectangle.
    images = [points]
    for axis in range(2):
        for border in (low, high):
            image = points.copy()
            image[:, axis] = 2.0 * border[axis] - image[:, axis]
            images.append(image)
    return Voronoi(np.concatenate(images))


def _polygon(diagram: Voronoi, k: int) -> np.ndarray:
    corners = diagram.vertices[diagram.regions[diagram.point_region[k]]]
    center = corners.mean(0)
    order = np.argsort(np.arctan2(corners[:, 1] - center[1], corners[:, 0] - center[0]), kind="stable")
    return corners[order]


def _drawn_in(outline: np.ndarray, by: float) -> np.ndarray:
    # Towards the centre, by about that distance from the nearest side.
    center = outline.mean(0)
    away = np.roll(outline, -1, 0) - outline
    length = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
    to = center - outline
    inner = np.abs(away[:, 0] * to[:, 1] - away[:, 1] * to[:, 0]) / length
    return center + (outline - center) * max(1.0 - by / max(inner.min(), 1e-9), 0.3)
