"""Lights: shapes, radiance, multipliers, groups, dome images and their orientation."""

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdLux
from test_usd_materials import write_image
from usd_stages import add_quad, load, new_stage

import frazil as fz


@pytest.fixture
def stage(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    add_quad(stage, "/Quad")
    stage.RemovePrim("/Dome")
    return stage


def read_light(stage):
    scene = load(stage)
    assert scene.warnings == []
    (light,) = scene.lights
    return light


def test_radiance_is_the_product_of_its_inputs(stage):
    light = UsdLux.RectLight.Define(stage, "/Light")
    light.CreateWidthAttr(20)
    light.CreateHeightAttr(30)
    light.CreateIntensityAttr(3)
    light.CreateExposureAttr(2)
    light.CreateColorAttr(Gf.Vec3f(1, 0.5, 0.25))
    light.CreateNormalizeAttr(True)
    light.CreateDiffuseAttr(0.5)
    light.CreateSpecularAttr(0.25)
    for name, value in (("translucency", 2.0), ("refraction", 3.0), ("volume", -4.0)):
        light.GetPrim().CreateAttribute(f"inputs:frazil:{name}", Sdf.ValueTypeNames.Float).Set(value)
    light.GetPrim().CreateAttribute("frazil:lightGroup", Sdf.ValueTypeNames.Token).Set("rim")
    light.AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    read = read_light(stage)
    np.testing.assert_allclose(read.radiance, [12, 6, 3])
    assert (read.shape.width, read.shape.height) == (20, 30)
    assert read.normalize
    assert (read.diffuse, read.specular, read.translucency) == (0.5, 0.25, 2.0)
    assert (read.refraction, read.volume) == (3.0, -4.0)
    assert read.group == "rim"
    np.testing.assert_allclose(read.matrix[3, :3], [1, 0, 0], rtol=1e-6)
    np.testing.assert_allclose(read.matrix[0, 0], 0.01, rtol=1e-6)


def test_color_temperature(stage):
    light = UsdLux.SphereLight.Define(stage, "/Light")
    light.CreateColorTemperatureAttr(3000)
    np.testing.assert_allclose(read_light(stage).radiance, [1, 1, 1])
    light.CreateEnableColorTemperatureAttr(True)
    expected = np.array(UsdLux.BlackbodyTemperatureAsRgb(3000))
    read = read_light(stage).radiance
    np.testing.assert_allclose(read, expected, rtol=1e-5)
    assert read[0] > read[2]


@pytest.mark.parametrize(
    ("kind", "sizes"),
    [
        ("DistantLight", {"angle": 2.0}),
        ("DiskLight", {"radius": 3.0}),
        ("SphereLight", {"radius": 4.0}),
        ("CylinderLight", {"length": 5.0, "radius": 0.25}),
    ],
)
def test_shapes(stage, kind, sizes):
    prim = stage.DefinePrim("/Light", kind)
    for name, value in sizes.items():
        prim.GetAttribute(f"inputs:{name}").Set(value)
    light = read_light(stage)
    assert type(light.shape).__name__ == kind
    for name, value in sizes.items():
        assert getattr(light.shape, name) == pytest.approx(value)


@pytest.mark.parametrize(("kind", "hint"), [("SphereLight", "treatAsPoint"), ("CylinderLight", "treatAsLine")])
def test_points_and_lines_keep_their_size_or_get_a_small_one(stage, kind, hint):
    prim = stage.DefinePrim("/Light", kind)
    prim.GetAttribute(hint).Set(True)
    prim.GetAttribute("inputs:radius").Set(2.0)
    assert read_light(stage).shape.radius == 2.0
    prim.GetAttribute("inputs:radius").Set(0.0)
    prim.GetAttribute("inputs:normalize").Set(True)
    light = read_light(stage)
    assert light.shape.radius * light.matrix[0, 0] == pytest.approx(1e-3)
    prim.GetAttribute("inputs:normalize").Set(False)
    assert any(w.startswith(f"/Light: {hint} with radius 0") for w in load(stage).warnings)
    prim.GetAttribute(hint).Set(False)
    assert any("radius must be > 0" in w for w in load(stage).warnings)


def test_distant_lights_keep_their_default_intensity(stage):
    UsdLux.DistantLight.Define(stage, "/Light")
    np.testing.assert_allclose(read_light(stage).radiance, 50000)


def dome_with_a_spot(stage, tmp_path, row, column, kind="DomeLight"):
    pixels = np.zeros((16, 32, 3), np.float32)
    pixels[row, column] = 100.0
    write_image(tmp_path / "sky.exr", pixels, oiio.FLOAT)
    prim = stage.DefinePrim("/Sky", kind)
    prim.GetAttribute("inputs:texture:file").Set(str(tmp_path / "sky.exr"))
    return prim


def brightest_world_direction(light):
    around = np.linspace(-np.pi, np.pi, 181)
    directions = [
        (np.sin(p) * np.cos(t), np.cos(p), np.sin(p) * np.sin(t))
        for p in np.linspace(0.01, np.pi - 0.01, 91)
        for t in around
    ]
    values = [light.shape.radiance(d)[0] for d in directions]
    local = np.array(directions[int(np.argmax(values))])
    return local @ light.matrix[:3, :3]


@pytest.mark.parametrize(
    ("row", "column", "expected"),
    [(0, 5, (0, 1, 0)), (15, 5, (0, -1, 0)), (8, 16, (0, 0, 1)), (8, 8, (1, 0, 0)), (8, 24, (-1, 0, 0))],
)
def test_dome_images_follow_the_lat_long_convention(stage, tmp_path, row, column, expected):
    dome_with_a_spot(stage, tmp_path, row, column)
    np.testing.assert_allclose(brightest_world_direction(read_light(stage)), expected, atol=0.15)


def test_a_dome_of_a_z_up_stage(stage, tmp_path):
    UsdGeom.SetStageUpAxis(stage, "Z")
    prim = dome_with_a_spot(stage, tmp_path, 0, 5)
    # UsdLuxDomeLight: the pole is the stage's +y, which is the world's -z
    np.testing.assert_allclose(brightest_world_direction(read_light(stage)), (0, 0, -1), atol=0.15)
    UsdLux.DomeLight(prim).OrientToStageUpAxis()
    np.testing.assert_allclose(brightest_world_direction(read_light(stage)), (0, 1, 0), atol=0.15)
    stage.RemovePrim("/Sky")
    # UsdLuxDomeLight_1: poleAxis 'scene' by default
    dome_with_a_spot(stage, tmp_path, 0, 5, "DomeLight_1")
    np.testing.assert_allclose(brightest_world_direction(read_light(stage)), (0, 1, 0), atol=0.15)


@pytest.mark.parametrize("problem", ["missing", "broken", "mirroredBall", "nan"])
def test_dome_images_that_cannot_be_used(stage, tmp_path, problem):
    prim = dome_with_a_spot(stage, tmp_path, 0, 0)
    if problem == "missing":
        prim.GetAttribute("inputs:texture:file").Set("./nowhere.exr")
    elif problem == "broken":
        (tmp_path / "sky.exr").write_bytes(b"v/1\x01")
    elif problem == "nan":
        write_image(tmp_path / "sky.exr", np.full((2, 4, 3), np.nan), oiio.FLOAT)
    else:
        prim.GetAttribute("inputs:texture:format").Set("mirroredBall")
    scene = load(stage)
    assert len(scene.lights) == 1
    assert scene.lights[0].shape.has_image == (problem == "nan")
    assert all(w.startswith("/Sky: ") for w in scene.warnings)
    assert scene.warnings
    assert scene.warnings[0].startswith("/Sky: ")


@pytest.mark.parametrize(
    ("kind", "name", "value", "said"),
    [
        ("SphereLight", "radius", 0.0, "radius must be > 0, got 0.0"),
        ("RectLight", "width", -1.0, "width must be > 0, got -1.0"),
        ("SphereLight", "intensity", float("inf"), "intensity times color must be finite"),
        ("DiskLight", "radius", 1e38, "radius must be in [1e-09, 1e+09] metres in the world, got 1"),
        ("CylinderLight", "length", 1e-38, "length must be in [1e-09, 1e+09] metres in the world, got 1"),
    ],
)
def test_lights_that_cannot_be_used_are_left_out(stage, kind, name, value, said):
    UsdLux.DistantLight.Define(stage, "/Sun")
    prim = stage.DefinePrim("/Light", kind)
    if name:
        prim.GetAttribute(f"inputs:{name}").Set(value)
    scene = load(stage)
    assert [light.path for light in scene.lights] == ["/Sun"]
    assert any(w.startswith("/Light: ") and said in w for w in scene.warnings), scene.warnings


def test_flattened_lights_are_left_out(stage):
    UsdLux.DistantLight.Define(stage, "/Sun")
    UsdLux.DiskLight.Define(stage, "/Light").AddScaleOp().Set(Gf.Vec3f(1, 0, 1))
    scene = load(stage)
    assert [light.path for light in scene.lights] == ["/Sun"]
    assert "/Light: its transform cannot be inverted" in scene.warnings[0]


def test_lights_beyond_single_precision_are_left_out(stage):
    UsdLux.DistantLight.Define(stage, "/Sun")
    UsdLux.DiskLight.Define(stage, "/Light").AddTranslateOp().Set(Gf.Vec3d(0, 1e17, 0))
    scene = load(stage)
    assert [light.path for light in scene.lights] == ["/Sun"]
    assert "/Light: must be within 1e+12 metres of the origin, got 1" in scene.warnings[0]


def test_what_lights_do_not_support_is_named(stage):
    light = UsdLux.SphereLight.Define(stage, "/Light")
    light.GetPrim().CreateRelationship("light:filters").SetTargets(["/Filter"])
    said = load(stage).warnings
    assert "/Light: light filters are not supported. They are left out." in said


IES = """IESNA:LM-63-2002
[TEST] none
TILT=NONE
1 1000 2 3 1 1 2 0 0 0
0.5 1 10
0, 45 90
0
10 20
40
"""


def test_ies_profiles(stage, tmp_path):
    (tmp_path / "lamp.ies").write_text(IES)
    light = UsdLux.SphereLight.Define(stage, "/Light")
    shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
    shaping.CreateShapingIesFileAttr("lamp.ies")
    shaping.CreateShapingIesAngleScaleAttr(0.5)
    shaping.CreateShapingIesNormalizeAttr(True)
    read = read_light(stage).shaping
    assert read.ies.vertical == [0, 45, 90]
    assert read.ies.values == [[10, 20, 40]]  # multiplier 2, ballast 0.5
    assert (read.ies_angle_scale, read.ies_normalize) == (0.5, True)
    assert read.cone_angle == 180
    assert read.ies.intensity((0, 0, -1)) == 10
    np.testing.assert_allclose(read.ies.intensity((0.5, 0, -(0.75**0.5))), 10 + 10 * 30 / 45, rtol=1e-6)
    assert read.ies.intensity((0, 0, 1)) == 0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "lamp.ies@ cannot be found"),
        ("hello", "must be an IES file, got one without a TILT line"),
        (IES.replace("40", ""), "must hold intensities, got the end of the file"),
        (IES.replace("20", "x"), "intensities must be numbers, got 'x'"),
        (IES.replace("3 1 1 2", "3 1 2 2"), "photometric type must be 1 (C), got 2"),
        (IES.replace("3 1 1 2", "1e9 1 1 2"), "the number of vertical angles must be in 1..100000"),
        (IES.replace("0, 45 90", "0, 45 45"), "vertical angles must rise"),
        (IES.replace("10 20", "-10 20"), "intensities must be >= 0"),
    ],
)
def test_broken_ies_profiles_are_named(stage, tmp_path, text, said):
    if text is not None:
        (tmp_path / "lamp.ies").write_text(text)
    light = UsdLux.SphereLight.Define(stage, "/Light")
    UsdLux.ShapingAPI.Apply(light.GetPrim()).CreateShapingIesFileAttr("lamp.ies")
    scene = load(stage)
    (warning,) = scene.warnings
    assert warning.startswith("/Light: ")
    assert said in warning
    assert warning.endswith("The light shines without its profile.")
    assert scene.lights[0].shaping.ies is None


