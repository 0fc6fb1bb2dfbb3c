"""Spacing that varies, spacing by count, and points that ride on a moving mesh."""

import numpy as np
import pytest
import trimesh
from point_checks import SAME_SIDE, mesh_of, nearest_pair, nearest_points, sample_surface

import frazil as fz
from frazil.points import spacing_from_camera, spacing_from_texture


def square(n=1):
    """The unit square as 2 n² triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1).astype(np.float32)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    lower = np.stack([corner, corner + 1, corner + n + 2], axis=1)
    upper = np.stack([corner, corner + n + 2, corner + n + 1], axis=1)
    return positions, np.concatenate([lower, upper]).astype(np.int32)


def check_varying(mesh, points, radius_at, relative=1e-3):
    """No pair nearer than the smaller of its radii; no surface farther than its own radius from a point."""
    radii = radius_at(points.positions.astype(np.float64))
    _, pairs = nearest_pair(points, True, radii.max())
    distance = np.linalg.norm(points.positions[pairs[:, 0]].astype("f8") - points.positions[pairs[:, 1]], axis=1)
    assert (distance >= np.minimum(radii[pairs[:, 0]], radii[pairs[:, 1]]) * (1 - relative)).all()
    places, _, normals, area, _, _ = sample_surface(mesh.positions, mesh.triangles, 50_000)
    gap, _ = nearest_points(points, places, normals, True, 1.5 * radii.max())
    assert (gap <= radius_at(places) * (1 + relative)).all()
    assert points.areas.sum(dtype="f8") == pytest.approx(area, rel=1e-4)


def linear(places):
    return 0.01 + 0.04 * places[:, 0]


def test_one_value_per_vertex():
    positions, triangles = square(20)
    mesh = fz.Mesh(positions, triangles)
    points = fz.poisson_points(mesh, linear(positions))
    check_varying(mesh, points, linear)
    left = points.positions[:, 0] < 0.2
    assert left.mean() > 0.4  # fine on the left


def test_spacing_jumps_by_a_factor_of_ten():
    positions, triangles = square(1)
    mesh = fz.Mesh(positions, triangles)

    def steep(places):
        return 0.01 + 0.09 * places[:, 1]

    check_varying(mesh, fz.poisson_points(mesh, steep(positions)), steep)


def test_function_on_large_triangles():
    mesh = fz.Mesh(*square(1))

    def bump(places):
        return 0.05 - 0.04 * np.exp(-((places[:, 0] - 0.5) ** 2 + (places[:, 1] - 0.5) ** 2) / 0.02)

    points = fz.poisson_points(mesh, bump)
    check_varying(mesh, points, bump, relative=0.06)
    assert set(points.triangles) == {0, 1}
    corners = mesh.positions[mesh.triangles[points.triangles]].astype("f8")
    u, v = points.barycentrics.astype("f8").T
    rebuilt = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    np.testing.assert_allclose(rebuilt, points.positions, atol=1e-6)


def test_camera_spacing_grows_with_distance():
    mesh = fz.Mesh(*square(4))
    function = spacing_from_camera([-0.1, 0.5, 0.0], pixel_angle=0.05, least=0.005)
    points = fz.poisson_points(mesh, function)
    check_varying(mesh, points, function, relative=0.06)


def test_texture_spacing():
    positions, triangles = square(8)
    mesh = fz.Mesh(positions, triangles)
    image = np.tile(np.linspace(0, 1, 64, dtype=np.float32), (8, 1))
    values = spacing_from_texture(mesh, np.clip(positions[:, :2], 0.01, 0.99), image, 0.02, 0.1)
    assert values[0] == pytest.approx(0.02, abs=0.002)
    assert len(fz.poisson_points(mesh, values)) > 100
    with pytest.raises(ValueError, match="uvs must have shape"):
        spacing_from_texture(mesh, positions, image, 0.02, 0.1)


@pytest.mark.parametrize("count", [40, 1000, 20_000])
def test_count(count):
    mesh = fz.Mesh(*mesh_of(trimesh.creation.icosphere(3)))
    assert abs(len(fz.poisson_points(mesh, count=count)) - count) <= 0.005 * count


def test_count_that_no_spacing_gives():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.icosphere(3)))
    with pytest.raises(ValueError, match="count must be one that some spacing gives"):
        fz.poisson_points(mesh, count=1)


@pytest.mark.parametrize(
    ("spacing", "message"),
    [
        (np.ones(3), "one per vertex"),
        (np.ones((4, 2)), r"shape \(V,\)"),
        (np.array([1, 1, np.nan, 1]), "got nan at vertex 2"),
        (np.array([1, -1, 1, 1]), "got -1 at vertex 1"),
        (lambda places: np.zeros(len(places)), "must be > 0 and finite, got 0"),
        (lambda places: np.ones(3), "must return shape"),
        (None, "spacing or count must be given"),
    ],
)
def test_bad_spacing(spacing, message):
    mesh = fz.Mesh(*square(1))
    with pytest.raises(ValueError, match=message):
        fz.poisson_points(mesh, spacing)


@pytest.mark.parametrize("count", [0, -5])
def test_bad_count(count):
    with pytest.raises(ValueError, match="count must be > 0"):
        fz.poisson_points(fz.Mesh(*square(1)), count=count)


def test_points_ride_on_a_pose():
    positions, triangles = mesh_of(trimesh.creation.icosphere(3))
    rest = fz.Mesh(positions, triangles)
    points = fz.poisson_points(rest, 0.1)
    np.testing.assert_allclose(points.on(rest).positions, points.positions, atol=2e-7)
    np.testing.assert_allclose(points.on(rest).areas, points.areas, rtol=1e-5)

    stretch = np.float32([2, 1, 1])
    pose = fz.Mesh(positions * stretch, triangles)
    moved = points.on(pose)
    np.testing.assert_allclose(moved.positions, points.positions * stretch, atol=1e-6)
    assert moved.areas.sum(dtype="f8") == pytest.approx(pose.area, rel=1e-6)
    assert (moved.triangles == points.triangles).all()
    corners = pose.positions[pose.triangles[moved.triangles]].astype("f8")
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    np.testing.assert_allclose(moved.normals, normals, atol=1e-5)
    with pytest.raises(ValueError, match="must be those of the mesh"):
        points.on(fz.Mesh(*mesh_of(trimesh.creation.icosphere(1))))


def test_statistics_agree_with_a_tree():
    positions, triangles = mesh_of(trimesh.creation.icosphere(4))
    mesh = fz.Mesh(positions, triangles)
    points = fz.poisson_points(mesh, 0.1)
    measured = fz.point_statistics(points, mesh)
    assert measured.count == len(points)
    # icosphere: no obtuse pairs within twice the spacing, so that the plain tree sees the same
    nearest, pairs = nearest_pair(points, True, 0.2)
    assert measured.min_distance == pytest.approx(nearest, rel=1e-9)
    assert 0.9 * points.spacing < measured.gap <= points.spacing * (1 + 1e-6)
    assert measured.area_sum == pytest.approx(mesh.area, rel=1e-5)
    assert measured.area_spread == pytest.approx(points.areas.std() / points.areas.mean(), rel=1e-4)
    assert SAME_SIDE > 0


def test_poisson_is_more_even_than_tessellated():
    positions, triangles = mesh_of(trimesh.creation.uv_sphere(count=[24, 24]))
    mesh = fz.Mesh(positions, triangles)
    poisson = fz.point_statistics(fz.poisson_points(mesh, 0.05), mesh)
    regular = fz.point_statistics(fz.tessellated_points(mesh, 0.05), mesh)
    assert poisson.area_spread < 0.6 * regular.area_spread
    assert poisson.distance_spread < 0.5 * regular.distance_spread
