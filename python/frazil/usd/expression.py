"""What feeds a shader's input: numbers, or an image with a scale and a bias, and arithmetic on both.

Model: a value of 1 to 4 numbers. Where they come from an image, each is channel * scale + bias, so that sums and
products with constants stay exact and cost nothing. Anything else is baked: worked out texel by texel, before
filtering, into an image of its own (the larger of two sizes), read from the files as that is needed.
Units: as authored.
Not: images that are laid on differently (primvar, transform, wrapping) in one expression.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from .._frazil import TextureLookup
from .context import ReadContext
from .textures import Image


@dataclass(frozen=True)
class Placement:
    """How an image is laid on: st' = st @ matrix + offset."""

    primvar: str = "st"
    matrix: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    wraps: tuple[str, str] = ("repeat", "repeat")
    triplanar_size: float = 1.0  # metres
    is_triplanar: bool = False

    def with_triplanar(self, size: float, is_forced: bool = False) -> Placement:
        """The same, one repeat every `size` metres where the image is projected."""
        return replace(self, triplanar_size=size, is_triplanar=is_forced)

    def decomposed(self) -> tuple[tuple[float, float], float, bool]:
        """Scales and then a turn in degrees, as UsdTransform2d has it; and whether that is all of the matrix."""
        s, t = np.array(self.matrix[:2]), np.array(self.matrix[2:])  # where (1, 0) and (0, 1) go
        angle = math.atan2(s[1], s[0]) if np.any(s) else math.atan2(-t[0], t[1])
        across = np.array([-math.sin(angle), math.cos(angle)])
        scale = (float(np.hypot(*s)), float(np.dot(t, across)))
        is_whole = bool(np.abs(t - across * scale[1]).max() <= 1e-6 * max(1.0, float(np.abs(t).max())))
        return scale, math.degrees(angle), is_whole


@dataclass(frozen=True)
class Expression:
    """1 to 4 numbers. Without an image `bias` has them; an entry of `channels` is -1 where its bias is all."""

    bias: np.ndarray
    scale: np.ndarray = field(default_factory=lambda: np.zeros(0))
    channels: tuple[int, ...] = ()
    image: Image | None = None
    placement: Placement = Placement()
    is_display_color: bool = False

    @staticmethod
    def constant(value) -> Expression:
        """Of a number, a vector or a colour; ValueError or TypeError where it is none."""
        numbers = np.atleast_1d(np.asarray(value, np.float64)).reshape(-1)
        if not 1 <= numbers.size <= 4:
            raise ValueError(f"a value must have 1 to 4 numbers, got {numbers.size}")
        return Expression(numbers)

    @property
    def width(self) -> int:
        """How many numbers it has."""
        return len(self.bias)

    def component(self, *indices: int) -> Expression:
        """Some of its numbers; a single number repeats. ValueError where it has not so many."""
        if self.width > 1 and max(indices) >= self.width:
            raise ValueError(f"a value of {max(indices) + 1} numbers is wanted, got one of {self.width}")
        at = [i if self.width > 1 else 0 for i in indices]
        if self.image is None:
            return replace(self, bias=self.bias[at])
        return replace(
            self, bias=self.bias[at], scale=self.scale[at], channels=tuple(self.channels[i] for i in at)
        ).simplified()

    def widened(self, width: int) -> Expression:
        """A single number repeated; others as they are."""
        return self.component(*range(width)) if self.width == 1 and width > 1 else self

    def simplified(self) -> Expression:
        """Without its image where nothing is read from it."""
        if self.image is not None and all(c < 0 for c in self.channels):
            return Expression(self.bias)
        return self

    def affine(self, scale, bias) -> Expression:
        """self * scale + bias, with constants. ValueError for displayColor, which stays as it is."""
        if self.is_display_color:
            raise ValueError("displayColor takes no arithmetic")
        scale, bias = np.asarray(scale, np.float64), np.asarray(bias, np.float64)
        wide = self.widened(max(scale.size, bias.size))
        if wide.image is None:
            return Expression(wide.bias * scale + bias)
        return replace(wide, bias=wide.bias * scale + bias, scale=wide.scale * scale)

    def evaluate(self, number: int) -> np.ndarray:
        """The numbers for every texel of a tile: (height, width, n)."""
        pixels = self.image.pixels(number if number in self.image.tiles else min(self.image.tiles))
        planes = [
            np.full(pixels.shape[:2], self.bias[i]) if c < 0 else _plane(pixels, c) * self.scale[i] + self.bias[i]
            for i, c in enumerate(self.channels)
        ]
        return np.stack(planes, axis=-1)

    def key(self) -> tuple:
        """What tells it from others."""
        return (self.image.key if self.image else None, self.channels, tuple(self.scale), tuple(self.bias))

    def mean(self) -> np.ndarray:
        """Its numbers; the mean over all texels of an image."""
        if self.image is None:
            return self.bias
        return np.mean([self.evaluate(n).mean(axis=(0, 1)) for n in sorted(self.image.tiles)], axis=0)

    # -- for materials

    def to_lookup(self, context: ReadContext, owner, width: int) -> TextureLookup | None:
        """What the core reads for an input of `width` numbers; None where the image cannot be read."""
        value = self.component(0) if width == 1 else self.widened(3).component(0, 1, 2)
        channels = value.channels
        is_grey = len(set(channels)) == 1 and channels[0] >= 0
        if not is_grey and channels != tuple(range(channels[0], channels[0] + width)):
            value = bake([value], lambda x: x, "gathered", context, owner)
            channels, is_grey = value.channels, False
        texture = value.image.to_texture(context, owner, value.placement.wraps)
        if texture is None:
            return None
        scale, turn, is_whole = value.placement.decomposed()
        if not is_whole:
            context.warn(owner, "its texture coordinates are sheared, which is not supported. The shear is left out.")
        return TextureLookup(
            texture,
            channels[0],
            np.resize(value.scale, 3).tolist(),
            np.resize(value.bias, 3).tolist(),
            st_scale=scale,
            st_rotation=turn,
            st_translation=value.placement.offset,
            is_grey=is_grey and width == 3,
            is_triplanar=value.placement.is_triplanar,
            triplanar_size=value.placement.triplanar_size,
        )


