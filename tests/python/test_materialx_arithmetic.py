"""MaterialX: the formulas of its nodes, held to MaterialX's own implementations worked out by hand."""

import colorsys

import numpy as np
import OpenImageIO as oiio
import pytest
from mtlx_documents import colored, fed, image, refer, surface, value
from test_usd_materials import write_image
from usd_stages import new_stage


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


A, B = np.array([0.6, 0.3, 0.2]), np.array([0.1, 0.5, 0.8])
# The node, its inputs beside in1 = fg = in = A and in2 = bg = B, and what comes out.
FORMULAS = {
    "plus": (("fg", "bg"), value("mix", "float", "0.5"), B + 0.5 * A),
    "minus": (("fg", "bg"), "", B - A),
    "difference": (("fg", "bg"), "", np.abs(B - A)),
    "screen": (("fg", "bg"), "", 1 - (1 - A) * (1 - B)),
    "burn": (("fg", "bg"), "", 1 - (1 - B) / A),
    "dodge": (("fg", "bg"), value("mix", "float", "0.25"), 0.25 * B / (1 - A) + 0.75 * B),
    "overlay": (("fg", "bg"), "", np.where(B < 0.5, 2 * A * B, 1 - 2 * (1 - A) * (1 - B))),
    "inside": (("in",), value("mask", "float", "0.25"), 0.25 * A),
    "outside": (("in",), value("mask", "float", "0.25"), 0.75 * A),
    "fract": (("in1", "in"), "", A),
    "luminance": (("in",), "", np.repeat(A @ [0.2722287, 0.6740818, 0.0536895], 3)),
    "saturate": (("in",), value("amount", "float", "0"), np.repeat(A @ [0.2722287, 0.6740818, 0.0536895], 3)),
    "rgbtohsv": (("in",), "", colorsys.rgb_to_hsv(*A)),
    "hsvtorgb": (("in",), "", colorsys.hsv_to_rgb(*A)),
    "hsvadjust": (("in",), value("amount", "vector3", "0.1, 0.5, 1"), None),
    "colorcorrect": (("in",), value("gain", "float", "0.5") + value("saturation", "float", "1"), 0.5 * A),
    "range": (("in",), value("outlow", "float", "0.2") + value("outhigh", "float", "0.6"), 0.2 + 0.4 * A),
    "contrast": (("in",), value("amount", "float", "2"), 2 * (A - 0.5) + 0.5),
    "acescg_to_lin_rec709": (("in",), "", None),
}


@pytest.mark.parametrize("node", FORMULAS)
def test_formulas_of_colors(stage, tmp_path, node):
    names, more, expected = FORMULAS[node]
    if node == "hsvadjust":
        h, s, v = colorsys.rgb_to_hsv(*A)
        expected = np.array(colorsys.hsv_to_rgb(h + 0.1, s * 0.5, v))
    if node == "acescg_to_lin_rec709":
        matrix = [[1.705, -0.622, -0.083], [-0.130, 1.141, -0.011], [-0.024, -0.129, 1.153]]
        expected = np.array(matrix) @ A
    given = {"in": A, "in1": A, "fg": A, "bg": B}
    inputs = "".join(value(n, "color3", ", ".join(map(str, given[n]))) for n in names if n != "in1")
    model, said = refer(stage, tmp_path, colored("n", f'<{node} name="n" type="color3">{inputs}{more}</{node}>'))
    assert all(": base_color must be in 0..1, got" in w for w in said)
    np.testing.assert_allclose(model.diffuse_color, np.clip(expected, 0, 1), atol=2e-3)


def as_color(kind, node):
    """A node's numbers as a color: the third of a pair is 0."""
    return f'<convert name="c" type="color3">{fed("in", kind, node)}</convert>'


VECTORS = {
    # MaterialX turns row vectors the other way round than a right hand does.
    "rotate2d": ("vector2", value("in", "vector2", "0.5, 0") + value("amount", "float", "-30"), (0.4330127, 0.25, 0)),
    "rotate3d": (
        "vector3",
        value("in", "vector3", "0.5, 0, 0") + value("amount", "float", "-90") + value("axis", "vector3", "0, 0, 2"),
        (0, 0.5, 0),
    ),
    "crossproduct": ("vector3", value("in1", "vector3", "1, 0, 0") + value("in2", "vector3", "0, 1, 0"), (0, 0, 1)),
}


@pytest.mark.parametrize("node", VECTORS)
def test_formulas_of_vectors(stage, tmp_path, node):
    kind, inputs, expected = VECTORS[node]
    graph = f'<{node} name="n" type="{kind}">{inputs}</{node}>'
    if kind == "vector2":
        graph += f'<convert name="v" type="vector3">{fed("in", "vector2", "n")}</convert>'
        graph += as_color("vector3", "v")
    else:
        graph += as_color(kind, "n")
    model, said = refer(stage, tmp_path, colored("c", graph))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, expected, atol=1e-6)


