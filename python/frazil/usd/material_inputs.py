"""The one table of material inputs: reading, defaults, ranges and docs/usd.md are driven by it."""

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
    kind: str  # float, int, color, bool, token, floats, colors
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
    MaterialInput("volume", "float", 0.0, 0.0, 1.0, meaning="how much of the light scattered once inside is traced"),
    MaterialInput("anisotropy", "float", 0.0, -0.95, 0.95, meaning="g of the light scattered once"),
    MaterialInput("priority", "int", 0, -1000, 1000, meaning="where bodies overlap, the highest fills the place"),
    MaterialInput("tint", "color", (1.0, 1.0, 1.0), takes_texture=True, meaning="multiplies what leaves the core"),
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
    MaterialInput("compensation_limit", "float", 8.0, 1.0, meaning="largest gain"),
    MaterialInput("compensation_strength", "float", 1.0, 0.0, 1.0, meaning="0 = off, 1 = full"),
    MaterialInput("spacing", "float", 0.0, length_power=1, meaning="of the points; 0 = from the mean free path"),
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
)

# Inputs that UsdPreviewSurface has and Frazil does not: silent, as they change nothing that is rendered here.
PREVIEW_IGNORED = frozenset({"displacement", "occlusion", "normal", "opacityMode"})


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


def ice_inputs_markdown() -> str:
    """The table of frazil:ice as docs/usd.md shows it."""
    lines = ["| input | type | default | range | unit | meaning |", "|---|---|---|---|---|---|"]
    types = {"color": "color3f", "floats": "float[]", "colors": "color3f[]"}
    for row in ICE_INPUTS:
        default = "–" if row.default is None or row.default == () else str(row.default)
        unit = {1: "scene unit", -1: "1/scene unit", 0: ""}[row.length_power]
        if row.length_power and row.kind == "color" and row.default:
            default += " m"
        texture = ", texture" if row.takes_texture else ""
        rule = "" if row.kind == "bool" else row.rule
        lines.append(
            f"| `{row.name}` | {types.get(row.kind, row.kind)}{texture} | {default} | {rule} | {unit} | {row.meaning} |"
        )
    return "\n".join(lines)
