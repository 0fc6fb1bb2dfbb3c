"""Bump and normal maps: the shading normal is that of the height's slope, however the image is laid on."""

import warnings

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdShade
from test_usd_materials import bind, write_image
from usd_stages import TEXCOORDS, add_quad, new_stage, set_primvar

import frazil as fz

TEXELS = 128
HEIGHT = 0.03  # in scene units; over one repeat of st
FLOAT, FLOAT2, ASSET = Sdf.ValueTypeNames.Float, Sdf.ValueTypeNames.Float2, Sdf.ValueTypeNames.Asset
VECTOR = Sdf.ValueTypeNames.Float3


def height(st):
    """Hills and hollows, steeper along s; st (..., 2)."""
    s, t = np.moveaxis(2 * np.pi * st, -1, 0)
    return HEIGHT * (0.5 + 0.35 * np.sin(s) + 0.15 * np.cos(t + 0.7))


def slope(st):
    """Of height, over s and t."""
    s, t = np.moveaxis(2 * np.pi * st, -1, 0)
    return 2 * np.pi * HEIGHT * np.stack([0.35 * np.cos(s), -0.15 * np.sin(t + 0.7)], axis=-1)


def texel_places():
    at = (np.arange(TEXELS) + 0.5) / TEXELS
    s, t = np.meshgrid(at, at[::-1])  # rows go down, t goes up
    return np.stack([s, t], axis=-1)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def texture(stage, shader, name, kind, file, node="ND_image_float", is_placed=False):
    """An image that feeds an input, laid on by the texture coordinates, or by PLACED."""
    image = UsdShade.Shader.Define(stage, f"/Material/Image_{name}")
    image.CreateIdAttr(node)
    image.CreateInput("file", ASSET).Set(str(file))
    is_usd = node == "UsdUVTexture"
    if is_placed:
        place = UsdShade.Shader.Define(stage, "/Material/Place")
        place.CreateIdAttr("ND_place2d_vector2")
        place.CreateInput("scale", FLOAT2).Set(Gf.Vec2f(0.5, 0.25))
        place.CreateInput("rotate", FLOAT).Set(90.0)
        image.CreateInput("texcoord", FLOAT2).ConnectToSource(place.ConnectableAPI(), "out")
    if is_usd:
        image.CreateInput("wrapS", Sdf.ValueTypeNames.Token).Set("repeat")
        image.CreateInput("wrapT", Sdf.ValueTypeNames.Token).Set("repeat")
    shader.CreateInput(name, kind).ConnectToSource(image.ConnectableAPI(), "rgb" if is_usd else "out")
    return image


def by_ice_bump(stage, quad, tmp_path, is_placed=False):
    """frazil:ice by a height in scene units: slopes per metre."""
    write_image(tmp_path / "h.exr", height(texel_places())[..., None], oiio.FLOAT)
    shader = bind(stage, quad, "frazil:ice")
    texture(stage, shader, "bump", FLOAT, tmp_path / "h.exr", is_placed=is_placed)


def by_materialx_bump(model, normal):
    """A MaterialX bump node: slopes over st, times scale / 16."""

    def author(stage, quad, tmp_path, is_placed=False):
        write_image(tmp_path / "h.exr", height(texel_places())[..., None], oiio.FLOAT)
        shader = bind(stage, quad, model, context="mtlx")
        bump = UsdShade.Shader.Define(stage, "/Material/Bump")
        bump.CreateIdAttr("ND_bump_vector3")
        bump.CreateInput("scale", FLOAT).Set(4.0 * 16.0)
        texture(stage, bump, "height", FLOAT, tmp_path / "h.exr", is_placed=is_placed)
        shader.CreateInput(normal, VECTOR).ConnectToSource(bump.ConnectableAPI(), "out")

    return author


def by_height_to_normal(stage, quad, tmp_path, is_placed=False):
    """heighttonormal and then normalmap."""
    write_image(tmp_path / "h.exr", height(texel_places())[..., None], oiio.FLOAT)
    shader = bind(stage, quad, "ND_standard_surface_surfaceshader", context="mtlx")
    encoded, decoded = (UsdShade.Shader.Define(stage, f"/Material/{n}") for n in ("Encoded", "Decoded"))
    encoded.CreateIdAttr("ND_heighttonormal_vector3")
    encoded.CreateInput("scale", FLOAT).Set(16.0)
    decoded.CreateIdAttr("ND_normalmap_float")
    decoded.CreateInput("scale", FLOAT).Set(4.0)
    texture(stage, encoded, "in", FLOAT, tmp_path / "h.exr", is_placed=is_placed)
    decoded.CreateInput("in", VECTOR).ConnectToSource(encoded.ConnectableAPI(), "out")
    shader.CreateInput("normal", VECTOR).ConnectToSource(decoded.ConnectableAPI(), "out")


def by_preview_normal(stage, quad, tmp_path, is_placed=False):
    """UsdPreviewSurface by an image of normals of slopes over st, four times as steep."""
    n = unit(np.concatenate([-4.0 * slope(texel_places()), np.ones((TEXELS, TEXELS, 1))], axis=-1))
    write_image(tmp_path / "n.exr", n * 0.5 + 0.5, oiio.FLOAT)
    shader = bind(stage, quad, "UsdPreviewSurface")
    image = texture(stage, shader, "normal", Sdf.ValueTypeNames.Normal3f, tmp_path / "n.exr", "UsdUVTexture", is_placed)
    image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(2, 2, 2, 1))
    image.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(-1, -1, -1, 0))


