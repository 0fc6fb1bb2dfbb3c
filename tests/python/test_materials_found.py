"""Materials as other programs write them: networks with interfaces, other renderers' shaders, broken bindings."""

import numpy as np
import pytest
from mtlx_documents import HEAD, fed, image, model_of, refer, surface, value
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade
from test_usd_materials import bind, bind_preview, connect_texture, read_model, write_image
from usd_stages import add_quad, load, new_stage

import frazil as fz

TYPES = Sdf.ValueTypeNames
COLOR, FLOAT, TOKEN = TYPES.Color3f, TYPES.Float, TYPES.Token
SRGB_HALF = 0.2140411  # what sRGB 0.5 is linearly


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


# -- networks


def test_colors_of_another_colour_space_become_linear(stage, tmp_path):
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    paint = UsdShade.Material(stage.GetPrimAtPath("/Material")).CreateInput("paint", COLOR)
    paint.Set(Gf.Vec3f(0.5))
    paint.GetAttr().SetColorSpace("srgb_texture")
    shader.CreateInput("diffuseColor", COLOR).ConnectToSource(paint)
    glow = shader.CreateInput("emissiveColor", COLOR)
    glow.Set(Gf.Vec3f(0.5))
    glow.GetAttr().SetColorSpace("lin_rec709")
    model, scene = read_model(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(model.diffuse_color, SRGB_HALF, rtol=1e-4)
    np.testing.assert_allclose(model.emissive_color, 0.5)
    glow.GetAttr().SetColorSpace("no_such_space")
    model, scene = read_model(stage)
    assert any(w.startswith("/Material/Surface.inputs:emissiveColor: colour space 'no_such") for w in scene.warnings)
    np.testing.assert_allclose(model.emissive_color, 0.5)


def test_colors_of_a_document_are_of_its_colour_space(stage, tmp_path):
    graph = f'<constant name="c" type="color3">{value("value", "color3", "0.5, 0.5, 0.5")}</constant>'
    inputs = fed("base_color", "color3", "c") + value("emission", "float", "1")
    inputs += value("emission_color", "color3", "0.5, 0.5, 0.5", 'colorspace="lin_rec709" ')
    head = HEAD.replace("lin_rec709", "srgb_texture")
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph), head=head)
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, SRGB_HALF, rtol=1e-4)
    np.testing.assert_allclose(model.emissive_color, 0.5)


def test_connections_that_lead_to_nothing_are_named_with_what_takes_their_place(stage):
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    graph = UsdShade.NodeGraph.Define(stage, "/Material/Graph")
    graph.CreateOutput("r", FLOAT)
    reader = UsdShade.Shader.Define(stage, "/Material/Reader")
    reader.CreateIdAttr("UsdPrimvarReader_float")
    shader.CreateInput("diffuseColor", COLOR).GetAttr().AddConnection("/Material/Gone.outputs:rgb")
    roughness = shader.CreateInput("roughness", FLOAT)
    roughness.Set(0.7)
    roughness.GetAttr().AddConnection("/Material/Graph.outputs:r")
    shader.CreateInput("metallic", FLOAT).GetAttr().AddConnection("/Material/Reader.outputs:r")
    model, scene = read_model(stage)
    assert model.roughness == pytest.approx(0.7)
    np.testing.assert_allclose(model.diffuse_color, 0.18, rtol=1e-6)
    said = sorted(w.removeprefix("/Material/Surface: ") for w in scene.warnings)
    assert said == [
        "diffuseColor is connected to </Material/Gone.outputs:rgb>, which gives no value. The default is used.",
        "metallic is connected to </Material/Reader.outputs:r>, which gives no value. The default is used.",
        "roughness is connected to </Material/Graph.outputs:r>, which gives no value. Its own value is used.",
    ]