@pytest.mark.parametrize("unit", ["", 'unittype="angle" unit="degree" ', 'unittype="angle" unit="radian" '])
def test_angles_are_in_degrees_whatever_their_unit(stage, tmp_path, unit):
    angle = "0.5235987756" if "radian" in unit else "30"
    inputs = value("in", "vector2", "0.5, 0") + value("amount", "float", f"-{angle}", unit)
    graph = f'<rotate2d name="n" type="vector2">{inputs}</rotate2d>'
    graph += f'<convert name="v" type="vector3">{fed("in", "vector2", "n")}</convert>' + as_color("vector3", "v")
    model, said = refer(stage, tmp_path, colored("c", graph))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, (0.4330127, 0.25, 0), atol=1e-6)


def test_compositing_by_alpha_is_worked_out_texel_by_texel(stage, tmp_path):
    front, back = np.random.default_rng(3).random((2, 4, 4, 4)).astype(np.float32)
    write_image(tmp_path / "f.exr", front, oiio.FLOAT)
    write_image(tmp_path / "b.exr", back, oiio.FLOAT)
    graph = image("f", "f.exr", "color4") + image("b", "b.exr", "color4")
    graph += f'<over name="o" type="color4">{fed("fg", "color4", "f")}{fed("bg", "color4", "b")}</over>'
    graph += f'<convert name="c" type="color3">{fed("in", "color4", "o")}</convert>'
    model, said = refer(stage, tmp_path, colored("c", graph))
    assert said == []
    expected = front[..., :3] + back[..., :3] * (1 - front[..., 3:])
    np.testing.assert_allclose(model.diffuse_color.texture.texels[..., :3], expected, atol=1e-5)


def test_a_pair_as_three_numbers_ends_in_0(stage, tmp_path):
    graph = f'<constant name="p" type="vector2">{value("value", "vector2", "0.25, 0.5")}</constant>'
    graph += f'<convert name="v" type="vector3">{fed("in", "vector2", "p")}</convert>'
    graph += f'<convert name="c" type="color3">{fed("in", "vector3", "v")}</convert>'
    model, said = refer(stage, tmp_path, colored("c", graph))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, [0.25, 0.5, 0])


OF_GEOMETRY = {
    "ramplr": value("valuel", "color3", "1, 0, 0"),
    "ramp4": value("valuetl", "color3", "1, 0, 0"),
    "splittb": value("valuet", "color3", "1, 0, 0"),
    "checkerboard": value("color1", "color3", "1, 0, 0"),
    "noise3d": value("amplitude", "float", "0.5"),
    "hextiledimage": "",
}


@pytest.mark.parametrize("node", OF_GEOMETRY)
def test_nodes_of_the_place_are_named_not_read_at_one_place(stage, tmp_path, node):
    graph = f'<{node} name="n" type="color3">{OF_GEOMETRY[node]}</{node}>'
    model, said = refer(stage, tmp_path, colored("n", graph))
    np.testing.assert_allclose(model.diffuse_color, 0.8, rtol=1e-6)  # standard_surface's own
    assert len(said) == 1
    assert said[0].startswith("/Looks/Mine/n: is a 'ND_")
    assert said[0].endswith("node, which is not supported. The default is used.")


def test_inputs_that_a_node_lacks_are_named(stage, tmp_path):
    graph = f'<clamp name="n" type="float">{value("in", "float", "0.4")}{value("hi", "float", "0.2")}</clamp>'
    inputs = fed("specular_roughness", "float", "n") + value("transmision", "float", "0.5")
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph))
    assert model.roughness == pytest.approx(0.4)
    assert any(w == "/Looks/Mine/shader: has no input 'transmision'. The nearest is 'transmission'." for w in said)
    assert any(w == "/Looks/Mine/n: is a 'ND_clamp_float' node, which has no input hi." for w in said), said


def test_what_takes_no_texture_is_named(stage, tmp_path):
    write_image(tmp_path / "t.exr", np.full((2, 2, 3), 0.5), oiio.FLOAT)
    graph = image("pic", "t.exr", "float") + image("uv", "t.exr", "vector2")
    graph += f'<switch name="n" type="float">{value("in1", "float", "0.1")}{fed("which", "float", "pic")}</switch>'
    graph += f'<texcoord name="st" type="vector2" /><add name="moved" type="vector2">{fed("in1", "vector2", "st")}'
    graph += f"{fed('in2', 'vector2', 'uv')}</add>"
    graph += image("base", "t.exr", more=fed("texcoord", "vector2", "moved"))
    inputs = fed("specular_roughness", "float", "n") + fed("base_color", "color3", "base")
    _, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph))
    assert any("/n: is a 'ND_switch_float' node that cannot be worked out: which takes no texture" in w for w in said)
    assert any("/moved: in2 takes no texture in texture coordinates. It is left out." in w for w in said)


def test_display_color_takes_no_arithmetic_and_is_not_black(stage, tmp_path):
    graph = f'<geompropvalue name="g" type="color3">{value("geomprop", "string", "displayColor")}</geompropvalue>'
    tinted = f'<multiply name="m" type="color3">{fed("in1", "color3", "g")}{value("in2", "float", "0.5")}</multiply>'
    model, said = refer(stage, tmp_path, colored("g", graph))
    assert said == []
    assert model.uses_display_color
    model, said = refer(stage, tmp_path, colored("m", graph + tinted))
    assert any("displayColor takes no arithmetic" in w for w in said)
    np.testing.assert_allclose(model.diffuse_color, 0.8, rtol=1e-6)
