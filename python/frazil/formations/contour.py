"""A surface mesh of an implicit field, with ridges and tips as sharp as the field has them.

Model: dual contouring: one vertex per cell that the surface crosses, where the tangent planes of the crossings meet in
    the least-squares sense (kept inside the cell); one quad per crossed grid edge. Grid faces whose corners alternate
    are filled beforehand, so that every edge of the mesh has exactly two triangles.
Units: those of the field. Fields are negative inside and change by at most `kLipschitz` per unit of length.
Not: level of detail, fields that touch the border of the box (the surface must close inside).
"""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

Field = Callable[[np.ndarray], np.ndarray]

kLipschitz = 1.3  # how steep a field may be before a block that it crosses can be overlooked
kBlock, kSubBlock = 12, 2  # cells along the edge of a block that is skipped as a whole where the field is large
kRegularization = 0.005  # pull of a cell's vertex towards the mean of its crossings
kSharp = 0.7  # share of a full turn that the angles around a tip may have
kChunk = 1 << 15  # points per call of the field


@dataclass
class Surface:
    """A closed triangle mesh: positions (V, 3), triangles (F, 3) counterclockwise seen from outside."""

    positions: np.ndarray
    triangles: np.ndarray

    def vertex_normals(self) -> np.ndarray:
        """Smooth unit normals (V, 3)."""
        a, b, c = (self.positions[self.triangles[:, k]] for k in range(3))
        return _normalized(_sum_at(self.triangles, np.repeat(np.cross(b - a, c - a), 3, 0), len(self.positions)))

    def largest_piece(self) -> "Surface":
        """The connected piece with the most triangles: without the crumbs where thin tips slip through the grid."""
        ends = self.triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
        links = coo_matrix((np.ones(len(ends)), ends.T), (len(self.positions),) * 2)
        _, piece = connected_components(links, directed=False)
        kept = piece == np.bincount(piece[self.triangles[:, 0]]).argmax()
        return Surface(self.positions[kept], (np.cumsum(kept) - 1)[self.triangles[kept[self.triangles[:, 0]]]])

    def sharpen(self, tips: np.ndarray, reach: float) -> None:
        """Pull the vertex nearest to each of the tips (K, 3) onto it, where that is within `reach`, makes a tip and
        has no other tip beside it."""
        distance, nearest = cKDTree(self.positions).query(tips)
        pulled = np.zeros(len(self.positions), bool)
        for vertex, tip in zip(nearest[distance < reach], tips[distance < reach], strict=True):
            fan = self.triangles[(self.triangles == vertex).any(1)]
            if pulled[fan].any():
                continue
            ends = self.positions[fan[fan != vertex].reshape(-1, 2)] - tip
            ends /= np.linalg.norm(ends, axis=2, keepdims=True)
            if np.arccos(np.clip(np.sum(ends[:, 0] * ends[:, 1], 1), -1.0, 1.0)).sum() < kSharp * 2.0 * np.pi:
                self.positions[vertex] = tip
                pulled[vertex] = True


def contour(field: Field, lower, upper, cell: float) -> Surface:
    """Mesh the zero surface of `field` in the box from `lower` to `upper` with cubic cells of size `cell`.

    Raises
    ------
    ValueError
        If nothing of the surface lies inside the box, or it crosses the border of the box.
    """
    lower = np.asarray(lower, np.float64)
    blocks = np.maximum(1, np.ceil((np.asarray(upper) - lower) / (cell * kBlock)).astype(int))
    values = _sample(field, lower, blocks, cell)
    inside = _fill_alternating_faces(values < 0)
    if not inside.any() or _touches_border(inside):
        raise ValueError(f"field: surface must lie inside the box {lower.tolist()} .. {list(upper)}. Enlarge the box.")
    crossings = [_crossings(values, inside, axis) for axis in range(3)]
    points = [_refined(field, lower, cell, axis, *crossing) for axis, crossing in enumerate(crossings)]
    normals = [_gradients(field, p, 0.05 * cell) for p in points]
    return _connect(crossings, points, normals, lower, cell, np.array(inside.shape))


