"""Image files as linear float arrays: found through USD's resolver, in usdz packages and UDIM sets too.

Model: every image is decoded once when the stage is read, so that a broken one is named then. Small ones stay in
memory; of large ones copies of 64 texels stay, and finer levels are read again when a render first sees them that
closely (`Texture`). Colour spaces: sRGB and raw here, all others by OpenColorIO through OpenImageIO: names of the
configuration in $OCIO, else of OpenImageIO's own (lin_rec709, acescg, g22_rec709, adobergb ...).
"""

from __future__ import annotations

import hashlib
import re
import tempfile
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Ar, Sdf

from .._frazil import Texture, TextureTile
from ..warning import FrazilWarning
from .context import ReadContext

# Images of more pixels are read as they are needed.
SMALL_IMAGE = 2**20
_KEPT_TEXELS = 64
_MOST_PIXELS = 2**30
_UDIM = re.compile(r"<(UDIM|UVTILE)>", re.IGNORECASE)
_LINEAR = "lin_rec709_scene"
_SRGB_NAMES = frozenset({"srgb", "srgb_texture", "srgb_rec709_scene", "srgb_tx"})
_RAW_NAMES = frozenset({"", "raw", "none", "data", "identity", "lin_rec709", "lin_rec709_scene", "lin_srgb", "linear"})


class TextureError(OSError):
    """An image that is missing or unreadable; the message begins with its path."""


@dataclass
class Image:
    """An image, or the tiles of a UDIM set, by functions that give the linear pixels (height, width, channels)."""

    key: tuple
    tiles: dict[int, Callable[[], np.ndarray]]
    channels: int
    is_8_bit: bool = False
    is_decoded: bool = False  # from a colour space: not the numbers of the file
    missing: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    notes: list[str] = field(default_factory=list)
    _pixels: dict[int, np.ndarray] = field(default_factory=dict)
    _made: list[TextureTile] | None = None

    @property
    def has_alpha(self) -> bool:
        """Whether channel 3 is anything but 1."""
        return self.channels in (2, 4)

    @property
    def is_file(self) -> bool:
        """Whether it is read as it is stored, not worked out."""
        return self.key[0] == "file"

    @property
    def is_udim(self) -> bool:
        """Whether there is a tile for each unit of st."""
        return 0 not in self.tiles

    def pixels(self, number: int) -> np.ndarray:
        """The pixels of one tile; small ones are kept."""
        known = self._pixels.get(number)
        if known is not None:
            return known
        pixels = self.tiles[number]()
        if pixels.shape[0] * pixels.shape[1] <= SMALL_IMAGE:
            self._pixels[number] = pixels
        return pixels

    def to_texture(self, context: ReadContext, owner, wraps: tuple[str, str]) -> Texture | None:
        """What the core reads; the pixels are shared. None, after a warning about `owner`, where none can be read."""
        if self._made is None:
            self._made = self._make_tiles(context, owner)
        return Texture.from_tiles(self._made, *wraps, missing=self.missing) if self._made else None

    def _make_tiles(self, context: ReadContext, owner) -> list[TextureTile]:
        tiles = []
        for number in sorted(self.tiles):
            try:
                pixels = self.pixels(number)
            except OSError as error:
                context.warn(owner, f"{error} Its fallback is used.")
                continue
            is_small = pixels.shape[0] * pixels.shape[1] <= SMALL_IMAGE
            if is_small and not self.is_udim:
                tiles.append(TextureTile(number, pixels))
                continue
            content = hashlib.blake2b(pixels.data, digest_size=16).hexdigest()
            again = None if is_small else _guarded(self.tiles[number], pixels.shape)
            tiles.append(TextureTile(number, pixels, again, _KEPT_TEXELS, self.is_8_bit, f"{number}:{content};"))
        for note in dict.fromkeys(self.notes):
            context.warn(owner, note)
        self.notes.clear()
        return tiles


