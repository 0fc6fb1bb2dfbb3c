"""Recipes: what `frazil grade` changes about a picture, from TOML or a dict, checked key by key.

Model: tables `lights`, `components`, `ramp`, `compensation`, `overlays`, `color` and `mattes`; docs/grading.md lists
every key.
Units: intensities and colours are factors, exposure is in stops, temperature in kelvin.
Valid: all numbers finite; an unknown key is refused with the nearest that there is.
Not: whether the picture has the layers: grading.py.
"""

import json
import math
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = [
    "MODES",
    "ColorCorrection",
    "Compensation",
    "Matte",
    "Mix",
    "RampChange",
    "Recipe",
    "read_recipe",
    "recipe_text",
]

MODES = ("off", "ratio", "conserve", "depth", "fill", "linear")


@dataclass(frozen=True)
class Mix:
    """How much of some light is left: factor = sign * intensity * 2**exposure * color."""

    intensity: float = 1.0
    exposure: float = 0.0
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    sign: int = 1

    @property
    def factor(self) -> np.ndarray:
        """(3,) float64."""
        return self.sign * self.intensity * 2.0**self.exposure * np.asarray(self.color, dtype=np.float64)


@dataclass(frozen=True)
class RampChange:
    """New colours (knots, 3) for the knots of a ramp, >= 0; whether energy is preserved, None = as rendered."""

    colors: tuple[tuple[float, float, float], ...]
    preserve_energy: bool | None = None


@dataclass(frozen=True)
class Compensation:
    """Area compensation after the render; None = as rendered."""

    mode: str | None = None
    strength: float | None = None


@dataclass(frozen=True)
class ColorCorrection:
    """Applied in this order: gain, exposure and temperature; saturation; gamma."""

    exposure: float = 0.0  # stops
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    temperature: float = 6500.0  # kelvin; lower is warmer
    saturation: float = 1.0
    gamma: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def is_identity(self) -> bool:
        """Nothing changes."""
        return self == ColorCorrection()


@dataclass(frozen=True)
class Matte:
    """Where a correction applies: a layer, or Cryptomatte picks (shell patterns such as /World/Rocks*)."""

    correction: ColorCorrection
    layer: str | None = None
    objects: tuple[str, ...] = ()
    materials: tuple[str, ...] = ()
    assets: tuple[str, ...] = ()
    refracted: bool = False  # picks of what is seen through ice
    invert: bool = False


@dataclass(frozen=True)
class Recipe:
    """All changes, in the order in which they are applied."""

    lights: dict[str, Mix] = field(default_factory=dict)  # by light group
    light_components: dict[tuple[str, str], Mix] = field(default_factory=dict)  # by light group and component
    components: dict[str, Mix] = field(default_factory=dict)
    ramp: dict[str, RampChange] = field(default_factory=dict)  # by material; "" = the only one that has a ramp
    compensation: Compensation | None = None
    age: float | None = None  # of all overlays, 0..1; None = as rendered
    overlays: dict[str, float] = field(default_factory=dict)  # factor of opacity by the overlay's name
    color: ColorCorrection = ColorCorrection()
    mattes: dict[str, Matte] = field(default_factory=dict)


def read_recipe(source: "str | os.PathLike | Mapping[str, Any] | Recipe") -> Recipe:
    """A recipe from a TOML file, or from a dict of the same shape.

    Raises
    ------
    OSError
        For a file that cannot be read.
    ValueError
        For text that is no TOML, unknown keys and values out of range; the message begins with the file's name and the
        key.
    """
    if isinstance(source, Recipe):
        return source
    if isinstance(source, Mapping):
        return _recipe(source, "recipe")
    path = Path(source)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: recipe must be a file. Check the path.")
    try:
        return _recipe(tomllib.loads(path.read_text(encoding="utf-8")), str(path))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: recipe must be TOML: {error}.") from None


def recipe_text(recipe: Mapping[str, Any]) -> str:
    """A recipe dict as TOML: tables of tables, whose values are numbers, texts and lists."""
    lines: list[str] = []

    def write(table: Mapping[str, Any], path: tuple[str, ...]) -> None:
        values = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
        if values and path:
            lines.append(("\n" if lines else "") + f"[{'.'.join(_toml_key(part) for part in path)}]")
        lines.extend(f"{_toml_key(key)} = {_toml_value(value)}" for key, value in values.items())
        for key, value in table.items():
            if isinstance(value, Mapping):
                write(value, (*path, key))

    write(recipe, ())
    return "\n".join(lines) + "\n"


