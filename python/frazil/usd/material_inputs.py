"""The one table of material inputs: reading, defaults, ranges, the MaterialX library and the docs are driven by it."""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass

INFINITY = math.inf


@dataclass(frozen=True)
class MaterialInput:
    """One input of a shader.

    `length_power` is +1 for a length, -1 for its inverse: values of a stage are in its units and are converted by
    metersPerUnit. Defaults are in metres.
    """

    name: str
    kind: str  # float, int, color, vector, bool, token, text, file, floats, colors, normal (a map alone)
    default: object
    minimum: float = 0.0
    maximum: float = INFINITY
    length_power: int = 0
    takes_texture: bool = False
    choices: tuple[str, ...] = ()
    meaning: str = ""

    @property
    def rule(self) -> str:
        """The range in words: 'in 0..1', '>= 0'."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        if self.minimum == -INFINITY:
            return ""
        if self.maximum != INFINITY:
            return f"in {self.minimum:g}..{self.maximum:g}"
        return f">= {self.minimum:g}"


# Just below 1 and above 0: an albedo of 1 has no finite medium, a length of 0 no medium at all.
_LARGEST_ALBEDO = 0.999
_SMALLEST_LENGTH = 1e-7

ICE_INPUTS: tuple[MaterialInput, ...] = (
    MaterialInput(
        "albedo",
        "color",
        (0.84, 0.92, 0.96),
        0.0,
        _LARGEST_ALBEDO,
        meaning="total diffuse reflectance of a flat, thick body",
    ),
    MaterialInput(
        "mean_free_path",
        "color",
        (0.012, 0.018, 0.025),
        _SMALLEST_LENGTH,
        length_power=1,
        meaning="transport mean free path 1/(sigma_s_prime + sigma_a)",
    ),
    MaterialInput(
        "sigma_s_prime",
        "color",
        None,
        1e-6,
        length_power=-1,
        meaning="reduced scattering; with sigma_a it takes the place of albedo and mean_free_path",
    ),
    MaterialInput("sigma_a", "color", None, length_power=-1, meaning="absorption"),
    MaterialInput("eta", "float", 1.31, 1.0, 4.0, meaning="index of refraction"),
    MaterialInput("roughness", "float", 0.1, 0.0, 1.0, takes_texture=True, meaning="of the surface"),
    MaterialInput("specular", "float", 1.0, 0.0, 1.0, meaning="weight of the reflection"),
    MaterialInput("translucency", "float", 1.0, 0.0, 1.0, meaning="weight of the core"),
    MaterialInput(
        "refraction",
        "float",
        1.0,
        0.0,
        1.0,
        meaning="how much of what the medium leaves unscattered is seen through the boundary",
    ),
    MaterialInput(
        "refraction_roughness",
        "float",
        None,
        0.0,
        1.0,
        meaning="of light that goes through the boundary; by default as `roughness`",
    ),
    MaterialInput(
        "refraction_tint",
        "color",
        (1.0, 1.0, 1.0),
        0.0,
        1.0,
        meaning="of light each time that it goes through the boundary unscattered",
    ),
    MaterialInput("volume", "float", 0.0, 0.0, 1.0, meaning="how much of the light scattered once inside is traced"),
    MaterialInput("anisotropy", "float", 0.0, -0.95, 0.95, meaning="g of the light scattered once"),
    MaterialInput("priority", "int", 0, -1000, 1000, meaning="where bodies overlap, the highest fills the place"),
    MaterialInput(
        "preset",
        "token",
        "none",
        choices=("none", "fresh_breath", "arctic_blue", "old_glacier", "weathered_white", "sea_ice"),
        meaning="where inputs that are not authored take their values from, overlays too (docs/material.md)",
    ),
    MaterialInput("preset_scale", "float", 1.0, 1e-6, meaning="how much larger the preset's lengths are"),
    MaterialInput("preset_depth", "float", 1.0, meaning="metres of ice that a metre counts for in colour"),
    MaterialInput("age", "float", 0.5, 0.0, 1.0, meaning="0 = fresh .. 1 = old: brings out the overlays"),
    MaterialInput("tint", "color", (1.0, 1.0, 1.0), takes_texture=True, meaning="multiplies what leaves the core"),
    MaterialInput("normal", "normal", None, takes_texture=True, meaning="tangent-space normal map"),
    MaterialInput(
        "bump", "float", 0.0, -INFINITY, length_power=1, takes_texture=True, meaning="height; tilts the normal alone"
    ),
    MaterialInput(
        "ramp_distances", "floats", (), length_power=1, meaning="knots of the colour ramp, strictly increasing"
    ),
    MaterialInput("ramp_colors", "colors", (), meaning="colour at each knot"),
    MaterialInput("ramp_preserve_energy", "bool", False, meaning="keep the total reflectance whatever the ramp"),
    MaterialInput(
        "profile",
        "token",
        "multiple_scattering",
        choices=("multiple_scattering", "photon_beam", "normalized_diffusion", "better_dipole", "dipole"),
        meaning="how light spreads inside",
    ),
    MaterialInput(
        "compensation",
        "token",
        "depth",
        choices=("off", "ratio", "conserve", "depth", "fill", "linear"),
        meaning="area compensation at tips, edges and thin parts",
    ),
    MaterialInput("compensation_limit", "float", 100.0, 1.0, meaning="largest gain"),
    MaterialInput("compensation_strength", "float", 1.0, 0.0, 1.0, meaning="0 = off, 1 = full"),
    MaterialInput(
        "spacing",
        "float",
        0.0,
        length_power=1,
        takes_texture=True,
        meaning="of the points; 0 = from the mean free path; a texture is read at the mesh's vertices",
    ),
)

# What describes a pattern alone.
_PATTERN_INPUTS = frozenset(
    {"pattern", "size", "width", "feather", "warp", "scales", "amount", "slope", "direction", "seed"}
)

# frazil:overlay, a shader whose output is connected to an input `overlays:NAME` of frazil:ice.
OVERLAY_INPUTS: tuple[MaterialInput, ...] = (
    MaterialInput(
        "pattern",
        "token",
        "solid",
        choices=("solid", "fracture", "cells", "frost", "bubbles", "snow", "bands"),
        meaning="where the overlay is",
    ),
    MaterialInput(
        "color", "color", (0.9, 0.95, 1.0), 0.0, 1.0, meaning="of what it scatters, and of what shines through"
    ),
    MaterialInput(
        "opacity", "float", 1.0, 0.0, 1.0, meaning="where the mask is 1: hides what is seen through the surface"
    ),
    MaterialInput("roughness", "float", 0.5, 0.0, 1.0, meaning="of the surface there"),
    MaterialInput(
        "scattering", "float", 0.7, 0.0, 1.0, meaning="part of the light that it reflects, so that it does not enter"
    ),
    MaterialInput("bump", "float", 0.0, -INFINITY, length_power=1, meaning="height where the mask is 1"),
    MaterialInput("internal", "float", 0.0, 0.0, 1.0, meaning="opacity of fracture planes inside, seen by refraction"),
    MaterialInput("age_begin", "float", 0.0, 0.0, 1.0, meaning="age at which it begins to show"),
    MaterialInput("age_end", "float", 1.0, 0.0, 1.0, meaning="age at which it has all of its opacity"),
    MaterialInput(
        "size",
        "float",
        0.3,
        _SMALLEST_LENGTH,
        length_power=1,
        meaning="of cells, widest features of frost and snow, distance of planes, bands and bubbles",
    ),
    MaterialInput("width", "float", 0.004, length_power=1, meaning="of lines and bands, diameter of bubbles"),
    MaterialInput("feather", "float", 0.004, length_power=1, meaning="over which a line's edge fades"),
    MaterialInput("warp", "float", 0.2, 0.0, 4.0, meaning="how much lines are bent, of `size`"),
    MaterialInput(
        "scales", "int", 2, 0, 8, meaning="of cells, each 2.3 times finer; further octaves of frost and snow"
    ),
    MaterialInput("amount", "float", 0.5, 0.0, 1.0, meaning="how much of it there is"),
    MaterialInput("slope", "float", 0.0, -1.0, 1.0, meaning="more frost where the surface faces `direction`, or away"),
    MaterialInput(
        "direction",
        "vector",
        (0.0, 1.0, 0.0),
        -INFINITY,
        meaning="up for snow and frost, across bands",
    ),
    MaterialInput("seed", "int", 0, 0, 2**31 - 1, meaning="another number, another pattern"),
    MaterialInput("mask", "float", 1.0, 0.0, 1.0, takes_texture=True, meaning="multiplies the pattern"),
)

# UsdPreviewSurface 2.6: its own names, and the core's in snake_case.
PREVIEW_INPUTS: tuple[MaterialInput, ...] = (
    MaterialInput("diffuseColor", "color", (0.18, 0.18, 0.18), takes_texture=True),
    MaterialInput("emissiveColor", "color", (0.0, 0.0, 0.0), takes_texture=True),
    MaterialInput("useSpecularWorkflow", "bool", False),
    MaterialInput("specularColor", "color", (0.0, 0.0, 0.0), takes_texture=True),
    MaterialInput("metallic", "float", 0.0, 0.0, 1.0, takes_texture=True),
    MaterialInput("roughness", "float", 0.5, 0.0, 1.0, takes_texture=True),
    MaterialInput("clearcoat", "float", 0.0, 0.0, 1.0, takes_texture=True),
    MaterialInput("clearcoatRoughness", "float", 0.01, 0.0, 1.0, takes_texture=True),
    MaterialInput("opacity", "float", 1.0, 0.0, 1.0, takes_texture=True),
    MaterialInput("opacityThreshold", "float", 0.0, 0.0, 1.0),
    MaterialInput("ior", "float", 1.5, 1.0, 100.0),
    MaterialInput("normal", "normal", None, takes_texture=True),
)

# Inputs that UsdPreviewSurface has and Frazil does not: silent, as they change nothing that is rendered here.
PREVIEW_IGNORED = frozenset({"displacement", "occlusion", "opacityMode"})


# frazil:density, a shader whose output is connected to the input `density` of frazil:ice.
DENSITY_INPUTS: tuple[MaterialInput, ...] = (
    MaterialInput("file", "file", "", meaning="an OpenVDB file; its frame is that of the mesh; without it noise"),
    MaterialInput("grid", "text", "density", meaning="the name of the file's grid"),
    MaterialInput("scale", "float", 1.0, meaning="multiplies noise or grid"),
    MaterialInput("absorption", "float", 1.0, 0.0, 1.0, meaning="how much of it counts for sigma_a: 0 = for bubbles"),
    MaterialInput(
        "contrast", "float", 1.0, 0.0, 4.0, meaning="of noise: standard deviation of its logarithm; its mean is 1"
    ),
    MaterialInput("size", "float", 0.3, _SMALLEST_LENGTH, length_power=1, meaning="of the noise's widest features"),
    MaterialInput("octaves", "int", 3, 1, 8, meaning="of noise, each twice as fine and half as strong"),
    MaterialInput("seed", "int", 0, 0, 2**31 - 1, meaning="another number, another noise"),
)

# frazil:displacement, a shader whose output is connected to a material's outputs:displacement.
DISPLACEMENT_INPUTS: tuple[MaterialInput, ...] = (
    MaterialInput("height", "float", 0.0, -INFINITY, length_power=1, takes_texture=True, meaning="along the normal"),
    MaterialInput(
        "vector",
        "vector",
        None,
        -INFINITY,
        length_power=1,
        takes_texture=True,
        meaning="takes the place of the height",
    ),
    MaterialInput(
        "space",
        "token",
        "tangent",
        choices=("tangent", "object"),
        meaning="of the vector: along s, along t and the normal; or the mesh's own",
    ),
    MaterialInput(
        "edge_length", "float", 0.0, length_power=1, meaning="of the finest triangles; 0 = what image and pattern show"
    ),
    *(row for row in OVERLAY_INPUTS if row.name in _PATTERN_INPUTS),
)


def find_input(table: tuple[MaterialInput, ...], name: str) -> MaterialInput | None:
    """The row of that name."""
    return next((row for row in table if row.name == name), None)


def nearest_name(table: tuple[MaterialInput, ...], name: str) -> str:
    """The name in the table that is most like the given one."""
    names = [row.name for row in table]
    return (difflib.get_close_matches(name, names, n=1, cutoff=0.0) or names)[0]


def snake_case(name: str) -> str:
    """diffuseColor -> diffuse_color."""
    return "".join("_" + c.lower() if c.isupper() else c for c in name)


def inputs_markdown(table: tuple[MaterialInput, ...] = ICE_INPUTS) -> str:
    """A table of inputs as the docs show it: frazil:ice in docs/usd.md, the others in docs/material.md."""
    lines = ["| input | type | default | range | unit | meaning |", "|---|---|---|---|---|---|"]
    types = {
        "color": "color3f",
        "vector": "vector3f",
        "floats": "float[]",
        "colors": "color3f[]",
        "normal": "normal3f",
        "text": "string",
        "file": "asset",
    }
    for row in table:
        default = "–" if row.default in (None, (), "") else str(row.default)
        unit = {1: "scene unit", -1: "1/scene unit", 0: ""}[row.length_power]
        if row.length_power and row.kind in ("color", "float") and row.default:
            default += " m"
        texture = ", texture" if row.takes_texture else ""
        rule = "" if row.kind in ("bool", "text", "file") else row.rule
        lines.append(
            f"| `{row.name}` | {types.get(row.kind, row.kind)}{texture} | {default} | {rule} | {unit} | {row.meaning} |"
        )
    return "\n".join(lines)
