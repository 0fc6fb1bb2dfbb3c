"""Meshes from files, and the command that places points on them."""

import contextlib
import io
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from point_checks import mesh_of

import frazil as fz
from frazil.cli import main
from frazil.mesh_io import read_mesh


def run(*arguments):
    """`frazil points ARGUMENTS`: its exit status and all that it prints."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        status = main(["points", *map(str, arguments)])
    return SimpleNamespace(exit_code=status, output=printed.getvalue())


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb"])
def test_formats(tmp_path, suffix):
    shape = trimesh.creation.box((1, 2, 3))
    path = tmp_path / f"box.{suffix}"
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


def test_usd_points(tmp_path):
    usd = pytest.importorskip("pxr.Usd")
    geom = pytest.importorskip("pxr.UsdGeom")
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(3).export(path)
    for _ in range(2):  # and over a file that is there
        result = run(path, "-o", tmp_path / "p.usda", "--spacing", 0.3, "--quiet")
        assert result.exit_code == 0, result.output
    expected = fz.poisson_points(read_mesh(path), 0.3)
    stage = usd.Stage.Open(str(tmp_path / "p.usda"))
    prim = geom.Points(stage.GetPrimAtPath("/Points"))
    np.testing.assert_array_equal(np.array(prim.GetPointsAttr().Get()), expected.positions)
    areas = geom.PrimvarsAPI(prim).GetPrimvar("frazil:area").Get()
    np.testing.assert_array_equal(np.array(areas), expected.areas)


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
    result = run(path, "-o", tmp_path / "p.ply", "--spacing", -1, "--quiet")
    assert result.exit_code == 1
    assert "spacing must be > 0" in result.output
