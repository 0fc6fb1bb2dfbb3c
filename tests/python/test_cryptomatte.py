"""Cryptomattes by the published specification: read by an outside decoder, and bit by bit as the specification says."""

import json

import numpy as np
import pytest

import frazil as fz
from frazil import _frazil
from frazil.cryptomatte import header_of, matte_of

# MurmurHash3_x86_32 with seed 0: published vectors, one for every length of the rest.
HASHES = {"": 0, "test": 0xBA6BD213, "Hello, world!": 0xC0363E43, "a": 0x3C2569B2, "ab": 0x9BBFD75F, "abc": 0xB3DD93FA}
HASHES["The quick brown fox jumps over the lazy dog"] = 0x2E4FF723


def test_hashes_are_the_published_ones():
    for text, value in HASHES.items():
        assert _frazil.cryptomatte_hash(text) == value, text


def test_ids_are_plain_numbers_of_the_hashs_bits():
    for number in range(3000):
        name = f"object{number}"
        bits = int(np.float32(_frazil.cryptomatte_id(name)).view(np.uint32))
        exponent = bits >> 23 & 255
        assert 0 < exponent < 255
        difference = bits ^ _frazil.cryptomatte_hash(name)
        assert difference in (0, 1 << 23)


def square(z, half, material, path, made, x=0.0, asset=""):
    corners = np.float32([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)])
    mesh = made.add_mesh(fz.Mesh(corners, np.int32([(0, 1, 2), (0, 2, 3)])), path)
    matrix = np.eye(4)
    matrix[3, :3] = x, 0, z
    made.add_object(path, mesh, material, matrix, asset)
    return mesh


