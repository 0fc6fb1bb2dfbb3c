"""The example scene: what examples/glacier.py writes is a complete stage with one closed, sharp body of ice."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Usd, UsdGeom, UsdLux, UsdShade

pytest.importorskip("scipy")

kExamples = Path(__file__).parents[2] / "examples"
kDetail = "0.25"


def run(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, str(kExamples / "glacier.py"), *arguments], capture_output=True, text=True, timeout=300
    )


@pytest.fixture(scope="module")
def stage_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("glacier") / "glacier.usda"
    done = run("-o", str(path), "--detail", kDetail)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return path


@pytest.fixture(scope="module")
def stage(stage_path):
    return Usd.Stage.Open(str(stage_path))


@pytest.fixture
def example_modules(monkeypatch):
    monkeypatch.syspath_prepend(str(kExamples))


def mesh_arrays(stage, name):
    mesh = UsdGeom.Mesh.Get(stage, f"/World/{name}")
    positions = np.array(mesh.GetPointsAttr().Get(), np.float64)
    triangles = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    return positions, triangles


def test_stage_is_complete(stage):
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.Camera.Get(stage, "/World/Camera")
    lights = {prim.GetTypeName() for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI)}
    assert lights == {"DomeLight", "DistantLight", "RectLight"}
    meshes = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert {prim.GetName() for prim in meshes} == {"Ice", "Snow", "RockLeft", "RockRight", "Snowfield"}
    for prim in meshes:
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
        assert material, prim.GetPath()
    shader = UsdShade.Shader.Get(stage, "/World/Materials/Ice/Surface")
    assert shader.GetShaderId() == "frazil:ice"


def test_every_file_that_the_stage_names_is_there(stage):
    count = 0
    for prim in stage.Traverse():
        for attribute in prim.GetAttributes():
            value = attribute.Get() if attribute.GetTypeName() == "asset" else None
            if value:
                count += 1
                image = oiio.ImageBuf(value.resolvedPath)
                pixels = image.get_pixels(oiio.FLOAT)
                assert pixels.size, image.geterror()
                assert np.isfinite(pixels).all()
                assert (pixels >= 0).all()
    assert count == 3


@pytest.mark.parametrize("name", ["Ice", "Snow", "RockLeft", "RockRight"])
def test_bodies_are_closed(stage, name):
    positions, triangles = mesh_arrays(stage, name)
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    # Every directed edge once, and its opposite once: closed, manifold along edges, turned the same way.
    directed = edges[:, 0] * len(positions) + edges[:, 1]
    opposite = edges[:, 1] * len(positions) + edges[:, 0]
    assert len(np.unique(directed)) == len(directed)
    assert np.array_equal(np.sort(directed), np.sort(opposite))
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    assert np.sum(a * np.cross(b, c)) / 6.0 > 0.001  # winding points out


def test_ice_is_one_piece_of_its_size(stage):
    positions, triangles = mesh_arrays(stage, "Ice")
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    ends = triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = coo_matrix((np.ones(len(ends)), ends.T), (len(positions),) * 2)
    assert connected_components(links, directed=False)[0] == 1
    assert 2.8 < np.ptp(positions[:, 1]) < 3.6
    assert 4.0 < np.ptp(positions[:, 0]) < 7.0


def test_tips_are_sharp(stage, example_modules):
    from ice_body import IceBody

    positions, triangles = mesh_arrays(stage, "Ice")
    tips = IceBody(3).tips
    # A coarse grid may miss thin shards altogether, the thick ones never.
    vertex = [np.argmin(np.linalg.norm(positions - tip, axis=1)) for tip in tips]
    reached = [(v, tip) for v, tip in zip(vertex, tips, strict=True) if np.linalg.norm(positions[v] - tip) < 1e-4]
    assert len(reached) >= 8
    for nearest, _ in reached:
        # One vertex, and all that meets there goes down: the angles of its faces fall far short of a full turn.
        fan = triangles[(triangles == nearest).any(1)]
        a = positions[nearest]
        ends = np.array([[positions[v] for v in row if v != nearest] for row in fan]) - a
        ends /= np.linalg.norm(ends, axis=2, keepdims=True)
        assert np.arccos(np.clip(np.sum(ends[:, 0] * ends[:, 1], 1), -1, 1)).sum() < 0.75 * 2 * np.pi


def test_normals_are_unit_and_on_the_faces_side(stage):
    positions, triangles = mesh_arrays(stage, "Ice")
    prim = stage.GetPrimAtPath("/World/Ice")
    normals = np.array(UsdGeom.PrimvarsAPI(prim).GetPrimvar("normals").Get()).reshape(-1, 3, 3)
    assert np.allclose(np.linalg.norm(normals, axis=2), 1.0, atol=1e-3)
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    assert np.mean(np.einsum("fi,fki->fk", np.cross(b - a, c - a), normals) > 0) > 0.995


def test_a_stage_that_is_up_to_date_is_left(stage_path):
    before = stage_path.stat().st_mtime_ns
    done = run("-o", str(stage_path), "--detail", kDetail)
    assert done.returncode == 0
    assert "up to date" in done.stdout
    assert stage_path.stat().st_mtime_ns == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--detail", "0"], "--detail must be in 0.05..4, got 0.0"),
        (["--seed", "-1"], "--seed must be >= 0, got -1"),
        (["-o", "x.obj"], "--output must end in .usda, got x.obj"),
    ],
)
def test_misuse_is_one_clear_line(arguments, message):
    done = run(*arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_unwritable_output_fails_with_its_path(tmp_path):
    (tmp_path / "file").write_text("")
    done = run("-o", str(tmp_path / "file" / "glacier.usda"), "--detail", "0.1")
    assert done.returncode == 1
    assert "file" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_box_meets_its_corners(example_modules):
    from frazil.formations.contour import contour

    half = np.array([0.31, 0.22, 0.17])
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    surface = contour(lambda p: (np.abs(p @ turn) - half).max(1), [-0.6] * 3, [0.6] * 3, 0.03)
    corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T * half @ turn.T
    miss = [np.linalg.norm(surface.positions - corner, axis=1).min() for corner in corners]
    assert max(miss) < 0.008  # of cells of 0.03; marching cubes would miss by about 0.015
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    assert np.sum(a * np.cross(b, c)) / 6.0 == pytest.approx(8 * half.prod(), rel=0.004)


def test_surface_that_leaves_the_box_is_refused(example_modules):
    from frazil.formations.contour import contour

    with pytest.raises(ValueError, match="must lie inside the box"):
        contour(lambda p: np.linalg.norm(p, axis=1) - 2.0, [-1] * 3, [1] * 3, 0.1)


def test_the_sky_is_brightest_towards_the_sun(example_modules):
    from frazil.formations.sky import make_sky

    pixels = make_sky(256, np.array([-0.8, 0.34, -0.62]), 3)
    row, column = np.unravel_index(pixels.sum(2).argmax(), pixels.shape[:2])
    polar, azimuth = (row + 0.5) / 128 * np.pi, (0.5 - (column + 0.5) / 256) * 2 * np.pi
    brightest = np.array([np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)])
    sun = np.array([-0.8, 0.34, -0.62])
    # Low cloud and horizon glow may be brighter than the aureole's centre, but on the sun's side.
    assert brightest @ sun / np.linalg.norm(sun) > 0.85
