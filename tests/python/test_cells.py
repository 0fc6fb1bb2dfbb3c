"""The cells of points: a partition of the mesh, its moments, and what a tenth of the points makes of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import frazil as fz

sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
from gather import Points, irradiance  # noqa: E402
from noise_free import Setting, measure, plane, rms  # noqa: E402


def to_mesh(shape: trimesh.Trimesh) -> fz.Mesh:
    return fz.Mesh(np.asarray(shape.vertices), np.asarray(shape.faces))


def blob(levels: int = 5) -> trimesh.Trimesh:
    """A bumpy sphere, finer than the points of these tests."""
    shape = trimesh.creation.icosphere(subdivisions=levels, radius=0.3)
    v = shape.vertices
    shape.vertices = v * (1 + 0.25 * np.sin(18 * v[:, :1]) * np.cos(15 * v[:, 1:2] + 1))
    return shape


def spires() -> trimesh.Trimesh:
    """Cones with long thin triangles on a box."""
    parts = [trimesh.creation.box((0.7, 0.15, 0.7))]
    for x, z, height in ((-0.2, 0.1, 0.5), (0.1, -0.15, 0.4), (0.2, 0.2, 0.3)):
        cone = trimesh.creation.cone(radius=0.07, height=height, sections=24)
        cone.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
        parts.append(cone.apply_translation((x, 0.075, z)))
    return trimesh.util.concatenate(parts)


@pytest.mark.parametrize("shape", [blob(), spires(), trimesh.creation.torus(0.3, 0.1)])
def test_cells_are_the_mesh(shape):
    """Area, centroid and second moments of all cells together are those of the mesh."""
    mesh = to_mesh(shape)
    points = fz.poisson_points(mesh, 0.03)
    cells = fz.Cells(points, mesh)
    assert len(cells) == len(points)
    assert cells.areas.sum() == pytest.approx(shape.area, rel=1e-5)
    areas, centroids = cells.areas.astype(float)[:, None], cells.centroids.astype(float)
    middle = shape.triangles_center.T @ shape.area_faces / shape.area
    np.testing.assert_allclose((areas * centroids).sum(0) / shape.area, middle, atol=1e-6)
    second = areas * (cells.covariances[:, :3] + centroids**2)
    corners = shape.triangles.astype(float)
    true = shape.area_faces @ ((corners**2).sum(1) + 9 * corners.mean(1) ** 2) / 12
    np.testing.assert_allclose(second.sum(0), true, rtol=1e-5)
    # Cells lie about their points.
    away = np.linalg.norm(cells.centroids - points.positions, axis=1)[cells.areas > 0]
    assert away.max() < points.spacing


def test_places_lie_on_the_mesh_in_their_cells():
    shape = blob(4)
    mesh = to_mesh(shape)
    points = fz.poisson_points(mesh, 0.04)
    cells = fz.Cells(points, mesh, places=31)
    assert (np.diff(cells.owners.astype(int)) >= 0).all()
    whole = np.bincount(cells.owners, minlength=len(points)) < 31
    assert whole.mean() > 0.9
    held = np.bincount(cells.owners, cells.weights, len(points))
    np.testing.assert_allclose(held[whole], cells.areas[whole], rtol=1e-4)
    assert np.linalg.norm(cells.positions - points.positions[cells.owners], axis=1).max() < 1.5 * points.spacing
    assert (np.abs(np.linalg.norm(cells.normals, axis=1) - 1) < 1e-5).all()
    away = trimesh.proximity.closest_point_naive(shape, cells.positions[::500])[1]
    assert away.max() < 1e-5


def test_points_that_a_stretched_mesh_carries_still_have_all_of_it():
    mesh = plane()
    stretched = fz.Mesh(mesh.positions * np.float32([3, 1, 1]), mesh.triangles)
    points = fz.poisson_points(mesh, 0.05).on(stretched)
    assert fz.Cells(points, stretched).areas.sum() == pytest.approx(3.0, rel=1e-4)


def test_few_places_stand_for_all_without_bias():
    """Of a mesh much finer than its cells, four places of each: the weights' sum over many seeds is the area."""
    mesh = to_mesh(blob(5))
    points = fz.poisson_points(mesh, 0.08)
    drawn = [fz.Cells(points, mesh, places=4, seed=seed) for seed in range(60)]
    assert np.bincount(drawn[0].owners).max() == 4
    sums = np.array([np.bincount(c.owners, c.weights, len(points)) for c in drawn])
    assert sums.std(axis=0).max() > 0
    np.testing.assert_allclose(sums.mean(), drawn[0].areas.mean(), rtol=0.02)


