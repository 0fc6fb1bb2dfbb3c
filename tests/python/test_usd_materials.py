"""Materials: frazil:ice, UsdPreviewSurface, textures, nearest matches, broken values."""

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdShade
from usd_stages import TEXCOORDS, add_quad, load, new_stage, set_primvar

from frazil.usd.material_inputs import ICE_INPUTS, inputs_markdown

FLOAT, COLOR, TOKEN = Sdf.ValueTypeNames.Float, Sdf.ValueTypeNames.Color3f, Sdf.ValueTypeNames.Token


def bind(stage, prim, shader_id, path="/Material", context=""):
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr(shader_id)
    material.CreateSurfaceOutput(context).ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)
    return shader


def bind_preview(stage, prim, path="/Material"):
    return bind(stage, prim, "UsdPreviewSurface", path)


def connect_texture(stage, shader, name, type_name, file, output="rgb", **inputs):
    base = shader.GetPath().GetParentPath()
    reader = UsdShade.Shader.Define(stage, base.AppendChild("Reader"))
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("map1")
    transform = UsdShade.Shader.Define(stage, base.AppendChild("Place"))
    transform.CreateIdAttr("UsdTransform2d")
    transform.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    transform.CreateInput("scale", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(2, 3))
    transform.CreateInput("rotation", FLOAT).Set(90.0)
    transform.CreateInput("translation", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(0.25, 0.5))
    texture = UsdShade.Shader.Define(stage, base.AppendChild(f"Texture_{name}"))
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(str(file))
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(transform.ConnectableAPI(), "result")
    for key, (kind, value) in inputs.items():
        texture.CreateInput(key, kind).Set(value)
    shader.CreateInput(name, type_name).ConnectToSource(texture.ConnectableAPI(), output)
    return texture


def write_image(path, pixels, kind=oiio.UINT8):
    pixels = np.asarray(pixels, np.float32)
    image = oiio.ImageBuf(oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind))
    image.set_pixels(oiio.ROI(), pixels)
    assert image.write(str(path))


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


def read_model(stage, number=0):
    scene = load(stage)
    return scene.materials[scene.objects[number].material].model, scene


