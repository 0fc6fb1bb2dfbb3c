"""Poisson points: the guarantees checked from outside, with a k-d tree and a dense sampling of the mesh."""

import numpy as np
import pytest
import trimesh
from point_checks import check_guarantees, mesh_of

import frazil as fz


def test_sphere_keeps_all_guarantees():
    check_guarantees(*mesh_of(trimesh.creation.icosphere(4)), spacing=0.08)


def test_box_of_large_triangles():
    check_guarantees(*mesh_of(trimesh.creation.box((1.0, 2.0, 3.0))), spacing=0.11)


def test_triangles_far_smaller_than_spacing():
    check_guarantees(*mesh_of(trimesh.creation.icosphere(6)), spacing=0.7)


def test_strict_mode_keeps_points_apart_across_a_sheet():
    positions, triangles = mesh_of(trimesh.creation.box((1.0, 1.0, 0.005)))
    check_guarantees(positions, triangles, spacing=0.05, thin_walls=False)


def test_thin_sheet_has_points_on_both_sides():
    positions, triangles = mesh_of(trimesh.creation.box((1.0, 1.0, 0.005)))
    points = check_guarantees(positions, triangles, spacing=0.05)
    up = points.normals[:, 2] > 0.5
    down = points.normals[:, 2] < -0.5
    assert points.areas[up].sum() == pytest.approx(1.0, rel=1e-4)
    assert points.areas[down].sum() == pytest.approx(1.0, rel=1e-4)
    strict = fz.poisson_points(fz.Mesh(positions, triangles), 0.05, thin_walls=False)
    assert len(strict) < 0.7 * len(points)


def test_same_bits_for_any_number_of_threads():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.icosphere(4)))
    sets = [fz.poisson_points(mesh, 0.02, seed=3, threads=n) for n in (1, 2, 8)]
    for name in ("positions", "normals", "areas", "triangles", "barycentrics"):
        reference = getattr(sets[0], name).tobytes()
        assert all(getattr(points, name).tobytes() == reference for points in sets[1:])


def test_seed_changes_the_points():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.icosphere(3)))
    a, b = fz.poisson_points(mesh, 0.2, seed=0), fz.poisson_points(mesh, 0.2, seed=1)
    assert a.positions.tobytes() != b.positions.tobytes()


def test_isosceles_triangles_end():
    # Ties between longest edges once made an endless loop.
    positions = np.array([[0, 0, 0], [2, 0, 0], [1, 3, 0]], np.float32)
    check_guarantees(positions, np.array([[0, 1, 2], [2, 0, 1]], np.int32), spacing=0.1)


def test_barycentrics_and_triangles_give_the_positions():
    positions, triangles = mesh_of(trimesh.creation.icosphere(3))
    points = fz.poisson_points(fz.Mesh(positions, triangles), 0.1)
    corners = positions[triangles[points.triangles]].astype(np.float64)
    u, v = points.barycentrics.astype(np.float64).T
    rebuilt = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    np.testing.assert_allclose(rebuilt, points.positions, atol=2e-7)


def test_spacing_far_larger_than_the_mesh_gives_a_point():
    positions, triangles = mesh_of(trimesh.creation.icosphere(2))
    points = fz.poisson_points(fz.Mesh(positions, triangles), 1e6)
    assert 1 <= len(points) <= 8
    assert points.areas.sum() == pytest.approx(fz.Mesh(positions, triangles).area, rel=1e-4)


@pytest.mark.parametrize("spacing", [0.0, -1.0, float("nan"), float("inf")])
def test_bad_spacing(spacing):
    mesh = fz.Mesh(*mesh_of(trimesh.creation.box()))
    with pytest.raises(ValueError, match="spacing must be > 0 and finite, got"):
        fz.poisson_points(mesh, spacing)
    with pytest.raises(ValueError, match="edge_length must be > 0 and finite, got"):
        fz.tessellated_points(mesh, spacing)


def test_wrong_types():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.box()))
    with pytest.raises(TypeError):
        fz.poisson_points(mesh, "fine")
    with pytest.raises(TypeError):
        fz.poisson_points("mesh", 0.1)


def test_no_surface():
    empty = fz.Mesh(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32))
    flat = fz.Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    for mesh in (empty, flat):
        with pytest.raises(ValueError, match="Mesh: area must be > 0"):
            fz.poisson_points(mesh, 0.1)
        with pytest.raises(ValueError, match="Mesh: area must be > 0"):
            fz.tessellated_points(mesh, 0.1)


