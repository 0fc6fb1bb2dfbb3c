"""Check a point set from outside: by k-d tree and a dense random sampling of the surface."""

import numpy as np
from scipy.spatial import cKDTree

import frazil as fz

SAME_SIDE = 1e-6


def mesh_of(shape):
    """The positions and triangles of a trimesh shape."""
    return np.asarray(shape.vertices, np.float32), np.asarray(shape.faces, np.int32)


def triangle_normals(positions, triangles):
    """Unit normals (zero where degenerate) and areas, in double."""
    corners = positions.astype(np.float64)[triangles]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return cross / np.where(length > 0, length, 1)[:, None], length / 2


def sample_surface(positions, triangles, count, seed=1):
    """Uniform random places on the mesh: positions, the triangle of each, its normal and the total area."""
    normals, areas = triangle_normals(positions, triangles)
    random = np.random.default_rng(seed)
    chosen = random.choice(len(triangles), count, p=areas / areas.sum())
    u, v = random.random((2, count))
    fold = u + v > 1
    u[fold], v[fold] = 1 - u[fold], 1 - v[fold]
    corners = positions.astype(np.float64)[triangles[chosen]]
    places = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    return places, chosen, normals[chosen], areas.sum(), u, v


def nearest_pair(points, thin_walls, within):
    """The smallest distance of two points on one side, or inf where none is below `within`."""
    positions, normals = points.positions.astype(np.float64), points.normals.astype(np.float64)
    pairs = cKDTree(positions).query_pairs(within, output_type="ndarray")
    if thin_walls:
        pairs = pairs[np.einsum("ij,ij->i", normals[pairs[:, 0]], normals[pairs[:, 1]]) > SAME_SIDE]
    if len(pairs) == 0:
        return np.inf, pairs
    return np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1).min(), pairs


def nearest_points(points, places, normals, thin_walls, reach):
    """Distance to, and index of, the nearest point on the side of each place, looked for within `reach`."""
    positions, point_normals = points.positions.astype(np.float64), points.normals.astype(np.float64)
    tree = cKDTree(positions)
    distance = np.full(len(places), np.inf)
    owner = np.full(len(places), -1)
    left = np.arange(len(places))
    count = 8
    while len(left):
        count = min(count * 2, len(positions))
        d, i = tree.query(places[left], k=np.arange(1, count + 1), distance_upper_bound=reach)
        is_found = np.isfinite(d)
        i = np.where(is_found, i, 0)
        is_same = is_found
        if thin_walls:
            is_same = is_found & (np.einsum("mkj,mj->mk", point_normals[i], normals[left]) > SAME_SIDE)
        first = is_same.argmax(axis=1)
        rows = np.arange(len(left))
        done = is_same[rows, first]
        distance[left[done]] = d[rows, first][done]
        owner[left[done]] = i[rows, first][done]
        exhausted = done | ~is_found[:, -1] | (count == len(positions))
        left = left[~exhausted]
    return distance, owner


def check_guarantees(positions, triangles, spacing, thin_walls=True, seed=0, samples=100_000, slack=1e-6):
    """Make points and assert everything that poisson_points promises; returns them."""
    mesh = fz.Mesh(positions, triangles)
    points = fz.poisson_points(mesh, spacing, seed=seed, thin_walls=thin_walls)
    nearest, _ = nearest_pair(points, thin_walls, spacing)
    assert nearest >= spacing, f"two points {nearest / spacing} spacings apart"

    places, _, normals, area, _, _ = sample_surface(positions, triangles, samples)
    distance, owner = nearest_points(points, places, normals, thin_walls, 1.5 * spacing)
    gap = distance.max() / spacing
    assert gap <= 1.0 + slack, f"gap of {gap} spacings"

    areas = points.areas.astype(np.float64)
    assert abs(areas.sum() / area - 1) < 1e-4
    assert (areas >= 0).all()
    # Each area against the samples that are nearest to its point: within what counting that many allows.
    expected = areas / area * samples
    counted = np.bincount(owner, minlength=len(points))
    score = (counted - expected) / np.sqrt(np.maximum(expected * (1 - areas / area), 1))
    assert np.abs(score).max() < 7, f"area {np.abs(score).max()} deviations from the sampled one"
    assert np.sqrt(np.mean(score**2)) < 1.2 + 5 / np.sqrt(len(points))
    assert np.allclose(np.linalg.norm(points.normals, axis=1), 1, atol=1e-5)
    return points
