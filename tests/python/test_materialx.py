"""MaterialX: the shipped library, frazil_ice in .mtlx files, looks, broken documents."""

import warnings

import MaterialX as mx
import numpy as np
import pytest
from mtlx_documents import HEAD, fed, image, model_of, refer, surface, value
from pxr import Gf, Sdf, UsdGeom, UsdShade
from test_usd_materials import COLOR, FLOAT, bind
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil.usd.material_inputs import DENSITY_INPUTS, DISPLACEMENT_INPUTS, ICE_INPUTS, OVERLAY_INPUTS
from frazil.usd.mtlx_library import LIBRARY_FILE, library, library_text


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


# -- the library


def test_the_library_is_made_from_the_table_of_inputs():
    assert LIBRARY_FILE.read_text(encoding="utf-8") == library_text(), "run python -m frazil.usd.mtlx_library"


def test_the_library_is_valid_by_materialx_itself():
    own = mx.createDocument()
    mx.readFromXmlFile(own, str(LIBRARY_FILE))
    own.setDataLibrary(library())
    assert own.validate() == (True, "")
    document = mx.createDocument()
    document.setDataLibrary(library())
    node = document.addNodeInstance(library().getNodeDef("ND_frazil_ice_surfaceshader"), "ice")
    node.setInputValue("roughness", 0.2)
    document.addMaterialNode("material", node)
    assert document.validate() == (True, "")


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("ND_frazil_ice_surfaceshader", ICE_INPUTS),
        ("ND_frazil_overlay", OVERLAY_INPUTS),
        ("ND_frazil_displacement", DISPLACEMENT_INPUTS),
        ("ND_frazil_density", DENSITY_INPUTS),
    ],
)
def test_definitions_have_the_tables_names_defaults_and_ranges(name, table):
    definition = library().getNodeDef(name)
    for row in table:
        found = definition.getInput(row.name)
        assert found is not None, row.name
        if row.kind == "float" and row.default is not None:
            assert found.getValue() == pytest.approx(row.default), row.name
        if row.kind == "float" and row.minimum == 0.0:
            assert float(found.getAttribute("uimin")) == 0.0, row.name


# -- frazil_ice


def test_frazil_ice_by_its_node_in_usd_is_frazil_ice(stage):
    def author(shader):
        shader.CreateInput("albedo", COLOR).Set(Gf.Vec3f(0.5, 0.7, 0.9))
        shader.CreateInput("mean_free_path", COLOR).Set(Gf.Vec3f(0.1, 0.2, 0.3))
        shader.CreateInput("roughness", FLOAT).Set(0.3)

    author(bind(stage, add_quad(stage, "/A"), "frazil:ice", "/MA"))
    author(bind(stage, add_quad(stage, "/B"), "ND_frazil_ice_surfaceshader", "/MB", context="mtlx"))
    scene = load(stage)
    assert scene.warnings == []
    assert repr(model_of(scene, 0)) == repr(model_of(scene, 1))
    assert model_of(scene, 1).roughness == pytest.approx(0.3)