def test_too_many_points_are_refused_with_a_spacing_that_works():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.box()))
    with pytest.raises(ValueError, match="spacing must be >= .*, got .*points") as caught:
        fz.poisson_points(mesh, np.sqrt(0.7 * 6 / 1e9))
    assert "GB" in str(caught.value)
    with pytest.raises(ValueError, match="by max_points") as caught:
        fz.poisson_points(mesh, 0.01, max_points=1000)
    remedy = float(str(caught.value).split(">= ")[1].split(",")[0])
    assert len(fz.poisson_points(mesh, remedy, max_points=1000)) < 1100


def test_needles_do_not_slip_past_the_prediction():
    # No area to speak of, but length without end: one point covers at most two spacings of it.
    needle = np.array([[0, 0, 0], [1e11, 0, 0], [0, 1e-11, 0]], np.float32)
    mesh = fz.Mesh(needle, np.array([[0, 1, 2]], np.int32))
    with pytest.raises(ValueError, match="spacing must be >= .* by the memory that is free"):
        fz.poisson_points(mesh, 0.1)
    with pytest.raises(ValueError, match="by max_points") as caught:
        fz.poisson_points(mesh, 0.1, max_points=1000)
    remedy = float(str(caught.value).split(">= ")[1].split(",")[0])
    assert 500 < len(fz.poisson_points(mesh, remedy, max_points=1000)) < 2000
    assert len(fz.poisson_points(mesh, count=1000)) == pytest.approx(1000, rel=0.005)
    # Many that are only together too long.
    start = np.random.default_rng(0).random((3000, 1, 3)) * 5
    needles = (start + np.array([[0, 0, 0], [1, 0, 0], [0, 1e-12, 0]])).astype(np.float32).reshape(-1, 3)
    needles[2::3] = needles[0::3] + np.float32([0, 1e-6, 0])
    with pytest.raises(ValueError, match="long thin triangles"):
        fz.poisson_points(fz.Mesh(needles, np.arange(9000, dtype=np.int32).reshape(-1, 3)), 1e-3, max_points=2000)


def test_areas_of_a_count_are_those_of_its_spacing():
    mesh = fz.Mesh(*mesh_of(trimesh.creation.torus(1.0, 0.4)))
    counted = fz.poisson_points(mesh, count=5000)
    spaced = fz.poisson_points(mesh, counted.spacing)
    assert counted.positions.tobytes() == spaced.positions.tobytes()
    np.testing.assert_allclose(counted.areas, spaced.areas, rtol=1e-4)


def test_tessellated_points_are_the_regular_cut():
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    points = fz.tessellated_points(fz.Mesh(positions, np.array([[0, 1, 2]], np.int32)), 0.5)
    assert len(points) == 9
    np.testing.assert_allclose(points.areas, 0.5 / 9, rtol=1e-6)
    np.testing.assert_allclose(points.positions.mean(axis=0), [1 / 3, 1 / 3, 0], atol=1e-6)


def test_save_and_load(tmp_path):
    points = fz.poisson_points(fz.Mesh(*mesh_of(trimesh.creation.icosphere(2))), 0.1)
    path = tmp_path / "points.ply"
    points.save(path)
    loaded = fz.PointSet.load(str(path))
    assert loaded.spacing == points.spacing
    for name in ("positions", "normals", "areas", "triangles", "barycentrics"):
        assert getattr(loaded, name).tobytes() == getattr(points, name).tobytes()
    # Other tools open it as well.
    np.testing.assert_array_equal(trimesh.load(path).vertices.astype(np.float32), points.positions)


def test_files_that_are_no_points(tmp_path):
    path = tmp_path / "points.ply"
    fz.poisson_points(fz.Mesh(*mesh_of(trimesh.creation.box())), 0.2).save(path)
    data = path.read_bytes()
    for broken in (
        data[:-1],
        data[:300],
        b"",
        b"ply\n",
        data.replace(b"float area", b"float mass"),
        data.replace(b"binary_little", b"binary_big"),
        b"\x00" * 100,
    ):
        path.write_bytes(broken)
        with pytest.raises(OSError, match=f"{path}: file must"):
            fz.PointSet.load(path)
    with pytest.raises(OSError, match="must be readable"):
        fz.PointSet.load(tmp_path / "none.ply")
    with pytest.raises(OSError, match="must be writable"):
        fz.poisson_points(fz.Mesh(*mesh_of(trimesh.creation.box())), 1.0).save(tmp_path / "no" / "such.ply")
