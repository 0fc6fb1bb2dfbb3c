"""Layered EXR: names, formats, compression, metadata."""

import os

import numpy as np
import pytest

from frazil import exr

LETTERS = {"beauty": "RGBA", "translucency": "RGB", "Z": "Z", "N": "XYZ"}
LOSSLESS = ("none", "rle", "zip", "zips", "piz")


def some_layers(width=33, height=300, seed=3):
    random = np.random.default_rng(seed)
    return {name: random.random((height, width, len(letters)), np.float32) for name, letters in LETTERS.items()}


@pytest.mark.parametrize("compression", LOSSLESS)
def test_float_layers_come_back_bit_for_bit(tmp_path, compression):
    layers = some_layers()
    exr.write_exr(tmp_path / "a.exr", layers, LETTERS, compression=compression)
    read, metadata = exr.read_exr(tmp_path / "a.exr")
    assert metadata["compression"] == compression
    assert set(read) == set(layers)
    for name in layers:
        np.testing.assert_array_equal(read[name], layers[name], err_msg=name)


@pytest.mark.parametrize("compression", exr.COMPRESSIONS)
def test_every_compression_is_stored_as_named_and_near(tmp_path, compression):
    layers = {"beauty": np.full((64, 64, 4), 0.5, np.float32)}
    exr.write_exr(tmp_path / "a.exr", layers, LETTERS, half_layers=["beauty"], compression=compression)
    read, metadata = exr.read_exr(tmp_path / "a.exr")
    assert metadata["compression"] == compression
    np.testing.assert_allclose(read["beauty"], 0.5, atol=2e-3)


def test_channels_have_the_names_and_formats_that_are_asked_for(tmp_path):
    exr.write_exr(tmp_path / "a.exr", some_layers(), LETTERS, half_layers=["beauty", "N"])
    width, height, layers, _ = exr.read_header(tmp_path / "a.exr")
    assert (width, height) == (33, 300)
    assert layers["beauty"] == dict.fromkeys("RGBA", "half")
    assert layers["N"] == {"N.X": "half", "N.Y": "half", "N.Z": "half"}
    assert layers["translucency"] == {f"translucency.{c}": "float" for c in "RGB"}
    assert layers["Z"] == {"Z": "float"}


def test_half_layers_are_rounded_to_half_and_no_further(tmp_path):
    layers = some_layers()
    exr.write_exr(tmp_path / "a.exr", layers, LETTERS, half_layers=list(layers))
    read, _ = exr.read_exr(tmp_path / "a.exr")
    for name, array in layers.items():
        np.testing.assert_array_equal(read[name], array.astype(np.float16).astype(np.float32), err_msg=name)


def test_values_beyond_half_keep_the_layer_float(tmp_path):
    layers = some_layers()
    layers["beauty"][5, 5, 1] = 1e6
    promoted = exr.write_exr(tmp_path / "a.exr", layers, LETTERS, half_layers=["beauty", "N"])
    assert promoted == ["beauty"]
    assert exr.read_exr(tmp_path / "a.exr")[0]["beauty"][5, 5, 1] == 1e6


def test_infinity_stays_infinity_and_needs_no_float(tmp_path):
    layers = {"Z": np.full((4, 4, 1), np.inf, np.float32)}
    assert exr.write_exr(tmp_path / "a.exr", layers, LETTERS, half_layers=["Z"]) == []
    assert np.isinf(exr.read_exr(tmp_path / "a.exr")[0]["Z"]).all()


def test_metadata_comes_back(tmp_path):
    metadata = {
        "Software": "Frazil",
        "DateTime": "2024:02:03 04:05:06",
        "frazil:seed": 7,
        "frazil:tolerance": 0.25,
        "frazil:long": "x" * 100_000,
    }
    matrix = np.arange(16.0).reshape(4, 4)
    exr.write_exr(tmp_path / "a.exr", some_layers(), LETTERS, metadata=metadata | {"frazil:matrix": matrix})
    _, read = exr.read_exr(tmp_path / "a.exr")
    assert {key: read[key] for key in metadata} == metadata
    np.testing.assert_array_equal(np.ravel(read["frazil:matrix"]), matrix.ravel())


def test_large_seeds_come_back(tmp_path):
    exr.write_exr(tmp_path / "a.exr", some_layers(), LETTERS, metadata={"frazil:seed": 2**32 - 1})
    assert int(exr.read_exr(tmp_path / "a.exr")[1]["frazil:seed"]) == 2**32 - 1


def test_empty_lists_are_left_out(tmp_path):
    exr.write_exr(tmp_path / "a.exr", some_layers(), LETTERS, metadata={"frazil:aovs": [], "frazil:seed": 3})
    metadata = exr.read_exr(tmp_path / "a.exr")[1]
    assert "frazil:aovs" not in metadata
    assert metadata["frazil:seed"] == 3


def test_views_that_are_not_contiguous_are_written(tmp_path):
    view = some_layers()["beauty"][::-2, ::3]
    exr.write_exr(tmp_path / "a.exr", {"beauty": view}, LETTERS)
    np.testing.assert_array_equal(exr.read_exr(tmp_path / "a.exr")[0]["beauty"], view)


def test_bad_requests_are_refused_before_anything_is_written(tmp_path):
    layers = some_layers()
    with pytest.raises(ValueError, match="compression must be one of .* got 'lzma'"):
        exr.write_exr(tmp_path / "a.exr", layers, LETTERS, compression="lzma")
    with pytest.raises(ValueError, match="layers must be one or more"):
        exr.write_exr(tmp_path / "a.exr", {}, LETTERS)
    with pytest.raises(ValueError, match=r"layer Z must have shape \(300, 33, 1\)"):
        exr.write_exr(tmp_path / "a.exr", layers | {"Z": layers["N"]}, LETTERS)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("content", [b"", b"not an image", b"v/1\x01 and then nothing"])
def test_a_file_that_is_no_exr_is_refused_by_name(tmp_path, content):
    path = tmp_path / "broken.exr"
    path.write_bytes(content)
    with pytest.raises(OSError, match=r"broken\.exr: must be an image"):
        exr.read_exr(path)


@pytest.mark.parametrize("fraction", [0.01, 0.5, 0.99])
def test_a_truncated_exr_is_refused(tmp_path, fraction):
    path = tmp_path / "cut.exr"
    exr.write_exr(path, some_layers(), LETTERS)
    path.write_bytes(path.read_bytes()[: int(fraction * path.stat().st_size)])
    with pytest.raises(OSError, match=r"cut\.exr: must be"):
        exr.read_exr(path)


def test_a_missing_file_is_named():
    with pytest.raises(FileNotFoundError, match=r"nowhere\.exr: file must exist"):
        exr.read_exr("nowhere.exr")