def test_ies_with_tilt(tmp_path):
    path = tmp_path / "tilted.ies"
    path.write_text(IES.replace("TILT=NONE", "TILT=INCLUDE\n1\n2\n0 90\n1 0.9"))
    assert fz.read_ies(path).values == [[10, 20, 40]]


def test_shaping(stage):
    light = UsdLux.SphereLight.Define(stage, "/Light")
    assert read_light(stage).shaping.cone_angle == 180  # not applied: to all sides
    shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
    assert read_light(stage).shaping.cone_angle == 180  # nothing authored
    shaping.CreateShapingConeSoftnessAttr(0.25)
    shaping.CreateShapingFocusAttr(3)
    shaping.CreateShapingFocusTintAttr((0.5, 0.25, 0))
    read = read_light(stage).shaping
    assert (read.cone_angle, read.cone_softness, read.focus) == (90, 0.25, 3)
    assert list(read.focus_tint) == [0.5, 0.25, 0]
    shaping.CreateShapingConeAngleAttr(200)
    scene = load(stage)
    assert scene.lights[0].shaping.cone_angle == 180
    assert "/Light: shaping:cone:angle must be in 0..180, got 200. 180 is used." in scene.warnings


def test_shadows_are_in_metres(stage):
    light = UsdLux.SphereLight.Define(stage, "/Light")
    shadow = UsdLux.ShadowAPI.Apply(light.GetPrim())
    assert read_light(stage).shadow.is_enabled
    shadow.CreateShadowEnableAttr(False)
    shadow.CreateShadowColorAttr((0.1, 0.2, 0.3))
    shadow.CreateShadowDistanceAttr(200)
    shadow.CreateShadowFalloffAttr(50)
    shadow.CreateShadowFalloffGammaAttr(2)
    read = read_light(stage).shadow
    assert not read.is_enabled
    np.testing.assert_allclose(read.color, (0.1, 0.2, 0.3), rtol=1e-6)
    scale = UsdGeom.GetStageMetersPerUnit(stage)
    np.testing.assert_allclose((read.distance, read.falloff, read.falloff_gamma), (200 * scale, 50 * scale, 2))