def test_ice_by_sigmas_is_in_inverse_metres(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    shader = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    shader.CreateInput("sigma_s_prime", COLOR).Set(Gf.Vec3f(1, 2, 3))
    shader.CreateInput("sigma_a", COLOR).Set(Gf.Vec3f(0.1, 0.02, 0.01))
    shader.CreateInput("eta", FLOAT).Set(1.5)
    shader.CreateInput("spacing", FLOAT).Set(2.0)
    shader.CreateInput("compensation", TOKEN).Set("conserve")
    shader.CreateInput("ramp_distances", Sdf.ValueTypeNames.FloatArray).Set([0.0, 5.0])
    shader.CreateInput("ramp_colors", Sdf.ValueTypeNames.Color3fArray).Set([Gf.Vec3f(1, 1, 1), Gf.Vec3f(0, 0.5, 1)])
    shader.CreateInput("ramp_preserve_energy", Sdf.ValueTypeNames.Bool).Set(True)
    model, scene = read_model(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(model.medium.sigma_s_prime, [100, 200, 300], rtol=1e-6)
    np.testing.assert_allclose(model.medium.sigma_a, [10, 2, 1], rtol=1e-6)
    assert model.medium.eta == pytest.approx(1.5)
    assert model.spacing == pytest.approx(0.02)
    assert model.compensation == "conserve"
    np.testing.assert_allclose(model.ramp_distances, [0, 0.05], rtol=1e-6)
    np.testing.assert_allclose(model.ramp_colors, [[1, 1, 1], [0, 0.5, 1]])
    assert model.ramp_preserve_energy


def test_ice_by_albedo_has_that_albedo_and_mean_free_path(tmp_path):
    import frazil as fz

    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.1)
    shader = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    shader.CreateInput("albedo", COLOR).Set(Gf.Vec3f(0.5, 0.7, 0.9))
    shader.CreateInput("mean_free_path", COLOR).Set(Gf.Vec3f(0.1, 0.2, 0.3))
    medium = read_model(stage)[0].medium
    np.testing.assert_allclose(1 / (medium.sigma_s_prime + medium.sigma_a), [0.01, 0.02, 0.03], rtol=1e-4)
    np.testing.assert_allclose(fz.MultipleScattering(medium, 1.0).albedo, [0.5, 0.7, 0.9], rtol=1e-3)


def test_ice_defaults_follow_the_table(stage):
    bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    model, scene = read_model(stage)
    assert scene.warnings == []
    defaults = {row.name: row.default for row in ICE_INPUTS}
    for name in (
        "roughness",
        "specular",
        "translucency",
        "compensation",
        "compensation_limit",
        "compensation_strength",
        "spacing",
        "ramp_preserve_energy",
    ):
        expected = defaults[name]
        assert getattr(model, name) == (expected if isinstance(expected, str) else pytest.approx(expected)), name
    assert tuple(model.tint) == defaults["tint"]
    assert model.medium.eta == pytest.approx(defaults["eta"])


def test_ice_for_the_frazil_context_wins_over_the_universal_surface(stage):
    quad = add_quad(stage, "/Quad")
    bind(stage, quad, "UsdPreviewSurface")
    material = UsdShade.Material(stage.GetPrimAtPath("/Material"))
    ice = UsdShade.Shader.Define(stage, "/Material/Ice")
    ice.CreateIdAttr("frazil:ice")
    ice.CreateInput("roughness", FLOAT).Set(0.4)
    material.CreateSurfaceOutput("frazil").ConnectToSource(ice.ConnectableAPI(), "surface")
    assert read_model(stage)[0].roughness == pytest.approx(0.4)
    assert "IceMaterial" in repr(read_model(stage)[0])


@pytest.mark.parametrize(
    ("name", "kind", "value", "used", "said"),
    [
        ("roughness", FLOAT, 2.0, 1.0, r"/Material/Surface: roughness must be in 0..1, got 2. 1 is used."),
        ("roughness", FLOAT, float("nan"), 0.1, "roughness must be finite"),
        ("compensation_limit", FLOAT, 0.0, 1.0, "compensation_limit must be >= 1, got 0"),
        ("compensation", TOKEN, "much", "depth", "compensation must be one of off, ratio"),
        ("roughness", Sdf.ValueTypeNames.String, "rough", 0.1, "roughness must be a float, got 'rough'"),
    ],
)
def test_ice_values_out_of_range(stage, name, kind, value, used, said):
    shader = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    shader.CreateInput(name, kind).Set(value)
    model, scene = read_model(stage)
    assert getattr(model, name) == (used if isinstance(used, str) else pytest.approx(used))
    assert len(scene.warnings) == 1
    assert said.replace("..", r"..") in scene.warnings[0]


def test_negative_absorption_is_named_and_clamped(stage):
    shader = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    shader.CreateInput("sigma_s_prime", COLOR).Set(Gf.Vec3f(10, 10, 10))
    shader.CreateInput("sigma_a", COLOR).Set(Gf.Vec3f(-0.1, 0, 0))
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.medium.sigma_a, 0)
    assert "sigma_a must be >= 0 1/m, got (-0.1, 0, 0)" in scene.warnings[0]


def test_unknown_inputs_name_the_nearest(stage):
    shader = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    shader.CreateInput("rougness", FLOAT).Set(0.3)
    _, scene = read_model(stage)
    assert scene.warnings == ["/Material/Surface: has no input 'rougness'. The nearest is 'roughness'."]


def test_a_ramp_out_of_order_is_left_out(stage):
    shader = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    shader.CreateInput("ramp_distances", Sdf.ValueTypeNames.FloatArray).Set([1.0, 0.5])
    shader.CreateInput("ramp_colors", Sdf.ValueTypeNames.Color3fArray).Set([Gf.Vec3f(1)] * 2)
    model, scene = read_model(stage)
    assert model.ramp_distances == []
    assert "strictly increasing" in scene.warnings[0]


