"""Our EXRs as the OpenEXR library itself reads them, of one part and of several."""

import fake_core
import numpy as np
import pytest

import frazil as fz


@pytest.mark.parametrize("multipart", [False, True])
@pytest.mark.parametrize("compression", ["zips", "piz", "none"])
def test_openexr_reads_what_was_written(tmp_path, monkeypatch, multipart, compression):
    outside = pytest.importorskip("OpenEXR")
    fake_core.install(monkeypatch, fake_core.Core())
    window = {"dataWindow": (3, 2, 16, 9), "displayWindow": (0, 0, 24, 16)}
    film = fz.Film(fake_core.layers(), window)
    film.save(tmp_path / "a.exr", compression, multipart=multipart)
    with outside.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
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
