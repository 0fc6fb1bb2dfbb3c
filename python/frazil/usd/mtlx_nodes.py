"""Nodes of MaterialX in a network: images, places, normal maps and arithmetic; others by the graph that defines them.

Model: values and images as `Expression`; a node that is not in the tables here but that MaterialX's library defines
by a graph of others is worked out as that graph.
Not: procedural textures, geometry other than texture coordinates and displayColor: a warning names them once, and the
input that they feed keeps its default.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import MaterialX as mx
import numpy as np
from pxr import Sdf

from .expression import Expression, bake, combine, image_expression
from .mtlx_library import library

_WRAPS = {"periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black"}
_SOBEL_SCALE = 1.0 / 16.0  # of MaterialX's heighttonormal
_LUMA = np.array([0.2126, 0.7152, 0.0722])


class NodeReader:
    """What evaluate_node asks of a node, wherever it comes from."""

    path: str
    id: str
    kind: str

    def value(self, name: str):
        """A constant input, or None."""
        raise NotImplementedError

    def input(self, name: str) -> Expression | None:
        """What feeds an input, or None."""
        raise NotImplementedError

    def upstream(self, name: str):
        """(node, output name) that feeds an input, or None."""
        raise NotImplementedError

    def file(self, name: str):
        """(asset, attribute, colour space)."""
        raise NotImplementedError


def node_kind(identifier: str) -> str:
    """ND_multiply_color3FA -> multiply; other identifiers as they are."""
    if not identifier.startswith("ND_"):
        return identifier
    definition = library().getNodeDef(identifier)
    if definition is not None:
        return definition.getNodeString()
    match = re.match(r"ND_([A-Za-z0-9]+?)(?:_.*)?$", identifier)
    return match[1] if match else identifier


def _default(node: NodeReader, name: str):
    """The value that the node's definition gives an input; None where it has none."""
    definition = library().getNodeDef(node.id)
    found = definition.getActiveInput(name) if definition is not None else None
    return _to_python(found.getValue()) if found is not None and found.getValueString() else None


def _to_python(value):
    return value.asTuple() if hasattr(value, "asTuple") else value


def _input(node: NodeReader, name: str, default=0.0) -> Expression:
    fed = node.input(name)
    if fed is not None:
        return fed
    known = _default(node, name)
    return Expression.constant(default if known is None else known)


def _value(node: NodeReader, name: str, default):
    value = node.value(name)
    if value is None:
        value = _default(node, name)
    return default if value is None else value


# Functions of one to four inputs, by name and default: numpy arrays whose last axis has the numbers.
_POINTWISE: dict[str, tuple[tuple[tuple[str, float], ...], Callable[..., np.ndarray]]] = {
    "clamp": ((("in", 0), ("low", 0), ("high", 1)), lambda x, low, high: np.minimum(np.maximum(x, low), high)),
    "min": ((("in1", 0), ("in2", 0)), np.minimum),
    "max": ((("in1", 0), ("in2", 0)), np.maximum),
    "power": ((("in1", 0), ("in2", 1)), lambda x, y: np.power(np.maximum(x, 0), y)),
    "modulo": ((("in1", 0), ("in2", 1)), np.mod),
    "absval": ((("in", 0),), np.abs),
    "sign": ((("in", 0),), np.sign),
    "floor": ((("in", 0),), np.floor),
    "ceil": ((("in", 0),), np.ceil),
    "round": ((("in", 0),), lambda x: np.floor(x + 0.5)),
    "sqrt": ((("in", 0),), lambda x: np.sqrt(np.maximum(x, 0))),
    "exp": ((("in", 0),), np.exp),
    "ln": ((("in", 1),), lambda x: np.log(np.maximum(x, 1e-30))),
    "sin": ((("in", 0),), np.sin),
    "cos": ((("in", 0),), np.cos),
    "smoothstep": (
        (("in", 0), ("low", 0), ("high", 1)),
        lambda x, low, high: _smooth(np.clip((x - low) / np.where(high == low, 1e-9, high - low), 0, 1)),
    ),
    "dotproduct": ((("in1", 0), ("in2", 0)), lambda x, y: np.sum(x * y, axis=-1, keepdims=True)),
    "magnitude": ((("in", 0),), lambda x: np.linalg.norm(x, axis=-1, keepdims=True)),
    "normalize": ((("in", 0),), lambda x: x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-20)),
    "luminance": ((("in", 0),), lambda x: np.repeat(np.sum(x[..., :3] * _LUMA, axis=-1, keepdims=True), 3, axis=-1)),
    "ifgreater": (
        (("value1", 1), ("value2", 0), ("in1", 0), ("in2", 0)),
        lambda a, b, x, y: np.where(a > b, x, y),
    ),
    "ifgreatereq": (
        (("value1", 1), ("value2", 0), ("in1", 0), ("in2", 0)),
        lambda a, b, x, y: np.where(a >= b, x, y),
    ),
    "ifequal": ((("value1", 0), ("value2", 0), ("in1", 0), ("in2", 0)), lambda a, b, x, y: np.where(a == b, x, y)),
}