def test_preview_surface_inputs(stage):
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    shader.CreateInput("diffuseColor", COLOR).Set(Gf.Vec3f(0.1, 0.2, 0.3))
    shader.CreateInput("emissiveColor", COLOR).Set(Gf.Vec3f(5, 6, 7))
    shader.CreateInput("useSpecularWorkflow", Sdf.ValueTypeNames.Int).Set(1)
    for name, value in (
        ("metallic", 0.25),
        ("roughness", 0.3),
        ("clearcoat", 0.6),
        ("clearcoatRoughness", 0.05),
        ("opacity", 0.5),
        ("opacityThreshold", 0.1),
        ("ior", 1.33),
    ):
        shader.CreateInput(name, FLOAT).Set(value)
    model, scene = read_model(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(model.diffuse_color, [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(model.emissive_color, [5, 6, 7])
    assert model.use_specular_workflow
    assert not model.uses_display_color
    for name, value in (
        ("metallic", 0.25),
        ("roughness", 0.3),
        ("clearcoat", 0.6),
        ("clearcoat_roughness", 0.05),
        ("opacity", 0.5),
        ("opacity_threshold", 0.1),
        ("ior", 1.33),
    ):
        assert getattr(model, name) == pytest.approx(value), name


def test_values_come_through_material_interfaces(stage):
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    material = UsdShade.Material(stage.GetPrimAtPath("/Material"))
    public = material.CreateInput("paint", COLOR)
    public.Set(Gf.Vec3f(0.9, 0.1, 0.2))
    shader.CreateInput("diffuseColor", COLOR).ConnectToSource(public)
    np.testing.assert_allclose(read_model(stage)[0].diffuse_color, [0.9, 0.1, 0.2], rtol=1e-6)


def test_texture_with_transform_scale_bias_and_primvar(stage, tmp_path):
    write_image(tmp_path / "t.png", np.full((2, 4, 3), 128 / 255))
    quad = add_quad(stage, "/Quad")
    set_primvar(quad, "map1", TEXCOORDS, "vertex", [Gf.Vec2f(0.25, 0.5)] * 4)
    shader = bind_preview(stage, quad)
    float4 = Sdf.ValueTypeNames.Float4
    connect_texture(
        stage,
        shader,
        "diffuseColor",
        COLOR,
        tmp_path / "t.png",
        wrapS=(TOKEN, "clamp"),
        wrapT=(TOKEN, "mirror"),
        scale=(float4, Gf.Vec4f(0.5, 0.6, 0.7, 1)),
        bias=(float4, Gf.Vec4f(0.1, 0, 0, 0)),
    )
    model, scene = read_model(stage)
    assert scene.warnings == []
    lookup = model.diffuse_color
    np.testing.assert_allclose(lookup.texture.texels, 0.2158605, rtol=1e-5)  # sRGB 128 is 0.2158605 linear
    assert (lookup.texture.wrap_s, lookup.texture.wrap_t) == ("clamp", "mirror")
    np.testing.assert_allclose(lookup.scale, [0.5, 0.6, 0.7], rtol=1e-6)
    np.testing.assert_allclose(lookup.bias, [0.1, 0, 0], rtol=1e-6)
    assert (tuple(lookup.st_scale), lookup.st_rotation, tuple(lookup.st_translation)) == ((2, 3), 90, (0.25, 0.5))
    np.testing.assert_allclose(scene.mesh(0).uvs, [[0.25, 0.5]] * 4)


@pytest.mark.parametrize(
    ("color_space", "kind", "channels", "linear"),
    [
        ("sRGB", oiio.UINT8, 1, True),
        ("raw", oiio.UINT8, 3, False),
        ("auto", oiio.UINT8, 3, True),
        ("auto", oiio.UINT8, 1, False),
        ("auto", oiio.UINT16, 3, False),
        ("auto", oiio.UINT8, 4, True),
    ],
)
def test_source_color_space(stage, tmp_path, color_space, kind, channels, linear):
    write_image(tmp_path / "t.png", np.full((1, 1, channels), 128 / 255), kind)
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    connect_texture(stage, shader, "diffuseColor", COLOR, tmp_path / "t.png", sourceColorSpace=(TOKEN, color_space))
    texels = read_model(stage)[0].diffuse_color.texture.texels
    assert texels[0, 0, 0] == pytest.approx(0.2158605 if linear else 128 / 255, rel=1e-4)
    if channels == 4:
        assert texels[0, 0, 3] == pytest.approx(128 / 255, rel=1e-4)  # alpha stays


def test_scalar_channels_of_one_texture(stage, tmp_path):
    write_image(tmp_path / "t.exr", np.array([[[0.1, 0.2, 0.3, 0.4]]]), oiio.FLOAT)
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    float4 = Sdf.ValueTypeNames.Float4
    connect_texture(stage, shader, "roughness", FLOAT, tmp_path / "t.exr", "g", scale=(float4, Gf.Vec4f(1, 2, 3, 4)))
    connect_texture(stage, shader, "opacity", FLOAT, tmp_path / "t.exr", "a")
    model, _ = read_model(stage)
    assert model.roughness.first_channel == 1
    assert tuple(model.roughness.scale) == (2, 2, 2)
    assert model.opacity.first_channel == 3


def test_a_missing_texture_gives_its_fallback(stage):
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    connect_texture(
        stage,
        shader,
        "diffuseColor",
        COLOR,
        "./nowhere.png",
        fallback=(Sdf.ValueTypeNames.Float4, Gf.Vec4f(0.3, 0.2, 0.1, 1)),
    )
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.diffuse_color, [0.3, 0.2, 0.1], rtol=1e-6)
    assert any(w.startswith("/Material/Texture_diffuseColor: ") and "nowhere.png" in w for w in scene.warnings)


@pytest.mark.parametrize("content", [b"", b"not an image", b"\x89PNG\r\n\x1a\n\x00\x00"])
def test_a_broken_texture_gives_its_fallback(stage, tmp_path, content):
    (tmp_path / "broken.png").write_bytes(content)
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    connect_texture(stage, shader, "diffuseColor", COLOR, tmp_path / "broken.png")
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.diffuse_color, [0, 0, 0])
    assert any("broken.png" in w and "fallback" in w for w in scene.warnings)


def test_display_color_without_a_material_and_through_a_reader(stage):
    quad = add_quad(stage, "/Quad")
    quad.CreateDisplayColorAttr([Gf.Vec3f(0.1, 0.2, 0.3)])
    model, scene = read_model(stage)
    assert model.uses_display_color
    np.testing.assert_allclose(scene.mesh(0).colors, [[0.1, 0.2, 0.3]], rtol=1e-6)
    shader = bind_preview(stage, quad)
    reader = UsdShade.Shader.Define(stage, "/Material/Color")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
    shader.CreateInput("diffuseColor", COLOR).ConnectToSource(reader.ConnectableAPI(), "result")
    model, scene = read_model(stage)
    assert model.uses_display_color
    assert scene.warnings == []


def test_unknown_shaders_become_their_nearest_match(stage):
    shader = bind(stage, add_quad(stage, "/Quad"), "acme:paint", context="acme")
    shader.CreateInput("base_color", COLOR).Set(Gf.Vec3f(0.7, 0.6, 0.5))
    shader.CreateInput("specular_roughness", FLOAT).Set(0.25)
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.diffuse_color, [0.7, 0.6, 0.5], rtol=1e-6)
    assert model.roughness == pytest.approx(0.25)
    assert len(scene.warnings) == 1
    assert scene.warnings[0].startswith("/Material/Surface: the shader 'acme:paint'")


