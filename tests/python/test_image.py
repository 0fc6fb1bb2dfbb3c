"""The display transform of previews."""

import os

import numpy as np
import pytest

from frazil import image


def read_png(path) -> np.ndarray:
    import OpenImageIO as oiio

    return oiio.ImageBuf(str(path)).get_pixels(oiio.UINT8)


def test_preview_is_srgb(tmp_path, monkeypatch):
    monkeypatch.delenv("OCIO", raising=False)
    # IEC 61966-2-1: linear 0.2140 is half of the display's range; 0.0031308 is where the two pieces meet.
    linear = np.array([[-1.0, 0.0, 0.0031308, 0.21404114, 1.0, 5.0, np.nan, np.inf]], np.float32)
    assert image.write_png(tmp_path / "a.png", np.repeat(linear[:, :, None], 3, axis=2)) == "sRGB"
    pixels = read_png(tmp_path / "a.png")
    assert pixels.shape == (1, 8, 3)
    np.testing.assert_allclose(pixels[0, :, 0].astype(int), [0, 0, 10, 128, 255, 255, 0, 255], atol=1)


OCIO_CONFIG = """ocio_profile_version: 2
roles: {default: lin, scene_linear: lin}
file_rules: [!<Rule> {name: Default, colorspace: lin}]
displays:
  screen:
    - !<View> {name: halved, colorspace: half}
colorspaces:
  - !<ColorSpace> {name: lin}
  - !<ColorSpace>
    name: half
    from_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}
"""


def test_preview_follows_ocio(tmp_path, monkeypatch):
    (tmp_path / "config.ocio").write_text(OCIO_CONFIG)
    monkeypatch.setenv("OCIO", str(tmp_path / "config.ocio"))
    assert image.write_png(tmp_path / "a.png", np.full((2, 2, 3), 0.5, np.float32)) == "screen / halved"
    np.testing.assert_allclose(read_png(tmp_path / "a.png").astype(int), 64, atol=1)


def test_preview_follows_a_built_in_ocio_config(tmp_path, monkeypatch):
    monkeypatch.setenv("OCIO", "ocio://default")
    transform = image.write_png(tmp_path / "a.png", np.full((2, 2, 3), 0.18, np.float32))
    assert transform.startswith("sRGB - Display / ")
    pixels = read_png(tmp_path / "a.png").astype(int)
    assert np.ptp(pixels) <= 1  # grey in Rec.709 stays grey
    assert 60 < pixels.mean() < 130


def test_an_ocio_that_is_missing_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("OCIO", str(tmp_path / "none.ocio"))
    with pytest.raises(OSError, match="OCIO: must name a configuration"):
        image.write_png(tmp_path / "a.png", np.zeros((2, 2, 3), np.float32))
    assert os.listdir(tmp_path) == []