def _guarded(load: Callable[[], np.ndarray], shape: tuple[int, ...]) -> Callable[[], np.ndarray]:
    """The same for a render, where a file that has gone or changed its size must not end it."""

    def load_again() -> np.ndarray:
        try:
            pixels = load()
        except OSError as error:
            warnings.warn(f"{error} It is rendered as coarsely as it was first read.", FrazilWarning, stacklevel=2)
            return np.zeros((0, 0, 0), np.float32)
        return pixels if pixels.shape == shape else np.zeros((0, 0, 0), np.float32)

    return load_again


def resolve(context: ReadContext, asset: Sdf.AssetPath, attribute=None) -> str:
    """Where the asset lies; '' where it cannot be found."""
    if asset.resolvedPath:
        return asset.resolvedPath
    if not asset.path:
        return ""
    return str(Ar.GetResolver().Resolve(_anchored(context, asset, attribute)))


def _anchored(context: ReadContext, asset: Sdf.AssetPath, attribute) -> str:
    layer = context.stage.GetRootLayer()
    if attribute is not None:
        stack = attribute.GetPropertyStack(context.time)
        layer = stack[0].layer if stack else layer
    return str(Sdf.ComputeAssetPathRelativeToLayer(layer, asset.path))


def find_tiles(context: ReadContext, asset: Sdf.AssetPath, attribute=None) -> dict[int, str]:
    """The files that an asset names, by UDIM number; 0 for a plain image. Empty where there are none."""
    match = _UDIM.search(asset.path)
    if not match:
        path = resolve(context, asset, attribute)
        return {0: path} if path else {}
    path = _anchored(context, asset, attribute)
    match = _UDIM.search(path)
    before, after = path[: match.start()], path[match.end() :]
    number = r"(?P<n>[1-9]\d{3})" if match[1].upper() == "UDIM" else r"u(?P<u>\d+)_v(?P<v>\d+)"
    pattern = re.compile(re.escape(before) + number + re.escape(after))
    found: dict[int, str] = {}
    for candidate in _siblings(path):
        if hit := pattern.fullmatch(candidate):
            groups = hit.groupdict()
            tile = int(groups["n"]) if "n" in groups else 1000 + int(groups["u"]) + 10 * (int(groups["v"]) - 1)
            if tile >= 1001:
                found[tile] = candidate
    return found


def _siblings(path: str) -> list[str]:
    if Ar.IsPackageRelativePath(path):
        package, _ = Ar.SplitPackageRelativePathOuter(path)
        try:
            with zipfile.ZipFile(package) as archive:
                return [f"{package}[{name}]" for name in archive.namelist()]
        except (OSError, zipfile.BadZipFile):
            return []
    folder = Path(path).parent
    return [str(folder / entry.name) for entry in folder.iterdir()] if folder.is_dir() else []


def read_image(path: str) -> tuple[np.ndarray, bool]:
    """The pixels (height, width, channels) float32 as stored, at most 4 channels, and whether the file is 8-bit.

    OSError, beginning with the path, where it cannot be read.
    """
    if Ar.IsPackageRelativePath(path):
        return _read_packaged(path)
    if not Path(path).is_file():
        raise TextureError(f"{path}: no such image.")
    image = oiio.ImageBuf(path)
    spec = image.spec()
    if image.has_error or spec.width < 1 or spec.nchannels < 1:
        message = image.geterror() or "it has no pixels"
        raise TextureError(f"{path}: not a readable image: {message.splitlines()[0]}")
    if spec.width * spec.height > _MOST_PIXELS:
        raise TextureError(
            f"{path}: size must be at most 2^30 pixels, got {spec.width} x {spec.height}. Use UDIM tiles."
        )
    is_8_bit = spec.format.basetype == oiio.UINT8
    pixels = image.get_pixels(oiio.FLOAT)
    if pixels is None or image.has_error:
        raise TextureError(f"{path}: not a readable image: {(image.geterror() or 'truncated').splitlines()[0]}")
    pixels = np.asarray(pixels, dtype=np.float32).reshape(spec.height, spec.width, -1)
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


