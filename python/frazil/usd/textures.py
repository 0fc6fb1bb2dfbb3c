"""Texture files as linear float arrays: found through USD's resolver, in usdz packages too, decoded once."""

from __future__ import annotations

import tempfile
import zipfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Ar, Sdf

from .context import ReadContext


class TextureError(OSError):
    """An image that is missing or unreadable; the message begins with its path."""


def resolve(context: ReadContext, asset: Sdf.AssetPath, attribute=None) -> str:
    """Where the asset lies; '' where it cannot be found."""
    if asset.resolvedPath:
        return asset.resolvedPath
    if not asset.path:
        return ""
    layer = context.stage.GetRootLayer()
    if attribute is not None:
        stack = attribute.GetPropertyStack(context.time)
        layer = stack[0].layer if stack else layer
    return str(Ar.GetResolver().Resolve(Sdf.ComputeAssetPathRelativeToLayer(layer, asset.path)))


def read_image(path: str) -> tuple[np.ndarray, bool]:
    """The pixels (height, width, channels) float32 as stored, at most 4 channels, and whether the file is 8-bit.

    OSError, beginning with the path, where it cannot be read.
    """
    if Ar.IsPackageRelativePath(path):
        return _read_packaged(path)
    if not Path(path).is_file():
        raise TextureError(f"{path}: no such image.")
    image = oiio.ImageBuf(path)
    if image.has_error or image.spec().width < 1 or image.spec().nchannels < 1:
        message = image.geterror() or "it has no pixels"
        raise TextureError(f"{path}: not a readable image: {message.splitlines()[0]}")
    is_8_bit = image.spec().format.basetype == oiio.UINT8
    pixels = image.get_pixels(oiio.FLOAT)
    if pixels is None or image.has_error:
        raise TextureError(f"{path}: not a readable image: {(image.geterror() or 'truncated').splitlines()[0]}")
    pixels = np.asarray(pixels, dtype=np.float32).reshape(image.spec().height, image.spec().width, -1)
    return np.ascontiguousarray(pixels[..., :4]), is_8_bit


def _read_packaged(path: str) -> tuple[np.ndarray, bool]:
    package, inner = Ar.SplitPackageRelativePathOuter(path)
    try:
        with zipfile.ZipFile(package) as archive:
            data = archive.read(inner)
    except (KeyError, OSError, zipfile.BadZipFile) as error:
        raise TextureError(f"{path}: no such image in the package.") from error
    with tempfile.NamedTemporaryFile(suffix=Path(inner).suffix) as file:
        file.write(data)
        file.flush()
        try:
            return read_image(file.name)
        except TextureError as error:
            raise TextureError(str(error).replace(file.name, path)) from error


def is_srgb(color_space: str, is_8_bit: bool, channels: int) -> bool:
    """Whether UsdUVTexture's sourceColorSpace says that the image holds sRGB values; 'auto' asks the image."""
    if color_space == "sRGB":
        return True
    if color_space == "raw":
        return False
    return is_8_bit and channels >= 3


def decode_srgb(pixels: np.ndarray) -> np.ndarray:
    """sRGB values as linear ones; a fourth channel (alpha) stays as it is."""
    color = pixels[..., :3]
    levels = np.rint(color * 255.0)
    if np.array_equal(levels, color * np.float32(255.0)) or np.abs(levels / 255.0 - color).max() < 1e-6:
        table = _srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)
        linear = table[np.clip(levels, 0, 255).astype(np.uint8)]
    else:
        linear = _srgb_to_linear(color).astype(np.float32)
    return np.concatenate([linear, pixels[..., 3:]], axis=-1)


def _srgb_to_linear(value: np.ndarray) -> np.ndarray:
    return np.where(value <= 0.04045, value / 12.92, (np.maximum(value, 0.04045) / 1.055 + 0.055 / 1.055) ** 2.4)