def test_linear_light_has_the_moments_of_the_cell():
    """Light that grows with x: its mean is x of the centroid, so that noise-free sums know it to second order."""
    mesh = plane()
    points = fz.poisson_points(mesh, 0.02)
    cells = fz.Cells(points, mesh)
    profile = fz.Dipole(fz.Medium(60.0, 1.0, eta=1.31))
    light = np.repeat(1.0 + cells.positions[:, :1], 3, axis=1)
    tree = fz.PointTree(points, light, profile, cells=cells)
    where = np.zeros((50, 3), np.float32)
    where[:, 0] = np.linspace(-0.1, 0.1, 50)
    out = tree.gather(where, tolerance=1e-4)
    np.testing.assert_allclose(out.exitance[:, 0] / out.coverage, np.repeat(1 + where[:, :1], 3, axis=1), atol=4e-3)
    exact = tree.gather_exact(where)
    np.testing.assert_allclose(out.exitance, exact.exitance, rtol=3e-3)
    np.testing.assert_allclose(out.coverage, exact.coverage, rtol=3e-3)


@pytest.mark.parametrize("name", ["plane", "blob", "spires"])
def test_a_tenth_of_the_points_is_as_smooth(name):
    """The whole of it: against 20 N, N/10 with cells beats the plain sum of N; flicker between seeds under 0.5 %."""
    mesh = {"plane": plane, "blob": lambda: to_mesh(blob(4)), "spires": lambda: to_mesh(spires())}[name]()
    profile = fz.MultipleScattering(fz.Medium(20.0, (0.4, 0.1, 0.03), eta=1.31))
    found = measure(Setting(name, mesh, shading=3000), profile, 20_000, ("sum", "cell"))
    assert found["cell"][0] <= found["bar"][0]
    assert found["cell"][2] <= 0.5
    assert found["cell"][0] < 0.4 * found["sum"][0]


def test_ramp_layers_with_cells():
    mesh = plane()
    points = fz.poisson_points(mesh, 0.08)
    cells = fz.Cells(points, mesh)
    light = np.where(cells.positions[:, :1] > 0.02, [3.0, 2.0, 1.0], 0.1)
    profile = fz.MultipleScattering(fz.Medium(20.0, 0.2))
    knots, colors = [0.02, 0.1, 0.3], [[1.0, 0.2, 0.5], [0.3, 1.0, 2.0], [2.0, 0.1, 1.0]]
    tree = fz.PointTree(points, light, profile, fz.Ramp(knots, colors), cells)
    out = tree.gather(points.positions[:100], ramp_layers=True)
    total = (out.layers * np.array(colors)[None, :, None, :]).sum(1)
    np.testing.assert_allclose(total, out.exitance, rtol=2**-11)


