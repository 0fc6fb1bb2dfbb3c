"""MaterialX: the shipped library, .mtlx files by reference and by look, node graphs, other models, broken documents."""

import warnings

import MaterialX as mx
import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdShade
from test_usd_materials import COLOR, FLOAT, bind, write_image
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil.usd.material_inputs import DISPLACEMENT_INPUTS, ICE_INPUTS, OVERLAY_INPUTS
from frazil.usd.mtlx_library import LIBRARY_FILE, library, library_text
from frazil.usd.surface_models import MODELS

OUTG = 'output="outg"'
HEAD = '<?xml version="1.0"?>\n<materialx version="1.39" colorspace="lin_rec709">\n'


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


def model_of(scene, number=0):
    return scene.materials[scene.objects[number].material].model


def refer(stage, tmp_path, body, name="Look", head=HEAD):
    """Bind a quad to a material of a .mtlx file, by reference."""
    (tmp_path / "looks.mtlx").write_text(f"{head}{body}</materialx>\n", encoding="utf-8")
    quad = add_quad(stage, "/Quad")
    material = UsdShade.Material.Define(stage, "/Looks/Mine")
    material.GetPrim().GetReferences().AddReference("./looks.mtlx", f"/MaterialX/Materials/{name}")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(material)
    scene = load(stage)
    return model_of(scene), scene.warnings


def surface(kind, inputs, more="", extra=""):
    return f"""{more}
  <{kind} name="shader" type="surfaceshader">{inputs}</{kind}>
  <surfacematerial name="Look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="shader" />{extra}
  </surfacematerial>
"""


def value(name, kind, text, more=""):
    return f'<input name="{name}" type="{kind}" value="{text}" {more}/>'


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


# -- other models


@pytest.mark.parametrize(
    ("kind", "base", "metal", "rough", "ior", "coat"),
    [
        ("standard_surface", "base", "metalness", "specular_roughness", "specular_IOR", "coat"),
        ("open_pbr_surface", "base_weight", "base_metalness", "specular_roughness", "specular_ior", "coat_weight"),
    ],
)
def test_opaque_surfaces_become_standard_materials(stage, tmp_path, kind, base, metal, rough, ior, coat):
    inputs = (
        value(base, "float", "0.5")
        + value("base_color", "color3", "0.8, 0.4, 0.2")
        + value(metal, "float", "0.25")
        + value(rough, "float", "0.35")
        + value(ior, "float", "1.4")
        + value(coat, "float", "0.6")
        + value("coat_roughness", "float", "0.15")
    )
    model, said = refer(stage, tmp_path, surface(kind, inputs))
    assert said == []
    assert isinstance(model, fz.StandardMaterial)
    np.testing.assert_allclose(model.diffuse_color, [0.4, 0.2, 0.1], rtol=1e-5)
    found = [model.metallic, model.roughness, model.ior, model.clearcoat, model.clearcoat_roughness]
    np.testing.assert_allclose(found, [0.25, 0.35, 1.4, 0.6, 0.15], rtol=1e-5)
    np.testing.assert_allclose(model.emissive_color, 0)


def test_defaults_are_those_of_the_definition(stage, tmp_path):
    model, said = refer(stage, tmp_path, surface("standard_surface", ""))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, 0.8, rtol=1e-5)
    assert model.roughness == pytest.approx(0.2)
    model, _ = refer(stage, tmp_path, surface("open_pbr_surface", ""))
    assert model.roughness == pytest.approx(0.3)


def test_emission_opacity_and_a_tinted_reflection(stage, tmp_path):
    inputs = (
        value("emission", "float", "3")
        + value("emission_color", "color3", "1, 0.5, 0.25")
        + value("opacity", "color3", "0.5, 0.5, 0.5")
        + value("specular_color", "color3", "1, 0, 0")
        + value("specular", "float", "0.5")
    )
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert said == []
    np.testing.assert_allclose(model.emissive_color, [3, 1.5, 0.75], rtol=1e-5)
    assert model.opacity == pytest.approx(0.5)
    assert model.use_specular_workflow
    np.testing.assert_allclose(model.specular_color, [0.02, 0, 0], rtol=1e-5)  # half of 4 %, red