def test_rect_images_are_read_and_bad_ones_named(stage, tmp_path):
    write_image(tmp_path / "card.exr", np.ones((4, 8, 3), np.float32), oiio.FLOAT)
    light = UsdLux.RectLight.Define(stage, "/Light")
    light.CreateTextureFileAttr(str(tmp_path / "card.exr"))
    assert read_light(stage).shape.has_image
    light.GetTextureFileAttr().Set(str(tmp_path / "none.exr"))
    scene = load(stage)
    assert not scene.lights[0].shape.has_image
    assert any(w.startswith("/Light: ") and "It shines evenly." in w for w in scene.warnings)


def test_images_that_darken_are_named(stage, tmp_path):
    dome_with_a_spot(stage, tmp_path, 0, 0)
    write_image(tmp_path / "sky.exr", np.zeros((4, 8, 3), np.float32), oiio.FLOAT)
    assert any("is black" in w for w in load(stage).warnings)
    write_image(tmp_path / "sky.exr", np.full((4, 8, 3), -1.0, np.float32), oiio.FLOAT)
    scene = load(stage)
    assert any("/Sky: " in w and "96 negative values" in w for w in scene.warnings)
    assert scene.lights[0].shape.has_image


def test_an_empty_light_group_is_the_default_one_and_odd_names_are_refused(stage):
    prim = UsdLux.SphereLight.Define(stage, "/Light").GetPrim()
    group = prim.CreateAttribute("frazil:lightGroup", Sdf.ValueTypeNames.String)
    group.Set("")
    assert read_light(stage).group == ""


