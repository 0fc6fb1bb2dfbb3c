"""What an input is worth to the core: a number, a colour or a lookup, in metres and in range."""

from __future__ import annotations

import math

import numpy as np
from pxr import UsdShade

from .._frazil import TextureLookup
from .context import ReadContext
from .expression import Expression
from .material_inputs import MaterialInput, find_input, nearest_name
from .shading import ShaderReader, UsdNode
from .textures import resolve

_WIDTHS = {"float": 1, "int": 1, "color": 3, "vector": 3, "normal": 3}


class ShaderValues:
    """One shader read by a table of inputs: `values` as the core takes them, and what fed each (None = its default)."""

    def __init__(
        self,
        reader: ShaderReader,
        shader: UsdShade.Shader,
        table: tuple[MaterialInput, ...],
        ignored: frozenset[str] = frozenset(),
        prefixes: tuple[str, ...] = (),
    ) -> None:
        self._context, self._path = reader.context, shader.GetPath()
        for shader_input in shader.GetInputs():
            name = shader_input.GetBaseName()
            if find_input(table, name) is None and name not in ignored and not name.startswith(prefixes or (":",)):
                self._context.warn(self._path, f"has no input '{name}'. The nearest is '{nearest_name(table, name)}'.")
        self.authored: set[str] = set()
        self.expressions: dict[str, Expression] = {}
        self.values: dict[str, object] = {}
        for row in table:
            self.values[row.name] = self._read(reader, shader, row)

    def _read(self, reader: ShaderReader, shader: UsdShade.Shader, row: MaterialInput):
        if row.kind == "file":
            asset, attribute, _ = UsdNode(reader, shader).file(row.name)
            if asset is None or not asset.path:
                raw = reader.raw(shader, row.name)
                return row.default if raw is None or asset is not None else self._wrong(row, raw)
            self.authored.add(row.name)
            found = resolve(self._context, asset, attribute)
            if not found:
                self._context.warn(self._path, f"@{asset.path}@ cannot be found. It is left out.")
            return found
        if row.kind in ("token", "text", "bool", "floats", "colors"):
            value = reader.raw(shader, row.name)
            if value is None:
                return row.default
            self.authored.add(row.name)
            try:
                return to_constant(self._context, self._path, row, value)
            except (TypeError, ValueError):
                return self._wrong(row, value)
        fed = reader.read(shader, row.name)
        if fed is None:
            raw = reader.raw(shader, row.name)
            return row.default if raw is None else self._wrong(row, raw)
        self.authored.add(row.name)
        try:
            value = to_value(self._context, self._path, row, fed)
        except (TypeError, ValueError):
            return self._wrong(row, reader.raw(shader, row.name))
        self.expressions[row.name] = fed
        return value

    def _wrong(self, row: MaterialInput, value):
        self._context.warn(self._path, f"{row.name} must be a {row.kind}, got {value!r}. {row.default} is used.")
        return row.default


def to_value(context: ReadContext, path, row: MaterialInput, fed: Expression):
    """What feeds the input as the core wants it; the row's default, after a warning, where it cannot be.

    TypeError or ValueError where it is of another type.
    """
    if fed.is_display_color:
        return row.default
    if fed.image is None:
        if row.kind == "normal":
            if not is_close(fed.widened(3).bias, (0.0, 0.0, 1.0)):
                context.warn(path, f"{row.name} takes a texture alone, got {number_text(fed.bias)}. It is left out.")
            return None
        return to_constant(context, path, row, fed.bias)
    if not row.takes_texture:
        context.warn(path, f"{row.name} takes no texture. {row.default} is used.")
        return row.default
    scaled = fed.affine(context.meters_per_unit**row.length_power, 0.0) if row.length_power else fed
    if row.kind == "normal":
        _check_encoding(context, path, row, fed)
    lookup: TextureLookup | None = scaled.to_lookup(context, path, _WIDTHS[row.kind])
    return row.default if lookup is None else lookup


