"""Points that ride on a moving mesh: ids, true areas on every pose, rest poses from Python, USD and in renders."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from point_checks import mesh_of, nearest_points, sample_surface
from pxr import Sdf, UsdGeom, UsdShade, Vt
from usd_stages import add_mesh, load, new_stage, set_primvar

import frazil as fz
from frazil.mesh_io import read_mesh

POINTS = Sdf.ValueTypeNames.Point3fArray


def ball(level=3):
    return mesh_of(trimesh.creation.icosphere(level))


def twisted(positions):
    """Bent, stretched up to three times on one side and squeezed on the other."""
    x, y, z = positions.astype(np.float64).T
    turn = 1.2 * z
    grown = np.exp(x)
    return np.float32(
        np.stack([x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z * grown], 1)
    )


def check_areas(points, mesh, thin_walls=True, samples=200_000):
    """Each area is the surface that is nearest to its point: counted by samples."""
    places, _, normals, area, _, _ = sample_surface(mesh.positions, mesh.triangles, samples)
    assert points.areas.sum(dtype="f8") == pytest.approx(area, rel=1e-5)
    _, owner = nearest_points(points, places, normals, thin_walls, np.inf)
    assert (owner >= 0).all()
    expected = points.areas.astype(np.float64) / area * samples
    counted = np.bincount(owner, minlength=len(points))
    score = (counted - expected) / np.sqrt(np.maximum(expected, 1))
    assert np.abs(score).max() < 7
    assert np.sqrt(np.mean(score**2)) < 1.2


def test_points_ride_on_a_pose():
    positions, triangles = ball()
    rest = fz.Mesh(positions, triangles)
    points = fz.poisson_points(rest, 0.1)
    same = points.on(rest)
    np.testing.assert_allclose(same.positions, points.positions, atol=2e-7)
    # Two ways to the same areas: tile by tile beside the points, and by a tree of the points.
    np.testing.assert_allclose(same.areas, points.areas, rtol=1e-3)

    pose = fz.Mesh(twisted(positions), triangles)
    moved = points.on(pose)
    assert (moved.triangles == points.triangles).all()
    assert (moved.barycentrics == points.barycentrics).all()
    corners = pose.positions[pose.triangles[moved.triangles]].astype("f8")
    u, v = points.barycentrics.astype("f8").T
    places = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    np.testing.assert_allclose(moved.positions, places, atol=1e-6)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    np.testing.assert_allclose(moved.normals, normals, atol=1e-5)
    check_areas(moved, pose)
    with pytest.raises(ValueError, match="must be those of the mesh"):
        points.on(fz.Mesh(*ball(1)))


def test_areas_on_any_points_and_poses():
    # Far too few points, walls that fold onto each other, large triangles, and points that coincide.
    positions, triangles = mesh_of(trimesh.creation.box((1, 1, 1)))
    points = fz.poisson_points(fz.Mesh(positions, triangles), 0.08)
    flat = fz.Mesh(positions * np.float32([1, 1, 1e-3]), triangles)
    check_areas(points.on(flat), flat)
    assert points.on(flat, thin_walls=False).areas.sum(dtype="f8") == pytest.approx(flat.area, rel=1e-6)
    few = fz.poisson_points(fz.Mesh(positions, triangles), 3.0)
    stretched = fz.Mesh(positions * np.float32([30, 1, 1]), triangles)
    check_areas(few.on(stretched), stretched)
    twice = fz.tessellated_points(fz.Mesh(positions, np.concatenate([triangles, triangles])), 0.3)
    both = fz.Mesh(positions, np.concatenate([triangles, triangles]))
    assert twice.on(both).areas.sum(dtype="f8") == pytest.approx(both.area, rel=1e-6)
    collapsed = fz.Mesh(positions * np.float32(0), triangles)
    assert (points.on(collapsed).areas == 0).all()
    assert np.isfinite(points.on(collapsed).normals).all()


def test_a_rest_pose_keeps_ids_in_every_pose():
    positions, triangles = ball()
    expected = fz.poisson_points(fz.Mesh(positions, triangles), 0.1, seed=4)
    for pose in (positions, twisted(positions), positions + np.float32([5, 0, 0])):
        mesh = fz.Mesh(pose, triangles)
        mesh.set_rest(positions)
        points = fz.poisson_points(mesh, 0.1, seed=4)
        assert points.triangles.tobytes() == expected.triangles.tobytes()
        assert points.barycentrics.tobytes() == expected.barycentrics.tobytes()
        # In the rest pose itself they are those made beside the points, which round otherwise.
        np.testing.assert_allclose(points.areas, expected.on(mesh).areas, rtol=1e-3)
    # By a function and by count too; the function is asked on the rest pose.
    mesh = fz.Mesh(twisted(positions), triangles)
    mesh.set_rest(positions)
    seen = []

    def spacing(places):
        seen.append(np.linalg.norm(places, axis=1).max())
        return 0.1 + 0.05 * places[:, 0]

    a = fz.poisson_points(mesh, spacing)
    b = fz.poisson_points(fz.Mesh(positions, triangles), spacing)
    assert max(seen) < 1.001
    assert (a.triangles == b.triangles).all()
    assert a.areas.sum(dtype="f8") == pytest.approx(mesh.area, rel=1e-5)
    assert abs(len(fz.poisson_points(mesh, count=2000)) - 2000) <= 10


def test_bad_rest_poses():
    mesh = fz.Mesh(*ball(1))
    with pytest.raises(ValueError, match="rest must have one position per vertex"):
        mesh.set_rest(np.zeros((3, 3), np.float32))
    wrong = np.full_like(mesh.positions, np.nan)
    with pytest.raises(ValueError, match="rest must be finite"):
        mesh.set_rest(wrong)
    for values, message in ((np.ones(3), "one value per vertex"), (np.zeros(len(mesh.positions)), "must be > 0")):
        with pytest.raises(ValueError, match=f"spacing must {message}|{message}"):
            fz.Mesh(*ball(1)).set_spacing(values.astype(np.float32))


def moving_stage(path, primvar=None, scheme="none"):
    """A cube of ice whose points move from frame 1 to 2, by itself and twice instanced beside it."""
    stage = new_stage(path)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(2)
    box = trimesh.creation.box()
    rest = np.asarray(box.vertices, np.float32)
    mesh = add_mesh(stage, "/Ice", rest, [3] * len(box.faces), box.faces.ravel(), scheme)
    points = mesh.GetPointsAttr()
    points.Clear()
    points.Set(Vt.Vec3fArray.FromNumpy(rest), 1)
    points.Set(Vt.Vec3fArray.FromNumpy(twisted(rest)), 2)
    if primvar:
        set_primvar(mesh, primvar, POINTS, "vertex", Vt.Vec3fArray.FromNumpy(rest))
    material = UsdShade.Material.Define(stage, "/Look")
    shader = UsdShade.Shader.Define(stage, "/Look/Ice")
    shader.CreateIdAttr("frazil:ice")
    shader.CreateInput("spacing", Sdf.ValueTypeNames.Float).Set(0.1)
    shader.CreateInput("mean_free_path", Sdf.ValueTypeNames.Color3f).Set((0.2, 0.2, 0.2))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.Save()
    return stage


@pytest.mark.parametrize("primvar", ["rest", "Pref"])
@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_usd_rest_primvar(tmp_path, primvar, scheme):
    stage = moving_stage(tmp_path / "a.usda", primvar, scheme)
    still, moved = (load(stage, frame=frame).mesh(0) for frame in (1, 2))
    np.testing.assert_allclose(moved.rest, still.positions, atol=1e-6)
    assert np.abs(moved.positions - still.positions).max() > 0.05
    a, b = (read_mesh(tmp_path / "a.usda", frame=frame) for frame in (1, 2))
    assert (fz.poisson_points(a, 0.1).triangles == fz.poisson_points(b, 0.1).triangles).all()


def test_usd_rest_frame_and_its_limits(tmp_path):
    stage = moving_stage(tmp_path / "a.usda")
    assert load(stage, frame=2).mesh(0).rest is None
    at_rest = load(stage, frame=2, rest_frame=1)
    np.testing.assert_allclose(at_rest.mesh(0).rest, load(stage, frame=1).mesh(0).positions, atol=1e-6)
    stage.GetPrimAtPath("/Ice").GetAttribute("points").Set(Vt.Vec3fArray(5), 0)
    scene = load(stage, frame=2, rest_frame=0)
    assert scene.mesh(0).rest is None
    assert any("points at the rest frame, got 5" in text for text in scene.warnings)
    with pytest.raises(ValueError, match="rest_frame must be a finite number"):
        fz.load_usd(tmp_path / "a.usda", rest_frame=float("nan"))


def test_a_render_keeps_its_points_on_a_deforming_body(tmp_path):
    stage = moving_stage(tmp_path / "a.usda")
    sets = [fz.bake(load(stage, frame=f, rest_frame=1), bake_samples=1, bake_bounces=0).points(0) for f in (1, 2)]
    assert sets[0].triangles.tobytes() == sets[1].triangles.tobytes()
    assert sets[0].barycentrics.tobytes() == sets[1].barycentrics.tobytes()
    check_areas(sets[1], load(stage, frame=2).mesh(0), samples=50_000)


def placed(mesh, matrices, spacing):
    """The points that a render places on a mesh of ice at several places."""
    scene = fz.Scene()
    index = scene.add_mesh(mesh, "/Ball")
    ice = scene.add_material("/Look", fz.IceMaterial(fz.Medium((9, 9, 9), (0.1, 0.1, 0.1)), spacing=spacing))
    for number, matrix in enumerate(matrices):
        scene.add_object(f"/Ball{number}", index, ice, np.ascontiguousarray(matrix, np.float64), "")
    scene.camera = fz.Camera()
    bake = fz.bake(scene, bake_samples=1, bake_bounces=0)
    return [bake.points(number) for number in range(len(matrices))]


@pytest.mark.parametrize("scale", [(1, 1, 1), (2.7, 2.7, 2.7), (0.3, 1, 2)])
def test_a_body_that_only_moves_keeps_its_points(scale):
    positions, triangles = ball(2)
    mesh = fz.Mesh(positions, triangles)
    first = None
    for angle, place in ((0.0, (0, 0, 0)), (0.7, (3, 2, -1)), (2.9, (-9, 90, 9))):
        turn = trimesh.transformations.rotation_matrix(angle, [1, 2, 3]).T
        turn[3, :3] = place
        matrix = np.diag([*scale, 1.0]) @ turn
        # In a scene of its own, as another frame is.
        (points,) = placed(mesh, [matrix], 0.2)
        first = first or points
        assert points.triangles.tobytes() == first.triangles.tobytes()
        assert points.barycentrics.tobytes() == first.barycentrics.tobytes()
        moved = mesh.transformed(matrix)
        np.testing.assert_allclose(points.on(moved).positions, points.positions, atol=2e-5)
        np.testing.assert_allclose(points.on(moved).normals, points.normals, atol=1e-4)
        assert points.areas.sum(dtype="f8") == pytest.approx(moved.area, rel=1e-5)


def test_instances_share_one_set_mirrored_ones_too():
    matrices = (np.eye(4), np.diag([-1.0, 1, 1, 1]), np.diag([2.0, 2, 2, 1]))
    plain, mirrored, large = placed(fz.Mesh(*ball(2)), matrices, 0.2)
    np.testing.assert_allclose(mirrored.positions, plain.positions * np.float32([-1, 1, 1]), atol=1e-6)
    np.testing.assert_allclose(mirrored.normals, plain.normals * np.float32([-1, 1, 1]), atol=1e-6)
    assert mirrored.triangles.tobytes() == plain.triangles.tobytes()
    assert len(large) > 3 * len(plain)


def textured_ice(tmp_path, stage, mesh):
    import OpenImageIO as oiio

    ramp = np.repeat(np.linspace(0.02, 0.1, 16, dtype=np.float32)[None, :, None], 4, axis=0)
    assert oiio.ImageBuf(ramp).write(str(tmp_path / "spacing.exr"))
    shader = UsdShade.Shader.Define(stage, "/Look/Ice")
    image = UsdShade.Shader.Define(stage, "/Look/Image")
    image.CreateIdAttr("UsdUVTexture")
    image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(str(tmp_path / "spacing.exr"))
    image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("raw")
    image.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set("clamp")
    shader.GetInput("spacing").ClearSources()
    shader.CreateInput("spacing", Sdf.ValueTypeNames.Float).ConnectToSource(image.ConnectableAPI(), "r")


def test_a_bake_takes_pixels_as_the_render_does(tmp_path, capsys):
    from frazil.cli import main

    stage = moving_stage(tmp_path / "a.usda")
    plate(stage)
    UsdGeom.Xformable(stage.GetPrimAtPath("/Camera")).AddTranslateOp().Set((0, 0.5, 0.2))
    stage.GetPrimAtPath("/Look/Ice").GetAttribute("inputs:spacing").Set(0.02)
    stage.GetRootLayer().Save()
    scene, cache, pixels = str(tmp_path / "a.usda"), str(tmp_path / "a.bake"), ["--spacing-pixels", "8"]
    some = ["--bake-samples", "1", "--bake-bounces", "0", "--progress", "none"]
    seen = ["--camera", "/Camera", "--resolution", "64x36"]
    assert main(["bake", scene, "-o", str(tmp_path / "all.bake"), *some]) == 0
    assert main(["bake", scene, "-o", cache, *some, *pixels, *seen]) == 0
    every, few = (int(line.split(": ")[2].split()[0]) for line in capsys.readouterr().out.splitlines())
    assert 100 < few < 0.5 * every
    # The render finds what it would have made.
    made = Path(cache).read_bytes()
    render = ["render", scene, "-o", str(tmp_path / "a.exr"), "--bake-cache", cache, "--samples", "1"]
    assert main([*render, *some, *pixels, *seen]) == 0
    assert Path(cache).read_bytes() == made
    assert main(["bake", scene, "-o", cache, "--spacing-pixels", "-1"]) == 2
    assert main(["bake", scene, "-o", cache, "--resolution", "wide"]) == 2


def test_texture_spacing_is_read_between_the_vertices(tmp_path):
    import OpenImageIO as oiio

    # Fine in a stripe that no vertex of the plate's two triangles touches.
    stage = moving_stage(tmp_path / "a.usda")
    mesh, _ = plate(stage, 1)
    textured_ice(tmp_path, stage, mesh)
    stripe = np.full((4, 64, 1), 0.08, np.float32)
    stripe[:, 24:40] = 0.02
    assert oiio.ImageBuf(stripe).write(str(tmp_path / "spacing.exr"))
    points = fz.bake(load(stage), bake_samples=1, bake_bounces=0).points(0)
    x = points.positions[:, 0]
    within, left = ((x > 0.4) & (x < 0.6)).sum(), (x < 0.2).sum()
    assert 12 < within / left < 20  # (0.08 / 0.02)², less at the border
    assert points.areas.sum(dtype="f8") == pytest.approx(1, rel=1e-4)
    # They are named by the mesh's own triangles.
    assert set(points.triangles) == {0, 1}
    u, v = points.barycentrics.T
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[[[0, 1, 2], [0, 2, 3]]][points.triangles]
    rebuilt = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    np.testing.assert_allclose(rebuilt, points.positions[:, :2], atol=1e-6)


def plate(stage, n=24):
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    quads = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1)
    mesh = add_mesh(stage, "/Plate", positions, [4] * len(quads), quads.ravel())
    set_primvar(mesh, "st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex", [tuple(map(float, p[:2])) for p in positions])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(UsdShade.Material(stage.GetPrimAtPath("/Look")))
    stage.RemovePrim("/Ice")
    return mesh, positions


def halves(points):
    """Points in the left and the right fifth of a plate one metre wide."""
    x = points.positions[:, 0]
    return (x < 0.2).sum(), (x > 0.8).sum()


@pytest.mark.parametrize("way", ["texture", "primvar", "constant primvar", "pixels"])
def test_usd_spacing_that_varies(tmp_path, way):
    stage = moving_stage(tmp_path / "a.usda")
    mesh, positions = plate(stage)
    options = {}
    if way == "texture":
        textured_ice(tmp_path, stage, mesh)
    elif way == "primvar":
        values = [float(v) for v in 0.02 + 0.08 * positions[:, 0]]
        set_primvar(mesh, "frazil:spacing", Sdf.ValueTypeNames.FloatArray, "vertex", values)
    elif way == "constant primvar":
        set_primvar(mesh, "frazil:spacing", Sdf.ValueTypeNames.FloatArray, "constant", [0.04])
    else:
        camera = UsdGeom.Xformable(stage.GetPrimAtPath("/Camera"))
        camera.AddTranslateOp().Set((0, 0.5, 0.2))
        stage.GetPrimAtPath("/Look/Ice").GetAttribute("inputs:spacing").Set(0.01)
        options = {"spacing_pixels": 8.0}
    scene = load(stage)
    if way == "pixels":
        film = fz.render(scene, resolution=(64, 36), samples=1, bake_samples=1, **options)
        few = film.stats["points"]
        every = len(fz.bake(scene, bake_samples=1, bake_bounces=0).points(0))
        assert 100 < few < 0.3 * every
        return
    points = fz.bake(scene, bake_samples=1, bake_bounces=0).points(0)
    left, right = halves(points)
    if way == "constant primvar":
        assert 0.7 < left / right < 1.4
        assert points.spacing == pytest.approx(0.04)
    else:
        # The spacing is 0.028 in the left fifth and 0.092 in the right one.
        assert 5 < left / right < 20
    assert points.areas.sum(dtype="f8") == pytest.approx(1, rel=1e-4)
