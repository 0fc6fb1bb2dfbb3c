"""Nodes of MaterialX in a network: images, places, normal maps and arithmetic; others by the graph that defines them.

Model: values and images as `Expression`; a node that is not in the tables here but that MaterialX's library defines
by a graph of others is worked out as that graph.
Not: procedural textures, geometry other than texture coordinates and displayColor: a warning names them once, and the
input that they feed keeps its default.
"""

from __future__ import annotations

import abc
import functools
import re

import MaterialX as mx
import numpy as np
from pxr import Sdf

from . import mtlx_normals
from .expression import Expression, bake, combine, image_expression
from .mtlx_arithmetic import EXACT, POINTWISE, UnsupportedNodeError, input_of, number_of, to_python, value_of
from .mtlx_library import library

_WRAPS = {"periodic": "repeat", "clamp": "clamp", "mirror": "mirror", "constant": "black"}
_WIDTHS = {"float": 1, "vector2": 2, "color3": 3, "vector3": 3, "color4": 4, "vector4": 4}


class NodeReader(abc.ABC):
    """What evaluate_node asks of a node, wherever it comes from."""

    path: str
    id: str
    kind: str

    @functools.cached_property
    def definition(self) -> mx.NodeDef | None:
        """What MaterialX's library says of such a node; None where it has none."""
        return library().getNodeDef(self.id) if self.id else None

    @abc.abstractmethod
    def value(self, name: str):
        """A constant input, or None."""

    @abc.abstractmethod
    def input(self, name: str) -> Expression | None:
        """What feeds an input, or None."""

    @abc.abstractmethod
    def upstream(self, name: str):
        """(node, output name) that feeds an input, or None."""

    @abc.abstractmethod
    def file(self, name: str):
        """(asset, attribute, colour space)."""


def node_kind(identifier: str) -> str:
    """ND_multiply_color3FA -> multiply; other identifiers as they are."""
    if not identifier.startswith("ND_"):
        return identifier
    definition = library().getNodeDef(identifier)
    if definition is not None:
        return definition.getNodeString()
    match = re.match(r"ND_([A-Za-z0-9]+?)(?:_.*)?$", identifier)
    return match[1] if match else identifier


def evaluate_node(reader, node: NodeReader, output: str) -> Expression | None:
    """One output of a MaterialX node; None, after a warning, where it is not supported."""
    try:
        return _evaluate(reader, node, output)
    except UnsupportedNodeError:
        message = f"is a '{node.id or node.kind}' node, which is not supported."
    except (ValueError, TypeError, IndexError, ArithmeticError) as error:
        message = f"is a '{node.id or node.kind}' node that cannot be worked out: {' '.join(str(error).split())}."
    reader.context.warn(node.path, f"{message} The default is used.")
    return None


def _evaluate(reader, node: NodeReader, output: str) -> Expression | None:
    kind = node.kind
    if kind in POINTWISE:
        inputs, function = POINTWISE[kind]
        return bake([input_of(node, n, d) for n, d in inputs], function, kind, reader.context, node.path)
    special = EXACT.get(kind) or _SPECIAL.get(kind)
    if special is not None:
        return special(reader, node, output)
    graph = _defining_graph(node.definition)
    if graph is None:
        raise UnsupportedNodeError(node.id)
    return _evaluate_graph(reader, node, graph, output)


# -- parts


def _constant(reader, node, output):
    return input_of(node, "value")


def _pass_on(reader, node, output):
    return input_of(node, "in")


def _convert(reader, node, output):
    value = input_of(node, "in")
    width = _WIDTHS.get(node.definition.getType() if node.definition is not None else "", value.width)
    if value.width == 1:
        return value.widened(width)
    if value.width >= width:
        return value.component(*range(width))
    # A third number is 0, a fourth (alpha) 1.
    parts = [value.component(i) if i < value.width else Expression.constant(float(i == 3)) for i in range(width)]
    return combine(parts, reader.context, node.path)


def _combine(reader, node, output):
    count = int(node.kind[-1])
    parts: list[Expression] = []
    for i in range(count):
        part = input_of(node, f"in{i + 1}")
        parts += [part.component(k) for k in range(part.width)]
    return combine(parts, reader.context, node.path)