def _check_encoding(context: ReadContext, path, row: MaterialInput, fed: Expression) -> None:
    """Name a normal map that cannot be meant as it is authored."""
    if not fed.image.is_file:
        return
    if fed.image.is_8_bit and (fed.bias >= 0.0).all():
        context.warn(
            path,
            f"{row.name} reads an 8-bit image as it is, which cannot point to all sides. Set scale (2, 2, 2, 1) and "
            "bias (-1, -1, -1, 0) of its texture.",
        )
    if fed.image.is_decoded:
        context.warn(
            path, f"{row.name} reads an image that is decoded from sRGB. Set sourceColorSpace 'raw' of its texture."
        )


def to_constant(context: ReadContext, path, row: MaterialInput, value):
    """A constant in metres and in range; TypeError or ValueError where it is of another type."""
    if row.kind == "bool":
        number = np.asarray(value, np.float64).reshape(1)
        if not np.isfinite(number).all():
            raise ValueError(row.name)
        return bool(number[0])
    if row.kind == "text":
        return str(value)
    if row.kind == "token":
        if str(value) in row.choices:
            return str(value)
        context.warn(path, f"{row.name} must be {row.rule}, got '{value}'. '{row.default}' is used.")
        return row.default
    array = np.asarray(value, dtype=np.float64)
    if row.kind == "floats" and array.ndim != 1:
        raise ValueError(f"{row.name} must have one number after another")
    if row.kind in ("color", "vector") and array.size == 1:
        array = np.repeat(array.reshape(1), 3)
    if row.kind in ("color", "vector") and array.size == 4:
        array = array.reshape(4)[:3]
    if row.kind == "float" and array.size == 3:
        array = array.reshape(3).mean()  # a colour where a number is wanted
    width = {"floats": -1, "colors": 3}.get(row.kind) or _WIDTHS[row.kind]
    array = array.reshape(-1, 3) if row.kind == "colors" else array.reshape(width)
    array = array * context.meters_per_unit**row.length_power
    if not np.isfinite(array).all():
        context.warn(path, f"{row.name} must be finite, got {value}. {row.default} is used.")
        return row.default
    if (array < row.minimum).any() or (array > row.maximum).any():
        clamped = np.clip(array, row.minimum, row.maximum)
        unit = {1: " m", -1: " 1/m", 0: ""}[row.length_power]
        got, used = number_text(array), number_text(clamped)
        context.warn(path, f"{row.name} must be {row.rule}{unit}, got {got}. {used} is used.")
        array = clamped
    if row.kind == "float":
        return float(array[0])
    if row.kind == "int":
        return round(float(array[0]))
    if row.kind == "colors":
        return [tuple(color) for color in array.tolist()]
    return tuple(array.tolist())


def number_text(array: np.ndarray) -> str:
    """0.5, or (0.1, 0.2, 0.3)."""
    values = ", ".join(f"{value:g}" for value in array.reshape(-1))
    return values if array.size == 1 else f"({values})"


def texcoord_name(context: ReadContext, path, expressions: list[Expression | None]) -> str | None:
    """The primvar that images are read by; one for all of a material."""
    names = list(dict.fromkeys(e.placement.primvar for e in expressions if e is not None and e.image is not None))
    if len(names) > 1:
        context.warn(path, f"reads textures by several primvars ({', '.join(names)}). '{names[0]}' is used for all.")
    return names[0] if names else None


def is_close(a, b) -> bool:
    """Whether two numbers, tuples or arrays agree."""
    return bool(np.allclose(np.asarray(a, np.float64), np.asarray(b, np.float64), rtol=1e-5, atol=1e-7))


def ior_of_f0(f0: float) -> float:
    """The index of refraction that reflects this share of light at normal incidence."""
    root = math.sqrt(min(max(f0, 0.0), 0.98))
    return (1.0 + root) / (1.0 - root)
