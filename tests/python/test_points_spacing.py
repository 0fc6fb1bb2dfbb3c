"""Spacing that varies, spacing by count, and the statistics of points."""

import numpy as np
import pytest
import trimesh
from point_checks import mesh_of, nearest_pair, nearest_points, sample_surface
from scipy.spatial import cKDTree

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


def test_function_is_asked_for_thousands_at_once():
    mesh = fz.Mesh(*square(1))
    asked = []

    def spacing(places):
        assert places.dtype == np.float64
        assert places.shape[1:] == (3,)
        asked.append(len(places))
        return np.full(len(places), 0.003)

    points = fz.poisson_points(mesh, spacing)
    assert max(asked) >= 4096
    assert len(asked) < len(points) / 500
    for threads in (1, 2):
        again = fz.poisson_points(mesh, spacing, threads=threads)
        assert again.positions.tobytes() == points.positions.tobytes()
        assert again.triangles.tobytes() == points.triangles.tobytes()


def test_what_a_function_raises_comes_through():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.icosphere(6)))

    def broken(places):
        raise ZeroDivisionError("of my own")

    for threads in (1, 2):
        with pytest.raises(ZeroDivisionError, match="of my own"):
            fz.poisson_points(mesh, broken, threads=threads)


def test_function_asks_on_the_rest_pose():
    positions, triangles = square(4)
    mesh = fz.Mesh(positions + np.float32([5, 0, 0]), triangles)
    mesh.set_rest(positions)

    def spacing(places):
        assert places[:, 0].max() <= 1
        return 0.02 + 0.05 * places[:, 0]

    points = fz.poisson_points(mesh, spacing)
    there = fz.poisson_points(fz.Mesh(positions, triangles), spacing)
    assert points.barycentrics.tobytes() == there.barycentrics.tobytes()
    assert points.positions[:, 0].min() >= 5


def test_camera_spacing_grows_with_distance():
    mesh = fz.Mesh(*square(4))
    function = spacing_from_camera([-0.1, 0.5, 0.0], pixel_angle=0.05, least=0.005)
    points = fz.poisson_points(mesh, function)
    check_varying(mesh, points, function, relative=0.06)


@pytest.mark.parametrize("kind", ["vertex", "corner"])
def test_texture_spacing(kind):
    # Far finer than the two triangles that it lies on: stripes of fine and coarse points.
    positions, triangles = square()
    mesh = fz.Mesh(positions, triangles)
    uvs = positions[:, :2]
    mesh.set_uvs(uvs if kind == "vertex" else uvs[triangles].reshape(-1, 2), kind)
    ramp = 0.5 - 0.5 * np.cos(np.arange(64) / 64 * 2 * np.pi * 2)
    image = np.tile(ramp.astype(np.float32), (8, 1))
    texture = spacing_from_texture(image, 0.012, 0.05)
    points = fz.poisson_points(mesh, texture)

    def spacing_at(places):
        return texture.at(places[:, :2])

    check_varying(mesh, points, spacing_at, relative=0.07)
    fine = spacing_at(points.positions) < 0.02
    places = np.random.default_rng(0).random((10_000, 2))
    assert fine.mean() > 2 * (texture.at(places) < 0.02).mean()


def test_texture_is_read_right_way_up(tmp_path):
    import OpenImageIO as oiio

    pixels = np.zeros((4, 4, 3), np.float32)
    pixels[0, 3] = 1  # the upper right corner, at (u, v) = (1, 1)
    path = tmp_path / "spacing.tif"
    buffer = oiio.ImageBuf(pixels)
    assert buffer.write(str(path), "float")
    texture = spacing_from_texture(path, 1, 3)
    assert texture.at(np.array([[7 / 8, 7 / 8]])) == pytest.approx(3)
    assert texture.at(np.array([[1 / 8, 7 / 8], [7 / 8, 1 / 8], [7 / 8 + 5, 1 / 8]])) == pytest.approx(1)


def test_bad_textures(tmp_path):
    for low, high in ((0, 1), (1, np.nan), (-1, 1)):
        with pytest.raises(ValueError, match="must be > 0 and finite, got"):
            spacing_from_texture(np.ones((2, 2)), low, high)
    for image in (np.ones(3), np.zeros((0, 4)), np.full((2, 2), np.nan)):
        with pytest.raises(ValueError, match="image must have shape"):
            spacing_from_texture(image, 1, 2)
    with pytest.raises(OSError, match="file must be an image"):
        spacing_from_texture(tmp_path / "none.png", 1, 2)
    with pytest.raises(ValueError, match="uvs must be given"):
        fz.poisson_points(fz.Mesh(*square()), spacing_from_texture(np.ones((2, 2)), 0.1, 0.2))


@pytest.mark.parametrize("count", [40, 1000, 20_000])
def test_count(count):
    mesh = fz.Mesh(*mesh_of(trimesh.creation.icosphere(3)))
    assert abs(len(fz.poisson_points(mesh, count=count)) - count) <= 0.005 * count


