"""MaterialX: node graphs, images and their places, and documents as they are found."""

import numpy as np
import OpenImageIO as oiio
import pytest
from mtlx_documents import OUTG, colored, fed, image, refer, surface, value
from test_usd_materials import write_image
from usd_stages import new_stage

import frazil as fz


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


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


# Documents as they are found: of an older version, with a file prefix, procedural textures, glass.
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
    <input name="coat" type="float" value="1" />
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
        ("glass", []),
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