def test_subsurface_has_its_color_and_radius(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.1)
    inputs = (
        value("subsurface", "float", "1")
        + value("subsurface_color", "color3", "0.5, 0.7, 0.9")
        + value("subsurface_radius", "color3", "0.1, 0.2, 0.3")
        + value("subsurface_scale", "float", "2")
        + value("specular_IOR", "float", "1.31")
    )
    ice, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert said == []
    assert isinstance(ice, fz.IceMaterial)
    medium = ice.medium
    np.testing.assert_allclose(1 / (medium.sigma_s_prime + medium.sigma_a), [0.02, 0.04, 0.06], rtol=1e-4)
    np.testing.assert_allclose(fz.MultipleScattering(medium, single=1.0).albedo, [0.5, 0.7, 0.9], rtol=1e-3)
    assert (ice.translucency, ice.refraction, ice.overlays) == (1.0, 0.0, [])


def test_subsurface_of_both_models_is_frazil_ice_to_the_last_field(stage):
    from frazil.content import content_hash

    color, scale = Gf.Vec3f(0.78, 0.9, 0.95), Gf.Vec3f(0.3, 0.5, 0.7)
    words = {
        "frazil:ice": {"albedo": color, "mean_free_path": scale * 0.1, "refraction": 0.0, "roughness": 0.22},
        "ND_standard_surface_surfaceshader": {
            "subsurface": 1.0,
            "subsurface_color": color,
            "subsurface_radius": scale,
            "subsurface_scale": 0.1,
            "specular_IOR": 1.31,
            "specular_roughness": 0.22,
        },
        "ND_open_pbr_surface_surfaceshader": {
            "subsurface_weight": 1.0,
            "subsurface_color": color,
            "subsurface_radius": 0.1,
            "subsurface_radius_scale": scale,
            "specular_ior": 1.31,
            "specular_roughness": 0.22,
        },
    }
    for number, (kind, inputs) in enumerate(words.items()):
        shader = bind(stage, add_quad(stage, f"/Q{number}"), kind, f"/M{number}")
        for name, given in inputs.items():
            shader.CreateInput(name, FLOAT if isinstance(given, float) else COLOR).Set(given)
    scene = load(stage)
    assert scene.warnings == []
    models = [model_of(scene, i) for i in range(3)]
    for model in models[1:]:
        np.testing.assert_allclose(model.medium.sigma_a, models[0].medium.sigma_a, rtol=1e-4)
        model.medium = models[0].medium
        assert content_hash(model) == content_hash(models[0])


def test_open_pbr_subsurface_is_the_same_medium(stage, tmp_path):
    inputs = (
        value("subsurface_weight", "float", "1")
        + value("subsurface_color", "color3", "0.5, 0.7, 0.9")
        + value("subsurface_radius", "float", "0.2")
        + value("subsurface_radius_scale", "color3", "1, 0.5, 0.25")
    )
    ice, said = refer(stage, tmp_path, surface("open_pbr_surface", inputs))
    assert said == []
    medium = ice.medium
    np.testing.assert_allclose(1 / (medium.sigma_s_prime + medium.sigma_a), [0.2, 0.1, 0.05], rtol=1e-4)
    assert medium.eta == pytest.approx(1.5)


