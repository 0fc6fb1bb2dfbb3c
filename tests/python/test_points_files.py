"""Meshes from files, and the command that places points on them."""

import contextlib
import io
from types import SimpleNamespace

import numpy as np
import OpenImageIO as oiio
import pytest
import trimesh
from point_checks import mesh_of
from pxr import Usd, UsdGeom, Vt
from scipy.spatial import cKDTree
from usd_stages import TEXCOORDS, add_quad, new_stage, set_primvar

import frazil as fz
from frazil.cli import main
from frazil.mesh_io import read_mesh


def run(*arguments):
    """`frazil points ARGUMENTS`: its exit status and all that it prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        status = main(["points", *map(str, arguments)])
    return SimpleNamespace(exit_code=status, output=printed.getvalue())


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb", "gltf", "off"])
def test_formats(tmp_path, suffix):
    shape = trimesh.creation.box((1, 2, 3))
    path = tmp_path / f"box.{suffix}"
    if suffix == "gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(shape)).items():
            (tmp_path / (path.name if name.endswith(".gltf") else name)).write_bytes(data)
    else:
        shape.export(path)
    assert read_mesh(path).area == pytest.approx(22, rel=1e-5)
    output = tmp_path / "points.ply"
    result = run(path, "-o", output, "--spacing", 0.2, "--seed", 3, "--quiet")
    assert result.exit_code == 0, result.output
    points = fz.PointSet.load(output)
    assert points.areas.sum() == pytest.approx(22, rel=1e-4)


def test_several_meshes_become_one(tmp_path):
    scene = trimesh.Scene([trimesh.creation.box(), trimesh.creation.box().apply_translation([3, 0, 0])])
    scene.export(tmp_path / "two.glb")
    assert read_mesh(tmp_path / "two.glb").area == pytest.approx(12, rel=1e-5)


def test_stats_and_count_and_tessellated(tmp_path):
    path = tmp_path / "ball.obj"
    trimesh.creation.icosphere(3).export(path)
    result = run(path, "-o", tmp_path / "p.ply", "--count", 500, "--stats", "--quiet")
    assert result.exit_code == 0, result.output
    assert "largest gap" in result.output
    result = run(path, "-o", tmp_path / "p.ply", "--spacing", 0.2, "--tessellated", "--quiet")
    assert result.exit_code == 0, result.output


ARRAYS = ("positions", "normals", "areas", "triangles", "barycentrics")


def test_binary_ply_has_all_attributes(tmp_path):
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(3).export(path)
    assert run(path, "-o", tmp_path / "p.ply", "--spacing", 0.3, "--quiet").exit_code == 0
    expected = fz.poisson_points(read_mesh(path), 0.3)
    loaded = fz.PointSet.load(tmp_path / "p.ply")
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(loaded, name), getattr(expected, name))
    # What a reader that is not ours sees.
    head, rows = (tmp_path / "p.ply").read_bytes().split(b"end_header\n", 1)
    assert b"format binary_little_endian" in head
    kinds = [("p", "<f4", 3), ("n", "<f4", 3), ("area", "<f4"), ("triangle", "<i4"), ("uv", "<f4", 2)]
    data = np.frombuffer(rows, np.dtype(kinds))
    for name, ours in zip(("p", "n", "area", "triangle", "uv"), ARRAYS, strict=True):
        np.testing.assert_array_equal(data[name], getattr(expected, ours))


@pytest.mark.parametrize("suffix", ["usda", "usdc"])
def test_usd_points(tmp_path, suffix):
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(3).export(path)
    output = tmp_path / f"p.{suffix}"
    for _ in range(2):  # and over a file that is there
        result = run(path, "-o", output, "--spacing", 0.3, "--quiet")
        assert result.exit_code == 0, result.output
    expected = fz.poisson_points(read_mesh(path), 0.3)
    stage = Usd.Stage.Open(str(output))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    prim = UsdGeom.Points(stage.GetDefaultPrim())
    primvars = UsdGeom.PrimvarsAPI(prim)
    written = {
        "positions": prim.GetPointsAttr().Get(),
        "normals": prim.GetNormalsAttr().Get(),
        "areas": primvars.GetPrimvar("frazil:area").Get(),
        "triangles": primvars.GetPrimvar("frazil:triangle").Get(),
        "barycentrics": primvars.GetPrimvar("frazil:barycentrics").Get(),
    }
    for name, values in written.items():
        np.testing.assert_array_equal(np.array(values), getattr(expected, name))
    assert list(prim.GetIdsAttr().Get()) == list(range(len(expected)))
    assert primvars.GetPrimvar("frazil:spacing").Get() == 0.3


def plate(path):
    """A square metre of USD in its texture's coordinates, and a camera at its left edge."""
    stage = new_stage(path)
    mesh = add_quad(stage, "/Plate")
    set_primvar(mesh, "st", TEXCOORDS, "faceVarying", [(0, 0), (1, 0), (1, 1), (0, 1)])
    UsdGeom.Xformable(stage.GetPrimAtPath("/Camera")).AddTranslateOp().Set((0, 0.5, 0.3))
    stage.Save()


