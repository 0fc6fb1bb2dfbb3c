"""Layered OpenEXR: a film's layers in one file, replaced whole or not at all.

Model: a layer is an (H, W, C) float32 array; its channels are stored as ``layer.R``, those of the beauty as plain
R, G, B, A, and a layer of one channel under its own name. Files are replaced whole (see replacing.py).
Units: linear light. Row 0 is on top.
Not: tiles, mip-maps, deep data; previews and other formats (see image.py).
"""

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from .image import HALF_MAX, one_line, opened
from .replacing import replacing

__all__ = ["COMPRESSIONS", "channel_names", "read_exr", "read_header", "write_exr"]

# Attributes that writing sets itself, whatever the picture that was read had.
_WINDOWS = ("dataWindow", "displayWindow")
_OWN_ATTRIBUTES = ("compression", "name", "type", "chunkCount", *_WINDOWS)
# What OpenEXR calls attributes that OpenImageIO, which reads them, has names of its own for.
_STANDARD_NAMES = {
    "PixelAspectRatio": "pixelAspectRatio",
    "DateTime": "capDate",
    "ImageDescription": "comments",
    "Copyright": "owner",
    "ExposureTime": "expTime",
    "FNumber": "aperture",
    "worldtocamera": "worldToCamera",
    "worldtoscreen": "worldToNDC",
}
LOSSY = ("pxr24", "b44", "b44a", "dwaa", "dwab")
COMPRESSIONS = ("none", "rle", "zip", "zips", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab")
STRIP = 256  # rows read at a time where channels are few: a multiple of every compression's block


def channel_names(layer: str, letters: str) -> list[str]:
    """What the channels of a layer are called in an EXR: ``specular.R``, R for the beauty, ``Z`` where there is one."""
    if layer == "beauty":
        return list(letters)
    if len(letters) == 1:
        return [layer]
    return [f"{layer}.{letter}" for letter in letters]


def write_exr(
    path: str | os.PathLike,
    layers: Mapping[str, np.ndarray],
    letters: Mapping[str, str],
    *,
    half_layers: Sequence[str] = (),
    exact_layers: Sequence[str] = (),
    compression: str = "zips",
    multipart: bool = False,
    metadata: Mapping[str, Any] | None = None,
) -> list[str]:
    """Write layers as one multi-channel EXR, atomically.

    Parameters
    ----------
    path : path-like
        The file; its folder must exist.
    layers : mapping of str to (H, W, C) float32 or float16
        All of one size. Non-contiguous views are fine.
    letters : mapping of str to str
        One letter per channel of each layer, as in ``"RGB"``.
    half_layers : sequence of str
        Layers stored as half; the others are float. A layer with a finite value beyond what half holds (65504) stays
        float, so that nothing is clamped.
    exact_layers : sequence of str
        Layers whose bits matter (Cryptomatte): never stored by a lossy compression.
    compression : str
        One of `COMPRESSIONS`. b44, b44a, dwaa and dwab lose precision, pxr24 that of float layers.
    multipart : bool
        Every layer in a part of its own, named after it, so that a program reads only what it shows.
    metadata : mapping, optional
        str, int, float or sequences of float, stored as header attributes. ``dataWindow`` and ``displayWindow``, (x, y,
        width, height) in pixels, place the picture; the size of the data window is that of the layers.

    Returns
    -------
    list of str
        The half layers that had to stay float.

    Raises
    ------
    ValueError
        For no layers, sizes that disagree, an unknown compression, or a lossy one for an exact layer in a single part.
    OSError
        Where the file cannot be written; what was there before is untouched.
    """
    import OpenEXR

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
    exact = [name for name in exact_layers if name in layers]
    if exact and compression in LOSSY and not multipart:
        raise ValueError(
            f"{path}: compression must keep the bits of layer {exact[0]}, got {compression}. Choose zips or piz, or "
            "--multipart, where every layer has its own."
        )
    promoted = [name for name in half_layers if name in layers and _exceeds_half(layers[name])]
    halves = set(half_layers) - set(promoted)
    attributes = _header_of(metadata or {}, width, height)
    with ThreadPoolExecutor(threads := os.cpu_count() or 1) as pool:
        kept = pool.map(lambda name: _channels_of(name, layers[name], letters[name], name in halves), layers)
        channels = dict(zip(layers, kept, strict=True))
    if multipart:
        parts = []
        for name in layers:
            # A later part repeats only what belongs to it.
            own = {
                key: value
                for key, value in attributes.items()
                if not parts or key in _WINDOWS or (key.startswith("cryptomatte/") and name.startswith("crypto"))
            }
            own["compression"] = _compression("zips" if name in exact and compression in LOSSY else compression)
            parts.append(OpenEXR.Part(own | {"type": OpenEXR.scanlineimage}, channels[name], name))
    else:
        attributes |= {"compression": _compression(compression), "type": OpenEXR.scanlineimage}
        joined = {channel: array for own in channels.values() for channel, array in own.items()}
        parts = [OpenEXR.Part(attributes, joined, "")]

    OpenEXR.set_global_thread_count(threads)
    with replacing(path) as temporary:
        try:
            OpenEXR.File(parts).write(str(temporary))
        except RuntimeError as error:
            raise OSError(one_line(str(error))) from error
    return promoted


def _compression(name: str) -> Any:
    import OpenEXR

    return getattr(OpenEXR, f"{name.upper()}_COMPRESSION" if name != "none" else "NO_COMPRESSION")


def _channels_of(layer: str, array: np.ndarray, letters: str, is_half: bool) -> dict[str, np.ndarray]:
    """The channels of a layer by name, each in memory of its own as it is stored."""
    kind = np.float16 if is_half else np.float32
    names = channel_names(layer, letters)
    return {name: np.ascontiguousarray(array[:, :, i], dtype=kind) for i, name in enumerate(names)}


def _header_of(metadata: Mapping[str, Any], width: int, height: int) -> dict[str, Any]:
    """A header's attributes, as OpenEXR has them."""
    data = [int(v) for v in metadata.get("dataWindow", (0, 0, width, height))][:2] + [width, height]
    display = [int(v) for v in metadata.get("displayWindow", data)]
    header = {
        name: (np.array([x, y], np.int32), np.array([x + w - 1, y + h - 1], np.int32))
        for name, (x, y, w, h) in zip(_WINDOWS, (data, display), strict=True)
    }
    for key, value in metadata.items():
        if key not in _OWN_ATTRIBUTES and not key.startswith(("oiio:", "openexr:")):
            if not isinstance(value, bool | int | float | str) and np.size(value) == 0:
                continue  # no attribute of OpenEXR holds an empty list
            name = _STANDARD_NAMES.get(key, key)
            header[name] = _attribute_of(name, value)
    return header


def read_exr(
    path: str | os.PathLike, *, keep_half: bool = False, layers: Collection[str] | None = None
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Read a multi-channel EXR, of one part or several, back into layers.

    Parameters
    ----------
    path : path-like
        The file.
    keep_half : bool
        Give float16 for layers that are stored as half: half the memory. Else all are float32.
    layers : collection of str, optional
        Only these; those that the file lacks are left out. All of them if not given.

    Returns
    -------
    layers : dict of str to (H, W, C) float32 or float16
        R, G, B, A are ``beauty``; a part whose channels have no layer of their own in their names is the layer of the
        part's name. The order is that of the file. Each array has its own memory.
    metadata : dict
        The header's attributes. ``dataWindow`` and ``displayWindow`` where the two differ.

    Raises
    ------
    OSError
        Naming `path`, for a file that is missing, truncated or no image.
    ValueError
        For parts of several sizes, or a layer that is in several parts.
    """
    result: dict[str, np.ndarray] = {}
    metadata: dict[str, Any] = {}
    with opened(path) as source:
        for spec in _parts(source):
            columns = _layers_of(spec, part_names=_part_names(source))
            columns = {name: own for name, own in columns.items() if layers is None or name in layers}
            for name in columns:
                if name in result:
                    raise ValueError(f"{path}: layer {name} must be in one part, is in several.")
            result |= _read_part(path, source, spec, columns, keep_half)
            metadata = _attributes(spec) | metadata
    sizes = sorted({array.shape[:2] for array in result.values()})
    if len(sizes) > 1:
        raise ValueError(f"{path}: parts must have one size, got {sizes}. Crop them to the same data window.")
    return result, metadata


def _parts(source: Any) -> Iterator[Any]:
    """The spec of each part; the source stands there meanwhile."""
    index = 0
    while source.seek_subimage(index, 0):
        yield source.spec()
        index += 1
    source.geterror()  # of the seek beyond the last


def _part_names(source: Any) -> list[str]:
    index, names = source.current_subimage(), []
    at = 0
    while source.seek_subimage(at, 0):
        names.append(source.spec().get_string_attribute("oiio:subimagename"))
        at += 1
    source.geterror()
    source.seek_subimage(index, 0)
    return names


def _layers_of(spec: Any, part_names: Sequence[str]) -> dict[str, list[int]]:
    """The columns of each layer of a part."""
    part = spec.get_string_attribute("oiio:subimagename")
    columns: dict[str, list[int]] = {}
    for i, channel in enumerate(spec.channelnames):
        name = _layer_of(channel)
        if len(part_names) > 1 and "." not in channel and part != part_names[0]:
            name = part or name  # bare R, G, B in a part that says whose they are
        columns.setdefault(name, []).append(i)
    return columns


def _read_part(
    path: str | os.PathLike, source: Any, spec: Any, columns: Mapping[str, list[int]], keep_half: bool
) -> dict[str, np.ndarray]:
    formats = [str(f) for f in spec.channelformats or (spec.format,) * spec.nchannels]
    arrays: dict[str, np.ndarray] = {}
    for name, own in columns.items():
        is_half = keep_half and all(formats[i] == "half" for i in own)
        arrays[name] = np.empty((spec.height, spec.width, len(own)), np.float16 if is_half else np.float32)
    if not arrays:
        return arrays
    # All channels of a strip at a time: they are compressed together.
    kind = (
        "half" if all(array.dtype == np.float16 for array in arrays.values()) and set(formats) == {"half"} else "float"
    )
    rows = max(16, STRIP * 16 // max(spec.nchannels, 16) // 16 * 16)
    for top in range(0, spec.height, rows):
        bottom = min(spec.height, top + rows)
        strip = source.read_scanlines(spec.y + top, spec.y + bottom, 0, 0, spec.nchannels, kind)
        if strip is None or source.has_error:
            raise OSError(f"{path}: must be a whole image: {one_line(source.geterror())}")
        for name, own in columns.items():
            for i, column in enumerate(own):
                arrays[name][top:bottom, :, i] = strip.reshape(bottom - top, spec.width, -1)[:, :, column]
    return arrays


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
    layers: dict[str, dict[str, str]] = {}
    metadata: dict[str, Any] = {}
    with opened(path) as source:
        first = source.spec()
        for spec in _parts(source):
            formats = spec.channelformats or (spec.format,) * spec.nchannels
            for name, columns in _layers_of(spec, _part_names(source)).items():
                layers[name] = {spec.channelnames[i]: str(formats[i]) for i in columns}
            metadata = _attributes(spec) | metadata
    return first.width, first.height, layers, metadata


def _layer_of(channel: str) -> str:
    layer, _, letter = channel.rpartition(".")
    if layer in ("matte", "refracted_matte"):
        return channel  # one channel per matte: each is a layer
    if layer:
        return layer
    return "beauty" if letter in ("R", "G", "B", "A") else letter


def _attributes(spec: Any) -> dict[str, Any]:
    attributes = {attribute.name: attribute.value for attribute in spec.extra_attribs}
    data = (spec.x, spec.y, spec.width, spec.height)
    display = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    return attributes if data == display else attributes | {"dataWindow": data, "displayWindow": display}


def _exceeds_half(array: np.ndarray) -> bool:
    magnitude = np.abs(array)
    return bool(np.any((magnitude > HALF_MAX) & np.isfinite(magnitude)))


def _attribute_of(name: str, value: Any) -> Any:
    """What OpenEXR makes an attribute of the right type of."""
    if isinstance(value, bool):
        return int(value)
    if isinstance(value, int) and not -(2**31) <= value < 2**31:
        return str(value)  # OpenEXR's integers have 32 bits with sign
    if isinstance(value, str | int | float):
        return value
    values = np.asarray(value, dtype=np.float32).ravel()
    if values.size == 16:
        return values.reshape(4, 4)
    if name == "chromaticities":
        return tuple(values.tolist())
    return values if name == "screenWindowCenter" else values.tolist()