def test_transmission_absorbs_to_its_color_over_its_depth(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    inputs = (
        value("transmission", "float", "1")
        + value("transmission_color", "color3", "0.25, 0.5, 0.75")
        + value("transmission_depth", "float", "50")
        + value("specular_roughness", "float", "0.1")
        + value("transmission_extra_roughness", "float", "0.2")
    )
    ice, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert said == []
    np.testing.assert_allclose(np.exp(-0.5 * np.asarray(ice.medium.sigma_a)), [0.25, 0.5, 0.75], rtol=1e-5)
    assert (ice.refraction, ice.translucency) == (1.0, 0.0)
    assert ice.refraction_roughness == pytest.approx(0.3)


def test_transmission_that_scatters_has_a_core(stage, tmp_path):
    inputs = (
        value("transmission_weight", "float", "1")
        + value("transmission_color", "color3", "0.5, 0.5, 0.5")
        + value("transmission_depth", "float", "2")
        + value("transmission_scatter", "color3", "0.2, 0.2, 2.0")
        + value("transmission_scatter_anisotropy", "float", "0.5")
    )
    ice, _ = refer(stage, tmp_path, surface("open_pbr_surface", inputs))
    extinction = np.log(2) / 2
    np.testing.assert_allclose(ice.medium.sigma_s_prime, [0.05, 0.05, 0.5], rtol=1e-5)
    # Blue would be negative: all are raised until it is 0 [OpenPBR].
    raised = 1.0 - extinction
    np.testing.assert_allclose(ice.medium.sigma_a, [extinction - 0.1 + raised] * 2 + [0.0], rtol=1e-4, atol=1e-6)
    assert ice.translucency == 1.0


def test_what_is_not_let_through_lies_over_the_ice(stage, tmp_path):
    inputs = (
        value("transmission", "float", "0.75")
        + value("base_color", "color3", "1, 0.5, 0")
        + value("base", "float", "1")
        + value("transmission_depth", "float", "1")
    )
    ice, _ = refer(stage, tmp_path, surface("standard_surface", inputs))
    (overlay,) = ice.overlays
    assert overlay.opacity == pytest.approx(0.25)
    assert overlay.scattering == 1.0
    np.testing.assert_allclose(overlay.color, [1, 0.5, 0])


def test_what_is_not_carried_over_is_named_once_and_only_where_it_matters(stage, tmp_path):
    inputs = (
        value("sheen", "float", "0.5")
        + value("thin_walled", "boolean", "true")
        + value("coat_IOR", "float", "1.5")  # its default
        + value("thin_film_thickness", "float", "300")
    )
    _, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert len(said) == 1
    assert "/Looks/Mine/shader: sheen, thin_film_thickness, thin_walled: not carried over" in said[0]


def test_every_input_of_the_models_is_carried_or_listed():
    for name, model in MODELS.items():
        if name.endswith("_100"):
            continue
        listed = {n.strip() for names, _ in model.not_carried for n in names.split(",")}
        every = {i.getName() for i in library().getNodeDef(name).getActiveInputs()}
        assert every == listed | model.carried, name


def test_the_lists_are_those_in_the_docs():
    from pathlib import Path

    from frazil.usd.surface_models import not_carried_markdown

    docs = (Path(__file__).parents[2] / "docs" / "material.md").read_text(encoding="utf-8")
    assert not_carried_markdown() in docs, "regenerate with not_carried_markdown()"


# -- node graphs


def colored(node, graph):
    """A surface whose base color that node of a graph feeds."""
    return surface("standard_surface", value("base", "float", "1") + fed("base_color", "color3", node), graph)


def image(name, file, kind="color3", more="", space=""):
    space = f'colorspace="{space}" ' if space else ""
    return (
        f'<image name="{name}" type="{kind}"><input name="file" type="filename" value="{file}" {space}/>{more}</image>'
    )


def fed(name, kind, node, output=""):
    return f'<input name="{name}" type="{kind}" nodename="{node}" {output}/>'


def test_images_and_arithmetic_with_constants_stay_exact(stage, tmp_path):
    write_image(tmp_path / "t.exr", np.full((2, 2, 3), 0.5), oiio.FLOAT)
    graph = (
        image("pic", "t.exr")
        + f'<multiply name="half" type="color3">{fed("in1", "color3", "pic")}{value("in2", "float", "0.5")}</multiply>'
        + f'<add name="more" type="color3">{fed("in1", "color3", "half")}'
        + f"{value('in2', 'color3', '0.1, 0.2, 0.3')}</add>"
        + f'<mix name="blend" type="color3">{value("fg", "color3", "1, 1, 1")}{fed("bg", "color3", "more")}'
        + f"{value('mix', 'float', '0.25')}</mix>"
        + f'<invert name="anti" type="color3">{fed("in", "color3", "blend")}</invert>'
    )
    model, said = refer(stage, tmp_path, colored("anti", graph))
    assert said == []
    lookup = model.diffuse_color
    # 1 - (0.25 + 0.75 (0.5 t + c))
    np.testing.assert_allclose(lookup.scale, [-0.375] * 3, rtol=1e-5)
    np.testing.assert_allclose(lookup.bias, [0.75 - 0.075, 0.75 - 0.15, 0.75 - 0.225], rtol=1e-5)
    np.testing.assert_allclose(lookup.texture.texels, 0.5)


def test_other_arithmetic_is_baked_texel_by_texel(stage, tmp_path):
    a, b = np.random.default_rng(1).random((2, 4, 4, 3)).astype(np.float32)
    write_image(tmp_path / "a.exr", a, oiio.FLOAT)
    write_image(tmp_path / "b.exr", b, oiio.FLOAT)
    graph = (
        image("a", "a.exr")
        + image("b", "b.exr")
        + f'<multiply name="ab" type="color3">{fed("in1", "color3", "a")}{fed("in2", "color3", "b")}</multiply>'
        + f'<power name="p" type="color3">{fed("in1", "color3", "ab")}{value("in2", "float", "2")}</power>'
    )
    model, said = refer(stage, tmp_path, colored("p", graph))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color.texture.texels, (a * b) ** 2, rtol=1e-5)