def evaluate(field: Field, points: np.ndarray) -> np.ndarray:
    """Values (N,) of the field at points (N, 3), in pieces that stay in cache, on all cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        parts = list(pool.map(field, [points[i : i + kChunk] for i in range(0, len(points), kChunk)]))
    return np.concatenate(parts) if parts else np.zeros(0)


def _sample(field: Field, lower: np.ndarray, blocks: np.ndarray, cell: float) -> np.ndarray:
    # Ask the centres of blocks, then of sub-blocks, whether the surface can pass through.
    shape = blocks * kBlock
    values = np.ones(shape + 1, np.float32)
    boxes, size = np.indices(blocks).reshape(3, -1).T, kBlock
    while True:
        centers = evaluate(field, lower + cell * size * (boxes + 0.5))
        near = np.abs(centers) < kLipschitz * cell * size * 0.5 * np.sqrt(3.0)
        for box in boxes[~near & (centers < 0)] * size:
            values[tuple(slice(k, k + size) for k in box)] = -1.0
        boxes = boxes[near]
        if size <= kSubBlock:
            break
        ratio = size // kSubBlock
        boxes = (boxes[:, None] * ratio + np.indices((ratio,) * 3).reshape(3, -1).T).reshape(-1, 3)
        size = kSubBlock

    # Evaluate every grid point of the sub-blocks that remain, once.
    offsets = np.indices((size + 1,) * 3).reshape(3, -1).T
    grid = (boxes[:, None] * size + offsets).reshape(-1, 3)
    flat = np.ravel_multi_index(grid.T, values.shape)
    _, first = np.unique(flat, return_index=True)
    first.sort()
    values.reshape(-1)[flat[first]] = evaluate(field, lower + cell * grid[first])
    return values


def _fill_alternating_faces(inside: np.ndarray) -> np.ndarray:
    inside = inside.copy()
    while True:
        changed = 0
        for axis in range(3):
            a, b = [k for k in range(3) if k != axis]
            lo, hi = slice(None, -1), slice(1, None)
            corners = []
            for i, j in ((lo, lo), (lo, hi), (hi, lo), (hi, hi)):
                index = [slice(None)] * 3
                index[a], index[b] = i, j
                corners.append(inside[tuple(index)])
            c00, c01, c10, c11 = corners
            alternating = (c00 == c11) & (c01 == c10) & (c00 != c01)
            changed += int(alternating.sum())
            for corner in corners:
                corner |= alternating
        if not changed:
            return inside


def _touches_border(inside: np.ndarray) -> bool:
    return any(inside.take(i, axis).any() for axis in range(3) for i in (0, -1))


def _crossings(values: np.ndarray, inside: np.ndarray, axis: int):
    # Grid edges along the axis whose ends differ: lower end (N, 3), the values at both ends, whether it leaves.
    lo = [slice(None)] * 3
    hi = [slice(None)] * 3
    lo[axis], hi[axis] = slice(None, -1), slice(1, None)
    base = np.argwhere(inside[tuple(lo)] != inside[tuple(hi)])
    end = base + np.eye(3, dtype=int)[axis]
    return (
        base,
        values[tuple(base.T)].astype(np.float64),
        values[tuple(end.T)].astype(np.float64),
        inside[tuple(base.T)],
    )


def _refined(field: Field, lower, cell, axis, base, a, b, _leaves) -> np.ndarray:
    # The crossing of each edge by two steps of false position; the middle where filling made it up.
    start, along = lower + cell * base, cell * np.eye(3)[axis]
    s, t = np.zeros(len(a)), np.ones(len(a))
    made_up = (a < 0) == (b < 0)

    def point():
        middle = np.where(made_up, 0.5, s + (t - s) * a / np.where(a == b, 1.0, a - b))
        return middle, start + middle[:, None] * along

    for _ in range(2):
        middle, p = point()
        value = evaluate(field, p)
        first = (value < 0) == (a < 0)
        s, a = np.where(first, middle, s), np.where(first, value, a)
        t, b = np.where(first, t, middle), np.where(first, b, value)
    return point()[1]


def _gradients(field: Field, points: np.ndarray, step: float) -> np.ndarray:
    corners = np.array([[1, -1, -1], [-1, -1, 1], [-1, 1, -1], [1, 1, 1]], np.float64)
    gradient = sum(evaluate(field, points + step * c)[:, None] * c for c in corners)
    return gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12)


def _connect(crossings, points, normals, lower, cell, shape) -> Surface:
    # Gather the four cells around each crossed edge.
    rings = []
    for axis, (base, *_) in enumerate(crossings):
        a, b = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        cells = np.stack([base - a - b, base - b, base, base - a], 1)
        rings.append(np.ravel_multi_index(np.moveaxis(cells, -1, 0), shape))
    ids, ring = np.unique(np.concatenate(rings), return_inverse=True)
    ring = ring.reshape(-1, 4)
    p, n = np.concatenate(points), np.concatenate(normals)

    # Solve for the point nearest to all tangent planes of the cell's crossings.
    def total(weight):
        return np.bincount(ring.reshape(-1), np.repeat(weight, 4), len(ids))

    count = total(np.ones(len(p)))
    mean = np.stack([total(p[:, k]) for k in range(3)], 1) / count[:, None]
    matrix = np.stack([total(n[:, i] * n[:, j]) for i in range(3) for j in range(3)], 1).reshape(-1, 3, 3)
    matrix += kRegularization * np.eye(3)
    rhs = np.stack([total(n[:, k] * np.sum(n * p, 1)) for k in range(3)], 1)
    rhs += kRegularization * mean
    positions = np.linalg.solve(matrix, rhs[..., None])[..., 0]
    corner = lower + cell * np.stack(np.unravel_index(ids, shape), 1)
    positions = np.clip(positions, corner, corner + cell)

    # Split each quad along the diagonal whose two triangles agree better with the field's own normal.
    entering = np.concatenate([c[3] for c in crossings])
    quad = np.where(entering[:, None], ring, ring[:, ::-1])
    first = np.stack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]], 1)
    second = np.stack([quad[:, [1, 2, 3]], quad[:, [1, 3, 0]]], 1)
    agree = [
        np.min(np.sum(face_normals(positions, t.reshape(-1, 3)).reshape(-1, 2, 3) * n[:, None], -1), 1)
        for t in (first, second)
    ]
    triangles = np.where((agree[0] >= agree[1])[:, None, None], first, second).reshape(-1, 3)
    return Surface(positions, triangles)


def face_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals (F, 3); zero where a triangle has no area."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-20)


def corner_normals(surface: Surface, crease_degrees: float = 38.0) -> np.ndarray:
    """Normals (F, 3, 3) of the triangles' corners: smooth, but for creases sharper than the angle."""
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    weighted = np.cross(b - a, c - a)
    unit = face_normals(surface.positions, surface.triangles)
    vertex = surface.triangles.reshape(-1)
    face = np.repeat(np.arange(len(surface.triangles)), 3)

    result = surface.vertex_normals()[vertex]
    # Where faces spread, each corner averages only the faces within the crease angle of its own.
    limit = np.cos(np.radians(crease_degrees))
    aligned = np.sum(unit[face] * result, 1)
    creased = np.zeros(len(surface.positions), bool)
    creased[vertex[aligned < np.cos(np.radians(0.5 * crease_degrees))]] = True
    corners = np.flatnonzero(creased[vertex])
    corners = corners[np.argsort(vertex[corners], kind="stable")]
    _, start, size = np.unique(vertex[corners], return_index=True, return_counts=True)
    for length in np.unique(size):
        group = corners[start[size == length][:, None] + np.arange(length)]
        n = unit[face[group]]
        near = np.einsum("gik,gjk->gij", n, n) > limit
        result[group] = _normalized(np.einsum("gij,gjk->gik", near, weighted[face[group]]))
    return result.reshape(-1, 3, 3)


def _sum_at(triangles: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    vertex = triangles.reshape(-1)
    return np.stack([np.bincount(vertex, values[:, k], count) for k in range(values.shape[1])], 1)


def _normalized(v: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.where(length > 1e-20, v / np.maximum(length, 1e-20), [0.0, 1.0, 0.0])