@pytest.mark.parametrize("shape", ["thin sheet", "soup", "shells", "needles", "far from the origin"])
def test_count_on_dirty_meshes(shape):
    random = np.random.default_rng(5)
    ball, faces = mesh_of(trimesh.creation.icosphere(3))
    if shape == "thin sheet":
        mesh = mesh_of(trimesh.creation.box((1, 1, 0.002)))
    elif shape == "soup":
        corners = random.random((300, 1, 3)) + 0.1 * random.normal(size=(300, 3, 3))
        mesh = corners.reshape(-1, 3).astype(np.float32), np.arange(900, dtype=np.int32).reshape(-1, 3)
    elif shape == "shells":
        both = np.concatenate([ball, ball * np.float32(0.99), ball])
        mesh = both, np.concatenate([faces, faces + len(ball), faces[:, ::-1] + 2 * len(ball)])
    elif shape == "needles":
        corners = random.random((200, 1, 3)) + np.array([0.3, 1e-4, 1e-4]) * random.normal(size=(200, 3, 3))
        mesh = corners.reshape(-1, 3).astype(np.float32), np.arange(600, dtype=np.int32).reshape(-1, 3)
    else:
        mesh = ball + np.float32(1e4), faces
    for count in (500, 10_000):
        points = fz.poisson_points(fz.Mesh(*mesh), count=count, seed=3)
        assert abs(len(points) - count) <= 0.005 * count


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
        (lambda places: np.where(places[:, 0] > 0.5, np.nan, 1), "must be > 0 and finite, got nan on triangle"),
        (lambda places: np.ones(3), r"must return shape .* of numbers, got \(3,\)"),
        (lambda places: np.ones((len(places), 1)), "must return shape"),
        (lambda places: np.full(len(places), "wide"), "must return shape"),
        (lambda places: 0.1, "must return shape .* got <class 'float'>"),
        (None, "spacing or count must be given"),
    ],
)
def test_bad_spacing(spacing, message):
    mesh = fz.Mesh(*square(1))
    with pytest.raises(ValueError, match=message):
        fz.poisson_points(mesh, spacing)


@pytest.mark.parametrize("spacing", ["wide", np.array(None), 1j])
def test_spacing_of_no_known_kind(spacing):
    with pytest.raises(TypeError, match="spacing must be a number, an array or a function"):
        fz.poisson_points(fz.Mesh(*square(1)), spacing)


@pytest.mark.parametrize("seed", [-1, 2**32, 0.5, "one"])
def test_bad_seed(seed):
    with pytest.raises(ValueError, match="seed must be a whole number"):
        fz.poisson_points(fz.Mesh(*square(1)), 0.5, seed)


def test_numbers_of_numpy_are_numbers():
    mesh = fz.Mesh(*square(1))
    expected = fz.poisson_points(mesh, 0.25, 7).positions.tobytes()
    for spacing in (np.float32(0.25), np.float64(0.25), np.array(0.25)):
        assert fz.poisson_points(mesh, spacing, np.int64(7)).positions.tobytes() == expected


@pytest.mark.parametrize("count", [0, -5])
def test_bad_count(count):
    with pytest.raises(ValueError, match="count must be > 0"):
        fz.poisson_points(fz.Mesh(*square(1)), count=count)


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
    assert measured.mean_area == pytest.approx(points.areas.mean(), rel=1e-4)
    distances, _ = cKDTree(points.positions.astype(np.float64)).query(points.positions.astype(np.float64), k=2)
    assert measured.min_distance == pytest.approx(distances[:, 1].min(), rel=1e-9)
    assert measured.mean_distance == pytest.approx(distances[:, 1].mean(), rel=1e-9)
    assert measured.distance_spread == pytest.approx(distances[:, 1].std() / distances[:, 1].mean(), rel=1e-6)
    places, _, normals, _, _, _ = sample_surface(positions, triangles, 400_000)
    gap, _ = nearest_points(points, places, normals, True, 0.2)
    assert measured.gap == pytest.approx(gap.max(), rel=0.02)


def test_statistics_tell_the_walls_of_a_sheet_apart():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.box((1.0, 1.0, 0.005))))
    points = fz.poisson_points(mesh, 0.05)
    assert fz.point_statistics(points, mesh).min_distance >= 0.05
    through = fz.point_statistics(points, mesh, thin_walls=False)
    nearest = cKDTree(points.positions).query(points.positions, k=2)[0][:, 1]
    assert through.min_distance == pytest.approx(nearest.min(), rel=1e-5)
    with pytest.raises(ValueError, match="points must be 1 or more"):
        fz.point_statistics(fz.PointSet(), mesh)


def test_poisson_is_more_even_than_tessellated():
    positions, triangles = mesh_of(trimesh.creation.uv_sphere(count=[24, 24]))
    mesh = fz.Mesh(positions, triangles)
    poisson = fz.point_statistics(fz.poisson_points(mesh, 0.05), mesh)
    regular = fz.point_statistics(fz.tessellated_points(mesh, 0.05), mesh)
    assert poisson.area_spread < 0.6 * regular.area_spread
    assert poisson.distance_spread < 0.5 * regular.distance_spread