def _smooth(t: np.ndarray) -> np.ndarray:
    return t * t * (3.0 - 2.0 * t)


def evaluate_node(reader, node: NodeReader, output: str) -> Expression | None:
    """One output of a MaterialX node; None, after a warning, where it is not supported."""
    kind = node.kind
    if kind in _POINTWISE:
        inputs, function = _POINTWISE[kind]
        return bake([_input(node, n, d) for n, d in inputs], function, kind, reader.context, node.path)
    special = _SPECIAL.get(kind)
    if special is not None:
        return special(reader, node, output)
    graph = _defining_graph(node.id)
    if graph is not None:
        return _evaluate_graph(reader, node, graph, output)
    reader.context.warn(node.path, f"is a '{node.id or kind}' node, which is not supported. The default is used.")
    return None


# -- arithmetic that stays exact with constants


def _is_number(value: Expression) -> bool:
    return value.image is None and not value.is_display_color


def _add(reader, node, output, sign=1.0):
    a, b = _input(node, "in1"), _input(node, "in2")
    if _is_number(b):
        return a.affine(1.0, sign * b.bias)
    if _is_number(a):
        return b.affine(sign, a.bias)
    return bake([a, b], lambda x, y: x + sign * y, node.kind, reader.context, node.path)


def _multiply(reader, node, output):
    a, b = _input(node, "in1"), _input(node, "in2", 1.0)
    if _is_number(b):
        return a.affine(b.bias, 0.0)
    if _is_number(a):
        return b.affine(a.bias, 0.0)
    return bake([a, b], np.multiply, node.kind, reader.context, node.path)


def _divide(reader, node, output):
    a, b = _input(node, "in1"), _input(node, "in2", 1.0)
    if _is_number(b):
        return a.affine(1.0 / np.where(b.bias == 0, 1.0, b.bias), 0.0)
    return bake([a, b], lambda x, y: x / np.where(y == 0, 1.0, y), node.kind, reader.context, node.path)


def _invert(reader, node, output):
    amount, value = _input(node, "amount", 1.0), _input(node, "in")
    if _is_number(amount):
        return value.affine(-1.0, amount.bias)
    return bake([amount, value], np.subtract, node.kind, reader.context, node.path)


def _mix(reader, node, output):
    front, back, share = _input(node, "fg"), _input(node, "bg"), _input(node, "mix")
    if _is_number(share):
        if _is_number(back):
            return front.affine(share.bias, back.bias * (1.0 - share.bias))
        if _is_number(front):
            return back.affine(1.0 - share.bias, front.bias * share.bias)
    elif _is_number(front) and _is_number(back):
        return share.affine(front.bias - back.bias, back.bias)
    return bake([front, back, share], lambda f, b, m: f * m + b * (1.0 - m), node.kind, reader.context, node.path)


def _remap(reader, node, output):
    value = _input(node, "in")
    low, high, to_low, to_high = (_input(node, n) for n in ("inlow", "inhigh", "outlow", "outhigh"))
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


# -- parts


def _constant(reader, node, output):
    return _input(node, "value")


def _pass_on(reader, node, output):
    return _input(node, "in")


def _convert(reader, node, output):
    value = _input(node, "in")
    definition = library().getNodeDef(node.id)
    width = {"float": 1, "vector2": 2, "color3": 3, "vector3": 3, "color4": 4, "vector4": 4}.get(
        definition.getType() if definition is not None else "", value.width
    )
    if value.width == 1:
        return value.widened(width)
    if value.width >= width:
        return value.component(*range(width))
    one = Expression.constant(1.0)
    return combine([value.component(i) if i < value.width else one for i in range(width)], reader.context, node.path)


def _combine(reader, node, output):
    count = int(node.kind[-1])
    parts: list[Expression] = []
    for i in range(count):
        part = _input(node, f"in{i + 1}")
        parts += [part.component(k) for k in range(part.width)]
    return combine(parts, reader.context, node.path)


def _separate(reader, node, output):
    at = {"outr": 0, "outg": 1, "outb": 2, "outa": 3, "outx": 0, "outy": 1, "outz": 2, "outw": 3}.get(output, 0)
    value = _input(node, "in")
    return value.component(min(at, value.width - 1))


def _extract(reader, node, output):
    value = _input(node, "in")
    return value.component(min(int(_value(node, "index", 0)), value.width - 1))