def open_image(
    context: ReadContext, owner, asset: Sdf.AssetPath, attribute, color_space: str, known: dict[tuple, Image | None]
) -> Image | None:
    """The image that an asset names; None, after one warning about `owner`, where there is none to read.

    `color_space` is a name, or 'auto': 8-bit images of 3 or 4 channels are sRGB.
    """
    files = find_tiles(context, asset, attribute)
    key = (tuple(sorted(files.items())), asset.path, color_space)
    if key in known:
        return known[key]
    known[key] = None
    if not files:
        what = "has no tiles" if _UDIM.search(asset.path) else "cannot be found"
        context.warn(owner, f"@{asset.path}@ {what}. Its fallback is used.")
        return None
    image = Image(("file", *key), {}, 0, True)
    for number, path in sorted(files.items()):
        try:
            channels, is_8_bit = _look_at(path)
        except OSError as error:
            context.warn(owner, f"{error} Its fallback is used.")
            continue
        image.channels, image.is_8_bit = max(image.channels, channels), image.is_8_bit and is_8_bit
        image.tiles[number] = _loader(path, color_space, image.notes)
    image.is_decoded = _is_decoded(color_space, image.channels, image.is_8_bit)
    if image.tiles:
        known[key] = image
    return known[key]


def _is_decoded(color_space: str, channels: int, is_8_bit: bool) -> bool:
    name = color_space.lower()
    return (is_8_bit and channels >= 3) if name == "auto" else name not in _RAW_NAMES


def _look_at(path: str) -> tuple[int, bool]:
    """Channels, and whether it is 8-bit, from the file's header."""
    if Ar.IsPackageRelativePath(path):
        pixels, is_8_bit = read_image(path)
        return pixels.shape[2], is_8_bit
    if not Path(path).is_file():
        raise TextureError(f"{path}: no such image.")
    source = oiio.ImageInput.open(path)
    if source is None:
        raise TextureError(f"{path}: not a readable image: {(oiio.geterror() or 'unknown format').splitlines()[0]}.")
    spec = source.spec()
    source.close()
    if spec.width * spec.height > _MOST_PIXELS:
        raise TextureError(
            f"{path}: size must be at most 2^30 pixels, got {spec.width} x {spec.height}. Use UDIM tiles."
        )
    return min(spec.nchannels, 4), spec.format.basetype == oiio.UINT8


def _loader(path: str, color_space: str, notes: list[str]) -> Callable[[], np.ndarray]:
    def load() -> np.ndarray:
        stored, is_8_bit = read_image(path)
        try:
            pixels = to_linear(stored, color_space, is_8_bit)
        except ValueError as error:
            notes.append(f"{error} {path} is taken as raw.")
            pixels = to_linear(stored, "raw", is_8_bit)
        if not np.isfinite(pixels).all():
            notes.append(f"{path} has NaN or infinite pixels. They are taken as 0.")
            pixels = np.nan_to_num(pixels, nan=0.0, posinf=0.0, neginf=0.0)
        return np.ascontiguousarray(pixels, dtype=np.float32)

    return load


def to_linear(pixels: np.ndarray, color_space: str, is_8_bit: bool) -> np.ndarray:
    """Pixels of a colour space as linear Rec.709; alpha stays. ValueError for a space that nobody knows."""
    if pixels.shape[2] == 2:  # grey and alpha
        pixels = pixels[..., [0, 0, 0, 1]]
    if not _is_decoded(color_space, pixels.shape[2], is_8_bit):
        return pixels
    if color_space.lower() in _SRGB_NAMES or color_space.lower() == "auto":
        return decode_srgb(pixels)
    color = np.repeat(pixels[..., :1], 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]
    image = oiio.ImageBuf(oiio.ImageSpec(color.shape[1], color.shape[0], 3, oiio.FLOAT))
    image.set_pixels(oiio.ROI(), np.ascontiguousarray(color))
    converted = oiio.ImageBufAlgo.colorconvert(image, color_space, _LINEAR)
    if converted.has_error:
        raise ValueError(f"colour space '{color_space}' is not known: {converted.geterror().splitlines()[0]}")
    linear = np.asarray(converted.get_pixels(oiio.FLOAT), np.float32)
    return linear[..., :1] if pixels.shape[2] == 1 else np.concatenate([linear, pixels[..., 3:]], axis=-1)


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
