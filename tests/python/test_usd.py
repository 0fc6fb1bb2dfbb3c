"""Stages: units, up axis, time, cameras, render settings, usdz."""

import subprocess
import sys
import warnings

import numpy as np
import OpenImageIO
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, UsdUtils
from usd_stages import add_quad, load, new_stage, world_positions

import frazil as fz


def test_units_and_up_axis_are_applied_once(tmp_path):
    stage = new_stage(tmp_path / "s.usda", up="Z", meters_per_unit=0.01)
    quad = add_quad(stage, "/Quad")
    quad.AddTranslateOp().Set(Gf.Vec3d(100, 200, 300))
    positions = world_positions(load(stage))
    # (x, y, z) cm, z up -> (x, z, -y) m
    expected = np.array([[1.0, 3.0, -2.0], [1.01, 3.0, -2.0], [1.01, 3.0, -2.01], [1.0, 3.0, -2.01]])
    np.testing.assert_allclose(positions, expected, atol=1e-6)


def test_units_of_a_sublayer_alone_are_named(tmp_path):
    below = new_stage(tmp_path / "below.usda", up="Z", meters_per_unit=1.0)
    add_quad(below, "/Quad")
    below.Save()
    above = Usd.Stage.CreateNew(str(tmp_path / "above.usda"))
    above.GetRootLayer().subLayerPaths.append("below.usda")
    above.Save()
    with pytest.warns(fz.FrazilWarning) as said:
        fz.load_usd(tmp_path / "above.usda")
    texts = [str(w.message) for w in said]
    for key, value, taken in (("metersPerUnit", "1.0", "0.01"), ("upAxis", "Z", "Y")):
        assert any(f"{key} must be authored in the root layer, got {value}" in t and f"as {taken}," in t for t in texts)
    UsdGeom.SetStageMetersPerUnit(above, 0.01)
    UsdGeom.SetStageUpAxis(above, "Y")
    above.Save()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fz.load_usd(tmp_path / "above.usda")


def test_camera_is_rigid_in_metres(tmp_path):
    stage = new_stage(tmp_path / "s.usda", up="Z", meters_per_unit=0.01)
    add_quad(stage, "/Quad")
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Camera"))
    camera.AddTransformOp().Set(Gf.Matrix4d(1).SetScale(2.0) * Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(0, -500, 0)))
    camera.CreateFocalLengthAttr(35.0)
    camera.CreateHorizontalApertureOffsetAttr(1.5)
    camera.CreateClippingRangeAttr(Gf.Vec2f(1, 1000))
    scene = load(stage)
    matrix = scene.camera.matrix
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(matrix[3, :3], [0, 0, 5.0], atol=1e-6)  # -y of the stage is +z of the world
    np.testing.assert_allclose(matrix[1, :3], [0, 0, -1], atol=1e-6)  # the camera's up is the stage's y
    assert scene.camera.focal_length == 35.0
    assert scene.camera.horizontal_offset == 1.5
    np.testing.assert_allclose(scene.camera.clipping, [0.02, 20.0], rtol=1e-6)
    assert scene.camera.path == "/Camera"