def test_a_binding_to_nothing_is_named(stage):
    quad = add_quad(stage, "/Quad")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).GetDirectBindingRel().SetTargets(["/Nowhere"])
    model, scene = read_model(stage)
    assert model.uses_display_color
    assert any(w.startswith("/Quad: is bound to </Nowhere>") for w in scene.warnings)


def test_a_texture_with_values_of_the_wrong_type_does_not_lose_the_mesh(stage, tmp_path):
    write_image(tmp_path / "t.png", np.full((1, 1, 3), 0.5))
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    wrong = {"scale": (Sdf.ValueTypeNames.String, "large")}
    connect_texture(stage, shader, "diffuseColor", COLOR, tmp_path / "t.png", **wrong)
    model, scene = read_model(stage)
    assert model.uses_display_color
    assert any(w.startswith("/Material: ") for w in scene.warnings)


def test_geom_subsets_split_the_mesh(stage):
    from usd_stages import add_mesh

    points = [(x, y, 0) for y in range(2) for x in range(4)]
    mesh = add_mesh(stage, "/Strip", points, [4, 4, 4], [0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6])
    bind_preview(stage, mesh, "/Base")
    left = UsdGeom.Subset.CreateGeomSubset(mesh, "left", "face", [0], "materialBind", "nonOverlapping")
    bind_preview(stage, left, "/Left")
    scene = load(stage)
    assert sorted(o.path for o in scene.objects) == ["/Strip", "/Strip/left"]
    by_path = {o.path: o for o in scene.objects}
    assert scene.materials[by_path["/Strip"].material].path == "/Base"
    assert scene.materials[by_path["/Strip/left"].material].path == "/Left"
    assert scene.mesh(by_path["/Strip"].mesh).area == pytest.approx(2.0)
    assert scene.mesh(by_path["/Strip/left"].mesh).positions[:, 0].max() == 1.0


def test_the_table_of_inputs_is_the_one_in_the_docs():
    from pathlib import Path

    docs = (Path(__file__).parents[2] / "docs" / "usd.md").read_text(encoding="utf-8")
    assert inputs_markdown() in docs, "regenerate the table in docs/usd.md with inputs_markdown()"
