"""Arithmetic of MaterialX's nodes: exact on images with constants, else texel by texel.

Model: the formulas of MaterialX's own implementations (libraries/stdlib/genosl). POINTWISE has functions of numpy
arrays whose last axis has the numbers; EXACT keeps sums and products with constants as a scale and a bias.
Not: angles other than in degrees, matrices other than constant ones.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .expression import Expression, bake

_SMALLEST = 1e-8  # of a divisor


class UnsupportedNodeError(Exception):
    """A node whose value cannot be told from constants and images."""


def _smooth(t: np.ndarray) -> np.ndarray:
    return t * t * (3.0 - 2.0 * t)


def _nonzero(x: np.ndarray) -> np.ndarray:
    return np.where(np.abs(x) < _SMALLEST, 1.0, x)


def _luminance(x: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    grey = np.sum(x[..., :3] * coefficients, axis=-1, keepdims=True)
    return np.concatenate([np.repeat(grey, 3, axis=-1), x[..., 3:]], axis=-1)


def _rgb_to_hsv(x: np.ndarray) -> np.ndarray:
    rgb, rest = x[..., :3], x[..., 3:]
    high, low = rgb.max(axis=-1, keepdims=True), rgb.min(axis=-1, keepdims=True)
    span = high - low
    r, g, b = (rgb[..., i : i + 1] for i in range(3))
    sectors = [(g - b) / _nonzero(span), 2.0 + (b - r) / _nonzero(span)]
    hue = np.select([span <= 0.0, high == r, high == g], [0.0 * r, *sectors], 4.0 + (r - g) / _nonzero(span)) / 6.0
    hue = np.where(hue < 0.0, hue + 1.0, hue)
    saturation = np.where(high > 0, span / _nonzero(high), 0.0)
    return np.concatenate([hue, saturation, high, rest], axis=-1)


def _hsv_to_rgb(x: np.ndarray) -> np.ndarray:
    hue, saturation, value, rest = x[..., :1], x[..., 1:2], x[..., 2:3], x[..., 3:]
    sector = 6.0 * (hue - np.floor(hue))
    # The distance around the circle of hues from red, green and blue.
    away = np.abs((sector - np.array([0.0, 2.0, 4.0]) + 3.0) % 6.0 - 3.0)
    full = np.clip(2.0 - away, 0.0, 1.0)
    return np.concatenate([value * (1.0 - saturation + saturation * full), rest], axis=-1)


def _rotate_2d(x: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    return np.concatenate([c * x[..., :1] + s * x[..., 1:2], c * x[..., 1:2] - s * x[..., :1]], axis=-1)


def _rotate_3d(x: np.ndarray, degrees: np.ndarray, axis: np.ndarray) -> np.ndarray:
    axis = axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), _SMALLEST)
    s, c = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    x, axis = np.broadcast_arrays(x, axis)
    return x * c + np.cross(x, axis) * s + axis * np.sum(axis * x, axis=-1, keepdims=True) * (1.0 - c)


def _blended(top: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Callable[..., np.ndarray]:
    return lambda fg, bg, mix: top(fg, bg) * mix + bg * (1.0 - mix)


def _alpha(x: np.ndarray) -> np.ndarray:
    return x[..., 3:4]


def _burn(fg: np.ndarray, bg: np.ndarray, mix: np.ndarray) -> np.ndarray:
    return np.where(np.abs(fg) < _SMALLEST, 0.0, mix * (1.0 - (1.0 - bg) / _nonzero(fg)) + (1.0 - mix) * bg)


def _dodge(fg: np.ndarray, bg: np.ndarray, mix: np.ndarray) -> np.ndarray:
    return np.where(np.abs(1.0 - fg) < _SMALLEST, 0.0, mix * (bg / _nonzero(1.0 - fg)) + (1.0 - mix) * bg)


def _matte(fg: np.ndarray, bg: np.ndarray) -> np.ndarray:
    rgb = fg[..., :3] * _alpha(fg) + bg[..., :3] * (1.0 - _alpha(fg))
    return np.concatenate([rgb, _alpha(fg) + _alpha(bg) * (1.0 - _alpha(fg))], axis=-1)


def _disjoint_over(fg: np.ndarray, bg: np.ndarray) -> np.ndarray:
    total = _alpha(fg) + _alpha(bg)
    share = np.where(np.abs(_alpha(bg)) < _SMALLEST, 0.0, (1.0 - _alpha(fg)) / _nonzero(_alpha(bg)))
    crowded = np.where(np.abs(_alpha(bg)) < _SMALLEST, 0.0, fg[..., :3] + bg[..., :3] * share)
    rgb = np.where(total <= 1.0, fg[..., :3] + bg[..., :3], crowded)
    return np.concatenate([rgb, np.minimum(total, 1.0)], axis=-1)


def _premultiplied(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x[..., :3] * _alpha(x), _alpha(x)], axis=-1)


def _unpremultiplied(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x[..., :3] / _nonzero(_alpha(x)), _alpha(x)], axis=-1)


_IN = (("in", 0),)
_TWO = (("in1", 0), ("in2", 0))
_BLEND = (("fg", 0), ("bg", 0), ("mix", 1))
_MASKED = (("in", 0), ("mask", 1))
_CHOICE = (("value1", 1), ("value2", 0), ("in1", 0), ("in2", 0))

# By a node's category: its inputs, with their values where no definition tells them, and the function.
POINTWISE: dict[str, tuple[tuple[tuple[str, float], ...], Callable[..., np.ndarray]]] = {
    "clamp": ((("in", 0), ("low", 0), ("high", 1)), lambda x, low, high: np.minimum(np.maximum(x, low), high)),
    "min": (_TWO, np.minimum),
    "max": (_TWO, np.maximum),
    "power": ((("in1", 0), ("in2", 1)), lambda x, y: np.power(np.maximum(x, 0), y)),
    "modulo": ((("in1", 0), ("in2", 1)), np.mod),
    "absval": (_IN, np.abs),
    "sign": (_IN, np.sign),
    "floor": (_IN, np.floor),
    "ceil": (_IN, np.ceil),
    "round": (_IN, lambda x: np.floor(x + 0.5)),
    "fract": (_IN, lambda x: x - np.floor(x)),
    "sqrt": (_IN, lambda x: np.sqrt(np.maximum(x, 0))),
    "exp": (_IN, np.exp),
    "ln": ((("in", 1),), lambda x: np.log(np.maximum(x, 1e-30))),
    "sin": (_IN, np.sin),
    "cos": (_IN, np.cos),
    "tan": (_IN, np.tan),
    "asin": (_IN, lambda x: np.arcsin(np.clip(x, -1, 1))),
    "acos": (_IN, lambda x: np.arccos(np.clip(x, -1, 1))),
    "atan2": ((("iny", 0), ("inx", 1)), np.arctan2),
    "smoothstep": (
        (("in", 0), ("low", 0), ("high", 1)),
        lambda x, low, high: _smooth(np.clip((x - low) / np.where(high == low, 1e-9, high - low), 0, 1)),
    ),
    "dotproduct": (_TWO, lambda x, y: np.sum(x * y, axis=-1, keepdims=True)),
    "crossproduct": (_TWO, lambda x, y: np.cross(*np.broadcast_arrays(x, y))),
    "magnitude": (_IN, lambda x: np.linalg.norm(x, axis=-1, keepdims=True)),
    "normalize": (_IN, lambda x: x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-20)),
    "rotate2d": ((("in", 0), ("amount", 0)), _rotate_2d),
    "rotate3d": ((("in", 0), ("amount", 0), ("axis", 0)), _rotate_3d),
    "luminance": ((("in", 0), ("lumacoeffs", 0)), _luminance),
    "rgbtohsv": (_IN, _rgb_to_hsv),
    "hsvtorgb": (_IN, _hsv_to_rgb),
    "premult": (_IN, _premultiplied),
    "unpremult": (_IN, _unpremultiplied),
    "plus": (_BLEND, _blended(lambda f, b: b + f)),
    "minus": (_BLEND, _blended(lambda f, b: b - f)),
    "difference": (_BLEND, _blended(lambda f, b: np.abs(b - f))),
    "screen": (_BLEND, _blended(lambda f, b: 1.0 - (1.0 - f) * (1.0 - b))),
    "burn": (_BLEND, _burn),
    "dodge": (_BLEND, _dodge),
    "in": (_BLEND, _blended(lambda f, b: f * _alpha(b))),
    "out": (_BLEND, _blended(lambda f, b: f * (1.0 - _alpha(b)))),
    "mask": (_BLEND, _blended(lambda f, b: b * _alpha(f))),
    "over": (_BLEND, _blended(lambda f, b: f + b * (1.0 - _alpha(f)))),
    "matte": (_BLEND, _blended(_matte)),
    "disjointover": (_BLEND, _blended(_disjoint_over)),
    "inside": (_MASKED, np.multiply),
    "outside": (_MASKED, lambda x, mask: x * (1.0 - mask)),
    "ifgreater": (_CHOICE, lambda a, b, x, y: np.where(a > b, x, y)),
    "ifgreatereq": (_CHOICE, lambda a, b, x, y: np.where(a >= b, x, y)),
    "ifequal": (_CHOICE, lambda a, b, x, y: np.where(a == b, x, y)),
    "and": (_TWO, lambda x, y: ((x != 0) & (y != 0)) * 1.0),
    "or": (_TWO, lambda x, y: ((x != 0) | (y != 0)) * 1.0),
    "xor": (_TWO, lambda x, y: ((x != 0) ^ (y != 0)) * 1.0),
    "not": (_IN, lambda x: (x == 0) * 1.0),
}


# -- inputs


def default_of(node, name: str):
    """The value that the node's definition gives an input; None where it has none."""
    found = node.definition.getActiveInput(name) if node.definition is not None else None
    return to_python(found.getValue()) if found is not None and found.getValueString() else None