def test_channels_are_taken_apart_and_joined(stage, tmp_path):
    pixels = np.random.default_rng(2).random((3, 3, 3)).astype(np.float32)
    write_image(tmp_path / "orm.exr", pixels, oiio.FLOAT)
    graph = (
        image("orm", "orm.exr")
        + f'<separate3 name="parts" type="multioutput">{fed("in", "color3", "orm")}</separate3>'
        + f'<extract name="blue" type="float">{fed("in", "color3", "orm")}{value("index", "integer", "2")}</extract>'
        + f'<combine3 name="back" type="color3">{fed("in1", "float", "blue")}'
        + f"{fed('in2', 'float', 'parts', OUTG)}{value('in3', 'float', '0.5')}</combine3>"
    )
    inputs = (
        value("base", "float", "1")
        + fed("base_color", "color3", "back")
        + fed("specular_roughness", "float", "parts", OUTG)
        + fed("metalness", "float", "blue")
    )
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph))
    assert said == []
    assert (model.roughness.first_channel, model.metallic.first_channel) == (1, 2)
    texels = model.diffuse_color.texture.texels
    np.testing.assert_allclose(texels[..., :2], pixels[..., [2, 1]], rtol=1e-5)
    np.testing.assert_allclose(texels[..., 2], 0.5)


def test_a_node_that_the_library_defines_by_a_graph_is_worked_out(stage, tmp_path):
    inputs = value("in", "color3", "0.6, 0.4, 0.3") + value("amount", "float", "2")
    graph = f'<contrast name="c" type="color3">{inputs}</contrast>'
    model, said = refer(stage, tmp_path, colored("c", graph))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, [0.7, 0.3, 0.1], atol=1e-5)  # (x - 0.5) 2 + 0.5


def test_a_node_that_the_document_defines_is_worked_out(stage, tmp_path):
    graph = f"""
  <nodedef name="ND_dim_color3" node="dim"><input name="in" type="color3" value="1, 1, 1" />
    <output name="out" type="color3" /></nodedef>
  <nodegraph name="NG_dim" nodedef="ND_dim_color3">
    <multiply name="m" type="color3"><input name="in1" type="color3" interfacename="in" />
      {value("in2", "float", "0.25")}</multiply>
    <output name="out" type="color3" nodename="m" />
  </nodegraph>
  <dim name="d" type="color3">{value("in", "color3", "0.8, 0.4, 0.4")}</dim>"""
    model, said = refer(stage, tmp_path, colored("d", graph))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, [0.2, 0.1, 0.1], rtol=1e-5)