def _plane(pixels: np.ndarray, channel: int) -> np.ndarray:
    """Channel 0..3 of an image that may have fewer: grey repeats, a missing alpha is 1."""
    count = pixels.shape[2]
    if channel == 3:
        return pixels[..., 3] if count == 4 else np.ones(pixels.shape[:2], np.float32)
    return pixels[..., channel if count >= 3 else 0]


def image_expression(image: Image, channels: list[int], scale, bias, placement: Placement) -> Expression:
    """Channels of an image; one that it lacks is 1 (alpha)."""
    constant = [c == 3 and not image.has_alpha for c in channels]
    scale, bias = np.asarray(scale, np.float64), np.asarray(bias, np.float64)
    return Expression(
        np.where(constant, scale + bias, bias),
        np.where(constant, 0.0, scale),
        tuple(-1 if fixed else c for c, fixed in zip(channels, constant, strict=True)),
        image,
        placement,
    ).simplified()


def combine(parts: list[Expression], context: ReadContext, owner) -> Expression:
    """Single numbers side by side. ValueError for displayColor."""
    if any(p.is_display_color for p in parts):
        raise ValueError("displayColor takes no arithmetic")
    images = {id(p.image): p for p in parts if p.image is not None}
    if not images:
        return Expression(np.concatenate([p.bias[:1] for p in parts]))
    first = next(iter(images.values()))
    if len(images) > 1 or any(p.placement != first.placement for p in images.values()):
        return bake(parts, lambda *x: np.concatenate(x, axis=-1), "combine", context, owner)
    return Expression(
        np.array([p.bias[0] for p in parts]),
        np.array([0.0 if p.image is None else p.scale[0] for p in parts]),
        tuple(-1 if p.image is None else p.channels[0] for p in parts),
        first.image,
        first.placement,
    )


def bake(
    arguments: list[Expression], function: Callable[..., np.ndarray], name: str, context: ReadContext, owner
) -> Expression:
    """function(arguments), worked out now for constants, else texel by texel as the images are read."""
    if any(a.is_display_color for a in arguments):
        raise ValueError("displayColor takes no arithmetic")
    imaged = [a for a in arguments if a.image is not None]
    if not imaged:
        with np.errstate(all="ignore"):
            result = np.asarray(function(*[a.bias for a in arguments]), np.float64).reshape(-1)
        return Expression(np.nan_to_num(result, nan=0.0, posinf=0.0, neginf=0.0))
    placement = imaged[0].placement
    if any(a.placement != placement for a in imaged):
        context.warn(
            owner, f"'{name}' joins images that are laid on differently, which is not supported. The first is taken."
        )
        return imaged[0]
    numbers = sorted(set().union(*(a.image.tiles for a in imaged)))

    def load(number: int) -> np.ndarray:
        values = [a.bias.reshape(1, 1, -1) if a.image is None else a.evaluate(number) for a in arguments]
        height, width = max(v.shape[0] for v in values), max(v.shape[1] for v in values)
        values = [v if v.shape[:2] == (1, 1) else _resized(v, height, width) for v in values]
        with np.errstate(all="ignore"):
            result = np.asarray(function(*values), np.float32)
        result = np.broadcast_to(result, (height, width, result.shape[-1]))[..., :4]
        if result.shape[2] == 2:  # two numbers are no grey and alpha
            result = np.concatenate([result, np.zeros_like(result[..., :1])], axis=-1)
        return np.ascontiguousarray(np.nan_to_num(result, nan=0.0, posinf=0.0, neginf=0.0))

    with np.errstate(all="ignore"):
        probe = np.asarray(function(*[np.ones((1, 1, a.width), np.float32) for a in arguments]))
    width = min(probe.shape[-1], 4)
    image = Image(
        ("baked", name, *(a.key() for a in arguments)),
        {n: (lambda n=n: load(n)) for n in numbers},
        3 if width == 2 else width,
        all(a.image.is_8_bit for a in imaged),
        notes=imaged[0].image.notes,
    )
    return Expression(np.zeros(width), np.ones(width), tuple(range(width)), image, placement)


def _resized(values: np.ndarray, height: int, width: int) -> np.ndarray:
    """Bilinear between texel centres."""
    for axis, size in ((0, height), (1, width)):
        have = values.shape[axis]
        if have == size:
            continue
        at = np.clip((np.arange(size) + 0.5) * have / size - 0.5, 0, have - 1)
        low = np.floor(at).astype(int)
        high = np.minimum(low + 1, have - 1)
        shape = [1, 1, 1]
        shape[axis] = size
        share = (at - low).reshape(shape)
        values = np.take(values, low, axis) * (1 - share) + np.take(values, high, axis) * share
    return values