def _toml_key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else json.dumps(key)


def _toml_value(value: Any) -> str:
    if isinstance(value, float):
        return repr(float(f"{value:.6g}"))
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    return json.dumps(value)


# ---- tables ----------------------------------------------------------------------------------------------------------


def _recipe(table: Mapping[str, Any], name: str) -> Recipe:
    at = f"{name}: "
    table = _american(table)
    _refuse_unknown(table, at, ("lights", "components", "ramp", "compensation", "overlays", "color", "mattes"))
    lights, light_components = {}, {}
    components = _component_names()
    for group, entry in _tables(table, "lights", at).items():
        where = f"{at}lights.{group}"
        entry = _american(entry)
        _refuse_unknown(entry, f"{where}.", (*_MIX_KEYS, *components))
        lights[group] = _mix({key: value for key, value in entry.items() if key not in components}, where)
        for component in components:
            if component in entry:
                light_components[group, component] = _mix(
                    _table(entry[component], f"{where}.{component}"), f"{where}.{component}"
                )
    mixes = _tables(table, "components", at)
    _refuse_unknown(mixes, f"{at}components.", components)
    return Recipe(
        lights,
        light_components,
        {component: _mix(_american(entry), f"{at}components.{component}") for component, entry in mixes.items()},
        _ramps(_table(table.get("ramp", {}), f"{at}ramp"), f"{at}ramp"),
        _compensation(table["compensation"], f"{at}compensation") if "compensation" in table else None,
        *_overlays(_table(table.get("overlays", {}), f"{at}overlays"), f"{at}overlays"),
        _correction(_table(table.get("color", {}), f"{at}color"), f"{at}color"),
        {key: _matte(entry, f"{at}mattes.{key}") for key, entry in _tables(table, "mattes", at).items()},
    )


def _component_names() -> tuple[str, ...]:
    from .aovs import aov_table

    return tuple(row["name"] for row in aov_table() if row["is_additive"])


_MIX_KEYS = ("intensity", "exposure", "color", "sign")


def _mix(entry: Mapping[str, Any], at: str) -> Mix:
    entry = _american(entry)
    _refuse_unknown(entry, f"{at}.", _MIX_KEYS)
    sign = entry.get("sign", 1)
    if sign not in (1, -1) or isinstance(sign, bool):
        raise ValueError(f"{at}.sign: must be 1 or -1, got {sign!r}.")
    return Mix(
        _number(entry, "intensity", at, 1.0),
        _number(entry, "exposure", at, 0.0, -64.0, 64.0),
        _color(entry, "color", at, -math.inf),
        int(sign),
    )


def _ramps(table: Mapping[str, Any], at: str) -> dict[str, RampChange]:
    table = _american(table)
    by_material = {key: value for key, value in table.items() if isinstance(value, Mapping)}
    own = {key: value for key, value in table.items() if key not in by_material}
    ramps = {key: _ramp(_american(value), f"{at}.{key}") for key, value in by_material.items()}
    return ({"": _ramp(own, at)} if own else {}) | ramps


def _ramp(table: Mapping[str, Any], at: str) -> RampChange:
    _refuse_unknown(table, f"{at}.", ("colors", "preserve_energy"))
    colors = table.get("colors")
    if not isinstance(colors, Sequence) or isinstance(colors, str) or not colors:
        raise ValueError(f"{at}.colors: must be a list of colours, one per knot of the ramp, got {colors!r}.")
    read = tuple(_color({"color": color}, "color", f"{at}.colors[{k}]", 0.0) for k, color in enumerate(colors))
    preserve = table.get("preserve_energy")
    if preserve is not None and not isinstance(preserve, bool):
        raise ValueError(f"{at}.preserve_energy: must be true or false, got {preserve!r}.")
    return RampChange(read, preserve)


def _compensation(table: Any, at: str) -> Compensation:
    table = _table(table, at)
    _refuse_unknown(table, f"{at}.", ("mode", "strength"))
    mode = table.get("mode")
    if mode is not None and mode not in MODES:
        raise ValueError(f"{at}.mode: must be one of {', '.join(MODES)}, got {mode!r}.{_nearest(str(mode), MODES)}")
    strength = _number(table, "strength", at, 1.0, 0.0, 1.0) if "strength" in table else None
    return Compensation(mode, strength)