def scene_of_squares(ice=False):
    """A wall with a square before its left part that covers a known half; a third mesh instanced twice."""
    made = fz.Scene()
    red = made.add_material("/Looks/Red", fz.StandardMaterial())
    blue = made.add_material("/Looks/Blue", fz.StandardMaterial())
    square(-1.0, 4.0, red, "/World/Wall", made)
    small = square(0.0, 0.25, blue, "/World/Rocks/A", made, x=-0.4, asset="/World/Rocks")
    matrix = np.eye(4)
    matrix[3, :3] = 0.4, 0, 0
    made.add_object("/World/Rocks/B", small, red, matrix, "/World/Rocks")
    made.add_light(fz.Light(fz.DomeLight(), radiance=(1, 1, 1)))
    if ice:
        corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0.5, 0.7)], np.float32)
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        box = fz.Mesh(corners, np.int32([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))
        medium = fz.Medium(sigma_s_prime=(0.5,) * 3, sigma_a=(0.1,) * 3, eta=1.0)
        core = made.add_material("/Looks/Ice", fz.IceMaterial(medium, roughness=0.0, refraction=1.0, spacing=0.1))
        made.add_object("/World/Ice", made.add_mesh(box, "/World/Ice"), core)
    camera = np.eye(4)
    camera[3, 2] = 3.0
    made.camera = fz.Camera(matrix=camera, focal_length=20, horizontal_aperture=20, vertical_aperture=20)
    return made


KINDS = ("object", "material", "asset")


@pytest.fixture(scope="module")
def film():
    aovs = [f"crypto_{kind}" for kind in KINDS]
    return fz.render(scene_of_squares(), resolution=(33, 33), samples=16, bake_samples=1, aovs=aovs)


def decoded(film, layer, name):
    """The coverage of a name, by the specification's words alone."""
    keys = [key for key, value in film.metadata.items() if key.startswith("cryptomatte/") and value == layer]
    manifest = json.loads(film.metadata[keys[0].replace("/name", "/manifest")])
    wanted = np.uint32(int(manifest[name], 16)).view(np.float32)
    total = np.zeros((film.height, film.width))
    for rank in range(3):
        rgba = film[f"{layer}{rank:02d}"]
        for i in (0, 2):
            total += np.where(rgba[:, :, i] == wanted, rgba[:, :, i + 1], 0)
    return total


def test_coverages_of_all_objects_sum_to_the_pixel(film):
    for kind in KINDS:
        coverage, names = matte_of(film, kind, ["*"])
        np.testing.assert_allclose(coverage, film["beauty"][:, :, 3], atol=1e-6)
        assert len(names) == {"object": 3, "material": 2, "asset": 2}[kind]


def test_ranks_fall_and_end_in_nothing(film):
    for kind in KINDS:
        ranks = np.concatenate([film[f"crypto_{kind}{k:02d}"] for k in range(3)], axis=2)
        coverage = ranks[:, :, 1::2]
        assert np.all(np.diff(coverage, axis=2) <= 0)
        assert np.all((ranks[:, :, 0::2] != 0) == (coverage > 0))


def test_coverage_is_the_area_that_is_seen(film):
    # The square of side 0.5 at distance 3, over a view 3 wide.
    a = decoded(film, "crypto_object", "/World/Rocks/A")
    np.testing.assert_allclose(a.mean(), (0.5 / 3) ** 2, rtol=0.03)
    assert a[16, 16 - round(0.4 / 3 * 33)] == 1.0
    assert 0 < np.sum((a > 0) & (a < 1))


def test_instances_have_names_of_their_own_and_a_common_asset(film):
    a, b = (decoded(film, "crypto_object", f"/World/Rocks/{name}") for name in "AB")
    np.testing.assert_allclose(decoded(film, "crypto_asset", "/World/Rocks"), a + b, atol=1e-6)
    assert np.all((a == 0) | (b == 0))
    np.testing.assert_allclose(decoded(film, "crypto_material", "/Looks/Blue"), a, atol=1e-6)


@pytest.mark.parametrize("compression", ["zips", "none", "piz"])
def test_an_outside_decoder_reads_the_file(tmp_path, film, compression):
    outside = pytest.importorskip("cryptomatte_api")
    film.save(tmp_path / "a.exr", compression)
    mattes = outside.Cryptomatte.load(tmp_path / "a.exr")
    assert len(mattes) == 3
    compared = 0
    for matte in mattes:
        for name, mask in matte.masks().items():
            kind = next(kind for kind in KINDS if np.array_equal(decoded_or_none(film, f"crypto_{kind}", name), mask))
            compared += kind in KINDS
    assert compared == 7


def decoded_or_none(film, layer, name):
    try:
        return decoded(film, layer, name).astype(np.float32)
    except KeyError:
        return None


def test_files_keep_the_bits(tmp_path, film):
    for options in ({"compression": "zips"}, {"compression": "dwaa", "multipart": True}, {"multipart": True}):
        film.save(tmp_path / "a.exr", **options)
        read = fz.Film.load(tmp_path / "a.exr", keep_half=True)
        for kind in KINDS:
            for k in range(3):
                np.testing.assert_array_equal(read[f"crypto_{kind}{k:02d}"], film[f"crypto_{kind}{k:02d}"])
            assert matte_of(read, kind, ["*"])[1] == matte_of(film, kind, ["*"])[1]
    with pytest.raises(ValueError, match=r"compression must keep the bits of layer crypto_.*, got dwaa.*--multipart"):
        film.save(tmp_path / "b.exr", "dwaa")
    assert not (tmp_path / "b.exr").exists()


def test_what_is_seen_through_ice_has_a_matte_of_its_own():
    aovs = ["crypto_object", "crypto_refracted_object"]
    film = fz.render(scene_of_squares(ice=True), resolution=(33, 33), samples=8, bake_samples=1, aovs=aovs)
    plain = fz.render(scene_of_squares(), resolution=(33, 33), samples=8, bake_samples=1, aovs=["crypto_object"])
    ice = matte_of(film, "object", ["/World/Ice"])[0]
    behind = matte_of(film, "object", ["/World/Rocks/A"], refracted=True)[0]
    expected = matte_of(plain, "object", ["/World/Rocks/A"])[0]
    assert ice[16, 11] == 1.0
    assert not np.any(matte_of(film, "object", ["/World/Rocks/A"])[0] * ice)
    np.testing.assert_allclose(behind, expected, atol=0.26)  # index-matched ice bends nothing
    np.testing.assert_allclose(behind.mean(), expected.mean(), rtol=0.1)


def test_picks_grade_what_they_name(film):
    recipe = {"mattes": {"rocks": {"objects": ["/World/Rocks/*"], "exposure": 1.0}}}
    graded = fz.grade(film, recipe)["beauty"][:, :, :3]
    rocks = decoded(film, "crypto_asset", "/World/Rocks")[:, :, None]
    np.testing.assert_allclose(graded, film["beauty"][:, :, :3] * (1 + rocks), rtol=1e-4)
    recipe["mattes"]["rocks"]["objects"] = "/World/Nothing"
    with pytest.warns(fz.FrazilWarning, match=r"mattes.rocks: no object in the picture is named /World/Nothing"):
        fz.grade(film, recipe)


def test_a_lost_or_broken_manifest_is_named(film):
    lost = fz.Film(film.layers, {})
    with pytest.raises(ValueError, match="crypto_object: manifest must be in the picture's header"):
        matte_of(lost, "object", ["*"])
    broken = header_of("crypto_object", ["a"]) | {next(iter(header_of("crypto_object", []))): "crypto_object"}
    broken = {key: "{" if key.endswith("manifest") else value for key, value in broken.items()}
    with pytest.raises(ValueError, match="crypto_object: manifest must be JSON"):
        matte_of(fz.Film(film.layers, broken), "object", ["*"])