def test_interfaces_of_nested_graphs_bring_files_values_and_images(stage, tmp_path):
    write_image(tmp_path / "t.1001.png", np.full((2, 2, 3), 0.5))
    text = """
def Material "M"
{
    color3f inputs:paint = (0.2, 0.4, 0.6)
    asset inputs:tex = @./t.<UDIM>.png@
    token outputs:mtlx:surface.connect = </M/Outer.outputs:surface>
    def NodeGraph "Outer"
    {
        color3f inputs:paint.connect = </M.inputs:paint>
        asset inputs:tex.connect = </M.inputs:tex>
        token outputs:surface.connect = </M/Outer/S.outputs:out>
        def Shader "S"
        {
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            color3f inputs:base_color.connect = </M/Outer/Inner.outputs:c>
            token outputs:out
        }
        def NodeGraph "Inner"
        {
            asset inputs:t.connect = </M/Outer.inputs:tex>
            color3f inputs:p.connect = </M/Outer.inputs:paint>
            color3f outputs:c.connect = </M/Outer/Inner/Product.outputs:out>
            def Shader "Product"
            {
                uniform token info:id = "ND_multiply_color3"
                color3f inputs:in1.connect = </M/Outer/Inner/Image.outputs:out>
                color3f inputs:in2.connect = </M/Outer/Inner.inputs:p>
                color3f outputs:out
            }
            def Shader "Image"
            {
                uniform token info:id = "ND_image_color3"
                asset inputs:file.connect = </M/Outer/Inner.inputs:t>
                color3f outputs:out
            }
        }
    }
}
"""
    layer = Sdf.Layer.CreateNew(str(tmp_path / "m.usda"))
    layer.ImportFromString(f"#usda 1.0\n{text}")
    layer.Save()
    stage.GetRootLayer().subLayerPaths.append("./m.usda")
    quad = add_quad(stage, "/Quad")
    UsdShade.MaterialBindingAPI.Apply(quad.GetPrim()).Bind(UsdShade.Material(stage.GetPrimAtPath("/M")))
    model, scene = read_model(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(model.diffuse_color.scale, [0.2, 0.4, 0.6], rtol=1e-6)


def test_normal_maps_that_cannot_be_meant_are_named(stage, tmp_path):
    write_image(tmp_path / "n.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    texture = connect_texture(stage, shader, "normal", TYPES.Normal3f, tmp_path / "n.png")
    said = read_model(stage)[1].warnings
    assert any("/Surface: normal reads an 8-bit image as it is" in w and "bias (-1, -1, -1, 0)" in w for w in said)
    assert any(
        "/Surface: normal reads an image that is decoded from sRGB. Set sourceColorSpace 'raw'" in w for w in said
    )
    texture.CreateInput("scale", TYPES.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
    texture.CreateInput("bias", TYPES.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))
    texture.CreateInput("sourceColorSpace", TOKEN).Set("raw")
    said = read_model(stage)[1].warnings
    assert not any("normal" in w for w in said), said


# -- documents


def test_graphs_are_fed_by_what_stands_beside_them(stage, tmp_path):
    graph = f"""
  <constant name="outer" type="float">{value("value", "float", "0.6")}</constant>
  <nodegraph name="NG">
    <input name="from_outside" type="float" nodename="outer" />
    <multiply name="half" type="float"><input name="in1" type="float" interfacename="from_outside" />
      {value("in2", "float", "0.5")}</multiply>
    <output name="out" type="float" nodename="half" />
  </nodegraph>"""
    inputs = '<input name="specular_roughness" type="float" nodegraph="NG" output="out" />'
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, graph))
    assert said == []
    assert model.roughness == pytest.approx(0.3)


INCLUDED = f"""<?xml version="1.0"?>
<materialx version="1.39" namespace="acme">
  <nodegraph name="G">{image("pic", "red.exr")}<output name="o" type="color3" nodename="pic" /></nodegraph>
  <standard_surface name="S" type="surfaceshader">
    <input name="base_color" type="color3" nodegraph="G" output="o" />
    <input name="coat" type="float" nodename="n" />
  </standard_surface>
  <constant name="n" type="float">{value("value", "float", "0.5")}</constant>
  <surfacematerial name="Ice" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" /></surfacematerial>
</materialx>"""