def test_frazil_ice_from_a_file_with_overlays_ramp_and_units(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    overlays = """
  <frazil_overlay name="frost" type="overlayshader">
    <input name="pattern" type="string" value="frost" />
    <input name="size" type="float" value="20" />
    <input name="width" type="float" value="2" unittype="distance" unit="millimeter" />
  </frazil_overlay>"""
    inputs = (
        value("sigma_s_prime", "color3", "1, 2, 3")
        + value("sigma_a", "color3", "0.1, 0.02, 0.01")
        + value("ramp_distances", "floatarray", "0, 5")
        + value("ramp_colors", "color3array", "1, 1, 1, 0, 0.5, 1")
        + value("profile", "string", "dipole")
        + value("priority", "integer", "3")
        + '<input name="overlay1" type="overlayshader" nodename="frost" />'
    )
    ice, said = refer(stage, tmp_path, surface("frazil_ice", inputs, overlays))
    assert said == []
    np.testing.assert_allclose(ice.medium.sigma_s_prime, [100, 200, 300], rtol=1e-5)
    np.testing.assert_allclose(ice.ramp_distances, [0, 0.05], rtol=1e-5)
    np.testing.assert_allclose(ice.ramp_colors, [[1, 1, 1], [0, 0.5, 1]])
    assert (ice.profile, ice.priority) == ("dipole", 3)
    (overlay,) = ice.overlays
    assert overlay.pattern == "frost"
    assert overlay.size == pytest.approx(0.2)
    assert overlay.width == pytest.approx(0.002)


# -- looks


LOOKS = (
    surface("standard_surface", value("base_color", "color3", "1, 0, 0") + value("base", "float", "1"))
    + """
  <standard_surface name="blue" type="surfaceshader"><input name="base" type="float" value="1" />
    <input name="base_color" type="color3" value="0, 0, 1" /></standard_surface>
  <surfacematerial name="Blue" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="blue" /></surfacematerial>
  <collection name="all_but_b" includegeom="/" excludegeom="/World/B" />
  <look name="day">
    <materialassign name="a1" material="Look" geom="/World" />
    <materialassign name="a2" material="Blue" geom="/World/B*" />
  </look>
  <look name="night"><materialassign name="a3" material="Blue" collection="all_but_b" /></look>
"""
)


def look_stage(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    UsdGeom.Xform.Define(stage, "/World")
    for name in ("A", "B", "C/D"):
        bind(stage, add_quad(stage, f"/World/{name}"), "UsdPreviewSurface", f"/M{name[0]}")
    stage.Save()
    (tmp_path / "looks.mtlx").write_text(f"{HEAD}{LOOKS}</materialx>\n", encoding="utf-8")
    return tmp_path / "s.usda"


def colors_of(scene):
    return {o.path[-1]: tuple(np.round(scene.materials[o.material].model.diffuse_color, 3)) for o in scene.objects}


def test_a_look_takes_the_place_of_the_stages_materials(tmp_path):
    path = look_stage(tmp_path)
    day = load(path, materials=tmp_path / "looks.mtlx")
    assert day.warnings == []
    assert colors_of(day) == {"A": (1, 0, 0), "B": (0, 0, 1), "D": (1, 0, 0)}
    night = load(path, materials=tmp_path / "looks.mtlx", look="night")
    assert colors_of(night) == {"A": (0, 0, 1), "B": (0.18, 0.18, 0.18), "D": (0, 0, 1)}
    assert colors_of(load(path))["A"] == (0.18, 0.18, 0.18)


def test_looks_on_the_command_line(tmp_path, capsys):
    from frazil.cli import main

    path, out = look_stage(tmp_path), tmp_path / "o.exr"
    arguments = ["render", str(path), "-o", str(out), "--resolution", "8x8", "--samples", "1", "--quiet"]
    assert main([*arguments, "--materials", str(tmp_path / "looks.mtlx"), "--look", "night"]) == 0
    assert out.exists()
    assert main([*arguments, "--materials", str(tmp_path / "nowhere.mtlx")]) == 1
    assert "nowhere.mtlx: no such MaterialX file" in capsys.readouterr().err


# -- bad input


def test_missing_and_broken_documents(tmp_path):
    path = look_stage(tmp_path)
    with pytest.raises(FileNotFoundError, match="nowhere.mtlx: no such MaterialX file"):
        load(path, materials=tmp_path / "nowhere.mtlx")
    (tmp_path / "broken.mtlx").write_text("<materialx", encoding="utf-8")
    with pytest.raises(OSError, match="broken.mtlx: is not a readable MaterialX file"):
        load(path, materials=tmp_path / "broken.mtlx")
    with pytest.raises(ValueError, match="look must be one of day, night, got 'noon'"):
        load(path, materials=tmp_path / "looks.mtlx", look="noon")
    (tmp_path / "bare.mtlx").write_text(HEAD + "</materialx>", encoding="utf-8")
    with pytest.raises(ValueError, match="must have a look"):
        load(path, materials=tmp_path / "bare.mtlx")


def test_a_missing_reference_is_named_with_its_prim(stage):
    quad = add_quad(stage, "/Quad")
    material = UsdShade.Material.Define(stage, "/Looks/Mine")
    material.GetPrim().GetReferences().AddReference("./nowhere.mtlx", "/MaterialX/Materials/Look")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(material)
    scene = load(stage)
    assert isinstance(model_of(scene), fz.StandardMaterial)
    assert any(w.startswith("/Looks/Mine: ") and "nowhere.mtlx: no such MaterialX file" in w for w in scene.warnings)


def test_unknown_nodes_are_named_and_their_inputs_keep_defaults(stage, tmp_path):
    default = value("default", "color3", "0.1, 0.2, 0.3")
    graph = '<cellnoise3d name="noise" type="float" />' + image("lost", "nowhere.png", more=default)
    inputs = value("base", "float", "1") + fed("base_color", "color3", "lost")
    inputs += fed("specular_roughness", "float", "noise")
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph))
    assert model.roughness == pytest.approx(0.2)
    np.testing.assert_allclose(model.diffuse_color, [0.1, 0.2, 0.3], rtol=1e-5)
    assert any("/noise: is a 'ND_cellnoise3d_float' node, which is not supported" in w for w in said)
    assert any("nowhere.png" in w for w in said)
    assert len(said) == 2