def sides(path):
    x = fz.PointSet.load(path).positions[:, 0]
    return (x < 0.25).sum(), (x > 0.75).sum()


def test_spacing_by_texture(tmp_path):
    plate(tmp_path / "plate.usda")
    image = np.repeat(np.linspace(0, 1, 32, dtype=np.float32)[None, :, None], 4, axis=0)
    assert oiio.ImageBuf(image).write(str(tmp_path / "map.exr"))
    options = ("-o", tmp_path / "p.ply", "--texture", tmp_path / "map.exr", "--quiet")
    result = run(tmp_path / "plate.usda", *options, "--spacing", 0.01, "--spacing-max", 0.05)
    assert result.exit_code == 0, result.output
    left, right = sides(tmp_path / "p.ply")
    assert left > 5 * right
    result = run(tmp_path / "plate.usda", *options, "--spacing", 0.05, "--spacing-max", 0.01)
    left, right = sides(tmp_path / "p.ply")
    assert right > 5 * left
    box = tmp_path / "box.stl"
    trimesh.creation.box().export(box)
    result = run(box, *options, "--spacing", 0.1, "--spacing-max", 0.2)
    assert (result.exit_code, result.output) == (1, result.output)
    assert "uvs must be given" in result.output


def test_spacing_by_camera(tmp_path):
    plate(tmp_path / "plate.usda")
    options = ("-o", tmp_path / "p.ply", "--camera", "/Camera", "--resolution", "100x50", "--quiet")
    result = run(tmp_path / "plate.usda", *options, "--spacing", 0.001, "--pixels", 4)
    assert result.exit_code == 0, result.output
    points = fz.PointSet.load(tmp_path / "p.ply")
    # A pixel is 20.955 / 50 / 100 radians wide, unless the aperture is higher than the picture.
    angle = max(20.955, 15.2908 * 2) / 50 / 100
    distances = np.linalg.norm(points.positions - np.float32([0, 0.5, 0.3]), axis=1)
    nearest = cKDTree(points.positions).query(points.positions, k=2)[0][:, 1]
    assert (nearest > 4 * angle * distances * 0.8).all()
    assert np.median(nearest / (4 * angle * distances)) < 1.5
    fine = len(points)
    run(tmp_path / "plate.usda", *options, "--spacing", 0.001, "--pixels", 8)
    assert len(fz.PointSet.load(tmp_path / "p.ply")) < 0.4 * fine
    result = run(tmp_path / "plate.usda", *options, "--spacing", 0.04, "--spacing-max", 0.04)
    assert fz.PointSet.load(tmp_path / "p.ply").spacing == pytest.approx(0.04)