def test_included_documents_with_a_namespace_and_their_images_beside_them(tmp_path):
    (tmp_path / "library").mkdir()
    write_image(tmp_path / "library" / "red.exr", np.full((2, 2, 3), (0.5, 0.1, 0.1)))
    (tmp_path / "library" / "acme.mtlx").write_text(INCLUDED, encoding="utf-8")
    body = '<xi:include href="library/acme.mtlx" xmlns:xi="http://www.w3.org/2001/XInclude" />'
    look = '<look name="l"><materialassign name="a" material="acme:Ice" geom="/Other, /Quad" /></look>'
    stage = new_stage(tmp_path / "s.usda")
    model, said = refer(stage, tmp_path, body + look, name="acme_Ice")
    assert not any("image" in w or "left out" in w for w in said), said
    assert model.clearcoat == pytest.approx(0.5)
    np.testing.assert_allclose(model.diffuse_color.texture.texels[0, 0], (0.5, 0.1, 0.1), atol=5e-3)
    scene = load(stage, materials=tmp_path / "looks.mtlx")
    assert scene.materials[scene.objects[0].material].path.endswith("/acme_Ice")
    assert model_of(scene).clearcoat == pytest.approx(0.5)


def test_looks_by_prefix_list_and_included_collections_and_variants_are_named(tmp_path):
    body = surface("standard_surface", value("base_color", "color3", "1, 0, 0"))
    body += """
  <collection name="b" includegeom="/World/B" />
  <collection name="c" includegeom="/World/C" includecollection="b" excludegeom="/World/C/Not" />
  <variantset name="wet"><variant name="yes"><input name="coat" type="float" value="1" /></variant></variantset>
  <look name="day">
    <materialassign name="m1" material="Look" geomprefix="/World/" geom="A, D" />
    <materialassign name="m2" material="Look" collection="c" />
    <variantassign name="v" variantset="wet" variant="yes" />
  </look>"""
    stage = new_stage(tmp_path / "s.usda")
    UsdGeom.Xform.Define(stage, "/World")
    for name in ("A", "B", "C/In", "C/Not", "D", "E"):
        add_quad(stage, f"/World/{name}")
    stage.Save()
    (tmp_path / "looks.mtlx").write_text(f"{HEAD}{body}</materialx>\n", encoding="utf-8")
    scene = load(tmp_path / "s.usda", materials=tmp_path / "looks.mtlx")
    red = {o.path for o in scene.objects if not scene.materials[o.material].model.uses_display_color}
    assert red == {"/World/A", "/World/B", "/World/C/In", "/World/D"}
    assert any("day/v chooses a variant, which is not supported. It is left out." in w for w in scene.warnings)


# -- other renderers


def bind_foreign(stage, render_context, identifier="", asset="", **inputs):
    quad = add_quad(stage, "/Quad")
    shader = bind(stage, quad, identifier or "x", context=render_context)
    if asset:
        shader.GetIdAttr().Clear()
        shader.SetSourceAsset(asset, render_context)
    for name, (kind, given) in inputs.items():
        shader.CreateInput(name, kind).Set(given)
    return read_model(stage)


def test_arnolds_standard_surface_is_standard_surface(stage):
    model, scene = bind_foreign(
        stage,
        "arnold",
        "arnold:standard_surface",
        base=(FLOAT, 0.5),
        base_color=(COLOR, Gf.Vec3f(0.5, 0.6, 0.7)),
        emission=(FLOAT, 0.0),
        emission_color=(COLOR, Gf.Vec3f(1)),
    )
    assert scene.warnings == []
    np.testing.assert_allclose(model.diffuse_color, [0.25, 0.3, 0.35], rtol=1e-5)
    np.testing.assert_allclose(model.emissive_color, 0)


def test_what_omniverse_names_in_its_own_inputs(stage, tmp_path):
    write_image(tmp_path / "color.png", np.full((2, 2, 3), 0.5))
    write_image(tmp_path / "normal.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    model, scene = bind_foreign(
        stage,
        "mdl",
        asset="OmniPBR.mdl",
        diffuse_color_constant=(COLOR, Gf.Vec3f(0.8, 0.1, 0.2)),
        diffuse_texture=(TYPES.Asset, "./color.png"),
        normalmap_texture=(TYPES.Asset, "./normal.png"),
        reflection_roughness_constant=(FLOAT, 0.35),
        metallic_constant=(FLOAT, 0.25),
        enable_emission=(TYPES.Bool, False),
        emissive_color=(COLOR, Gf.Vec3f(1, 0.1, 0.1)),
        emissive_intensity=(FLOAT, 40.0),
        enable_opacity=(TYPES.Bool, False),
        opacity_constant=(FLOAT, 0.5),
    )
    assert scene.warnings == [
        "/Material/Surface: the shader 'OmniPBR.mdl' is not supported. "
        "Its nearest match in UsdPreviewSurface is rendered."
    ]
    np.testing.assert_allclose(model.diffuse_color.texture.texels, 0.2158605, rtol=1e-2)
    np.testing.assert_allclose([model.normal.scale, model.normal.bias], [[2] * 3, [-1] * 3])
    assert (model.roughness, model.metallic, model.opacity) == (pytest.approx(0.35), pytest.approx(0.25), 1.0)
    np.testing.assert_allclose(model.emissive_color, 0)


