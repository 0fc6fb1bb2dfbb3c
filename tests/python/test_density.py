"""Density: grids from OpenVDB files, clouds of noise, and both from USD and MaterialX."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, UsdShade
from test_usd_materials import FLOAT, TOKEN, bind
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil import grids
from frazil.usd.material_inputs import DENSITY_INPUTS, inputs_markdown

CLOUDS = Path(__file__).parents[1] / "data" / "clouds.vdb"


def importable(*names):
    for name in names:
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    return None


openvdb = importable("openvdb", "pyopenvdb")
needs_openvdb = pytest.mark.skipif(not (openvdb or importable("tinyvdb")), reason="no library that reads OpenVDB")
needs_own_module = pytest.mark.skipif(not openvdb, reason="no Python module of OpenVDB's own")


def cloud_frame():
    """Voxels of clouds.vdb to its frame, as tests/data/clouds.py says."""
    c, s = np.cos(0.5), np.sin(0.5)
    return np.array([[0.1 * c, 0.1 * s, 0, 0], [-0.2 * s, 0.2 * c, 0, 0], [0, 0, 0.05, 0], [1, 2, 3, 1]])


def cloud_place(voxel):
    return (np.array([*voxel, 1.0]) @ cloud_frame())[:3]


@needs_openvdb
def test_a_grid_of_openvdb_has_its_values_where_they_lie():
    density = fz.read_density(CLOUDS, scale=2.0, absorption=0.0)
    assert density.values.shape == (6, 7, 8)  # padded by the background
    assert (density.scale, density.absorption, density.outside) == (2.0, 0.0, 0.0)
    for i, j, k in ((0, 0, 0), (3, 4, 5), (1, 2, 3)):
        value = density.eval([cloud_place((i - 2, j + 3, k + 1))])[0]
        assert value == pytest.approx(2.0 * (i + 10 * j + 100 * k + 1) / 1000, abs=1e-5)
    # Half way to the padding it is half as much, beyond it nothing.
    assert density.eval([cloud_place((1.5, 7, 6))])[0] == pytest.approx(0.544, abs=1e-4)
    assert density.eval([cloud_place((3, 7, 6))])[0] == 0.0


@needs_openvdb
def test_what_is_no_density_is_refused_by_name(tmp_path):
    with pytest.raises(ValueError, match=r"clouds.vdb: grid 'distance' must be >= 0 and finite, got -0.199"):
        fz.read_density(CLOUDS, "distance")
    with pytest.raises(KeyError, match=r"has no grid 'heat' of floats. It has density, distance, tiled"):
        fz.read_density(CLOUDS, "heat")
    with pytest.raises(FileNotFoundError, match="nowhere.vdb"):
        fz.read_density(tmp_path / "nowhere.vdb")
    (tmp_path / "picture.vdb").write_bytes(b"not a grid")
    with pytest.raises(OSError, match=r"picture.vdb: must be an OpenVDB file"):
        fz.read_density(tmp_path / "picture.vdb")
    (tmp_path / "short.vdb").write_bytes(CLOUDS.read_bytes()[:700])
    with pytest.raises(OSError, match=r"short.vdb: cannot be read"):
        fz.read_density(tmp_path / "short.vdb")


def test_tiles_that_tinyvdb_does_not_tell_are_not_lost_in_silence():
    pytest.importorskip("tinyvdb")
    with pytest.raises(ValueError, match=r"'tiled' must have no constant tiles .* got 4096 voxels in such"):
        grids._read_tinyvdb(CLOUDS, "tiled")


@needs_own_module
def test_openvdb_s_own_module_reads_what_tinyvdb_reads_and_tiles():
    pytest.importorskip("tinyvdb")
    own, other = grids._read_openvdb(openvdb, CLOUDS, "density"), grids._read_tinyvdb(CLOUDS, "density")
    for value, expected in zip(own, other, strict=True):
        np.testing.assert_allclose(value, expected, atol=1e-6)
    values = grids._read_openvdb(openvdb, CLOUDS, "tiled")[0]
    assert values.shape == (18, 18, 18)
    assert np.all(values[1:-1, 1:-1, 1:-1] == 2.0)
    assert values.sum() == 2.0 * 16**3


@needs_own_module
def test_what_openvdb_s_own_module_cannot_turn_into_a_box_is_refused(tmp_path):
    empty, bent = openvdb.FloatGrid(0.5), openvdb.FloatGrid(0.0)
    empty.name, bent.name = "empty", "bent"
    bent.copyFromArray(np.ones((4, 4, 4), np.float32))
    bent.transform = openvdb.createFrustumTransform((0, 0, 0), (8, 8, 8), 0.5, 10.0)
    openvdb.write(str(tmp_path / "odd.vdb"), grids=[empty, bent])
    with pytest.raises(ValueError, match=r"odd.vdb: grid 'empty' must have active voxels, got none"):
        grids._read_openvdb(openvdb, tmp_path / "odd.vdb", "empty")
    with pytest.raises(ValueError, match=r"odd.vdb: grid 'bent' must have an affine transform, got NonlinearFrustum"):
        grids._read_openvdb(openvdb, tmp_path / "odd.vdb", "bent")


def test_depth_is_the_integral_of_eval():
    density = fz.Density(contrast=1.0, size=0.2, octaves=2, seed=3)
    a, b = np.array([-0.3, 0.1, 0.5]), np.array([0.7, -0.4, 0.2])
    steps = (np.arange(20000) + 0.5) / 20000
    mean = np.mean(density.eval(a + steps[:, None] * (b - a)))
    assert density.depth([a], [b])[0] == pytest.approx(mean * np.linalg.norm(b - a), rel=1e-3)


def test_shapes_and_ranges():
    with pytest.raises(ValueError, match=r"values must have shape \(X, Y, Z\), got 2 dimensions"):
        fz.Density(np.zeros((3, 3), np.float32))
    with pytest.raises(ValueError, match=r"density grid must have >= 2 voxels along each axis, got 1"):
        fz.Density(np.zeros((3, 1, 3), np.float32)).eval([[0, 0, 0]])
    with pytest.raises(ValueError, match=r"density scale must be >= 0, got -1"):
        fz.Density(scale=-1.0).eval([[0, 0, 0]])


def density_shader(stage, ice, **inputs):
    shader = UsdShade.Shader.Define(stage, "/Material/Density")
    shader.CreateIdAttr("frazil:density")
    ice.CreateInput("density", TOKEN).ConnectToSource(shader.ConnectableAPI(), "out")
    for name, (kind, value) in inputs.items():
        shader.CreateInput(name, kind).Set(value)
    return shader


def ice_of(scene):
    return scene.materials[scene.objects[0].material].model


def test_noise_from_usd_is_in_the_stage_s_units(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    density_shader(stage, ice, contrast=(FLOAT, 0.7), size=(FLOAT, 20.0), absorption=(FLOAT, 0.0))
    scene = load(stage)
    assert scene.warnings == []
    density = ice_of(scene).density
    assert (density.contrast, density.size, density.absorption) == pytest.approx((0.7, 0.2, 0.0))
    assert density.values is None


@needs_openvdb
def test_a_grid_from_usd(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    (tmp_path / "clouds.vdb").write_bytes(CLOUDS.read_bytes())
    density_shader(stage, ice, file=(Sdf.ValueTypeNames.Asset, "./clouds.vdb"), scale=(FLOAT, 3.0))
    scene = load(stage)
    assert scene.warnings == []
    assert ice_of(scene).density.eval([cloud_place((1, 7, 6))])[0] == pytest.approx(3 * 0.544, rel=1e-4)


@needs_openvdb
@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"file": (Sdf.ValueTypeNames.Asset, "./none.vdb")}, "@./none.vdb@ cannot be found. It is left out."),
        (
            {"file": (Sdf.ValueTypeNames.Asset, str(CLOUDS)), "grid": (Sdf.ValueTypeNames.String, "heat")},
            f"{CLOUDS}: has no grid 'heat' of floats. It has density, distance, tiled. The density is left out.",
        ),
        ({"contrast": (FLOAT, 9.0)}, "contrast must be in 0..4, got 9. 4 is used."),
        ({"contrasts": (FLOAT, 9.0)}, "has no input 'contrasts'. The nearest is 'contrast'."),
    ],
)
def test_what_is_wrong_is_named(tmp_path, inputs, message):
    stage = new_stage(tmp_path / "s.usda")
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    density_shader(stage, ice, **inputs)
    assert load(stage).warnings == [f"/Material/Density: {message}"]


def test_a_density_that_is_none_is_named(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    ice.CreateInput("density", FLOAT).Set(2.0)
    scene = load(stage)
    assert scene.warnings == ["/Material/Surface: density must be connected to a frazil:density. It is left out."]
    assert ice_of(scene).density.contrast == 0.0


def test_clouds_from_materialx(tmp_path):
    (tmp_path / "looks.mtlx").write_text(
        """<?xml version="1.0"?>
        <materialx version="1.39">
          <frazil_density name="clouds" type="densityshader"><input name="contrast" type="float" value="0.6"/>
          </frazil_density>
          <frazil_ice name="ice" type="surfaceshader"><input name="density" type="densityshader" nodename="clouds"/>
          </frazil_ice>
          <surfacematerial name="Ice" type="material">
            <input name="surfaceshader" type="surfaceshader" nodename="ice"/></surfacematerial>
          <look name="all"><materialassign name="a" material="Ice" geom="/Quad"/></look>
        </materialx>"""
    )
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    scene = load(stage, materials=tmp_path / "looks.mtlx")
    assert scene.warnings == []
    assert ice_of(scene).density.contrast == pytest.approx(0.6)


def test_docs_have_the_table():
    docs = (Path(__file__).parents[2] / "docs" / "material.md").read_text(encoding="utf-8")
    assert inputs_markdown(DENSITY_INPUTS) in docs, "regenerate with inputs_markdown(DENSITY_INPUTS)"
