"""The guarantees as properties of any triangle soup, and the dirty meshes that the world is full of."""

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from point_checks import check_guarantees, mesh_of

import frazil as fz


@st.composite
def soups(draw):
    """Random triangles of wildly different sizes and shapes, some twice, some flipped, some without area."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(1, 40))
    centers = random.random((count, 1, 3)) * draw(st.sampled_from([0.1, 1.0, 3.0]))
    sizes = 10.0 ** random.uniform(-3, draw(st.sampled_from([-1.0, 0.0])), (count, 1, 1))
    corners = centers + random.normal(size=(count, 3, 3)) * sizes
    slivers = random.random(count) < 0.2
    corners[slivers, 2] = corners[slivers, 0] + (corners[slivers, 1] - corners[slivers, 0]) * 0.5
    corners[slivers, 2] += random.normal(size=(slivers.sum(), 3)) * 1e-6
    positions = corners.reshape(-1, 3).astype(np.float32)
    triangles = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    twice = random.integers(0, count, count // 3)
    triangles = np.concatenate([triangles, triangles[twice], triangles[twice[::2]][:, ::-1]])
    return positions, triangles


@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(soups(), st.floats(0.05, 3.0), st.booleans(), st.integers(0, 2**32 - 1))
def test_soup_keeps_all_guarantees(soup, spacing, thin_walls, seed):
    positions, triangles = soup
    if fz.Mesh(positions, triangles).area < 1e-12:
        return
    check_guarantees(positions, triangles, spacing, thin_walls, seed, samples=20_000)


def sphere(scale=1.0, offset=0.0):
    positions, triangles = mesh_of(trimesh.creation.icosphere(3))
    return positions * np.float32(scale) + np.float32(offset), triangles


def test_duplicate_and_flipped_faces():
    positions, triangles = sphere()
    doubled = np.concatenate([triangles, triangles + len(positions), triangles[:, ::-1]])
    check_guarantees(np.concatenate([positions, positions]), doubled, 0.15)


def test_shells_inside_each_other():
    positions, triangles = sphere()
    both = np.concatenate([positions, positions * np.float32(0.98)])
    check_guarantees(both, np.concatenate([triangles, triangles + len(positions)]), 0.15)


def test_edges_that_many_faces_share_and_vertices_without_faces():
    # A book of seven pages on one spine, some of them turned over, whose pages cross a sheet; and stray vertices.
    angles = np.linspace(0.1, 2.9, 7)
    pages = np.stack([np.cos(angles), np.sin(angles), np.zeros(7)], axis=1)
    spine = np.array([[0, 0, -1], [0, 0, 1]])
    sheet = np.array([[-2, 0.3, -1], [2, 0.3, -1], [0, 0.3, 2]])
    positions = np.concatenate([spine, pages, sheet, np.full((5, 3), 7.0)]).astype(np.float32)
    faces = [[0, 1, 2 + i] if i % 2 else [1, 0, 2 + i] for i in range(7)] + [[9, 10, 11], [0, 0, 1], [2, 3, 3]]
    check_guarantees(positions, np.array(faces, np.int32), 0.05)


def test_a_spacing_far_larger_than_each_of_many_shells_gives_each_its_points():
    shells, count = [], 5
    for i in range(count):
        positions, triangles = mesh_of(trimesh.creation.icosphere(1, radius=1e-3))
        shells.append((positions + np.float32([10 * i, 0, 0]), triangles + i * len(positions)))
    positions, triangles = (np.concatenate(x) for x in zip(*shells, strict=True))
    points = check_guarantees(positions, triangles.astype(np.int32), 1.0)
    per_shell = np.bincount(np.round(points.positions[:, 0] / 10).astype(int), minlength=count)
    assert (per_shell >= 1).all()
    assert (per_shell <= 8).all()


def test_sliver_of_aspect_a_million():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0], [0.5, 0.3, 0]], np.float32)
    check_guarantees(positions, np.array([[0, 1, 2], [0, 1, 3]], np.int32), 0.05)
    check_guarantees(positions, np.array([[0, 1, 2]], np.int32), 0.05)


def test_one_triangle_far_larger_than_the_spacing():
    positions = np.array([[0, 0, 0], [150, 0, 10], [0, 150, 70]], np.float32)
    check_guarantees(positions, np.array([[0, 1, 2]], np.int32), 1.0, slack=1e-5)


@pytest.mark.parametrize("spacing", [0.05, 0.3])
def test_a_hundred_kilometres_from_the_origin(spacing):
    # Floats are 8 mm apart there: the guarantees hold for the positions as they are stored.
    check_guarantees(*sphere(offset=1e5), spacing)


@pytest.mark.parametrize("scale", [1e-18, 1e-6, 1e15])
def test_any_unit(scale):
    check_guarantees(*sphere(scale), 0.1 * scale)


def test_turned_box_and_thin_shapes():
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])
    check_guarantees(*mesh_of(trimesh.creation.box().apply_transform(turn)), 0.1)
    check_guarantees(*mesh_of(trimesh.creation.cylinder(0.02, 3)), 0.1)
    check_guarantees(*mesh_of(trimesh.creation.cone(0.1, 3)), 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("thin_walls", [True, False])
def test_two_million_places_on_a_dirty_mesh(thin_walls):
    # A thin shell, doubled faces, a sliver fan and a body that cuts through: 40,000 points.
    ball, faces = sphere()
    box, box_faces = mesh_of(trimesh.creation.box((3, 0.3, 0.004)))
    fan = np.float32([[2, 0, 0], [3, 1, 0], [3, 1 + 1e-5, 0], [3, 1 + 2e-5, 0]])
    parts = [(ball, faces), (ball * np.float32(0.995), faces[:, ::-1]), (ball, faces[::7]), (box, box_faces)]
    parts.append((fan, np.int32([[0, 1, 2], [0, 2, 3]])))
    first = np.cumsum([0] + [len(p) for p, _ in parts])
    positions = np.concatenate([p for p, _ in parts])
    triangles = np.concatenate([t + f for (_, t), f in zip(parts, first, strict=False)]).astype(np.int32)
    check_guarantees(positions, triangles, 0.023, thin_walls, samples=2_000_000)