@pytest.mark.parametrize("compensation", ["conserve", "depth"])
def test_a_render_takes_a_tenth_of_the_points(compensation):
    """Renders bake over cells: sparse noise-free points are nearer to dense ones than ten times as many plain ones."""
    shape = blob(4)
    scene = fz.Scene()
    mesh = scene.add_mesh(to_mesh(shape), "/blob")
    medium = fz.Medium(20.0, (0.4, 0.1, 0.03), eta=1.31)
    scene.add_object(
        "/blob", mesh, scene.add_material("/ice", fz.IceMaterial(medium, specular=0.0, compensation=compensation))
    )
    # The sun stands at the right of the camera: a shadow's edge runs down the middle.
    turn = trimesh.transformations.rotation_matrix(1.1, (0, 1, 0))
    matrix = np.ascontiguousarray(turn.T)
    eye = np.eye(4)
    eye[3, 2] = 2.0
    scene.camera = fz.Camera(matrix=eye, focal_length=50.0, horizontal_aperture=20.0, vertical_aperture=20.0)
    scene.add_light(fz.Light(fz.DistantLight(0.0), radiance=[3.0, 2.7, 2.2], matrix=matrix, path="/sun"))
    scene.add_light(fz.Light(fz.DomeLight(), radiance=[0.05, 0.06, 0.1], path="/sky"))

    def translucency(spacing: float, estimator: str, bake_samples: int):
        film = fz.render(
            scene, resolution=(48, 48), samples=16, spacing=spacing, estimator=estimator, bake_bounces=0, seed=3,
            bake_samples=bake_samples, tolerance=1e-3,
        )  # fmt: skip
        return film["translucency"][..., :3], film["beauty"][..., 3] == 1

    truth, inside = translucency(0.0018, "sum", 64)
    plain, sparse = (translucency(*a)[0] for a in ((0.007, "sum", 64), (0.007 * 10**0.5, "noise_free", 640)))
    assert 500 < inside.sum() < 2000
    assert truth[inside].max() > 3 * truth[inside].min()
    # Thickness is no part of the bake's rays: a tenth of the points asks a tenth of them, but each for all of its cell.
    as_good = 1.15 if compensation == "depth" else 1.0
    assert rms(sparse[inside], truth[inside]) <= as_good * rms(plain[inside], truth[inside])
    assert rms(sparse[inside], truth[inside]) < 0.2  # percent


def test_two_places_a_cell_are_as_smooth_as_light_at_the_points():
    """The fewest that a bake takes, where points are many (kFewestPlaces): with one, edges of shadows are noisier."""
    setting, count = Setting("plane", plane(), shading=3000), 20000
    profile = fz.MultipleScattering(fz.Medium(30.0, [0.6, 0.15, 0.05], eta=1.31))
    exact = {"tolerance": 1e-3}
    truth = setting.gather("sum", profile, 20 * count, 99, tolerance=exact).exitance

    def error(candidate: str, places: int) -> float:
        found = (setting.gather(candidate, profile, count, k, places, exact).exitance for k in (1, 2, 3))
        return float(np.mean([rms(values, truth) for values in found]))

    plain = error("sum", 0)
    assert error("cell", 2) <= 1.1 * plain < 0.9 * error("cell", 1)


def test_bad_input():
    mesh, profile = plane(), fz.Dipole(fz.Medium(1, 1))
    points, fewer = fz.poisson_points(mesh, 0.1), fz.poisson_points(mesh, 0.3)
    assert len(fz.Cells(fz.PointSet(), mesh)) == 0
    with pytest.raises(ValueError, match=r"Cells: places must be in \[1, 4096\], got 0"):
        fz.Cells(points, mesh, places=0)
    with pytest.raises(ValueError, match="Cells: points must cover the mesh within their spacing"):
        fz.Cells(points, fz.Mesh(mesh.positions + np.float32(5), mesh.triangles))
    cells = fz.Cells(points, mesh)
    with pytest.raises(ValueError, match="PointTree: irradiance must have one row per point"):
        fz.PointTree(points, np.ones((3, 3)), profile, cells=cells)
    with pytest.raises(ValueError, match="PointTree: cells must be one per point"):
        fz.PointTree(fewer, np.ones((len(fewer), 3)), profile, cells=cells)


class Loose:
    """Points of another maker."""

    def __init__(self, points: fz.PointSet):
        self.positions, self.normals, self.areas = (
            np.array(values) for values in (points.positions, points.normals, points.areas)
        )
        self.spacing = points.spacing


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("positions", np.nan, "Cells: positions must be finite, got NaN or infinity at point 3. Leave"),
        ("positions", 1e30, "Cells: positions must be within 1e[+]15 m of the origin"),
        ("normals", np.inf, "Cells: normals must be finite, got NaN or infinity at point 3. Leave"),
        ("areas", np.nan, "Cells: areas must be >= 0 and finite, got nan at point 3. It is"),
        ("areas", -1.0, "Cells: areas must be >= 0 and finite, got -1 at point 3. It is"),
    ],
)
def test_points_that_cells_cannot_stand_for(field, value, message):
    points = Loose(fz.poisson_points(plane(), 0.1))
    getattr(points, field)[3] = value
    with pytest.raises(ValueError, match=message):
        fz.Cells(points, plane())