@pytest.mark.parametrize(
    ("identifier", "inputs", "glow"),
    [
        ("PxrSurface", {"diffuseColor": (0.3,) * 3, "glowColor": (1, 1, 1)}, 0),
        ("PxrSurface", {"diffuseColor": (0.3,) * 3, "glowColor": (1, 1, 1), "glowGain": 2.0}, 2),
        ("ND_gltf_pbr_surfaceshader", {"base_color": (0.3,) * 3, "emissive": (1,) * 3, "emissive_strength": 3.0}, 3),
        ("acme:paint", {"base_color": (0.3,) * 3, "emission_color": (1, 1, 1)}, 0),
        ("acme:paint", {"base_color": (0.3,) * 3, "emissive_color": (1, 1, 1)}, 1),
    ],
)
def test_light_of_other_shaders_counts_by_its_weight(stage, identifier, inputs, glow):
    given = {n: (COLOR, Gf.Vec3f(*v)) if isinstance(v, tuple) else (FLOAT, v) for n, v in inputs.items()}
    model, scene = bind_foreign(stage, "ri", identifier, **given)
    np.testing.assert_allclose(model.diffuse_color, 0.3, rtol=1e-6)
    np.testing.assert_allclose(model.emissive_color, glow)
    assert len(scene.warnings) == 1


def test_unlit_surfaces_shine_and_reflect_nothing(stage, tmp_path):
    inputs = value("emission", "float", "2") + value("emission_color", "color3", "1, 0.5, 0.25")
    model, said = refer(stage, tmp_path, surface("surface_unlit", inputs))
    assert said == []
    np.testing.assert_allclose(model.emissive_color, [2, 1, 0.5])
    np.testing.assert_allclose(model.diffuse_color, 0)
    assert model.ior == 1.0


@pytest.mark.parametrize(("share", "name", "color"), [(0.25, "bg", (0, 0, 1)), (0.75, "fg", (1, 0, 0))])
def test_of_a_mix_of_surfaces_the_larger_is_rendered(stage, tmp_path, share, name, color):
    more = f"""
  <standard_surface name="a" type="surfaceshader">{value("base_color", "color3", "1, 0, 0")}</standard_surface>
  <standard_surface name="b" type="surfaceshader">{value("base_color", "color3", "0, 0, 1")}</standard_surface>"""
    inputs = fed("fg", "surfaceshader", "a") + fed("bg", "surfaceshader", "b") + value("mix", "float", str(share))
    model, said = refer(stage, tmp_path, surface("mix", inputs, more))
    np.testing.assert_allclose(model.diffuse_color, color)
    (only,) = said
    assert f"mixes two surfaces, which is not supported. '{name}' is rendered" in only


# -- bindings


def test_a_binding_for_previews_alone_is_named(stage):
    quad = add_quad(stage, "/Quad")
    bind_preview(stage, quad)
    material = UsdShade.Material(stage.GetPrimAtPath("/Material"))
    api = UsdShade.MaterialBindingAPI(quad.GetPrim())
    api.UnbindAllBindings()
    api.Bind(material, materialPurpose="preview")
    model, scene = read_model(stage)
    assert model.uses_display_color
    assert any(w.startswith("/Quad: is bound to </Material> for the purpose 'preview' alone") for w in scene.warnings)
    api.Bind(material, materialPurpose="full")
    assert read_model(stage)[1].warnings == []


def test_a_broken_binding_of_a_parent_is_named(stage):
    parent = UsdGeom.Xform.Define(stage, "/World").GetPrim()
    add_quad(stage, "/World/Quad")
    UsdShade.MaterialBindingAPI.Apply(parent).GetDirectBindingRel().SetTargets(["/Nowhere"])
    _, scene = read_model(stage)
    assert any(w.startswith("/World/Quad: is bound to </Nowhere>, which is no material") for w in scene.warnings)