def _swizzle(reader, node, output):
    value = _input(node, "in")
    letters = str(_value(node, "channels", "r"))
    parts = [
        Expression.constant(float(c)) if c in "01" else value.component(min("rgbaxyzw".index(c) % 4, value.width - 1))
        for c in letters
        if c in "01rgbaxyzw"
    ]
    return combine(parts or [value], reader.context, node.path)


def _switch(reader, node, output):
    number = int(float(np.asarray(_value(node, "which", 0)).reshape(-1)[0]))
    return _input(node, f"in{min(max(number, 0), 9) + 1}")


def _geompropvalue(reader, node, output):
    if _value(node, "geomprop", "") in ("displayColor", "Cd"):
        return Expression(np.zeros(3), is_display_color=True)
    reader.context.warn(
        node.path,
        f"reads the geomprop '{_value(node, 'geomprop', '')}', which is not supported. Its default is used.",
    )
    return node.input("default")


# -- images


def _width_of(node: NodeReader) -> int:
    definition = library().getNodeDef(node.id)
    kind = definition.getType() if definition is not None else "color3"
    return {"float": 1, "vector2": 2, "color3": 3, "vector3": 3, "color4": 4, "vector4": 4}.get(kind, 3)


def _image(reader, node, output):
    width = _width_of(node)
    fallback = np.resize(np.asarray(_value(node, "default", 0.0), np.float64).reshape(-1), width)
    wraps = tuple(_WRAPS.get(str(_value(node, n, "periodic")), "repeat") for n in ("uaddressmode", "vaddressmode"))
    placement = reader.placement(node, "texcoord", wraps)
    if node.kind == "tiledimage":
        tiling = np.resize(np.asarray(_value(node, "uvtiling", 1.0), np.float64), 2)
        shift = np.resize(np.asarray(_value(node, "uvoffset", 0.0), np.float64), 2)
        size = np.resize(np.asarray(_value(node, "realworldimagesize", 1.0), np.float64), 2)
        tile = np.resize(np.asarray(_value(node, "realworldtilesize", 1.0), np.float64), 2)
        factor = tile / np.where(size == 0, 1.0, size)
        matrix = np.reshape(placement.matrix, (2, 2)) @ np.diag(tiling * factor)
        offset = (np.array(placement.offset) * tiling - shift) * factor
        placement = type(placement)(
            placement.primvar, tuple(matrix.reshape(4).tolist()), tuple(offset.tolist()), ("repeat", "repeat")
        )
    return _open(reader, node, "file", width, fallback, placement)


def _triplanar(reader, node, output):
    width = _width_of(node)
    fallback = np.resize(np.asarray(_value(node, "default", 0.0), np.float64).reshape(-1), width)
    files = [node.file(n)[0] for n in ("filex", "filey", "filez")]
    if len({f.path for f in files if f is not None}) > 1:
        reader.context.warn(node.path, "projects several images, which is not supported. 'filex' is used for all.")
    # One repeat for each unit of `position`, which may be the place times a constant.
    repeats = 1.0
    found = node.upstream("position")
    while found is not None and found[0].kind == "multiply":
        fed = [None if found[0].upstream(n) else found[0].value(n) for n in ("in1", "in2")]
        factor = next((np.asarray(v, float).reshape(-1)[0] for v in fed if v is not None), 1.0)
        repeats *= float(factor)
        found = found[0].upstream("in1") or found[0].upstream("in2")
    placement = reader.placement(node, "texcoord", ("repeat", "repeat"))
    size = reader.context.meters_per_unit / (abs(repeats) or 1.0)
    return _open(reader, node, "filex", width, fallback, placement.with_triplanar(size, True))


def _open(reader, node, name, width, fallback, placement):
    """The image, as `width` numbers; colours in the file's colour space, others raw."""
    is_color = "color" in (node.id.rsplit("_", 1)[-1])
    rgba = np.concatenate([np.resize(fallback, 3), [fallback[3] if fallback.size == 4 else 1.0]])
    image = reader.open_file(node, name, None if is_color else "raw", "raw", rgba)
    if image is None:
        return Expression(fallback)
    return image_expression(image, list(range(width)), np.ones(width), np.zeros(width), placement)


# -- normals: in tangent space, z along the surface's own


def _normalmap(reader, node, output):
    value = _input(node, "in", (0.5, 0.5, 1.0)).widened(3)
    space = str(_value(node, "space", "tangent"))
    if space != "tangent":
        reader.context.warn(node.path, f"normal maps must be in tangent space, got '{space}'. It is left out.")
        return None
    strength = np.resize(np.asarray(_value(node, "scale", 1.0), np.float64), 2)
    factors = np.array([strength[0], strength[1], 1.0])
    return value.affine(2.0 * factors, -1.0 * factors)


