"""Previews through a display transform, and images of any format as linear light.

Model: (H, W, 3) float32 linear Rec.709. Row 0 is on top. Files are replaced whole (see replacing.py).
Not: layers (see exr.py), tiles, mip-maps.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .replacing import replacing

__all__ = ["display_rgb", "read_picture", "read_picture_steps", "write_png"]

HALF_MAX = 65504.0  # the largest finite half


# ---- preview ---------------------------------------------------------------------------------------------------------


def display_rgb(linear: np.ndarray) -> tuple[np.ndarray, str]:
    """Bring linear Rec.709 light to display values in [0, 1].

    Where ``OCIO`` names a configuration, its default display and view are used; else the sRGB transfer function.

    Parameters
    ----------
    linear : (H, W, 3) float32

    Returns
    -------
    display : (H, W, 3) float32
    transform : str
        ``sRGB``, or the display and view.

    Raises
    ------
    OSError
        Where ``OCIO`` names a configuration that cannot be used.
    """
    linear = np.nan_to_num(linear, nan=0.0, posinf=HALF_MAX, neginf=0.0)
    if os.environ.get("OCIO"):
        return _ocio_display(linear)
    clipped = np.clip(linear, 0.0, 1.0)
    display = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return display.astype(np.float32), "sRGB"


def _ocio_display(linear: np.ndarray) -> tuple[np.ndarray, str]:
    import OpenImageIO as oiio

    config = oiio.ColorConfig(os.environ["OCIO"])
    if problem := one_line(config.geterror()):
        raise OSError(f"OCIO: must name a configuration, got '{os.environ['OCIO']}': {problem}.")
    # Our light has Rec.709 primaries; a configuration without such a space takes it as its scene_linear.
    spaces = config.getColorSpaceNames()
    names = ("Linear Rec.709 (sRGB)", "lin_rec709", "Utility - Linear - sRGB", "lin_srgb")
    space = next((name for name in names if name in spaces), "scene_linear")
    display = config.getDefaultDisplayName()
    view = config.getDefaultViewName(display)
    source = oiio.ImageBuf(np.ascontiguousarray(linear))
    shown = oiio.ImageBufAlgo.ociodisplay(source, display, view, space, colorconfig=os.environ["OCIO"])
    if shown.has_error:
        raise OSError(f"OCIO: display '{display}', view '{view}' failed: {one_line(shown.geterror())}")
    return np.clip(shown.get_pixels(oiio.FLOAT), 0.0, 1.0), f"{display} / {view}"


def write_png(path: str | os.PathLike, linear: np.ndarray) -> str:
    """Write linear RGB (H, W, 3) as an 8-bit PNG through the display transform; return the transform's name.

    Raises
    ------
    OSError
        As `write_exr` and `display_rgb`.
    """
    import OpenImageIO as oiio

    display, transform = display_rgb(np.asarray(linear, dtype=np.float32))
    spec = oiio.ImageSpec(display.shape[1], display.shape[0], 3, "uint8")
    spec.attribute("oiio:ColorSpace", "sRGB" if transform == "sRGB" else "")
    with replacing(path) as temporary:
        output = oiio.ImageOutput.create("png")
        try:
            check_written(output.open(str(temporary), spec), output)
            check_written(output.write_image(np.ascontiguousarray(display)), output)
        finally:
            closed = output.close()
        check_written(closed, output)
    return transform


# ---- any picture -----------------------------------------------------------------------------------------------------


def read_picture(path: str | os.PathLike, *, is_data: bool = False) -> np.ndarray:
    """Read the colour of an image of any format as linear light.

    Parameters
    ----------
    path : path-like
        Formats of whole numbers (PNG, JPEG, TIFF) are decoded from sRGB, unless `is_data`; EXR and HDR are linear.
    is_data : bool
        Values are no colours: nothing is decoded.

    Returns
    -------
    (H, W, 3) float32
        Grey in all three where the image has fewer channels.

    Raises
    ------
    OSError
        Naming `path`, for a file that is missing, truncated or no image.
    """
    pixels, levels = _read_colors(path)
    return pixels if is_data or levels == 0 else _from_srgb(pixels)


def read_picture_steps(path: str | os.PathLike) -> np.ndarray | None:
    """How exactly a picture's file tells each value of `read_picture`: the width of one of its levels in linear light.

    Returns
    -------
    (H, W, 3) float32 or None
        Infinity where the value is the lowest or highest that the file can hold; None for files of floats.
    """
    pixels, levels = _read_colors(path)
    if levels == 0:
        return None
    slope = np.where(pixels <= 0.04045, 1.0 / 12.92, 2.4 / 1.055 * ((pixels + 0.055) / 1.055) ** 1.4)
    is_cut = (pixels < 0.5 / levels) | (pixels > 1.0 - 0.5 / levels)
    return np.where(is_cut, np.inf, slope / levels).astype(np.float32)


def _read_colors(path: str | os.PathLike) -> tuple[np.ndarray, int]:
    """(H, W, 3) float32 as they are in the file, and the number of the highest level; 0 for floats."""
    with opened(path) as source:
        spec = source.spec()
        pixels = source.read_image("float")
        if pixels is None or source.has_error:
            raise OSError(f"{path}: must be a whole image: {one_line(source.geterror())}")
    pixels = np.asarray(pixels, np.float32).reshape(spec.height, spec.width, -1)
    if {"R", "G", "B"} <= set(spec.channelnames):
        pixels = pixels[:, :, [spec.channelnames.index(name) for name in "RGB"]]
    pixels = pixels[:, :, :3] if pixels.shape[2] >= 3 else np.repeat(pixels[:, :, :1], 3, axis=2)
    levels = 0 if str(spec.format) in ("half", "float", "double") else 2 ** (8 * spec.format.size()) - 1
    return np.ascontiguousarray(pixels), levels


def _from_srgb(pixels: np.ndarray) -> np.ndarray:
    return np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4).astype(np.float32)


# ---- files -----------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def opened(path: str | os.PathLike) -> Iterator[Any]:
    import OpenImageIO as oiio

    if not Path(path).is_file():
        raise FileNotFoundError(f"{path}: file must exist. Check the path.")
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise OSError(f"{path}: must be an image: {one_line(oiio.geterror())}")
    try:
        yield source
    finally:
        source.close()


def check_written(succeeded: bool, output: Any) -> None:
    if not succeeded:
        raise OSError(one_line(output.geterror()) or "writing failed")


def one_line(text: str) -> str:
    return " ".join(text.split())