def _separate(reader, node, output):
    at = {"outr": 0, "outg": 1, "outb": 2, "outa": 3, "outx": 0, "outy": 1, "outz": 2, "outw": 3}.get(output, 0)
    value = input_of(node, "in")
    return value.component(min(at, value.width - 1))


def _extract(reader, node, output):
    value = input_of(node, "in")
    return value.component(min(max(int(number_of(node, "index", 0)), 0), value.width - 1))


def _swizzle(reader, node, output):
    value = input_of(node, "in")
    letters = str(value_of(node, "channels", "r"))
    parts = [
        Expression.constant(float(c)) if c in "01" else value.component(min("rgbaxyzw".index(c) % 4, value.width - 1))
        for c in letters
        if c in "01rgbaxyzw"
    ]
    return combine(parts or [value], reader.context, node.path)


def _switch(reader, node, output):
    number = int(number_of(node, "which", 0))
    return input_of(node, f"in{number + 1}") if 0 <= number <= 9 else Expression.constant(np.zeros(_width_of(node)))


def _geompropvalue(reader, node, output):
    if value_of(node, "geomprop", "") in ("displayColor", "Cd"):
        return Expression(np.zeros(3), is_display_color=True)
    reader.context.warn(
        node.path,
        f"reads the geomprop '{value_of(node, 'geomprop', '')}', which is not supported. Its default is used.",
    )
    return node.input("default")


# -- images


def _width_of(node: NodeReader) -> int:
    return _WIDTHS.get(node.definition.getType() if node.definition is not None else "color3", 3)


def _image(reader, node, output):
    width = _width_of(node)
    fallback = np.resize(np.asarray(value_of(node, "default", 0.0), np.float64).reshape(-1), width)
    wraps = tuple(_WRAPS.get(str(value_of(node, n, "periodic")), "repeat") for n in ("uaddressmode", "vaddressmode"))
    placement = reader.placement(node, "texcoord", wraps)
    if node.kind == "tiledimage":
        tiling = np.resize(np.asarray(value_of(node, "uvtiling", 1.0), np.float64), 2)
        shift = np.resize(np.asarray(value_of(node, "uvoffset", 0.0), np.float64), 2)
        size = np.resize(np.asarray(value_of(node, "realworldimagesize", 1.0), np.float64), 2)
        tile = np.resize(np.asarray(value_of(node, "realworldtilesize", 1.0), np.float64), 2)
        factor = tile / np.where(size == 0, 1.0, size)
        matrix = np.reshape(placement.matrix, (2, 2)) @ np.diag(tiling * factor)
        offset = (np.array(placement.offset) * tiling - shift) * factor
        placement = type(placement)(
            placement.primvar, tuple(matrix.reshape(4).tolist()), tuple(offset.tolist()), ("repeat", "repeat")
        )
    return _open(reader, node, "file", width, fallback, placement)


def _triplanar(reader, node, output):
    width = _width_of(node)
    fallback = np.resize(np.asarray(value_of(node, "default", 0.0), np.float64).reshape(-1), width)
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


def _own_normal(reader, node, output):
    """The surface's own normal, which is what an input has that nothing feeds."""
    return None


_SPECIAL = {
    "constant": _constant,
    "dot": _pass_on,
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
    "normalmap": mtlx_normals.normalmap,
    "heighttonormal": mtlx_normals.heighttonormal,
    "bump": mtlx_normals.bump,
    "normal": _own_normal,
}


# -- nodes that are graphs


def _defining_graph(definition: mx.NodeDef | None) -> mx.NodeGraph | None:
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
            return value_of(self._outer, found.getInterfaceName(), None)
        if found.getNodeName():
            node, _ = self.upstream(name)
            if node.kind == "constant":  # matrices too
                return node.value("value")
            fed = self.input(name)
            return fed.bias if fed is not None and fed.image is None else None
        return to_python(found.getValue())

    def input(self, name: str) -> Expression | None:
        found = self._find(name)
        if found is None:
            return None
        if found.getInterfaceName():
            return input_of(self._outer, found.getInterfaceName())
        if found.getNodeName():
            node, output = self.upstream(name)
            value = _evaluate(self._reader, node, output)
            if value is None and node.kind != "normal":
                raise UnsupportedNodeError(node.id)
            return value
        value = to_python(found.getValue())
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
    return _evaluate(reader, _GraphNode(reader, node, inner), found.getOutputString() or "out")