def to_python(value):
    """A value of MaterialX's as numbers."""
    if hasattr(value, "asTuple"):
        return value.asTuple()
    if type(value).__name__ in ("Matrix33", "Matrix44"):
        size = int(type(value).__name__[-1])
        return np.array([[value[i, j] for j in range(size)] for i in range(size)])
    return value


def input_of(node, name: str, default=0.0) -> Expression:
    """What feeds an input, else its default. UnsupportedNodeError where that is geometry's: st, position, normal ..."""
    fed = node.input(name)
    if fed is not None:
        return fed
    known = default_of(node, name)
    if known is None and node.definition is not None:
        found = node.definition.getActiveInput(name)
        if found is not None and found.getDefaultGeomPropString():
            raise UnsupportedNodeError(node.id)
    return Expression.constant(default if known is None else known)


def value_of(node, name: str, default):
    """A constant input, else its default. ValueError where an image feeds it."""
    value = node.value(name)
    if value is None and node.upstream(name) is not None and node.input(name) is not None:
        raise ValueError(f"{name} takes no texture")
    if value is None:
        value = default_of(node, name)
    return default if value is None else value


def number_of(node, name: str, default: float) -> float:
    """A constant input that is one number."""
    return float(np.asarray(value_of(node, name, default), np.float64).reshape(-1)[0])


