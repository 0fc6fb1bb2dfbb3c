"""Every input of Frazil's shaders, out of range, not finite or of another type: named with its prim and its range."""

import math

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdShade, Vt
from test_usd_materials import bind
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil.usd.material_inputs import (
    DENSITY_INPUTS,
    ICE_INPUTS,
    INFINITY,
    OVERLAY_INPUTS,
    PREVIEW_INPUTS,
    snake_case,
)

TYPES = Sdf.ValueTypeNames
KINDS = {
    "float": TYPES.Float,
    "int": TYPES.Int,
    "color": TYPES.Color3f,
    "vector": TYPES.Vector3f,
    "floats": TYPES.FloatArray,
    "colors": TYPES.Color3fArray,
}
SHADERS = {"frazil:ice": ICE_INPUTS, "frazil:overlay": OVERLAY_INPUTS, "frazil:density": DENSITY_INPUTS}


def author(stage, kind):
    """A quad of ice, and the shader of that kind in its material."""
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    if kind == "frazil:ice":
        return ice
    shader = UsdShade.Shader.Define(stage, "/Material/Other")
    shader.CreateIdAttr(kind)
    name = "density" if kind == "frazil:density" else "overlays:first"
    ice.CreateInput(name, TYPES.Token).ConnectToSource(shader.CreateOutput("out", TYPES.Token))
    return shader


def read(tmp_path, kind, values):
    """What is said of each input, all of them authored at once: {name: (type, value)}."""
    stage = new_stage(tmp_path / "s.usda")
    shader = author(stage, kind)
    for name, (type_name, value) in values.items():
        shader.CreateInput(name, type_name).Set(value)
    scene = load(stage)
    (item,) = scene.objects
    assert scene.materials[item.material].path == "/Material"
    assert type(scene.materials[item.material].model).__name__ == "IceMaterial"
    start = f"{shader.GetPath()}: "
    said = [w.removeprefix(start) for w in scene.warnings if w.startswith(start)]
    return {name: [w for w in said if w.startswith(f"{name} ")] for name in values}


def filled(row, number):
    """The number in the shape of the input."""
    return {
        "color": lambda: Gf.Vec3f(number),
        "vector": lambda: Gf.Vec3f(number),
        "floats": lambda: Vt.FloatArray([number, number + 1.0]),
        "colors": lambda: [Gf.Vec3f(number)] * 2,
    }.get(row.kind, lambda: number)()


def numbers_of(kind):
    return [row for row in SHADERS[kind] if row.kind in KINDS]


@pytest.mark.parametrize("is_high", [False, True])
@pytest.mark.parametrize("kind", SHADERS)
def test_every_number_out_of_range_is_named_and_clamped(tmp_path, kind, is_high):
    bounded = [row for row in numbers_of(kind) if row.minimum != -INFINITY]
    if is_high:
        bounded = [row for row in bounded if row.maximum < 2**31 - 1]
    assert len(bounded) >= 3
    values = {}
    for row in bounded:
        number = row.maximum + 2 if is_high else row.minimum - 2
        values[row.name] = (KINDS[row.kind], filled(row, int(number) if row.kind == "int" else number))
    said = read(tmp_path, kind, values)
    for row in bounded:
        assert len(said[row.name]) >= 1, row.name
        assert said[row.name][0].startswith(f"{row.name} must be {row.rule}"), said[row.name]
        assert said[row.name][0].endswith(" is used."), said[row.name]


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("kind", SHADERS)
def test_every_number_that_is_not_finite_is_named(tmp_path, kind, number):
    rows = [row for row in numbers_of(kind) if row.kind != "int"]
    said = read(tmp_path, kind, {row.name: (KINDS[row.kind], filled(row, number)) for row in rows})
    for row in rows:
        assert any(w.startswith(f"{row.name} must be finite, got") for w in said[row.name]), row.name


