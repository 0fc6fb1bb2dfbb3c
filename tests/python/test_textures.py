"""Texture files: UDIM sets, colour spaces, memory, projection, and what becomes of missing and broken ones."""

import zipfile

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf
from test_usd_materials import COLOR, FLOAT, TOKEN, bind, bind_preview, connect_texture, read_model, write_image
from usd_stages import TEXCOORDS, add_quad, load, new_stage, set_primvar

import frazil as fz
from frazil.usd import textures


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


def emissive_quad(stage, tmp_path, file, **inputs):
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    texture = connect_texture(stage, shader, "emissiveColor", COLOR, file, **inputs)
    return shader, texture


def test_udim_tiles_are_found_beside_one_another(stage, tmp_path):
    for number, level in ((1001, 0.25), (1002, 0.5), (1012, 0.75)):
        write_image(tmp_path / f"t.{number}.exr", np.full((2, 2, 3), level), oiio.FLOAT)
    write_image(tmp_path / "t.0999.exr", np.full((2, 2, 3), 9.0), oiio.FLOAT)
    write_image(tmp_path / "t.10011.exr", np.full((2, 2, 3), 9.0), oiio.FLOAT)
    emissive_quad(stage, tmp_path, "./t.<UDIM>.exr")
    model, scene = read_model(stage)
    assert scene.warnings == []
    assert model.emissive_color.texture.tiles == [1001, 1002, 1012]


def test_udim_tiles_in_a_package(stage, tmp_path):
    for number, level in ((1001, 0.25), (1002, 0.5)):
        write_image(tmp_path / f"t.{number}.exr", np.full((2, 2, 3), level), oiio.FLOAT)
    emissive_quad(stage, tmp_path, "./t.<UDIM>.exr")
    stage.Save()
    package = tmp_path / "s.usdz"
    with zipfile.ZipFile(package, "w", zipfile.ZIP_STORED) as archive:
        for name in ("s.usda", "t.1001.exr", "t.1002.exr"):
            archive.write(tmp_path / name, name)
    scene = load(package)
    assert scene.materials[0].model.emissive_color.texture.tiles == [1001, 1002]


def test_an_image_is_rendered_where_its_tiles_lie(stage, tmp_path):
    """Four tiles over a square, seen from in front: each quarter shows its own, the missing one its fallback."""
    for number, level in ((1001, 0.1), (1002, 0.2), (1011, 0.3)):
        write_image(tmp_path / f"t.{number}.exr", np.full((4, 4, 3), level), oiio.FLOAT)
    quad = add_quad(stage, "/Quad")
    set_primvar(quad, "st", TEXCOORDS, "vertex", [Gf.Vec2f(*p) for p in ((0, 0), (2, 0), (2, 2), (0, 2))])
    shader = bind_preview(stage, quad)
    shader.CreateInput("diffuseColor", COLOR).Set(Gf.Vec3f(0))
    fallback = {"fallback": (Sdf.ValueTypeNames.Float4, Gf.Vec4f(0.9, 0.9, 0.9, 1))}
    texture = connect_texture(stage, shader, "emissiveColor", COLOR, "./t.<UDIM>.exr", **fallback)
    texture.GetInput("st").ClearSources()
    scene = load(stage)
    matrix = np.eye(4)
    matrix[3, :3] = 0.5, 0.5, 3.0
    scene.camera = fz.Camera(matrix=matrix, focal_length=60, horizontal_aperture=20, vertical_aperture=20)
    film = fz.render(scene, resolution=(16, 16), samples=4, threads=1)
    seen = np.asarray(film.layers["emission"])[..., 0]
    np.testing.assert_allclose(seen[12, [4, 12]], [0.1, 0.2], rtol=1e-3)
    np.testing.assert_allclose(seen[4, [4, 12]], [0.3, 0.9], rtol=1e-3)


def test_a_large_image_is_kept_as_finely_as_it_is_seen(stage, tmp_path, monkeypatch):
    monkeypatch.setattr(textures, "SMALL_IMAGE", 256 * 256)
    pixels = np.random.default_rng(3).random((512, 512, 3)).astype(np.float32)
    write_image(tmp_path / "t.exr", pixels, oiio.HALF)
    quad = add_quad(stage, "/Quad")
    set_primvar(quad, "st", TEXCOORDS, "vertex", [Gf.Vec2f(*p) for p in ((0, 0), (1, 0), (1, 1), (0, 1))])
    shader = bind_preview(stage, quad)
    shader.CreateInput("diffuseColor", COLOR).Set(Gf.Vec3f(0))
    texture = connect_texture(stage, shader, "emissiveColor", COLOR, "./t.exr")
    texture.GetInput("st").ClearSources()

    def memory_after(distance):
        scene = load(stage)
        image = scene.materials[0].model.emissive_color.texture
        assert image.texels is None
        matrix = np.eye(4)
        matrix[3, :3] = 0.5, 0.5, distance
        scene.camera = fz.Camera(matrix=matrix, focal_length=60, horizontal_aperture=20, vertical_aperture=20)
        before = image.memory()
        film = fz.render(scene, resolution=(32, 32), samples=4, threads=2)
        return before, image.memory(), np.asarray(film.layers["emission"])[8:24, 8:24].mean()

    whole = 512 * 512 * 3 * 4 * 4 / 3
    before, far, far_mean = memory_after(3.0)
    assert before < whole / 50
    assert far < whole / 50  # 32 pixels see no more than 64 texels
    _, near, _ = memory_after(0.1)
    assert near == pytest.approx(whole, rel=0.01)
    assert far_mean == pytest.approx(0.5, rel=0.01)