# -- exact with constants


def _is_number(value: Expression) -> bool:
    return value.image is None and not value.is_display_color


def _add(reader, node, output, sign=1.0):
    a, b = input_of(node, "in1"), input_of(node, "in2")
    if _is_number(b):
        return a.affine(1.0, sign * b.bias)
    if _is_number(a):
        return b.affine(sign, a.bias)
    return bake([a, b], lambda x, y: x + sign * y, node.kind, reader.context, node.path)


def _multiply(reader, node, output):
    a, b = input_of(node, "in1"), input_of(node, "in2", 1.0)
    if _is_number(b):
        return a.affine(b.bias, 0.0)
    if _is_number(a):
        return b.affine(a.bias, 0.0)
    return bake([a, b], np.multiply, node.kind, reader.context, node.path)


def _divide(reader, node, output):
    a, b = input_of(node, "in1"), input_of(node, "in2", 1.0)
    if _is_number(b):
        return a.affine(1.0 / np.where(b.bias == 0, 1.0, b.bias), 0.0)
    return bake([a, b], lambda x, y: x / np.where(y == 0, 1.0, y), node.kind, reader.context, node.path)


def _invert(reader, node, output):
    amount, value = input_of(node, "amount", 1.0), input_of(node, "in")
    if _is_number(amount):
        return value.affine(-1.0, amount.bias)
    return bake([amount, value], np.subtract, node.kind, reader.context, node.path)


def _mix(reader, node, output):
    front, back, share = input_of(node, "fg"), input_of(node, "bg"), input_of(node, "mix")
    if _is_number(share):
        if _is_number(back):
            return front.affine(share.bias, back.bias * (1.0 - share.bias))
        if _is_number(front):
            return back.affine(1.0 - share.bias, front.bias * share.bias)
    elif _is_number(front) and _is_number(back):
        return share.affine(front.bias - back.bias, back.bias)
    return bake([front, back, share], lambda f, b, m: f * m + b * (1.0 - m), node.kind, reader.context, node.path)


def _remap(reader, node, output):
    value = input_of(node, "in")
    low, high, to_low, to_high = (input_of(node, n) for n in ("inlow", "inhigh", "outlow", "outhigh"))
    if all(map(_is_number, (low, high, to_low, to_high))):
        span = high.bias - low.bias
        scale = (to_high.bias - to_low.bias) / np.where(span == 0, 1.0, span)
        return value.affine(scale, to_low.bias - low.bias * scale)
    return bake(
        [value, low, high, to_low, to_high],
        lambda x, a, b, c, d: c + (x - a) / np.where(b == a, 1.0, b - a) * (d - c),
        node.kind,
        reader.context,
        node.path,
    )


def _transform_matrix(reader, node, output):
    """Row vectors, as MaterialX has them; a matrix one larger has a translation."""
    value, matrix = input_of(node, "in"), np.asarray(value_of(node, "mat", 1.0), np.float64)
    size = matrix.shape[0] if matrix.ndim == 2 else 0
    if size not in (value.width, value.width + 1):
        raise UnsupportedNodeError(node.id)
    linear, move = matrix[: value.width, : value.width], np.zeros(value.width)
    if size > value.width:
        move = matrix[-1, : value.width]
    return bake([value], lambda x: x @ linear + move, f"transformmatrix {matrix.tolist()}", reader.context, node.path)


EXACT = {
    "add": _add,
    "subtract": lambda reader, node, output: _add(reader, node, output, -1.0),
    "multiply": _multiply,
    "divide": _divide,
    "invert": _invert,
    "mix": _mix,
    "remap": _remap,
    "transformmatrix": _transform_matrix,
}
