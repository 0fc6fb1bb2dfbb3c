"""Our EXRs as the OpenEXR library itself reads them, of one part and of several."""

import fake_core
import numpy as np
import OpenEXR
import pytest

import frazil as fz
from frazil import exr


@pytest.mark.parametrize("multipart", [False, True])
@pytest.mark.parametrize("compression", ["zips", "piz", "none"])
def test_openexr_reads_what_was_written(tmp_path, monkeypatch, multipart, compression):
    fake_core.install(monkeypatch, fake_core.Core())
    window = {"dataWindow": (3, 2, 16, 9), "displayWindow": (0, 0, 24, 16)}
    film = fz.Film(fake_core.layers(), window)
    film.save(tmp_path / "a.exr", compression, multipart=multipart)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        parts = {part.header.get("name", ""): part for part in file.parts}
        assert len(parts) == (len(list(film)) if multipart else 1)
        part = parts["Z"] if multipart else file.parts[0]
        np.testing.assert_array_equal(part.channels["Z"].pixels, film["Z"][:, :, 0])
        assert tuple(part.header["dataWindow"][0]) == (3, 2)
        assert tuple(part.header["displayWindow"][1]) == (23, 15)
        part = parts["specular"] if multipart else file.parts[0]
        assert part.channels["specular.R"].pixels.dtype == np.float16
    read = fz.Film.load(tmp_path / "a.exr", keep_half=True)
    assert set(read) == set(film)
    assert read["specular"].dtype == np.float16
    assert tuple(read.metadata["dataWindow"]) == (3, 2, 16, 9)


def test_standard_attributes_keep_names_and_types_when_a_file_is_written_again(tmp_path):
    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIPS_COMPRESSION,
        "pixelAspectRatio": 2.0,
        "screenWindowCenter": np.array([0.25, 0.5], np.float32),
        "chromaticities": (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329),
        "worldToCamera": np.diag(np.float32([1, 2, 3, 1])),
        "capDate": "2026:11:30 08:00:00",
        "owner": "a studio",
        "comments": "a note",
        "expTime": 0.5,
        "aperture": 2.8,
    }
    pixels = np.ones((4, 5), np.float32)
    OpenEXR.File(header, {letter: pixels for letter in "RGB"}).write(str(tmp_path / "theirs.exr"))
    layers, metadata = exr.read_exr(tmp_path / "theirs.exr")
    exr.write_exr(tmp_path / "ours.exr", layers, {"beauty": "RGB"}, metadata=metadata)
    with OpenEXR.File(str(tmp_path / "ours.exr")) as ours, OpenEXR.File(str(tmp_path / "theirs.exr")) as theirs:
        for name in header:
            got, expected = ours.header()[name], theirs.header()[name]
            assert type(got) is type(expected), name
            assert np.all(np.asarray(got) == np.asarray(expected)), name