def _overlays(table: Mapping[str, Any], at: str) -> tuple[float | None, dict[str, float]]:
    """The age of all overlays, and the factor of each one's opacity."""
    age = _number(table, "age", at, 0.0, 0.0, 1.0) if "age" in table else None
    factors = {}
    for name, entry in table.items():
        if name == "age":
            continue
        entry = _table(entry, f"{at}.{name}")
        _refuse_unknown(entry, f"{at}.{name}.", ("opacity",))
        factors[name] = _number(entry, "opacity", f"{at}.{name}", 1.0, 0.0)
    return age, factors


_CORRECTION_KEYS = ("exposure", "gain", "temperature", "saturation", "gamma")


def _correction(table: Mapping[str, Any], at: str) -> ColorCorrection:
    _refuse_unknown(table, f"{at}.", _CORRECTION_KEYS)
    return ColorCorrection(
        _number(table, "exposure", at, 0.0, -64.0, 64.0),
        _color(table, "gain", at, -math.inf),
        _number(table, "temperature", at, 6500.0, 1667.0, 25000.0),
        _number(table, "saturation", at, 1.0, 0.0),
        _color(table, "gamma", at, 1e-3),
    )


def _matte(table: Mapping[str, Any], at: str) -> Matte:
    own = ("layer", "objects", "materials", "assets", "refracted", "invert")
    _refuse_unknown(table, f"{at}.", (*own, *_CORRECTION_KEYS))
    layer = table.get("layer")
    if layer is not None and not isinstance(layer, str):
        raise ValueError(f"{at}.layer: must be the name of a layer, got {layer!r}.")
    picks = {kind: _names(table.get(kind, ()), f"{at}.{kind}") for kind in ("objects", "materials", "assets")}
    if (layer is None) == (not any(picks.values())):
        raise ValueError(f"{at}: must have either layer or some of objects, materials and assets.")
    flags = {}
    for key in ("refracted", "invert"):
        flags[key] = table.get(key, False)
        if not isinstance(flags[key], bool):
            raise ValueError(f"{at}.{key}: must be true or false, got {flags[key]!r}.")
    correction = _correction({key: value for key, value in table.items() if key not in own}, at)
    return Matte(correction, layer, **picks, **flags)


# ---- values ----------------------------------------------------------------------------------------------------------


def _table(value: Any, at: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{at}: must be a table, got {value!r}.")
    return value


def _tables(table: Mapping[str, Any], key: str, at: str) -> dict[str, Mapping[str, Any]]:
    """A table of tables."""
    entries = _table(table.get(key, {}), f"{at}{key}")
    return {name: _table(entry, f"{at}{key}.{name}") for name, entry in entries.items()}


def _american(table: Mapping[str, Any]) -> dict[str, Any]:
    """The table with `colour` and `colours` spelled as the keys are."""
    return {{"colour": "color", "colours": "colors"}.get(key, key): value for key, value in table.items()}


def _refuse_unknown(table: Mapping[str, Any], at: str, known: Sequence[str]) -> None:
    for key in table:
        if key not in known:
            raise ValueError(f"{at}{key}: key must be one of {', '.join(known)}.{_nearest(key, known)}")


def _nearest(name: str, known: Sequence[str]) -> str:
    nearest = get_close_matches(name, known, n=1)
    return f" Did you mean {nearest[0]!r}?" if nearest else ""


def _number(
    table: Mapping[str, Any], key: str, at: str, default: float, low: float = -math.inf, high: float = math.inf
) -> float:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{at}.{key}: must be a finite number, got {value!r}.")
    if not low <= value <= high:
        limit = f"in {low:g}..{high:g}" if math.isfinite(low) and math.isfinite(high) else f">= {low:g}"
        raise ValueError(f"{at}.{key}: must be {limit}, got {value!r}.")
    return float(value)


def _color(table: Mapping[str, Any], key: str, at: str, low: float) -> tuple[float, float, float]:
    """Three numbers, or one for all."""
    value = table.get(key, 1.0)
    values = list(value) if isinstance(value, Sequence) and not isinstance(value, str) else [value] * 3
    if len(values) != 3:
        raise ValueError(f"{at}.{key}: must be a number or three, got {value!r}.")
    return tuple(_number({key: v}, key, at, 1.0, low) for v in values)  # type: ignore[return-value]


def _names(value: Any, at: str) -> tuple[str, ...]:
    if isinstance(value, str):
        return (value,)
    if not isinstance(value, Sequence) or not all(isinstance(name, str) for name in value):
        raise ValueError(f"{at}: must be a name or a list of names, got {value!r}.")
    return tuple(value)