def test_rest_frame(tmp_path):
    path = tmp_path / "plate.usda"
    plate(path)
    stage = Usd.Stage.Open(str(path))
    points = stage.GetPrimAtPath("/Plate").GetAttribute("points")
    corners = np.float32([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    for frame in (1, 2):
        points.Set(Vt.Vec3fArray.FromNumpy(corners * np.float32([frame, 1, 1])), frame)
    stage.Save()
    for frame in (1, 2):
        options = ("--frame", frame, "--rest-frame", 1, "--spacing", 0.05, "--quiet")
        assert run(path, "-o", tmp_path / f"{frame}.ply", *options).exit_code == 0
    a, b = (fz.PointSet.load(tmp_path / f"{frame}.ply") for frame in (1, 2))
    np.testing.assert_array_equal(a.barycentrics, b.barycentrics)
    np.testing.assert_allclose(b.positions, a.positions * np.float32([2, 1, 1]), atol=1e-6)
    assert b.areas.sum(dtype="f8") == pytest.approx(2, rel=1e-5)


def test_stats_agree_with_a_k_d_tree(tmp_path):
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(4).export(path)
    result = run(path, "-o", tmp_path / "p.ply", "--spacing", 0.1, "--stats", "--quiet")
    nearest = cKDTree(fz.PointSet.load(tmp_path / "p.ply").positions).query(
        fz.PointSet.load(tmp_path / "p.ply").positions, k=2
    )[0][:, 1]
    said = {line[:18].strip(): line[19:].split() for line in result.output.splitlines()[1:]}
    assert float(said["nearest pair"][0]) == pytest.approx(nearest.min(), rel=1e-4)
    assert float(said["distance spread"][0]) == pytest.approx(nearest.std() / nearest.mean(), abs=1e-4)
    assert 0.09 < float(said["largest gap"][0]) <= 0.1 + 1e-6


@pytest.mark.parametrize("name", ["points.xyz", "points.usdz", "points"])
def test_output_of_no_known_kind(tmp_path, name):
    box = tmp_path / "box.stl"
    trimesh.creation.box().export(box)
    result = run(box, "-o", tmp_path / name, "--spacing", 0.5, "--quiet")
    assert (result.exit_code, "must end in .ply, .usd" in " ".join(result.output.split())) == (2, True), result.output
    assert not (tmp_path / name).exists()


def test_bad_files(tmp_path):
    cloud = tmp_path / "cloud.ply"
    fz.poisson_points(fz.Mesh(*mesh_of(trimesh.creation.box())), 0.5).save(cloud)
    text = tmp_path / "text.obj"
    text.write_text("nothing here\n")
    for path in (tmp_path / "none.obj", cloud, text):
        with pytest.raises(OSError, match=f"{path}: file must"):
            read_mesh(path)
        result = run(path, "-o", tmp_path / "p.ply", "--spacing", 0.1, "--quiet")
        assert result.exit_code == 1
        assert str(path) in result.output


@pytest.mark.parametrize("name", ["p.ply", "p.usda"])
def test_what_cannot_be_written_leaves_the_old_file(tmp_path, monkeypatch, name):
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(2).export(path)
    result = run(path, "-o", tmp_path / "none" / name, "--spacing", 0.3, "--quiet")
    assert result.exit_code == 1
    assert "folder must exist" in result.output
    (tmp_path / name).write_text("old")

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("frazil.replacing.os.replace", full_disk)
    result = run(path, "-o", tmp_path / name, "--spacing", 0.3, "--quiet")
    assert result.exit_code == 1
    assert len(result.output.splitlines()) == 1
    assert (tmp_path / name).read_text() == "old"
    assert {p.name for p in tmp_path.iterdir()} == {"ball.ply", name}


def test_misuse(tmp_path):
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(1).export(path)
    assert run(path, "-o", tmp_path / "p.ply").exit_code == 2
    assert run(path, "-o", tmp_path / "p.ply", "--spacing", 0.1, "--count", 5).exit_code == 2
    given = ("-o", tmp_path / "p.ply")
    for options in (
        ("--count", 5, "--texture", "a.png", "--spacing-max", 1),
        ("--spacing", 1, "--texture", "a.png"),
        ("--spacing", 1, "--spacing-max", 2),
        ("--spacing", 1, "--camera", "/Camera"),  # not USD
        ("--spacing", 1, "--tessellated", "--texture", "a.png", "--spacing-max", 1),
        ("--spacing", 1, "--pixels", 0),
        ("--count", 5, "--tessellated"),
    ):
        assert run(path, *given, *options).exit_code == 2, options
    result = run(path, *given, "--spacing", 1, "--spacing-max", 1, "--texture", tmp_path / "none.png", "--quiet")
    assert result.exit_code == 1
    assert "file must be an image" in result.output
    plate(tmp_path / "plate.usda")
    camera = ("--spacing", 1, "--camera", "/Camera")
    assert run(tmp_path / "plate.usda", *given, *camera, "--resolution", "huge").exit_code == 2
    result = run(path, "-o", tmp_path / "p.ply", "--spacing", -1, "--quiet")
    assert result.exit_code == 1
    assert "spacing must be > 0" in result.output