WRONG = {
    "text": (TYPES.String, "plenty"),
    "asset": (TYPES.Asset, Sdf.AssetPath("./nothing.png")),
    "nothing": (TYPES.FloatArray, Vt.FloatArray()),
    "many": (TYPES.FloatArray, Vt.FloatArray([0.1] * 7)),
    "matrix": (TYPES.Matrix4d, Gf.Matrix4d(1)),
}
# What is of a type after all: a text is whatever is authored.
RIGHT = {
    "text": tuple(WRONG),
    "file": ("text", "asset"),
    "floats": ("nothing", "many"),
    "colors": ("nothing",),
}


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("kind", SHADERS)
def test_every_input_of_another_type_is_named(tmp_path, kind, wrong):
    rows = [row for row in SHADERS[kind] if wrong not in RIGHT.get(row.kind, ())]
    said = read(tmp_path, kind, {row.name: WRONG[wrong] for row in rows})
    for row in rows:
        assert any(" must be " in w or "takes a texture alone" in w for w in said[row.name]), (row.name, said)


def test_a_value_of_another_type_leaves_the_other_inputs_as_they_are(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    shader = author(stage, "frazil:ice")
    shader.CreateInput("eta", TYPES.String).Set("high")
    shader.CreateInput("sigma_s_prime", TYPES.Color3f).Set(Gf.Vec3f(3, 4, 5))
    shader.CreateInput("roughness", TYPES.Float).Set(0.25)
    scene = load(stage)
    assert scene.warnings == ["/Material/Surface: eta must be a float, got 'high'. 1.31 is used."]
    model = scene.materials[0].model
    assert model.roughness == 0.25
    np.testing.assert_allclose(model.medium.sigma_s_prime, [3, 4, 5])


# -- in Python: the core names the material by its path

MEDIUM = fz.Medium([1, 1, 1], [0, 0, 0])
MAKERS = {
    "frazil:ice": lambda **given: fz.IceMaterial(MEDIUM, **given),
    "frazil:overlay": lambda **given: fz.IceMaterial(MEDIUM, overlays=[fz.Overlay(**given)]),
    "frazil:density": lambda **given: fz.IceMaterial(MEDIUM, density=fz.Density(**given)),
    "UsdPreviewSurface": lambda **given: fz.StandardMaterial(**given),
}
# Of a preset and of the medium, which has its own checks; and ramps, whose rows must fit together.
ELSEWHERE = ("albedo", "mean_free_path", "sigma_s_prime", "sigma_a", "eta", "preset_scale", "preset_depth")


def refused(model):
    """What a render of a body of that material says."""
    scene = fz.Scene()
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
    look = scene.add_material("/Look", model)
    scene.add_object("/Body", scene.add_mesh(fz.Mesh(corners, faces), "/Body"), look, np.eye(4))
    with pytest.raises(ValueError, match="^/Look: ") as caught:
        fz.render(scene, resolution=(1, 1), samples=1)
    return str(caught.value)


@pytest.mark.parametrize("kind", MAKERS)
def test_the_core_refuses_every_number_out_of_range(kind):
    table = PREVIEW_INPUTS if kind == "UsdPreviewSurface" else SHADERS[kind]
    for row in table:
        if row.kind not in ("float", "int", "color", "vector") or row.name in ELSEWHERE:
            continue
        wrong = [] if row.kind == "int" else [math.nan, math.inf]
        if row.minimum != -INFINITY and row.name != "seed":
            wrong.append(row.minimum - 2)
        if row.maximum < 2**31 - 1:
            wrong.append(row.maximum + 2)
        name = snake_case(row.name)
        for number in wrong:
            value = int(number) if row.kind == "int" else number
            said = refused(MAKERS[kind](**{name: (value,) * 3 if row.kind in ("color", "vector") else value}))
            assert name in said, said
            assert " must be " in said, said


def test_the_core_refuses_ramps_and_textures_that_are_not_finite():
    for given in (
        {"ramp_colors": [(math.nan,) * 3]},
        {"ramp_distances": [0.0, -1.0], "ramp_colors": [(1, 1, 1)] * 2},
        {"ramp_distances": [0.0, 1.0], "ramp_colors": [(1, 1, 1), (-1, 0, 0)]},
    ):
        assert ": ramp: " in refused(fz.IceMaterial(MEDIUM, **given))
    image = fz.Texture(np.ones((2, 2, 1), np.float32))
    bent = fz.TextureLookup(image, scale=(math.nan, 1, 1))
    assert "scale of its texture must be finite" in refused(fz.IceMaterial(MEDIUM, roughness=bent))
    assert "scale of its texture must be finite" in refused(fz.StandardMaterial(normal=bent))