def _height_to_normal(value: Expression, scale: float, reader, node) -> Expression:
    """Encoded normals of a height image, as MaterialX's heighttonormal has them: slopes over st, times scale / 16."""

    def normals(height: np.ndarray) -> np.ndarray:
        h = height[..., 0]
        if min(h.shape) < 2:
            n = np.zeros((*h.shape, 3))
            n[..., 2] = 1.0
        else:
            by_t, by_s = np.gradient(h)
            slope_s, slope_t = by_s * h.shape[1], -by_t * h.shape[0]
            n = np.stack([-slope_s * scale * _SOBEL_SCALE, -slope_t * scale * _SOBEL_SCALE, np.ones_like(h)], axis=-1)
        return n / np.linalg.norm(n, axis=-1, keepdims=True) * 0.5 + 0.5

    if value.image is None:
        return Expression.constant((0.5, 0.5, 1.0))
    return bake([value.component(0)], normals, f"heighttonormal {scale}", reader.context, node.path)


def _heighttonormal(reader, node, output):
    scale = float(np.asarray(_value(node, "scale", 1.0)).reshape(-1)[0])
    return _height_to_normal(_input(node, "in"), scale, reader, node)


def _bump(reader, node, output):
    scale = float(np.asarray(_value(node, "scale", 1.0)).reshape(-1)[0])
    return _height_to_normal(_input(node, "height"), scale, reader, node).affine(2.0, -1.0)


def _no_normal(reader, node, output):
    return None


_SPECIAL = {
    "constant": _constant,
    "dot": _pass_on,
    "add": _add,
    "subtract": lambda reader, node, output: _add(reader, node, output, -1.0),
    "multiply": _multiply,
    "divide": _divide,
    "invert": _invert,
    "mix": _mix,
    "remap": _remap,
    "convert": _convert,
    "combine2": _combine,
    "combine3": _combine,
    "combine4": _combine,
    "separate2": _separate,
    "separate3": _separate,
    "separate4": _separate,
    "extract": _extract,
    "swizzle": _swizzle,
    "switch": _switch,
    "geompropvalue": _geompropvalue,
    "image": _image,
    "tiledimage": _image,
    "triplanarprojection": _triplanar,
    "normalmap": _normalmap,
    "heighttonormal": _heighttonormal,
    "bump": _bump,
    "normal": _no_normal,
}


# -- nodes that are graphs


def _defining_graph(identifier: str) -> mx.NodeGraph | None:
    definition = library().getNodeDef(identifier) if identifier else None
    if definition is None or definition.getType() in ("surfaceshader", "displacementshader", "material"):
        return None
    found = definition.getImplementation()
    return found if isinstance(found, mx.NodeGraph) else None


class _GraphNode(NodeReader):
    """A node inside a graph of the library; its graph's inputs are those of the node that the graph defines."""

    def __init__(self, reader, outer: NodeReader, node: mx.Node) -> None:
        self._reader, self._outer, self._node = reader, outer, node
        definition = node.getNodeDef()
        self.id = definition.getName() if definition is not None else ""
        self.kind = node.getCategory()
        self.path = outer.path

    def _find(self, name: str):
        return self._node.getInput(name)

    def value(self, name: str):
        found = self._find(name)
        if found is None:
            return None
        if found.getInterfaceName():
            return _value(self._outer, found.getInterfaceName(), None)
        if found.getNodeName():
            fed = self.input(name)
            return fed.bias if fed is not None and fed.image is None else None
        return _to_python(found.getValue())

    def input(self, name: str) -> Expression | None:
        found = self._find(name)
        if found is None:
            return None
        if found.getInterfaceName():
            return _input(self._outer, found.getInterfaceName())
        if found.getNodeName():
            node, output = self.upstream(name)
            return evaluate_node(self._reader, node, output)
        value = _to_python(found.getValue())
        return None if value is None or isinstance(value, str) else Expression.constant(value)

    def upstream(self, name: str):
        found = self._find(name)
        if found is None:
            return None
        if found.getInterfaceName():
            return self._outer.upstream(found.getInterfaceName())
        other = found.getConnectedNode() if found.getNodeName() else None
        return (_GraphNode(self._reader, self._outer, other), found.getOutputString() or "out") if other else None

    def file(self, name: str):
        found = self._find(name)
        if found is None:
            return None, None, ""
        if found.getInterfaceName():
            return self._outer.file(found.getInterfaceName())
        return Sdf.AssetPath(found.getValueString()), None, found.getActiveColorSpace()


def _evaluate_graph(reader, node: NodeReader, graph: mx.NodeGraph, output: str) -> Expression | None:
    found = graph.getOutput(output) or (graph.getOutputs()[0] if graph.getOutputs() else None)
    inner = found.getConnectedNode() if found is not None else None
    if inner is None:
        return None
    value = evaluate_node(reader, _GraphNode(reader, node, inner), found.getOutputString() or "out")
    return value