def test_cycles_end_with_a_warning(stage, tmp_path):
    graph = (
        f'<add name="a" type="float">{fed("in1", "float", "b")}{value("in2", "float", "1")}</add>'
        f'<add name="b" type="float">{fed("in1", "float", "a")}{value("in2", "float", "1")}</add>'
    )
    model, said = refer(stage, tmp_path, surface("standard_surface", fed("specular_roughness", "float", "a"), graph))
    assert isinstance(model, fz.StandardMaterial)
    assert any("cycle" in w for w in said)


def test_cycles_of_usd_nodes_too(stage):
    shader = bind(stage, add_quad(stage, "/Quad"), "ND_standard_surface_surfaceshader", context="mtlx")
    first, second = (UsdShade.Shader.Define(stage, f"/Material/{n}") for n in ("first", "second"))
    for node, other in ((first, second), (second, first)):
        node.CreateIdAttr("ND_multiply_float")
        node.CreateInput("in1", FLOAT).ConnectToSource(other.CreateOutput("out", FLOAT))
    shader.CreateInput("specular_roughness", FLOAT).ConnectToSource(first.ConnectableAPI(), "out")
    scene = load(stage)
    assert any("is part of a cycle of connections" in w for w in scene.warnings)


def test_values_out_of_range_are_named_with_prim_and_range(stage, tmp_path):
    _, said = refer(stage, tmp_path, surface("frazil_ice", value("roughness", "float", "3")))
    assert said == ["/Looks/Mine/shader: roughness must be in 0..1, got 3. 1 is used."]
    _, said = refer(stage, tmp_path, surface("open_pbr_surface", value("specular_roughness", "float", "-1")))
    assert said == ["/Looks/Mine/shader: specular_roughness must be in 0..1, got -1. 0 is used."]


def test_dangling_connections_are_named(stage, tmp_path):
    _, said = refer(stage, tmp_path, surface("standard_surface", fed("base_color", "color3", "nothing")))
    assert any("connected to 'nothing', which does not exist" in w for w in said)


def test_a_material_of_another_name_is_no_material(stage, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model, said = refer(stage, tmp_path, surface("standard_surface", ""), name="Lok")
    assert isinstance(model, fz.StandardMaterial)
    assert said


def test_sdf_types_cover_the_table():
    from frazil.usd.mtlx import _TYPES
    from frazil.usd.mtlx_library import _TYPES as KINDS

    assert {k for k in KINDS.values()} <= set(_TYPES)
    assert isinstance(_TYPES["float"], Sdf.ValueTypeName)
