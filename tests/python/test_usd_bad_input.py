"""What cannot be read: an OSError with the path for files, a warning that names the prim; nothing else is lost."""

import numpy as np
import pytest
from pxr import Gf, UsdGeom
from usd_stages import COLORS, add_mesh, add_quad, load, new_stage, set_primvar

import frazil as fz


def test_missing_files(tmp_path):
    with pytest.raises(OSError, match=r"nowhere\.usda: no such file"):
        fz.load_usd(tmp_path / "nowhere.usda")
    with pytest.raises(OSError, match="is not a file"):
        fz.load_usd(tmp_path)
    with pytest.raises(OSError, match=r"nowhere\.usda: no such file"):
        fz.read_meshes(tmp_path / "nowhere.usda")


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd", ".usdz", ".txt", ".abc"])
@pytest.mark.parametrize(
    "content", [b"", b"hello", b'#usda 1.0\ndef Mesh "A" {', b"PXR-USDC", b"PK\x03\x04", bytes(200)]
)
def test_files_that_are_no_stage(tmp_path, suffix, content, capfd):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(OSError, match=f"bad{suffix}: ") as caught:
        fz.load_usd(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("fraction", [0.1, 0.5, 0.9, 0.99])
def test_truncated_crate_files(tmp_path, fraction):
    stage = new_stage(tmp_path / "whole.usdc")
    points = np.random.default_rng(0).random((300, 3))
    add_mesh(stage, "/Mesh", points, [3] * 100, np.arange(300))
    stage.Save()
    data = (tmp_path / "whole.usdc").read_bytes()
    path = tmp_path / f"cut{fraction}.usdc"
    path.write_bytes(data[: int(len(data) * fraction)])
    with pytest.raises(OSError, match="is not a readable USD file"):
        fz.load_usd(path)


@pytest.fixture
def stage(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    add_quad(stage, "/Good")
    return stage


def check_left_out(stage, said, prim="/Bad"):
    scene = load(stage)
    assert [o.path for o in scene.objects] == ["/Good"]
    assert any(w.startswith(f"{prim}: ") and said in w for w in scene.warnings), scene.warnings


SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
@pytest.mark.parametrize(
    ("points", "counts", "indices", "said"),
    [
        (SQUARE, [4], [0, 1, 2, 4], "faceVertexIndices must be in 0..3, got 4"),
        (SQUARE, [4], [0, 1, 2, -1], "faceVertexIndices must be in 0..3, got -1"),
        (SQUARE, [4], [0, 1, 2], "faceVertexIndices must have 4 entries"),
        (SQUARE, [3], [0, 1, 2, 3], "faceVertexIndices must have 3 entries"),
        (SQUARE, [-4], [], "faceVertexCounts must be >= 0"),
        (SQUARE, [], [], "is a mesh without faces"),
        ([], [], [], "is a mesh without points"),
        (SQUARE, [2, 2], [0, 1, 2, 3], "fewer than 3 corners"),
        ([(0, 0, 0), (1, 0, float("nan")), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3], "points must be finite"),
        ([(0, 0, 0), (1, 0, float("inf")), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3], "points must be finite"),
        ([(0, 0, 0), (1, 0, 1e30), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3], "points must be within"),
    ],
)
def test_broken_meshes_are_left_out(stage, scheme, points, counts, indices, said):
    add_mesh(stage, "/Bad", points, counts, indices, scheme)
    check_left_out(stage, said)


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_faces_without_area_are_kept(stage, scheme):
    add_mesh(stage, "/Thin", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [3, 3], [0, 1, 2, 0, 0, 1], scheme)
    scene = load(stage)
    assert "/Thin" in [o.path for o in scene.objects]
    for mesh in scene.meshes:
        assert mesh.normals is None or np.isfinite(mesh.normals).all()


def test_broken_creases_are_named(stage):
    mesh = add_mesh(stage, "/Bad", SQUARE, [4], [0, 1, 2, 3], "catmullClark")
    mesh.CreateCreaseIndicesAttr([0, 1])
    mesh.CreateCreaseLengthsAttr([3])
    mesh.CreateCreaseSharpnessesAttr([1.0])
    check_left_out(stage, "creaseIndices must have 3 entries")
    mesh.GetCreaseLengthsAttr().Set([2])
    mesh.GetCreaseSharpnessesAttr().Set([float("nan")])
    check_left_out(stage, "sharpness must be >= 0")
    mesh.GetCreaseSharpnessesAttr().Set([1.0])
    mesh.GetCreaseIndicesAttr().Set([0, 9])
    check_left_out(stage, "creaseIndices must be in 0..3, got 9")


@pytest.mark.parametrize(
    "matrix",
    [
        Gf.Matrix4d(1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1),
        Gf.Matrix4d(float("nan")),
        Gf.Matrix4d(1).SetScale(1e-14),
        Gf.Matrix4d(1).SetScale(1e14),
        Gf.Matrix4d(1).SetTranslate(Gf.Vec3d(1e39, 0, 0)),
        Gf.Matrix4d(1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1),
    ],
)
def test_singular_transforms(stage, matrix):
    add_quad(stage, "/Bad").AddTransformOp().Set(matrix)
    check_left_out(stage, "its transform cannot be inverted")


@pytest.mark.parametrize(
    ("kind", "name"), [("Sphere", "radius"), ("Cube", "size"), ("Cone", "height"), ("Plane", "width")]
)
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_shapes_without_a_size(stage, kind, name, value):
    stage.DefinePrim("/Bad", kind).GetAttribute(name).Set(value)
    check_left_out(stage, f"{name} must be > 0")


def test_primvars_that_do_not_fit_are_left_out_alone(stage):
    quad = add_quad(stage, "/Quad")
    set_primvar(quad, "displayColor", COLORS, "vertex", [Gf.Vec3f(1)] * 3)
    quad.CreateNormalsAttr([Gf.Vec3f(0)] * 4)
    scene = load(stage)
    assert len(scene.objects) == 2
    assert scene.mesh(1).colors is None
    assert scene.mesh(1).normals is None
    assert any("displayColor (vertex) must have 4 values, got 3" in w for w in scene.warnings)
    assert any("normals must have a length" in w for w in scene.warnings)


def test_subset_indices_out_of_range(stage):
    quad = add_quad(stage, "/Quad")
    UsdGeom.Subset.CreateGeomSubset(quad, "part", "face", [0, 5, -2], "materialBind", "nonOverlapping")
    scene = load(stage)
    assert "/Quad/part" in [o.path for o in scene.objects]
    assert any(w.startswith("/Quad/part: indices must be in 0..0, got 5") for w in scene.warnings)


def test_broken_references_are_named_and_the_rest_is_read(stage, capfd):
    stage.DefinePrim("/Lost").GetReferences().AddReference("./nowhere.usda")
    stage.DefinePrim("/LostPayload").GetPayloads().AddPayload("./nowhere_either.usda")
    capfd.readouterr()  # what USD said while the stage was made
    scene = load(stage)
    assert [o.path for o in scene.objects] == ["/Good"]
    assert any(w.startswith("/Lost: ") and "nowhere.usda" in w for w in scene.warnings), scene.warnings
    assert any(w.startswith("/LostPayload: ") and "nowhere_either.usda" in w for w in scene.warnings)
    assert not any("0x" in w or "\n" in w for w in scene.warnings)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_meters_per_unit_out_of_range(stage, value):
    stage.SetMetadata("metersPerUnit", value)
    scene = load(stage)
    assert any("metersPerUnit must be > 0" in w for w in scene.warnings)
    assert scene.objects[0].matrix[0, 0] == 1.0


def test_cameras_out_of_range(stage):
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Camera"))
    camera.CreateFocalLengthAttr(0.0)
    camera.CreateHorizontalApertureAttr(float("nan"))
    camera.CreateClippingRangeAttr(Gf.Vec2f(5, 1))
    scene = load(stage)
    assert scene.camera.focal_length == 50.0
    assert scene.camera.horizontal_aperture == pytest.approx(20.955)
    assert scene.camera.clipping[0] < scene.camera.clipping[1]
    assert len([w for w in scene.warnings if w.startswith("/Camera: ")]) == 3
    camera.AddScaleOp().Set(Gf.Vec3f(0))
    assert load(stage).camera.path == "/framing_camera"


def test_a_stage_without_geometry(tmp_path):
    scene = load(new_stage(tmp_path / "s.usda"))
    assert len(scene.objects) == 0
    assert any("has no geometry" in w for w in scene.warnings)


def test_settings_that_name_nothing(stage):
    from pxr import UsdRender

    settings = UsdRender.Settings.Define(stage, "/Render")
    settings.CreateResolutionAttr(Gf.Vec2i(0, 10))
    settings.CreateCameraRel().SetTargets(["/NoCamera"])
    settings.CreateProductsRel().SetTargets(["/NoProduct"])
    scene = load(stage)
    assert scene.camera.path == "/Camera"
    assert scene.render_settings.resolution is None
    for word in ("resolution must be at least 1x1", "/NoCamera: is named by the render settings", "/NoProduct"):
        assert any(word in w for w in scene.warnings)


def test_wrong_types_of_attributes(tmp_path):
    prims = {
        'Camera "Camera"': ['string focalLength = "long"'],
        'DomeLight "Dome"': ["color3f[] inputs:color = [(1, 1, 1)]", 'string inputs:intensity = "strong"'],
        'Mesh "Bad"': ['string points = "many"', "double faceVertexCounts = 3"],
        'Sphere "Sphere"': ['token radius = "wide"'],
        'Cube "Good"': ['string visibility = "invisible?"', "float3 primvars:displayColor = (1, 0, 0)"],
    }
    text = "#usda 1.0\n(\n metersPerUnit = 1\n)\n"
    for prim, lines in prims.items():
        text += "def " + prim + "\n{\n" + "\n".join(lines) + "\n}\n"
    (tmp_path / "s.usda").write_text(text)
    scene = load(tmp_path / "s.usda")
    assert "/Good" in [o.path for o in scene.objects]
    assert "/Bad" not in [o.path for o in scene.objects]
    assert any(w.startswith("/Bad: ") for w in scene.warnings)
