"""Images of domes and rect lights: found, decoded and made finite, or a warning."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd

from .context import ReadContext
from .textures import read_image, resolve, to_linear


def read_light_image(
    context: ReadContext, prim: Usd.Prim, attribute: Usd.Attribute, asset: Sdf.AssetPath, instead: str
) -> np.ndarray | None:
    """Linear pixels (height, width, 3) float32; None, and a warning that ends with `instead`, where there are none."""
    path = prim.GetPath()
    try:
        file = resolve(context, asset, attribute)
        if not file:
            raise OSError(f"@{asset.path}@ cannot be found.")
        pixels, is_8_bit = read_image(file)
    except OSError as error:
        context.warn(path, f"{error} {instead}")
        return None
    color_space = (attribute.GetColorSpace() or "auto") if attribute else "auto"
    pixels = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    try:
        pixels = to_linear(pixels, str(color_space), is_8_bit)
    except ValueError as error:
        context.warn(path, f"{error} {file} is taken as raw.")
    is_good = np.isfinite(pixels)
    if not is_good.all():
        context.warn(path, f"{file} has {int((~is_good).sum())} NaN or infinite values. They are taken as 0.")
        pixels = np.where(is_good, pixels, 0.0)
    if (pixels < 0).any():
        context.warn(path, f"{file} has {int((pixels < 0).sum())} negative values. They take light away.")
    if not pixels.any():
        context.warn(path, f"{file} is black. The light is dark.")
    return np.ascontiguousarray(pixels, dtype=np.float32)