def test_bindings_by_collection_variant_instance_and_subset(tmp_path):
    asset = Usd.Stage.CreateNew(str(tmp_path / "asset.usda"))
    root = UsdGeom.Xform.Define(asset, "/Asset").GetPrim()
    asset.SetDefaultPrim(root)
    (tmp_path / "tex").mkdir()
    write_image(tmp_path / "tex" / "c.png", np.full((2, 2, 3), 0.5))
    shader = bind_preview(asset, add_quad(asset, "/Asset/Quad"), "/Asset/Look")
    connect_texture(asset, shader, "diffuseColor", COLOR, "./tex/c.png")
    asset.Save()
    stage = new_stage(tmp_path / "s.usda")
    for number in range(2):
        prim = UsdGeom.Xform.Define(stage, f"/I{number}").GetPrim()
        prim.GetReferences().AddReference("./asset.usda")
        prim.SetInstanceable(True)
    UsdGeom.Xform.Define(stage, "/Group")
    bind_preview(stage, add_quad(stage, "/Group/X"), "/Red").CreateInput("roughness", FLOAT).Set(0.1)
    bind_preview(stage, add_quad(stage, "/Group/Y"), "/Blue").CreateInput("roughness", FLOAT).Set(0.2)
    group = stage.GetPrimAtPath("/Group")
    collection = Usd.CollectionAPI.Apply(group, "hot")
    collection.IncludePath("/Group/X")
    UsdShade.MaterialBindingAPI.Apply(group).Bind(
        collection, UsdShade.Material(stage.GetPrimAtPath("/Blue")), "hot", UsdShade.Tokens.strongerThanDescendants
    )
    variant = UsdGeom.Xform.Define(stage, "/Variant").GetPrim()
    add_quad(stage, "/Variant/Quad")
    sets = variant.GetVariantSets().AddVariantSet("look")
    for name in ("Red", "Blue"):
        sets.AddVariant(name)
        sets.SetVariantSelection(name)
        with sets.GetVariantEditContext():
            UsdShade.MaterialBindingAPI.Apply(variant).Bind(UsdShade.Material(stage.GetPrimAtPath(f"/{name}")))
    sets.SetVariantSelection("Red")
    scene = load(stage)
    assert not [w for w in scene.warnings if "map1" not in w], scene.warnings
    of = {o.path: scene.materials[o.material] for o in scene.objects}
    assert of["/Group/X"].path == of["/Group/Y"].path == "/Blue"
    assert of["/Variant/Quad"].path == "/Red"
    instances = [of["/I0/Quad"], of["/I1/Quad"]]
    assert instances[0].path == instances[1].path
    np.testing.assert_allclose(instances[0].model.diffuse_color.texture.texels, 0.2158605, rtol=1e-2)


# -- what is no value at all


@pytest.mark.parametrize("kind", ["UsdPreviewSurface", "ND_standard_surface_surfaceshader", "frazil:ice", "acme:paint"])
def test_no_value_ends_the_reading_of_a_stage(stage, kind):
    shader = bind(stage, add_quad(stage, "/Quad"), kind)
    names = {
        "ND_standard_surface_surfaceshader": (
            "specular_roughness",
            "base_color",
            "metalness",
            "normal",
            "transmission",
        ),
        "frazil:ice": ("roughness", "tint", "eta", "normal", "mean_free_path"),
    }.get(kind, ("roughness", "diffuseColor", "metallic", "normal", "opacity"))
    given = [
        (TYPES.FloatArray, []),
        (TYPES.Asset, "./x.png"),
        (TYPES.Matrix4d, Gf.Matrix4d(1)),
        (TYPES.Float2, Gf.Vec2f(1)),
        (TYPES.String, "much"),
    ]
    for name, (type_name, wrong) in zip(names, given, strict=True):
        shader.CreateInput(name, type_name).Set(wrong)
    scene = load(stage)
    assert scene.materials[scene.objects[0].material].path == "/Material"
    assert len(scene.warnings) >= (1 if kind == "acme:paint" else 4), scene.warnings
    assert all(w.startswith("/Material") for w in scene.warnings)
    assert isinstance(model_of(scene), fz.IceMaterial if kind == "frazil:ice" else fz.StandardMaterial)