def test_invisible_lights_are_off(stage):
    UsdLux.DistantLight.Define(stage, "/Sun")
    UsdLux.SphereLight.Define(stage, "/Light").MakeInvisible()
    assert [light.path for light in load(stage).lights] == ["/Sun"]


def test_lights_inside_point_instancers_are_placed(stage):
    instancer = UsdGeom.PointInstancer.Define(stage, "/Points")
    instancer.CreatePositionsAttr([Gf.Vec3f(0), Gf.Vec3f(100, 0, 0)])
    instancer.CreateProtoIndicesAttr([0, 0])
    UsdLux.SphereLight.Define(stage, "/Points/Bulb")
    instancer.CreatePrototypesRel().SetTargets(["/Points/Bulb"])
    scene = load(stage)
    assert [light.path for light in scene.lights] == ["/Points[0]/Bulb", "/Points[1]/Bulb"]
    np.testing.assert_allclose(scene.lights[1].matrix[3, :3], [1, 0, 0], rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("inputs:frazil:translucancy", "RectLight has no inputs:frazil:translucancy, which is left out. "),
        ("frazil:lightgroup", "RectLight has no frazil:lightgroup, which is left out. "),
        ("inputs:intensty", "RectLight has no inputs:intensty, which is left out. "),
        ("inputs:shaping:cone:angel", "RectLight has no inputs:shaping:cone:angel, which is left out. "),
        ("inputs:shadow:distance", "inputs:shadow:distance has no effect without ShadowAPI."),
        ("inputs:ri:light:shadowSubset", None),
        ("userProperties:frazil", None),
    ],
)
def test_attributes_that_no_schema_knows_are_named(stage, name, expected):
    light = UsdLux.RectLight.Define(stage, "/Light")
    UsdLux.ShapingAPI.Apply(light.GetPrim())
    light.GetPrim().CreateAttribute(name, Sdf.ValueTypeNames.Float).Set(0.5)
    nearest = {
        "inputs:frazil:translucancy": "inputs:frazil:translucency",
        "frazil:lightgroup": "frazil:lightGroup",
        "inputs:intensty": "inputs:intensity",
        "inputs:shaping:cone:angel": "inputs:shaping:cone:angle",
    }
    said = load(stage).warnings
    if expected is None:
        assert said == []
        return
    (warning,) = said
    assert warning.startswith(f"/Light: {expected}")
    assert name not in nearest or warning.endswith(f"The nearest name is {nearest[name]}.")
