"""A cold sky as a lat-long image: bright horizon, broken cloud lit from the sun's side, far ridges in haze.

Model: a gradient between measured-looking zenith and horizon colours, brightened towards the sun; cloud is noise on a
    plane above the viewer; ridges are noise of the azimuth. The sun's disk is left to a light of its own.
Units: radiance, the sunlit snow about 1; row 0 is up, the centre of the image +z, +x left of it (UsdLuxDomeLight).
Not: a sky for other times of day than a low sun.
"""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from .noise import Noise, swirl

kZenith = np.array([0.10, 0.22, 0.46])
kHorizon = np.array([0.80, 0.92, 1.04])
kGlow = np.array([1.0, 0.78, 0.52])
kCloud = np.array([0.62, 0.70, 0.80])
kHaze = (0.02, 0.16)  # sines of the elevations between which cloud comes out of the haze
kSnowfield = np.array([0.46, 0.54, 0.66])


def make_sky(width: int, sun: np.ndarray, seed: int) -> np.ndarray:
    """Radiance (width/2, width, 3) float32 of the sky whose sun stands in direction `sun` (3,)."""
    height = width // 2
    noise = Noise(seed)
    v, u = np.mgrid[0:height, 0:width]
    polar = (v + 0.5) / height * np.pi
    azimuth = (0.5 - (u + 0.5) / width) * 2.0 * np.pi
    direction = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)], -1)
    direction = direction.reshape(-1, 3)
    up = direction[:, 1]
    toward_sun = direction @ (sun / np.linalg.norm(sun))

    # Clear air: pale and bright low down, brighter on the sun's side, a warm aureole around the sun.
    low = np.exp(-np.maximum(up, 0.0) / 0.16)[:, None]
    side = (0.62 + 0.38 * toward_sun)[:, None]
    sky = (kZenith * (1.0 - low) + kHorizon * low) * (0.55 + 0.75 * side)
    near_sun = np.exp(-(1.0 - toward_sun) / 0.05) + 0.35 * np.exp(-(1.0 - toward_sun) / 0.35)
    sky += near_sun[:, None] * kGlow * (0.4 + 0.9 * low)

    texel = np.pi / height
    sky = _add_clouds(sky, direction, toward_sun, noise, texel)
    sky = _add_ridges(sky, direction, toward_sun, noise, texel)
    ground = kSnowfield * (0.75 + 0.25 * side)
    blend = np.clip(up / max(0.004, texel) + 0.5, 0.0, 1.0)[:, None]
    return (sky * blend + ground * (1.0 - blend)).reshape(height, width, 3).astype(np.float32)


def _add_clouds(sky, direction, toward_sun, noise: Noise, texel: float):
    up = direction[:, 1]
    above = np.flatnonzero(up > kHaze[0])
    d = direction[above]
    # A layer overhead, stretched along the wind.
    plane = d / (d[:, 1:2] + 0.10) * [0.55, 0.0, 1.0]
    bent = plane + 0.25 * swirl(plane, 1.6)
    # Octaves fade out where a texel sees more than half of a feature.
    seen = texel / (d[:, 1] + 0.10) ** 2
    shape = np.zeros(len(d))
    for octave in range(5):
        size = 1.5 * 0.5**octave
        shown = np.clip(2.0 - 4.0 * seen / size, 0.0, 1.0)
        shape += 0.55**octave * shown * noise(bent, size, octave)
    cover = np.clip((shape + 0.02) / 0.55, 0.0, 1.0)
    hazy = np.clip((d[:, 1] - kHaze[0]) / (kHaze[1] - kHaze[0]), 0.0, 1.0)
    cover = cover * cover * (3.0 - 2.0 * cover) * hazy * hazy * (3.0 - 2.0 * hazy)
    lining = np.exp(-(1.0 - toward_sun[above]) / 0.25) * (1.0 - cover) * 1.6
    bright = 0.55 + 0.40 * np.clip(toward_sun[above], 0.0, 1.0) + 0.25 * (1.0 - cover) - 0.14 * (shape - 0.5)
    color = kCloud * bright[:, None] + lining[:, None] * [1.0, 0.86, 0.70]
    result = sky.copy()
    result[above] += cover[:, None] * 0.85 * (color - sky[above])
    return result


def _add_ridges(sky, direction, toward_sun, noise: Noise, texel: float):
    around = direction * [1.0, 0.0, 1.0]
    around /= np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-9)
    elevation = np.arcsin(np.clip(direction[:, 1], -1.0, 1.0))
    result = sky.copy()
    band = np.flatnonzero((elevation > -0.01) & (elevation < 0.16))
    around, elevation, direction, toward_sun = around[band], elevation[band], direction[band], toward_sun[band]
    for layer, (height, haze) in enumerate([(0.105, 0.78), (0.055, 0.52)]):
        rough = noise.fractal(around + 3.0 * layer, 0.35, 6, 50 + 10 * layer, 0.52)
        crest = height * (0.62 + 0.55 * rough)
        # No sharper than a texel: a crest would go down in steps.
        inside = np.clip((crest - elevation) / max(0.0025, texel) + 0.5, 0.0, 1.0)[:, None]
        slope = noise.fractal(direction * [1.0, 0.55, 1.0], 0.045, 4, 70 + 10 * layer, 0.6)
        rock = np.array([0.25, 0.33, 0.46]) + 0.16 * np.clip(slope, -0.4, 1.0)[:, None]
        air = np.array([0.66, 0.78, 0.92]) * (0.85 + 0.25 * toward_sun[:, None])
        foot = np.clip(1.0 - elevation / np.maximum(crest, 1e-3), 0.0, 1.0)[:, None]
        depth = haze + (1.0 - haze) * 0.7 * foot
        result[band] += inside * (rock * (1.0 - depth) + air * depth - result[band])
    return result


def write_image(path: Path, pixels: np.ndarray) -> None:
    """Write linear pixels (H, W, 3) as EXR in half precision; OSError where that fails."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "half")
    spec.attribute("compression", "zip")
    output = oiio.ImageOutput.create(str(path))
    if output is None or not output.open(str(path), spec):
        raise OSError(f"{path}: cannot be written: {oiio.geterror()}")
    if not output.write_image(np.ascontiguousarray(pixels, np.float32)) or not output.close():
        raise OSError(f"{path}: cannot be written: {output.geterror()}")
