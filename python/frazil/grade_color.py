"""Colour corrections of linear pictures: exposure, gain, temperature, saturation, gamma, through a matte or not.

Model: in this order: c *= gain * 2**exposure * white(temperature); c = Y + saturation * (c - Y) with Y the Rec.709
luminance; c = sign(c) |c|**(1/gamma). A matte m mixes: c + m (corrected - c). white() is the Planckian locus by the
cubic fit of [Kim2002], relative to 6500 K, luminance kept.
Units: linear Rec.709; kelvin.
Valid: temperature 1667..25000 K; NaN and infinity stay what they are.
Not: curves, keying, display transforms.
"""

import numpy as np

from .grade_recipe import ColorCorrection

__all__ = ["LUMINANCE", "correct", "white_of_temperature"]

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # of linear Rec.709
_XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
_ROWS = 64  # of a block, which stays in the cache


def correct(rgb: np.ndarray, correction: ColorCorrection, matte: np.ndarray | None = None) -> None:
    """Correct a picture in place, block by block.

    Parameters
    ----------
    rgb : (H, W, 3) float32
        Changed in place.
    correction : ColorCorrection
        What to do.
    matte : (H, W) float, optional
        How much of it, 0..1.
    """
    if correction.is_identity:
        return
    scale = np.asarray(correction.gain) * 2.0**correction.exposure * white_of_temperature(correction.temperature)
    scale = scale.astype(np.float32)
    exponent = (1.0 / np.asarray(correction.gamma)).astype(np.float32)
    for top in range(0, rgb.shape[0], _ROWS):
        block = rgb[top : top + _ROWS]
        mask = None if matte is None else matte[top : top + _ROWS, :, None].astype(np.float32)
        if mask is not None and not mask.any():
            continue
        new = block * scale
        if correction.saturation != 1.0:
            grey = (new @ LUMINANCE)[:, :, None]
            new -= grey
            new *= np.float32(correction.saturation)
            new += grey
        if correction.gamma != (1.0, 1.0, 1.0):
            new = np.copysign(np.abs(new) ** exponent, new)
        if mask is None:
            block[...] = new
        else:
            block += mask * (new - block)


def white_of_temperature(kelvin: float) -> np.ndarray:
    """(3,) factors that turn a picture lit by 6500 K into one lit by `kelvin`; luminance of white stays 1."""
    if kelvin == 6500.0:
        return np.ones(3)
    return _planckian(kelvin) / _planckian(6500.0)


def _planckian(kelvin: float) -> np.ndarray:
    """Linear Rec.709 of a black body, of luminance 1."""
    t = 1e3 / kelvin
    if kelvin <= 4000.0:
        x = -0.2661239 * t**3 - 0.2343589 * t**2 + 0.8776956 * t + 0.179910
    else:
        x = -3.0258469 * t**3 + 2.1070379 * t**2 + 0.2226347 * t + 0.240390
    if kelvin <= 2222.0:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin <= 4000.0:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    rgb = np.maximum(_XYZ_TO_RGB @ np.array([x / y, 1.0, (1.0 - x - y) / y]), 1e-6)
    return rgb / (rgb @ LUMINANCE)
