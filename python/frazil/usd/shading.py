"""Shader networks: what feeds an input - numbers, an image with its transform and primvar, or displayColor."""

from __future__ import annotations

import math

import numpy as np
from pxr import Sdf, Usd, UsdShade

from .context import ReadContext
from .expression import Expression, Placement, image_expression
from .mtlx_arithmetic import number_of, value_of
from .mtlx_nodes import NodeReader, evaluate_node, node_kind
from .textures import Image, open_image, to_linear

_OUTPUT_CHANNELS = {"r": (0,), "g": (1,), "b": (2,), "a": (3,), "rgb": (0, 1, 2), "rgba": (0, 1, 2, 3)}
_USD_WRAPS = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "black": "black", "useMetadata": "black"}
_MOST_STEPS = 64  # of a chain of texture coordinates


class ShaderReader:
    """Follows connections; each node is worked out once, each image read once per colour space."""

    def __init__(self, context: ReadContext) -> None:
        self.context = context
        self.images: dict[tuple, Image | None] = {}
        self._known: dict[tuple[str, str], Expression | None] = {}
        self._open: set[tuple[str, str]] = set()

    def read(self, shader: UsdShade.Shader, name: str) -> Expression | None:
        """What feeds an input of the shader; None where nothing is authored or it cannot be followed."""
        return UsdNode(self, shader).input(name)

    def token(self, shader: UsdShade.Shader, name: str) -> str | None:
        """A constant text (through material interfaces)."""
        value = UsdNode(self, shader).value(name)
        return None if value is None else str(value)

    def raw(self, shader: UsdShade.Shader, name: str):
        """A constant as authored (through material interfaces); None where there is none, or a node feeds it."""
        return UsdNode(self, shader).value(name)

    def shader_of(self, shader: UsdShade.Shader, name: str) -> UsdShade.Shader | None:
        """The node that feeds an input."""
        found = UsdNode(self, shader).upstream(name)
        return found[0].shader if found else None

    def evaluate(self, node: UsdNode, output: str) -> Expression | None:
        """One output of a node; None, after a warning, where it is not supported or fed by itself."""
        key = (node.path, output)
        if key in self._open:
            self.context.warn(node.path, "is part of a cycle of connections. The default is used.")
            return None
        if key not in self._known:
            self._open.add(key)
            try:
                self._known[key] = self._evaluate(node, output)
            finally:
                self._open.discard(key)
        return self._known[key]

    def _evaluate(self, node: UsdNode, output: str) -> Expression | None:
        kind = node.kind
        if kind == "UsdUVTexture":
            return self._read_uv_texture(node, output)
        if kind.startswith("UsdPrimvarReader"):
            if node.value("varname") in ("displayColor", "Cd"):
                return Expression(np.zeros(3), is_display_color=True)
            self.context.warn(
                node.path,
                f"reads the primvar '{node.value('varname') or ''}', which is not supported. Its fallback is used.",
            )
            return node.input("fallback")
        if node.definition is not None:
            self._warn_of_unknown_inputs(node)
        return evaluate_node(self, node, output)

    def _warn_of_unknown_inputs(self, node: UsdNode) -> None:
        names = [i.GetBaseName() for i in node.shader.GetInputs() if i.GetValueProducingAttributes()]
        unknown = [n for n in names if node.definition.getActiveInput(n) is None]
        if unknown:
            self.context.warn(node.path, f"is a '{node.id}' node, which has no input {', '.join(unknown)}.")

    def _read_uv_texture(self, node: UsdNode, output: str) -> Expression | None:
        scale = np.resize(np.asarray(_or(node.value("scale"), (1, 1, 1, 1)), np.float64), 4)
        bias = np.resize(np.asarray(_or(node.value("bias"), (0, 0, 0, 0)), np.float64), 4)
        fallback = np.resize(np.asarray(_or(node.value("fallback"), (0, 0, 0, 1)), np.float64), 4)
        if not np.isfinite(scale).all() or not np.isfinite(bias).all():
            self.context.warn(node.path, "scale and bias must be finite. The texture is left out.")
            return None
        channels = _OUTPUT_CHANNELS.get(output, (0, 1, 2))
        wraps = tuple(_USD_WRAPS.get(str(_or(node.value(n), "useMetadata")), "repeat") for n in ("wrapS", "wrapT"))
        size = node.value("frazil:triplanarSize")
        placement = self.placement(node, "st", wraps)
        if size is not None and float(size) > 0:
            placement = placement.with_triplanar(float(size) * self.context.meters_per_unit)
        image = self.open_file(node, "file", _or(node.value("sourceColorSpace"), None), "auto", fallback)
        at = list(channels)
        if image is None:
            return Expression((fallback * scale + bias)[at])
        return image_expression(image, at, scale[at], bias[at], placement)

    def open_file(self, node, name: str, color_space, default_space: str, fallback: np.ndarray) -> Image | None:
        """The image of a node's file input, or None after a warning."""
        asset, attribute, authored_space = node.file(name)
        if asset is None or not asset.path:
            self.context.warn(node.path, f"names no image in '{name}'. Its fallback is used.")
            return None
        space = str(color_space or authored_space or default_space)
        image = open_image(self.context, node.path, asset, attribute, space, self.images)
        if image is not None:
            image.missing = tuple(float(v) for v in fallback)
            # A picture that cannot be decoded is found now, while there is a fallback to use.
            if image.to_texture(self.context, node.path, ("repeat", "repeat")) is None:
                return None
        return image

    # -- texture coordinates

    def placement(self, node, name: str, wraps: tuple[str, str]) -> Placement:
        """How an image is laid on that reads its coordinates from an input."""
        chain = []
        found = node.upstream(name)
        while found is not None and len(chain) < _MOST_STEPS:
            chain.append(found[0])
            next_name = next((n for n in _COORDINATE_INPUTS if found[0].upstream(n)), None)
            found = found[0].upstream(next_name) if next_name else None
        primvar, matrix, offset = "st", np.eye(2), np.zeros(2)
        for step in reversed(chain):
            kind = step.kind
            if kind.startswith("UsdPrimvarReader") or kind == "geompropvalue":
                primvar = str(step.value("varname") or step.value("geomprop") or "st")
            elif kind == "texcoord":
                number = int(step.value("index") or 0)
                primvar = "st" if number == 0 else f"st{number}"
            else:
                try:
                    move = _coordinate_step(step)
                except (ValueError, TypeError) as error:
                    self.context.warn(
                        step.path, f"{' '.join(str(error).split())} in texture coordinates. It is left out."
                    )
                    continue
                if move is None:
                    self.context.warn(
                        step.path,
                        f"is a '{kind}' node for texture coordinates, which is not supported. It is left out.",
                    )
                    continue
                matrix, offset = matrix @ move[0], offset @ move[0] + move[1]
        if primvar in ("UV0", "UV1"):
            primvar = "st" if primvar == "UV0" else "st1"
        return Placement(primvar, tuple(matrix.reshape(4).tolist()), tuple(offset.tolist()), wraps)