def test_a_file_that_goes_during_a_render_leaves_the_coarse_copy(tmp_path, monkeypatch, stage):
    monkeypatch.setattr(textures, "SMALL_IMAGE", 64)
    write_image(tmp_path / "t.exr", np.full((256, 256, 3), 0.5), oiio.FLOAT)
    emissive_quad(stage, tmp_path, "./t.exr")
    scene = load(stage)
    (tmp_path / "t.exr").unlink()
    matrix = np.eye(4)
    matrix[3, :3] = 0.5, 0.5, 0.05
    scene.camera = fz.Camera(matrix=matrix, focal_length=60, horizontal_aperture=20, vertical_aperture=20)
    with pytest.warns(fz.FrazilWarning, match="rendered as coarsely"):
        film = fz.render(scene, resolution=(8, 8), samples=1, threads=1)
    assert np.asarray(film.layers["emission"])[4, 4, 0] == pytest.approx(0.5, rel=1e-3)


def test_content_tells_large_images_apart(stage, tmp_path, monkeypatch):
    from frazil.content import scene_hash

    monkeypatch.setattr(textures, "SMALL_IMAGE", 64)
    emissive_quad(stage, tmp_path, "./t.exr")
    hashes = []
    for level in (0.5, 0.6, 0.5):
        write_image(tmp_path / "t.exr", np.full((16, 16, 3), level), oiio.FLOAT)
        oiio.ImageCache(True).invalidate_all(True)
        hashes.append(scene_hash(load(stage)))
    assert hashes[0] == hashes[2] != hashes[1]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("acescg", (0.7198412, 0.16197792, 0.07750176)),
        ("lin_displayp3", (0.56748205, 0.1873829, 0.08428138)),
        ("srgb_texture", (0.21404114, 0.03310477, 0.01002283)),
        ("lin_rec709", (0.5, 0.2, 0.1)),
    ],
)
def test_colour_spaces_by_metadata_and_by_name(stage, tmp_path, name, expected):
    write_image(tmp_path / "t.exr", np.array([[[0.5, 0.2, 0.1]]]), oiio.FLOAT)
    _, texture = emissive_quad(stage, tmp_path, "./t.exr")
    texture.GetInput("file").GetAttr().SetColorSpace(name)
    model, scene = read_model(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(model.emissive_color.texture.texels[0, 0], expected, rtol=1e-3)
    texture.CreateInput("sourceColorSpace", TOKEN).Set("raw")  # the node's own word is stronger
    np.testing.assert_allclose(read_model(stage)[0].emissive_color.texture.texels[0, 0], (0.5, 0.2, 0.1), rtol=1e-6)


def test_an_unknown_colour_space_is_named_and_taken_as_raw(stage, tmp_path):
    write_image(tmp_path / "t.exr", np.full((1, 1, 3), 0.5), oiio.FLOAT)
    _, texture = emissive_quad(stage, tmp_path, "./t.exr")
    texture.GetInput("file").GetAttr().SetColorSpace("fantasy")
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.emissive_color.texture.texels, 0.5)
    (said,) = scene.warnings
    assert said.startswith("/Material/Texture_emissiveColor: ")
    assert "'fantasy' is not known" in said
    assert "taken as raw" in said