def test_orthographic_aperture_is_in_tenths_of_a_scene_unit(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    add_quad(stage, "/Quad")
    UsdGeom.Camera(stage.GetPrimAtPath("/Camera")).CreateProjectionAttr("orthographic")
    camera = load(stage).camera
    assert camera.is_orthographic
    assert camera.aperture_scale == pytest.approx(0.001)


def test_choice_of_camera(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    UsdGeom.Camera.Define(stage, "/Second")
    scene = load(stage)
    assert scene.camera.path == "/Camera"
    assert any("several cameras" in w and "/Second" in w for w in scene.warnings)
    assert load(stage, camera="/Second").camera.path == "/Second"
    assert load(stage, camera="Second").camera.path == "/Second"
    with pytest.raises(ValueError, match=r"/Third: camera must be a camera of .*: /Camera, /Second\."):
        load(stage, camera="/Third")
    with pytest.raises(ValueError, match="camera must be a camera"):
        load(stage, camera="not a path!")


def test_no_camera_frames_the_scene_and_no_light_gives_a_grey_dome(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "s.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    quad = add_quad(stage, "/Quad")
    quad.AddTranslateOp().Set(Gf.Vec3d(10, 20, 30))
    stage.Save()
    with pytest.warns(fz.FrazilWarning) as caught:
        scene = fz.load_usd(tmp_path / "s.usda")
    said = [str(w.message) for w in caught]
    assert said == scene.warnings
    assert any("has no camera" in s for s in said)
    assert any("has no lights" in s for s in said)
    assert len(scene.lights) == 1
    # Every corner lies in front of the camera, inside its picture.
    camera = scene.camera
    local = np.c_[world_positions(scene), np.ones(4)] @ np.linalg.inv(camera.matrix)
    assert (local[:, 2] < 0).all()
    assert (np.abs(local[:, 0] / local[:, 2]) < camera.horizontal_aperture / 2 / camera.focal_length).all()
    assert (np.abs(local[:, 1] / local[:, 2]) < camera.vertical_aperture / 2 / camera.focal_length).all()


def test_framing_fills_the_picture(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "s.usda"))
    UsdGeom.Sphere.Define(stage, "/Sphere").AddTranslateOp().Set(Gf.Vec3d(1e5, 0, 0))
    scene = load(stage)
    camera = scene.camera
    positions = world_positions(scene).astype(float)
    local = np.c_[positions, np.ones(len(positions))] @ np.linalg.inv(camera.matrix)
    y = -local[:, 1] / local[:, 2] * 2 * camera.focal_length / camera.vertical_aperture
    assert 0.85 < y.max() < 1
    assert -1 < y.min() < -0.85
    assert camera.clipping[0] < -local[:, 2].max()
    assert -local[:, 2].min() < camera.clipping[1]


def test_time_samples(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    quad = add_quad(stage, "/Quad")
    move = quad.AddTranslateOp()
    move.Set(Gf.Vec3d(0, 0, 0), 1.0)
    move.Set(Gf.Vec3d(10, 0, 0), 11.0)
    quad.GetVisibilityAttr().Set("inherited", 1.0)
    quad.GetVisibilityAttr().Set("invisible", 8.0)
    stage.SetStartTimeCode(3)
    stage.SetEndTimeCode(11)
    assert world_positions(load(stage))[0, 0] == pytest.approx(2.0)
    assert load(stage).frame == 3.0
    scene = load(stage, frame=6)
    assert world_positions(scene)[0, 0] == pytest.approx(5.0)
    assert scene.frame == 6.0
    assert len(load(stage, frame=9).objects) == 0
    with pytest.raises(ValueError, match="frame must be a finite number"):
        load(stage, frame=float("nan"))


def test_first_samples_are_read_where_there_is_no_time_range(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    quad = add_quad(stage, "/Quad")
    points = quad.GetPointsAttr().Get()
    quad.GetPointsAttr().Clear()
    quad.GetPointsAttr().Set(points, 24.0)
    scene = load(stage)
    assert len(scene.objects) == 1
    assert scene.frame is None


def test_visibility_and_purpose(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    UsdGeom.Xform.Define(stage, "/Hidden").MakeInvisible()
    add_quad(stage, "/Hidden/Quad")
    for purpose in ("default", "render", "proxy", "guide"):
        group = UsdGeom.Xform.Define(stage, f"/{purpose}")
        group.CreatePurposeAttr(purpose)
        add_quad(stage, f"/{purpose}/Quad")
    assert [o.path for o in load(stage).objects] == ["/default/Quad", "/render/Quad"]
    assert [o.path for o in load(stage, purposes=["proxy"]).objects] == ["/proxy/Quad"]
    with pytest.raises(ValueError, match="purposes must be of default"):
        load(stage, purposes=["beauty"])


def test_render_settings(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    UsdGeom.Camera.Define(stage, "/Second")
    settings = UsdRender.Settings.Define(stage, "/Render/Settings")
    settings.CreateResolutionAttr(Gf.Vec2i(640, 360))
    settings.CreatePixelAspectRatioAttr(2.0)
    settings.CreateCameraRel().SetTargets(["/Second"])
    product = UsdRender.Product.Define(stage, "/Render/Product")
    product.CreateProductNameAttr("beauty.exr")
    var = UsdRender.Var.Define(stage, "/Render/Vars/translucency")
    var.CreateSourceNameAttr("translucency")
    product.CreateOrderedVarsRel().SetTargets([var.GetPath()])
    settings.CreateProductsRel().SetTargets([product.GetPath()])
    stage.SetMetadata("renderSettingsPrimPath", "/Render/Settings")
    scene = load(stage)
    assert scene.camera.path == "/Second"
    assert scene.render_settings.resolution == (640, 360)
    assert scene.render_settings.pixel_aspect_ratio == 2.0
    (read,) = scene.render_settings.products
    assert (read.name, read.resolution, read.camera) == ("beauty.exr", (640, 360), "/Second")
    assert [v.source_name for v in read.vars] == ["translucency"]
    assert load(stage, camera="/Camera").camera.path == "/Camera"


def test_usdz_with_a_texture(tmp_path):
    import OpenImageIO as oiio
    from test_usd_materials import bind_preview, connect_texture

    image = oiio.ImageBuf(oiio.ImageSpec(2, 2, 3, oiio.UINT8))
    oiio.ImageBufAlgo.fill(image, (1.0, 0.0, 0.0))
    image.write(str(tmp_path / "red.png"))
    stage = new_stage(tmp_path / "s.usda")
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    connect_texture(stage, shader, "diffuseColor", Sdf.ValueTypeNames.Color3f, "./red.png")
    stage.Save()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "s.usda"), str(tmp_path / "s.usdz"))
    (tmp_path / "red.png").unlink()
    scene = load(tmp_path / "s.usdz")
    assert scene.warnings == []
    lookup = scene.materials[scene.objects[0].material].model.diffuse_color
    np.testing.assert_allclose(lookup.texture.texels[0, 0], [1, 0, 0], atol=1e-6)


def test_read_meshes_are_in_world_space(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    quad = add_quad(stage, "/Quad")
    quad.AddTransformOp().Set(Gf.Matrix4d(1).SetScale(Gf.Vec3d(-200, 100, 100)))  # mirrored
    stage.Save()
    ((path, mesh),) = fz.read_meshes(tmp_path / "s.usda")
    assert path == "/Quad"
    assert mesh.area == pytest.approx(2.0)
    a, b, c = mesh.positions[mesh.triangles[0]]
    assert np.cross(b - a, c - a)[2] > 0  # still faces +z


def test_unsupported_prims_are_named_once(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    for kind in ("BasisCurves", "Points", "NurbsPatch", "Volume", "Mystery"):
        stage.DefinePrim(f"/{kind}", kind)
    scene = load(stage)
    assert len(scene.objects) == 1
    for kind in ("BasisCurves", "Points", "NurbsPatch", "Volume", "Mystery"):
        assert len([w for w in scene.warnings if w.startswith(f"/{kind}: ")]) == 1, scene.warnings


def test_payloads_and_variants(tmp_path):
    model = new_stage(tmp_path / "model.usda")
    add_quad(model, "/Model/Small")
    model.SetDefaultPrim(model.GetPrimAtPath("/Model"))
    variants = model.GetPrimAtPath("/Model").GetVariantSets().AddVariantSet("size")
    for name, scale in (("small", 1.0), ("large", 3.0)):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with variants.GetVariantEditContext():
            UsdGeom.Xformable(model.GetPrimAtPath("/Model/Small")).AddScaleOp().Set(Gf.Vec3f(scale))
    model.Save()
    stage = new_stage(tmp_path / "s.usda")
    prim = stage.DefinePrim("/World")
    prim.GetPayloads().AddPayload("./model.usda")
    prim.GetVariantSets().GetVariantSet("size").SetVariantSelection("large")
    assert world_positions(load(stage)).max() == pytest.approx(3.0)


def test_reading_a_clean_stage_says_nothing(tmp_path, capfd):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    UsdLux.DistantLight.Define(stage, "/Sun")
    stage.Save()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = fz.load_usd(tmp_path / "s.usda")
    assert scene.warnings == []
    assert capfd.readouterr() == ("", "")


def test_the_same_scene_in_metres_and_centimetres_gives_the_same_picture(tmp_path):
    from test_usd_materials import bind

    pictures = []
    for name, unit in (("m", 1.0), ("cm", 0.01)):
        stage = new_stage(tmp_path / f"{name}.usda", meters_per_unit=unit)
        size = 1.0 / unit
        camera = UsdGeom.Camera(stage.GetPrimAtPath("/Camera"))
        camera.AddTranslateOp().Set(Gf.Vec3d(0, 0, 3 * size))
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.01 * size, 100 * size))
        camera.CreateFocalLengthAttr(20.0)
        sphere = UsdGeom.Sphere.Define(stage, "/Ice")
        sphere.CreateRadiusAttr(0.5 * size)
        shader = bind(stage, sphere, "frazil:ice")
        shader.CreateInput("albedo", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.6, 0.8, 0.9))
        shader.CreateInput("mean_free_path", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.05, 0.08, 0.1) * size)
        light = UsdLux.RectLight.Define(stage, "/Light")
        light.CreateWidthAttr(2 * size)
        light.CreateHeightAttr(size)
        light.CreateNormalizeAttr(True)
        light.CreateIntensityAttr(8)
        light.AddTranslateOp().Set(Gf.Vec3d(0, 0, 2 * size))
        pictures.append(fz.render(load(stage), resolution=(32, 18), samples=4).layers["translucency"])
    metres, centimetres = (np.asarray(picture) for picture in pictures)
    assert metres.max() > 0.1
    # Only rounding differs; points may fall elsewhere where a tie breaks the other way.
    assert abs(metres.mean() / centimetres.mean() - 1) < 0.01
    np.testing.assert_allclose(metres, centimetres, atol=0.05 * metres.max())


def test_render_settings_that_are_not_honoured_are_named(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    settings = UsdRender.Settings.Define(stage, "/Settings")
    settings.CreatePixelAspectRatioAttr(2.0)
    settings.CreateDataWindowNDCAttr(Gf.Vec4f(0, 0, 0.5, 1))
    settings.CreateIncludedPurposesAttr(["default", "proxy"])
    product = UsdRender.Product.Define(stage, "/Product")
    product.CreateProductNameAttr("beauty.exr")
    settings.CreateProductsRel().SetTargets(["/Product"])
    said = "\n".join(load(stage).warnings)
    for what in ("pixelAspectRatio 2", "dataWindowNDC", "asks for proxy", "/Product: productName"):
        assert what in said


def test_the_first_product_chooses_resolution_camera_and_layers(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Quad")
    for name in ("Wide", "Near"):
        UsdGeom.Camera.Define(stage, f"/{name}").AddTranslateOp().Set(Gf.Vec3d(0, 0, 5))
    settings = UsdRender.Settings.Define(stage, "/Settings")
    settings.CreateResolutionAttr(Gf.Vec2i(64, 32))
    settings.CreateCameraRel().SetTargets(["/Wide"])
    product = UsdRender.Product.Define(stage, "/Product")
    product.CreateResolutionAttr(Gf.Vec2i(20, 10))
    product.CreateCameraRel().SetTargets(["/Near"])
    for name, source in (("Color", "Ci"), ("Glow", "translucency"), ("Odd", "velvet")):
        UsdRender.Var.Define(stage, f"/Vars/{name}").CreateSourceNameAttr(source)
    product.CreateOrderedVarsRel().SetTargets(["/Vars/Color", "/Vars/Glow", "/Vars/Odd"])
    settings.CreateProductsRel().SetTargets(["/Product"])
    stage.Save()

    out = tmp_path / "s.exr"
    arguments = [tmp_path / "s.usda", "-o", out, "--samples", "1", "--quiet"]
    done = subprocess.run(
        [sys.executable, "-m", "frazil.cli", "render", *map(str, arguments)], capture_output=True, text=True
    )
    assert done.returncode == 0
    assert "frazil: warning: /Vars/Odd: sourceName 'velvet' is no layer." in done.stderr
    image = OpenImageIO.ImageBuf(str(out))
    assert (image.spec().width, image.spec().height) == (20, 10)
    assert image.spec().getattribute("frazil:camera") == "/Near"
    assert set(image.spec().channelnames) == {"R", "G", "B", "A", "translucency.R", "translucency.G", "translucency.B"}