LANGUAGES = {
    "frazil_bump": by_ice_bump,
    "standard_surface_bump": by_materialx_bump("ND_standard_surface_surfaceshader", "normal"),
    "open_pbr_bump": by_materialx_bump("ND_open_pbr_surface_surfaceshader", "geometry_normal"),
    "height_to_normal": by_height_to_normal,
    "preview_normal": by_preview_normal,
}

# Texture coordinates at the corners (0, 0), (1, 0), (1, 1), (0, 1) of the quad.
PLAIN = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
LAYOUTS = {
    "plain": PLAIN,
    "mirrored": PLAIN * [-1, 1] + [1, 0],
    "turned": PLAIN[:, ::-1] * [1, -1],
    "upside_down": PLAIN * [1, -1],
    "twice": PLAIN * 2,
}
# Matrices for row vectors: a scale, a turn, a mirror.
TURN = np.array([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]])
SHAPES = {"plain": np.eye(3), "large": 3 * np.eye(3), "turned": TURN, "mirrored": np.diag([-1.0, 1, 1])}


# place2d by a scale of (0.5, 0.25) and a quarter turn: (s, t) -> (4 t, -2 s).
PLACED = np.array([[0.0, -2.0], [4.0, 0.0]])


def rendered_normals(stage, unit_size=1.0):
    """Shading normals and places of the quad, (N, 3) each, in world space."""
    stage.Save()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fz.FrazilWarning)
        scene = fz.load_usd(stage.GetRootLayer().realPath)
        film = fz.render(scene, resolution=(56, 56), samples=1, aovs=["N", "P"], spacing=0.2 * unit_size)
    assert scene.warnings == []
    seen = np.linalg.norm(film["N"], axis=-1) > 0.9
    return film["N"][seen], film["P"][seen]


def expected_normals(language, places, corners, matrix, is_left_handed, unit_size, placed):
    """What the height's slope makes of the quad's normal at places of the world."""
    local = places / unit_size @ np.linalg.inv(matrix)
    st_of_xy = np.array([corners[1] - corners[0], corners[3] - corners[0]])
    st = local[:, :2] @ st_of_xy + corners[0]
    along = np.linalg.inv(np.concatenate([st_of_xy, np.zeros((2, 1))], axis=1)[:, :2])  # xy per st
    directions = np.concatenate([along, np.zeros((2, 1))], axis=1) @ matrix  # where s and t grow, scene units
    side = -1.0 if is_left_handed else 1.0
    outer = unit(np.array([0, 0, side]) @ np.linalg.inv(matrix).T)
    over_st = slope(st @ placed) @ placed.T
    if language == "frazil_bump":
        lengths = np.linalg.norm(directions, axis=1)
        rise = over_st / lengths  # per scene unit along them
    else:
        rise = 4.0 * over_st
    return unit(outer - rise @ unit(directions))


def check(
    tmp_path, language, layout="plain", shape="plain", is_left_handed=False, meters_per_unit=1.0, is_placed=False
):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=meters_per_unit)
    quad, matrix, corners = add_quad(stage, "/Quad"), SHAPES[shape], LAYOUTS[layout]
    set_primvar(quad, "st", TEXCOORDS, "vertex", [Gf.Vec2f(*map(float, c)) for c in corners])
    if is_left_handed:
        quad.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    whole = np.eye(4)
    whole[:3, :3] = matrix
    quad.AddTransformOp().Set(Gf.Matrix4d(whole.tolist()))
    LANGUAGES[language](stage, quad, tmp_path, is_placed)
    # Seen from its outer side: a camera above or below.
    middle = np.array([0.5, 0.5, 0.0]) @ matrix
    size = abs(matrix[0]).max()
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Camera"))
    camera.AddTranslateOp().Set(Gf.Vec3d(*middle[:2].tolist(), -4.0 * size if is_left_handed else 4.0 * size))
    if is_left_handed:
        camera.AddRotateYOp().Set(180.0)
    camera.CreateFocalLengthAttr(90.0)
    normals, places = rendered_normals(stage, meters_per_unit)
    assert len(normals) > 800
    placed = PLACED if is_placed else np.eye(2)
    expected = expected_normals(language, places, corners, matrix, is_left_handed, meters_per_unit, placed)
    tilt = np.linalg.norm(np.cross(expected, [0, 0, 1]), axis=-1)
    assert tilt.max() > 0.02
    off = np.degrees(np.arccos(np.clip(np.sum(unit(normals) * expected, axis=-1), -1, 1)))
    assert np.sqrt(np.mean(off**2)) < 0.04 * np.degrees(np.sqrt(np.mean(tilt**2)))
    return off


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_normals_follow_the_slope_however_st_lies(tmp_path, language, layout):
    check(tmp_path, language, layout)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("shape", [name for name in SHAPES if name != "plain"])
def test_normals_follow_the_slope_under_transforms(tmp_path, language, shape):
    check(tmp_path, language, shape=shape)


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize("layout", ["plain", "mirrored"])
def test_normals_of_left_handed_meshes_follow_the_slope(tmp_path, language, layout):
    check(tmp_path, language, layout, is_left_handed=True)


@pytest.mark.parametrize("language", [name for name in LANGUAGES if name != "preview_normal"])
def test_slopes_are_over_the_surface_not_the_image(tmp_path, language):
    check(tmp_path, language, is_placed=True)


def test_a_bump_of_frazil_ice_is_in_scene_units(tmp_path):
    check(tmp_path, "frazil_bump", meters_per_unit=0.01)