def test_a_graph_with_an_interface_and_places(stage, tmp_path):
    write_image(tmp_path / "t.png", np.full((2, 2, 3), 0.5))
    graph = f"""
  <nodegraph name="NG">
    <input name="tint" type="color3" value="0.5, 0.25, 1" />
    <texcoord name="uv" type="vector2">{value("index", "integer", "0")}</texcoord>
    <place2d name="place" type="vector2">{fed("texcoord", "vector2", "uv")}{value("scale", "vector2", "0.5, 0.25")}
      {value("rotate", "float", "90")}{value("offset", "vector2", "0.1, 0.2")}</place2d>
    <image name="pic" type="color3">{fed("texcoord", "vector2", "place")}
      {value("file", "filename", "t.png", 'colorspace="srgb_texture"')}
      {value("uaddressmode", "string", "clamp")}</image>
    <multiply name="tinted" type="color3">{fed("in1", "color3", "pic")}
      <input name="in2" type="color3" interfacename="tint" /></multiply>
    <output name="out" type="color3" nodename="tinted" />
  </nodegraph>"""
    inputs = value("base", "float", "1") + '<input name="base_color" type="color3" nodegraph="NG" output="out" />'
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph))
    assert said == []
    lookup = model.diffuse_color
    np.testing.assert_allclose(lookup.scale, [0.5, 0.25, 1], rtol=1e-5)
    np.testing.assert_allclose(lookup.texture.texels, 0.2158605, rtol=1e-2)  # 8-bit 0.5 from sRGB
    assert (lookup.texture.wrap_s, lookup.texture.wrap_t) == ("clamp", "repeat")
    # st / scale, turned by -90 degrees as MaterialX does, less the offset.
    np.testing.assert_allclose(lookup.st_scale, [2, 4], rtol=1e-5)
    assert lookup.st_rotation == pytest.approx(-90)
    np.testing.assert_allclose(lookup.st_translation, [-0.1, -0.2], rtol=1e-5)


def test_tiled_images_and_normal_maps(stage, tmp_path):
    write_image(tmp_path / "n.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    graph = (
        f'<tiledimage name="pic" type="vector3">{value("file", "filename", "n.png")}'
        f"{value('uvtiling', 'vector2', '3, 4')}{value('uvoffset', 'vector2', '0.5, 0')}</tiledimage>"
        f'<normalmap name="n" type="vector3">{fed("in", "vector3", "pic")}{value("scale", "float", "0.5")}</normalmap>'
    )
    model, said = refer(stage, tmp_path, surface("open_pbr_surface", fed("geometry_normal", "vector3", "n"), graph))
    assert said == []
    np.testing.assert_allclose(model.normal.scale, [1, 1, 2])
    np.testing.assert_allclose(model.normal.bias, [-0.5, -0.5, -1])
    np.testing.assert_allclose(model.normal.st_scale, [3, 4])
    np.testing.assert_allclose(model.normal.st_translation, [-0.5, 0])
    np.testing.assert_allclose(model.normal.texture.texels[0, 0], [128 / 255, 128 / 255, 1], rtol=1e-4)  # raw


def test_udim_sets_and_triplanar_projection(stage, tmp_path):
    for number, level in ((1001, 0.25), (1002, 0.5)):
        write_image(tmp_path / f"t.{number}.exr", np.full((2, 2, 3), level), oiio.FLOAT)
    graph = image("pic", "t.&lt;UDIM&gt;.exr")
    model, said = refer(stage, tmp_path, colored("pic", graph))
    assert said == []
    assert model.diffuse_color.texture.tiles == [1001, 1002]
    graph = (
        '<position name="p" type="vector3">' + value("space", "string", "object") + "</position>"
        f'<multiply name="scaled" type="vector3">{fed("in1", "vector3", "p")}{value("in2", "float", "4")}</multiply>'
        f'<triplanarprojection name="pic" type="float">{value("filex", "filename", "t.1001.exr")}'
        f"{value('filey', 'filename', 't.1001.exr')}{value('filez', 'filename', 't.1001.exr')}"
        f"{fed('position', 'vector3', 'scaled')}</triplanarprojection>"
    )
    model, said = refer(stage, tmp_path, surface("standard_surface", fed("specular_roughness", "float", "pic"), graph))
    assert said == []
    assert model.roughness.is_triplanar
    assert model.roughness.triplanar_size == pytest.approx(0.25)


def test_bump_of_a_height_image_tilts_towards_its_fall(stage, tmp_path):
    write_image(tmp_path / "h.exr", np.tile(np.linspace(0, 1, 16)[None, :, None], (16, 1, 1)), oiio.FLOAT)
    graph = image("h", "h.exr", "float") + f'<bump name="b" type="vector3">{fed("height", "float", "h")}</bump>'
    model, said = refer(stage, tmp_path, surface("standard_surface", fed("normal", "vector3", "b"), graph))
    assert said == []
    n = model.normal.texture.texels[8, 8] * 2 - 1
    slope = 16 / 15 / 16  # rise per repeat of st, over MaterialX's 16
    np.testing.assert_allclose(n, np.array([-slope, 0, 1]) / np.hypot(slope, 1), atol=1e-4)