_COORDINATE_INPUTS = ("in", "texcoord", "in1", "st", "in2")


def _or(value, default):
    return default if value is None else value


def _turn(degrees: float) -> np.ndarray:
    """For row vectors, counter-clockwise."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, s], [-s, c]])


def _coordinate_step(node) -> tuple[np.ndarray, np.ndarray] | None:
    """What a node does to coordinates: st @ matrix + offset. ValueError where an image moves them."""

    def pair(name: str, default: float) -> np.ndarray:
        return np.resize(np.asarray(value_of(node, name, default), np.float64), 2)

    kind = node.kind
    if kind == "UsdTransform2d":
        turn = _turn(number_of(node, "rotation", 0.0))
        return np.diag(pair("scale", 1.0)) @ turn, pair("translation", 0.0)
    if kind == "place2d":
        pivot, shrink, move = pair("pivot", 0.0), np.diag(1.0 / _nonzero(pair("scale", 1.0))), pair("offset", 0.0)
        turn = _turn(-number_of(node, "rotate", 0.0))
        if int(number_of(node, "operationorder", 0)) == 0:
            return shrink @ turn, -pivot @ shrink @ turn - move + pivot
        return turn @ shrink, (-pivot - move) @ turn @ shrink + pivot
    if kind == "rotate2d":
        return _turn(-number_of(node, "amount", 0.0)), np.zeros(2)
    other = "in1" if node.upstream("in2") and not node.upstream("in1") else "in2"
    if kind == "multiply":
        return np.diag(pair(other, 1.0)), np.zeros(2)
    if kind == "divide" and other == "in2":
        return np.diag(1.0 / _nonzero(pair("in2", 1.0))), np.zeros(2)
    if kind == "add":
        return np.eye(2), pair(other, 0.0)
    if kind == "subtract":
        return (np.eye(2), -pair("in2", 0.0)) if other == "in2" else (-np.eye(2), pair("in1", 0.0))
    if kind in ("dot", "constant"):
        return np.eye(2), np.zeros(2)
    return None


def _nonzero(values: np.ndarray) -> np.ndarray:
    return np.where(values == 0.0, 1.0, values)


class UsdNode(NodeReader):
    """A node of a UsdShade network."""

    def __init__(self, reader: ShaderReader, shader: UsdShade.Shader) -> None:
        self._reader = reader
        self.shader = shader
        self.path = str(shader.GetPath())
        self.id = str(shader.GetShaderId() or "")
        self.kind = node_kind(self.id)

    def _sources(self, name: str):
        shader_input = self.shader.GetInput(name)
        if not shader_input:
            return []
        found = shader_input.GetValueProducingAttributes()
        if shader_input.HasConnectedSource() or shader_input.GetAttr().HasAuthoredConnections():
            self._warn_of_dangling(shader_input, found)
        return found

    def _warn_of_dangling(self, shader_input: UsdShade.Input, found) -> None:
        """Name a connection that leads to nothing, and what takes its place."""
        if any(UsdShade.Output.IsOutput(a) or a.HasAuthoredValue() for a in found if a != shader_input.GetAttr()):
            return
        targets = ", ".join(f"<{path}>" for path in shader_input.GetAttr().GetConnections())
        rest = "Its own value" if shader_input.GetAttr().HasAuthoredValue() else "The default"
        self._reader.context.warn(
            self.path, f"{shader_input.GetBaseName()} is connected to {targets}, which gives no value. {rest} is used."
        )

    def _constant(self, attribute: Usd.Attribute):
        """A value at the frame; colours of another colour space as linear Rec.709."""
        value = self._reader.context.get(attribute)
        space = attribute.GetColorSpace() if attribute.HasColorSpace() else ""
        if not space or value is None or attribute.GetTypeName().role != "Color":
            return value
        color = np.asarray(value, np.float32).reshape(1, -1)
        if color.shape[1] not in (3, 4):
            return value
        try:
            return to_linear(color[None], space, False).reshape(-1)
        except ValueError as error:
            self._reader.context.warn(attribute.GetPath(), f"{error} Its value is taken as linear.")
            return value

    def value(self, name: str):
        """A constant (through material interfaces), as USD has it; one that constant nodes feed, as an array."""
        for attribute in self._sources(name):
            if not UsdShade.Output.IsOutput(attribute):
                return self._constant(attribute)
            fed = self.input(name)
            return fed.bias if fed is not None and fed.image is None else None
        return None

    def input(self, name: str) -> Expression | None:
        """What feeds an input; None where that is nothing, or no number."""
        for attribute in self._sources(name):
            if UsdShade.Output.IsOutput(attribute):
                node = UsdNode(self._reader, UsdShade.Shader(attribute.GetPrim()))
                return self._reader.evaluate(node, UsdShade.Output(attribute).GetBaseName())
            value = self._constant(attribute)
            try:
                return None if value is None or isinstance(value, str) else Expression.constant(value)
            except (ValueError, TypeError):
                return None
        return None

    def upstream(self, name: str):
        """The node that feeds an input, and its output's name."""
        for attribute in self._sources(name):
            if UsdShade.Output.IsOutput(attribute):
                node = UsdNode(self._reader, UsdShade.Shader(attribute.GetPrim()))
                return node, UsdShade.Output(attribute).GetBaseName()
        return None

    def file(self, name: str):
        """Asset path, the attribute that has it, and the colour space that is authored there."""
        for attribute in self._sources(name):
            asset = self._reader.context.get(attribute)
            if isinstance(asset, str):
                asset = Sdf.AssetPath(asset)
            if isinstance(asset, Sdf.AssetPath):
                return asset, attribute, attribute.GetColorSpace() or ""
        return None, None, ""
