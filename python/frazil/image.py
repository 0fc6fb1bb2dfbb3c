"""Pictures on disk: layered OpenEXR and PNG previews, replaced whole or not at all.

Model: a layer is an (H, W, C) float32 array; its channels are stored as ``layer.R``, those of the beauty as plain
R, G, B, A, and a layer of one channel under its own name. Files are replaced whole (see replacing.py).
Units: linear light in the EXR; the preview goes through a display transform. Row 0 is on top.
Not: tiles, mip-maps, deep data; other formats than EXR and PNG.
"""

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .replacing import replacing

__all__ = ["COMPRESSIONS", "channel_names", "display_rgb", "read_exr", "read_header", "write_exr", "write_png"]

COMPRESSIONS = ("none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
HALF_MAX = 65504.0  # the largest finite half
STRIP = 256  # rows written at a time: a multiple of every compression's block


# ---- layered EXR -----------------------------------------------------------------------------------------------------


def channel_names(layer: str, letters: str) -> list[str]:
    """What the channels of a layer are called in an EXR: ``specular.R``, R for the beauty, ``Z`` where there is one."""
    if layer == "beauty":
        return list(letters)
    if len(letters) == 1:
        return [layer]
    return [f"{layer}.{letter}" for letter in letters]


@dataclass
class _Channel:
    name: str
    array: np.ndarray  # (H, W)
    format: str  # half or float


def write_exr(
    path: str | os.PathLike,
    layers: Mapping[str, np.ndarray],
    letters: Mapping[str, str],
    *,
    half_layers: Sequence[str] = (),
    compression: str = "zips",
    metadata: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write layers as one multi-channel EXR, atomically.

    Parameters
    ----------
    path : path-like
        The file; its folder must exist.
    layers : mapping of str to (H, W, C) float32
        All of one size. Non-contiguous views are fine.
    letters : mapping of str to str
        One letter per channel of each layer, as in ``"RGB"``.
    half_layers : sequence of str
        Layers stored as half; the others are float. A layer with a finite value beyond what half holds (65504) stays
        float, so that nothing is clamped.
    compression : str
        One of `COMPRESSIONS`. b44, b44a, dwaa and dwab lose precision, pxr24 that of float layers.
    metadata : mapping, optional
        str, int, float or sequences of float, stored as header attributes.

    Returns
    -------
    list of str
        The half layers that had to stay float.

    Raises
    ------
    ValueError
        For no layers, sizes that disagree, an unknown compression.
    OSError
        Where the file cannot be written; what was there before is untouched.
    """
    import OpenImageIO as oiio

    if compression not in COMPRESSIONS:
        raise ValueError(f"{path}: compression must be one of {', '.join(COMPRESSIONS)}, got {compression!r}.")
    if not layers:
        raise ValueError(f"{path}: layers must be one or more, got none.")
    height, width = next(iter(layers.values())).shape[:2]
    for name, array in layers.items():
        if array.shape != (height, width, len(letters[name])):
            raise ValueError(
                f"{path}: layer {name} must have shape {(height, width, len(letters[name]))}, got {array.shape}."
            )
    promoted = [name for name in half_layers if name in layers and _exceeds_half(layers[name])]
    channels = [
        _Channel(channel, layers[name][:, :, i], "half" if name in half_layers and name not in promoted else "float")
        for name in layers
        for i, channel in enumerate(channel_names(name, letters[name]))
    ]

    formats = [channel.format for channel in channels]
    spec = oiio.ImageSpec(width, height, len(channels), formats[0])
    spec.channelnames = tuple(channel.name for channel in channels)
    if len(set(formats)) > 1:  # OpenImageIO takes no heed of channelformats that are all the same
        spec.channelformats = tuple(formats)
    spec.attribute("compression", compression)
    for key, value in (metadata or {}).items():
        _set_attribute(oiio, spec, key, value)

    with replacing(path) as temporary:
        output = oiio.ImageOutput.create("openexr")
        try:
            _check(output.open(str(temporary), spec), output)
            for top in range(0, height, STRIP):
                bottom = min(height, top + STRIP)
                strip = np.stack([channel.array[top:bottom] for channel in channels], axis=-1, dtype=np.float32)
                _check(output.write_scanlines(top, bottom, 0, strip), output)
        finally:
            closed = output.close()
        _check(closed, output)
    return promoted


def read_exr(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read a multi-channel EXR back into layers.

    Returns
    -------
    layers : dict of str to (H, W, C) float32
        R, G, B, A are ``beauty``. The order is that of OpenEXR, by name.
    metadata : dict
        The header's attributes.

    Raises
    ------
    OSError
        Naming `path`, for a file that is missing, truncated or no image.
    """
    with _opened(path) as source:
        spec = source.spec()
        pixels = source.read_image("float")
        if pixels is None or source.has_error:
            raise OSError(f"{path}: must be a whole image: {_one_line(source.geterror())}")
    layers: dict[str, list[int]] = {}
    for i, channel in enumerate(spec.channelnames):
        layers.setdefault(_layer_of(channel), []).append(i)
    return {name: pixels[:, :, columns] for name, columns in layers.items()}, _attributes(spec)


def read_header(path: str | os.PathLike) -> tuple[int, int, dict[str, dict[str, str]], dict[str, Any]]:
    """What an EXR says of itself, without its pixels.

    Returns
    -------
    width, height : int
    layers : dict of str to dict
        By layer: channel name to its format, half, float or uint.
    metadata : dict

    Raises
    ------
    OSError
        As `read_exr`.
    """
    with _opened(path) as source:
        spec = source.spec()
    layers: dict[str, dict[str, str]] = {}
    formats = spec.channelformats or (spec.format,) * spec.nchannels
    for channel, format in zip(spec.channelnames, formats, strict=True):
        layers.setdefault(_layer_of(channel), {})[channel] = str(format)
    return spec.width, spec.height, layers, _attributes(spec)


@contextlib.contextmanager
def _opened(path: str | os.PathLike) -> Iterator[Any]:
    import OpenImageIO as oiio

    if not Path(path).is_file():
        raise FileNotFoundError(f"{path}: file must exist. Check the path.")
    source = oiio.ImageInput.open(str(path))
    if source is None:
        raise OSError(f"{path}: must be an image: {_one_line(oiio.geterror())}")
    try:
        yield source
    finally:
        source.close()


def _layer_of(channel: str) -> str:
    layer, _, letter = channel.rpartition(".")
    if layer:
        return layer
    return "beauty" if letter in ("R", "G", "B", "A") else letter


def _attributes(spec: Any) -> dict[str, Any]:
    return {attribute.name: attribute.value for attribute in spec.extra_attribs}


def _exceeds_half(array: np.ndarray) -> bool:
    magnitude = np.abs(array)
    return bool(np.any((magnitude > HALF_MAX) & np.isfinite(magnitude)))


def _set_attribute(oiio: Any, spec: Any, key: str, value: Any) -> None:
    if isinstance(value, bool):
        value = int(value)
    if isinstance(value, int) and not -(2**31) <= value < 2**31:
        value = str(value)  # OpenEXR's integers have 32 bits with sign
    if isinstance(value, str | int | float):
        spec.attribute(key, value)
        return
    values = np.asarray(value, dtype=np.float32).ravel()
    if values.size == 16:
        spec.attribute(key, oiio.TypeMatrix44, tuple(values.tolist()))
    else:
        spec.attribute(key, oiio.TypeDesc(f"float[{values.size}]"), tuple(values.tolist()))


def _check(succeeded: bool, output: Any) -> None:
    if not succeeded:
        raise OSError(_one_line(output.geterror()) or "writing failed")


def _one_line(text: str) -> str:
    return " ".join(text.split())


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
    if problem := _one_line(config.geterror()):
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
        raise OSError(f"OCIO: display '{display}', view '{view}' failed: {_one_line(shown.geterror())}")
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
            _check(output.open(str(temporary), spec), output)
            _check(output.write_image(np.ascontiguousarray(display)), output)
        finally:
            closed = output.close()
        _check(closed, output)
    return transform