# Documents as they are found: of an older version, with a file prefix, procedural textures, a tint without a depth.
FOUND = {
    "brass": """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709" fileprefix="./tex/">
  <nodegraph name="NG_brass1">
    <tiledimage name="image_color" type="color3">
      <input name="file" type="filename" value="color.png" colorspace="srgb_texture" /></tiledimage>
    <tiledimage name="image_roughness" type="float">
      <input name="file" type="filename" value="roughness.png" /></tiledimage>
    <output name="out_color" type="color3" nodename="image_color" />
    <output name="out_roughness" type="float" nodename="image_roughness" />
  </nodegraph>
  <standard_surface name="SR_brass1" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG_brass1" output="out_color" />
    <input name="specular_roughness" type="float" nodegraph="NG_brass1" output="out_roughness" />
    <input name="metalness" type="float" value="1" />
    <input name="coat_color" type="color3" nodegraph="NG_brass1" output="out_color" />
  </standard_surface>
  <surfacematerial name="Look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR_brass1" /></surfacematerial>
</materialx>""",
    "marble": """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <nodegraph name="NG_marble1">
    <input name="base_color_1" type="color3" value="0.8, 0.8, 0.8" uiname="Color 1" />
    <input name="base_color_2" type="color3" value="0.1, 0.1, 0.3" />
    <position name="obj_pos" type="vector3" />
    <fractal3d name="noise" type="float"><input name="octaves" type="integer" value="3" />
      <input name="position" type="vector3" nodename="obj_pos" /></fractal3d>
    <sin name="sin" type="float"><input name="in" type="float" nodename="noise" /></sin>
    <mix name="color_mix" type="color3"><input name="fg" type="color3" interfacename="base_color_1" />
      <input name="bg" type="color3" interfacename="base_color_2" />
      <input name="mix" type="float" nodename="sin" /></mix>
    <output name="out" type="color3" nodename="color_mix" />
  </nodegraph>
  <standard_surface name="SR_marble1" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="NG_marble1" output="out" />
    <input name="subsurface" type="float" value="0.4" />
    <input name="subsurface_color" type="color3" nodegraph="NG_marble1" output="out" />
  </standard_surface>
  <surfacematerial name="Look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR_marble1" /></surfacematerial>
</materialx>""",
    "glass": """<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709">
  <open_pbr_surface name="glass" type="surfaceshader">
    <input name="transmission_weight" type="float" value="1.0" />
    <input name="transmission_color" type="color3" value="0.9, 1, 0.95" />
    <input name="specular_roughness" type="float" value="0" />
    <input name="geometry_thin_walled" type="boolean" value="false" />
  </open_pbr_surface>
  <surfacematerial name="Look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="glass" /></surfacematerial>
</materialx>""",
}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("brass", ["coat_color: not carried over"]),
        ("marble", ["noise: is a 'ND_fractal3d_float' node, which is not supported"]),
        ("glass", ["transmission_color without transmission_depth: not carried over"]),
    ],
)
def test_documents_as_they_are_found(stage, tmp_path, name, said):
    (tmp_path / "tex").mkdir()
    write_image(tmp_path / "tex/color.png", np.full((2, 2, 3), 0.5))
    write_image(tmp_path / "tex/roughness.png", np.full((2, 2, 1), 0.5))
    text = FOUND[name].removesuffix("</materialx>")
    model, warned = refer(stage, tmp_path, text, head="")
    assert len(warned) == len(said), warned
    for message in said:
        assert any(message in w for w in warned)
    assert isinstance(model, fz.StandardMaterial if name == "brass" else fz.IceMaterial)
    if name == "brass":
        np.testing.assert_allclose(model.diffuse_color.texture.texels, 0.2158605, rtol=1e-2)
        assert model.roughness.texture.texels[0, 0, 0] == pytest.approx(128 / 255, rel=1e-4)


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
    assert said == ["/Looks/Mine/shader: roughness must be in 0..1, got -1. 0 is used."]


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