@pytest.mark.parametrize("spacing", [np.nan, np.inf, -1.0, "wide", None])
@pytest.mark.parametrize("maker", ["Cells", "PointTree"])
def test_a_bad_spacing_of_points(spacing, maker):
    points = Loose(fz.poisson_points(plane(), 0.1))
    points.spacing = spacing
    light, profile = np.ones((len(points.areas), 3)), fz.Dipole(fz.Medium(1, 1))
    got = str(spacing).removesuffix(".0")
    with pytest.raises(ValueError, match=f"{maker}: spacing of the points must be .*, got '?{got}'?[.] It is"):
        fz.Cells(points, plane()) if maker == "Cells" else fz.PointTree(points, light, profile)


def test_points_of_unequal_arrays_have_no_cells():
    points = Loose(fz.poisson_points(plane(), 0.1))
    points.normals = points.normals[:2]
    with pytest.raises(ValueError, match="Cells: points must have a normal and an area each, got .* 2 normals"):
        fz.Cells(points, plane())
    points.normals = "up"
    with pytest.raises(ValueError, match="Cells: normals must be an array of numbers"):
        fz.Cells(points, plane())


@pytest.mark.parametrize("scale", [1e6, 1e15, 1e20])
def test_a_mesh_far_larger_than_its_points_is_refused_at_once(scale):
    """Its pieces, as small as a cell, would be more than any memory holds: the process died."""
    points, mesh = fz.poisson_points(plane(), 0.1), plane()
    with pytest.raises(ValueError, match="Cells: points must cover the mesh within their spacing"):
        fz.Cells(points, fz.Mesh(mesh.positions * np.float32(scale), mesh.triangles))
    tiny = Loose(points)
    tiny.spacing /= scale
    with pytest.raises(ValueError, match="Cells: points must cover the mesh within their spacing"):
        fz.Cells(tiny, mesh)


def test_slivers_and_triangles_without_area_have_cells():
    """A long sliver is as long as its points allow; what has no area is in no cell."""
    strip = fz.Mesh(
        np.float32([[0, 0, 0], [100, 0, 0], [100, 0.001, 0], [0, 0.001, 0], [1e6, 0, 0], [2e6, 0, 0]]),
        np.int32([[0, 1, 2], [0, 2, 3], [0, 4, 5]]),
    )
    cells = fz.Cells(fz.poisson_points(strip, 0.5), strip)
    assert cells.areas.sum() == pytest.approx(0.1, rel=1e-4)


def test_normals_of_other_points_are_made_unit_length():
    points = fz.poisson_points(plane(), 0.1)
    light, profile = np.ones((len(points), 3)), fz.Dipole(fz.Medium(10, 0.1))
    straight = fz.PointTree(points, light, profile).gather(points.positions).exitance
    for scale in (1e-30, 7.0, 1e30):
        loose = Loose(points)
        loose.normals = points.normals * scale
        got = fz.PointTree(loose, light, profile).gather(points.positions).exitance
        np.testing.assert_allclose(got, straight, rtol=1e-5)


def test_light_that_is_dark_among_others_is_as_exact():
    """Suns from eight sides, and a lamp on one end: where one is dark, all of its light comes from far clusters."""
    shape = blob(5)
    shape.apply_scale(2.5)
    points, places = Points(shape, 100_000, 1), Points(shape, 100_000, 2).positions
    light = irradiance(points, 9)
    light[:, 8] = (points.positions[:, 1:2] > 0.8 * points.positions[:, 1].max()) * np.float32([3, 2.7, 2.2])
    tree = fz.PointTree(points, light, fz.MultipleScattering(fz.Medium(30.0, (0.6, 0.15, 0.05), eta=1.0)))
    checked = slice(None, None, 1500)
    exact = tree.gather_exact(places[checked], "sum")
    error = 100 * (tree.gather(places, estimator="sum").exitance[checked] / exact.exitance - 1)
    share = exact.exitance / (light.mean(0) * exact.coverage[:, None])
    for faintest, darkest in ((0.1, np.inf), (1e-3, 0.1), (1e-5, 1e-3)):
        here = (share > faintest) & (share <= darkest)
        assert here.sum() > 50
        assert np.sqrt(np.mean(error[here] ** 2)) < 0.5
        assert np.abs(error[here]).max() < 3
    assert np.abs(exact.exitance * error / 100)[share <= 1e-5].max() < 1e-6 * light.mean(0).max()
