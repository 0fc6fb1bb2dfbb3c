"""Looks of ice to start from: media, surfaces and overlays that belong together, and the age that drives them.

Model: a preset is a medium, a few inputs of IceMaterial and a list of overlays for bodies of about a metre.
Absorption is that of ice per metre, from `frazil.optics` (pure ice of [WarrenBrandt2008]; sea ice with some dust and
algae), which is why small bodies are nearly colourless.
Units: metres; `scale` makes all lengths larger and all coefficients smaller; `depth` multiplies absorption, so that a
metre shows what a glacier shows in so many.
Not: measurements of scattering and overlays, which are looks.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

from ._frazil import IceMaterial, Medium, Overlay

__all__ = ["ICE_PRESETS", "IcePreset", "ice_preset"]

_LENGTHS = ("size", "width", "feather", "bump")


@dataclass(frozen=True)
class IcePreset:
    """One look: coefficients in 1/m, inputs of IceMaterial, overlays as arguments of Overlay."""

    meaning: str
    sigma_s_prime: tuple[float, float, float]
    sigma_a: tuple[float, float, float]
    inputs: dict[str, float]
    overlays: tuple[dict[str, Any], ...] = field(default=())


def _cracks(**changes: Any) -> dict[str, Any]:
    """Planes through the body, seen inside too."""
    return dict(
        pattern="fracture", color=(0.88, 0.95, 1.0), opacity=0.85, roughness=0.45, scattering=0.6, internal=0.5,
        age_begin=0.0, age_end=0.7, size=0.11, width=0.0035, feather=0.006, warp=0.35, amount=0.52,
    ) | changes  # fmt: skip


def _cells(**changes: Any) -> dict[str, Any]:
    return dict(
        pattern="cells", color=(0.92, 0.97, 1.0), opacity=0.8, roughness=0.5, scattering=0.7, age_begin=0.15,
        age_end=1.0, size=0.3, width=0.004, feather=0.008, warp=0.35, scales=2, amount=0.5, bump=-0.0015, seed=3,
    ) | changes  # fmt: skip


def _frost(**changes: Any) -> dict[str, Any]:
    return dict(
        pattern="frost", color=(0.93, 0.96, 1.0), opacity=0.85, roughness=0.65, scattering=0.75, age_begin=0.2,
        age_end=1.0, size=0.35, warp=0.6, scales=5, amount=0.42, slope=0.35, seed=5,
    ) | changes  # fmt: skip


def _snow(**changes: Any) -> dict[str, Any]:
    return dict(
        pattern="snow", color=(0.95, 0.97, 1.0), opacity=0.95, roughness=0.8, scattering=0.9, age_begin=0.45,
        age_end=1.0, size=0.08, scales=4, amount=0.45, seed=7,
    ) | changes  # fmt: skip


def _bubbles(**changes: Any) -> dict[str, Any]:
    return dict(
        pattern="bubbles", color=(0.95, 0.98, 1.0), opacity=0.5, roughness=0.3, scattering=0.5, age_begin=0.0,
        age_end=0.6, size=0.012, width=0.007, feather=0.001, amount=0.35, seed=11,
    ) | changes  # fmt: skip


def _dirt(**changes: Any) -> dict[str, Any]:
    return dict(
        pattern="bands", color=(0.30, 0.26, 0.21), opacity=0.75, roughness=0.7, scattering=0.6, age_begin=0.3,
        age_end=1.0, size=0.16, width=0.014, feather=0.02, warp=0.5, amount=0.5, seed=13,
    ) | changes  # fmt: skip


ICE_PRESETS: dict[str, IcePreset] = {
    "fresh_breath": IcePreset(
        "just frozen: clear, a breath of frost on it, light scattered once inside",
        (1.1, 1.1, 1.1),
        (0.149, 0.048, 0.0037),
        {"roughness": 0.06, "refraction_roughness": 0.10, "volume": 1.0, "anisotropy": 0.3},
        (
            _cracks(age_begin=0.25, age_end=1.0, amount=0.4),
            _frost(age_begin=0.0, age_end=0.6, opacity=0.7, size=0.16, amount=0.36, slope=0.1),
            _bubbles(opacity=0.35),
        ),
    ),
    "arctic_blue": IcePreset(
        "dense and blue, old air pressed out; planes of fracture",
        (3.0, 3.0, 3.0),
        (0.149, 0.048, 0.0037),
        {"roughness": 0.12, "refraction_roughness": 0.16},
        (_cracks(), _cells(opacity=0.6), _frost(amount=0.36), _snow(age_begin=0.6)),
    ),
    "old_glacier": IcePreset(
        "bubbly, with bands of dirt, frosted cracks and snow",
        (14.0, 14.0, 14.0),
        (0.149, 0.048, 0.0037),
        {"roughness": 0.3},
        (_dirt(), _cracks(opacity=0.95), _cells(size=0.22, width=0.007, feather=0.012, amount=0.6), _frost(), _snow()),
    ),
    "weathered_white": IcePreset(
        "a crust of sun and wind: white, cracked all over",
        (45.0, 45.0, 45.0),
        (0.149, 0.048, 0.0037),
        {"roughness": 0.5, "refraction": 0.6},
        (
            _cells(
                size=0.12, width=0.006, feather=0.008, scales=3, amount=0.7, color=(0.75, 0.85, 0.95), scattering=0.3
            ),
            _frost(amount=0.62, age_begin=0.0, age_end=0.8),
            _snow(age_begin=0.3),
        ),
    ),
    "sea_ice": IcePreset(
        "milky, green below, layers of brine and bubbles under snow",
        (9.0, 9.0, 9.0),
        (0.160, 0.067, 0.081),
        {"roughness": 0.25},
        (
            _bubbles(amount=0.6, opacity=0.6),
            _dirt(color=(0.93, 0.97, 0.97), scattering=0.7, size=0.09, width=0.012, age_begin=0.0, warp=0.3),
            _cells(size=0.4, amount=0.45),
            _frost(amount=0.4),
            _snow(),
        ),
    ),
}


def ice_preset(name: str, age: float = 0.5, scale: float = 1.0, depth: float = 1.0, **changes: Any) -> IceMaterial:
    """An ice material of ICE_PRESETS.

    Parameters
    ----------
    name : str
        ``fresh_breath``, ``arctic_blue``, ``old_glacier``, ``weathered_white`` or ``sea_ice``.
    age : float
        From 0, fresh, to 1, old: how far its cracks, frost and snow have come out.
    scale : float
        > 0; how much larger the body is than the metre that the preset is made for.
    depth : float
        >= 0; how many metres of ice each metre counts for in colour: 8 makes a block as blue as a glacier's wall.
        `depth` = `scale` keeps the absorption of real ice at any size.
    **changes
        Arguments of IceMaterial that take the place of the preset's; `medium` too.

    Returns
    -------
    IceMaterial

    Raises
    ------
    KeyError
        For an unknown name; the message has the nearest.
    ValueError
        For a scale that is not > 0, a depth that is not >= 0.

    Examples
    --------
    >>> import frazil as fz
    >>> ice = fz.ice_preset("arctic_blue", age=0.3, scale=2.0, depth=8.0)
    >>> len(ice.overlays), ice.age < 0.5
    (4, True)
    """
    preset = find_preset(name)
    return IceMaterial(
        **{"medium": preset_medium(preset, scale, depth), "overlays": preset_overlays(preset, scale), "age": age}
        | preset.inputs
        | changes
    )


def find_preset(name: str) -> IcePreset:
    """The row of that name; KeyError with the nearest where there is none."""
    if name in ICE_PRESETS:
        return ICE_PRESETS[name]
    nearest = get_close_matches(name, ICE_PRESETS, n=1, cutoff=0.0)[0]
    raise KeyError(f"ice_preset: name must be one of {', '.join(ICE_PRESETS)}, got {name!r}. Did you mean {nearest!r}?")


def preset_medium(preset: IcePreset, scale: float = 1.0, depth: float = 1.0, eta: float = 1.31) -> Medium:
    """The preset's medium for a body `scale` times as large, `depth` times as deep in colour."""
    if not scale > 0.0:
        raise ValueError(f"ice_preset: scale must be > 0, got {scale}.")
    if not depth >= 0.0:
        raise ValueError(f"ice_preset: depth must be >= 0, got {depth}.")
    return Medium([s / scale for s in preset.sigma_s_prime], [s * depth / scale for s in preset.sigma_a], eta)


def preset_overlays(preset: IcePreset, scale: float = 1.0, **changes: Any) -> list[Overlay]:
    """The preset's overlays, lengths times `scale`; `changes` are arguments of every Overlay."""
    made = []
    for row in preset.overlays:
        overlay = Overlay(**({"name": row["pattern"]} | row | changes))
        for name in _LENGTHS:
            setattr(overlay, name, getattr(overlay, name) * scale)
        made.append(overlay)
    return made


def presets_markdown() -> str:
    """The table of presets as docs/material.md shows it."""
    lines = ["| preset | scattering, 1/m | absorption R G B, 1/m | overlays | what |", "|---|---|---|---|---|"]
    for name, preset in ICE_PRESETS.items():
        patterns = ", ".join(row["pattern"] for row in preset.overlays)
        absorption = " ".join(f"{a:g}" for a in preset.sigma_a)
        lines.append(f"| `{name}` | {preset.sigma_s_prime[0]:g} | {absorption} | {patterns} | {preset.meaning} |")
    return "\n".join(lines)