def test_an_image_without_texture_coordinates_is_projected(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    write_image(tmp_path / "t.exr", np.full((2, 2, 3), 0.5), oiio.FLOAT)
    size = {"frazil:triplanarSize": (FLOAT, 25.0)}
    emissive_quad(stage, tmp_path, "./t.exr", **size)
    model, scene = read_model(stage)
    assert scene.mesh(0).uvs is None
    assert model.emissive_color.triplanar_size == pytest.approx(0.25)
    assert not model.emissive_color.is_triplanar
    matrix = np.eye(4)
    matrix[3, :3] = 0.005, 0.005, 0.03
    scene.camera = fz.Camera(matrix=matrix, focal_length=60, horizontal_aperture=20, vertical_aperture=20)
    film = fz.render(scene, resolution=(8, 8), samples=1, threads=1)
    assert np.asarray(film.layers["emission"]).max() == pytest.approx(0.5, rel=1e-3)


def test_one_image_for_two_inputs_is_kept_once(stage, tmp_path):
    write_image(tmp_path / "orm.png", np.random.default_rng(0).random((4, 4, 3)))
    shader = bind_preview(stage, add_quad(stage, "/Quad"))
    raw = {"sourceColorSpace": (TOKEN, "raw")}
    connect_texture(stage, shader, "roughness", FLOAT, "./orm.png", "g", **raw)
    connect_texture(stage, shader, "metallic", FLOAT, "./orm.png", "b", **raw)
    model, _ = read_model(stage)
    assert model.roughness.texture is model.metallic.texture or np.shares_memory(
        model.roughness.texture.texels, model.metallic.texture.texels
    )


def test_chains_of_transforms_are_one(stage, tmp_path):
    from pxr import UsdShade

    write_image(tmp_path / "t.exr", np.full((1, 1, 3), 0.5), oiio.FLOAT)
    _, texture = emissive_quad(stage, tmp_path, "./t.exr")
    first = UsdShade.Shader.Get(stage, "/Material/Place")
    second = UsdShade.Shader.Define(stage, "/Material/Place2")
    second.CreateIdAttr("UsdTransform2d")
    second.CreateInput("rotation", FLOAT).Set(-90.0)
    second.CreateInput("translation", Sdf.ValueTypeNames.Float2).Set(Gf.Vec2f(0.5, 0))
    second.CreateInput("in", Sdf.ValueTypeNames.Float2).ConnectToSource(first.ConnectableAPI(), "result")
    texture.GetInput("st").ConnectToSource(second.ConnectableAPI(), "result")
    model, scene = read_model(stage)
    assert scene.warnings == []
    lookup = model.emissive_color
    np.testing.assert_allclose(lookup.st_scale, [2, 3], rtol=1e-6)  # turned there and back
    assert lookup.st_rotation == pytest.approx(0, abs=1e-5)
    np.testing.assert_allclose(lookup.st_translation, [0.5 + 0.5, -0.25], rtol=1e-6)


# -- bad input


def test_a_udim_set_without_tiles_gives_its_fallback_with_one_warning(stage, tmp_path):
    fallback = {"fallback": (Sdf.ValueTypeNames.Float4, Gf.Vec4f(0.3, 0.2, 0.1, 1))}
    emissive_quad(stage, tmp_path, "./t.<UDIM>.exr", **fallback)
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.emissive_color, [0.3, 0.2, 0.1], rtol=1e-6)
    (said,) = scene.warnings
    assert "/Material/Texture_emissiveColor: @./t.<UDIM>.exr@ has no tiles" in said


def test_a_broken_tile_is_named_and_the_others_stay(stage, tmp_path):
    write_image(tmp_path / "t.1001.png", np.full((2, 2, 3), 0.5))
    (tmp_path / "t.1002.png").write_bytes(b"\x89PNG\r\n\x1a\nbroken")
    emissive_quad(stage, tmp_path, "./t.<UDIM>.png")
    model, scene = read_model(stage)
    assert model.emissive_color.texture.tiles == [1001]
    (said,) = scene.warnings
    assert "t.1002.png" in said


def test_a_truncated_image_gives_its_fallback(stage, tmp_path):
    write_image(tmp_path / "t.png", np.random.default_rng(0).random((64, 64, 3)))
    whole = (tmp_path / "t.png").read_bytes()
    (tmp_path / "t.png").write_bytes(whole[: len(whole) // 3])
    emissive_quad(stage, tmp_path, "./t.png")
    model, scene = read_model(stage)
    np.testing.assert_allclose(model.emissive_color, 0)
    (said,) = scene.warnings
    assert "t.png" in said
    assert "fallback" in said


def test_a_mask_of_ice_that_is_missing_leaves_the_pattern(stage):
    from test_ice import add_overlay

    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    overlay = add_overlay(stage, ice, "frost", pattern=(TOKEN, "frost"))
    connect_texture(
        stage, overlay, "mask", FLOAT, "./nowhere.png", "r", fallback=(Sdf.ValueTypeNames.Float4, Gf.Vec4f(1))
    )
    model, scene = read_model(stage)
    assert model.overlays[0].mask == 1.0
    assert len(scene.warnings) == 1


def test_a_normal_map_and_a_bump_on_ice(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    write_image(tmp_path / "n.png", np.full((2, 2, 3), (0.5, 0.5, 1.0)))
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    float4 = Sdf.ValueTypeNames.Float4
    decode = {"scale": (float4, Gf.Vec4f(2)), "bias": (float4, Gf.Vec4f(-1)), "sourceColorSpace": (TOKEN, "raw")}
    connect_texture(stage, ice, "normal", Sdf.ValueTypeNames.Normal3f, "./n.png", **decode)
    connect_texture(stage, ice, "bump", FLOAT, "./n.png", "r", scale=(float4, Gf.Vec4f(4)))
    model, scene = read_model(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(model.normal.scale, 2)
    np.testing.assert_allclose(model.bump.scale, 0.04, rtol=1e-6)  # centimetres
