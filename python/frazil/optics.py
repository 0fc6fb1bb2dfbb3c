"""Ice from its physics: absorption of pure ice, bubbles and impurities become a Medium.

Absorption tables are per metre from 350 to 750 nm in steps of 10 nm:

- ``warren2008``: 4 pi k / wavelength from the imaginary index k of [WarrenBrandt2008] at these wavelengths, within
  0.3 % of the table in the package snowoptics 0.99.2.
- ``picard2016``: [Picard2016] below 600 nm as the authors' package snowoptics 0.99.2 holds it, within 0.5 % (its values
  lie 6-7 % under the table on the authors' page), and [WarrenBrandt2008] above. In the blue it absorbs ten times as
  much.

Checked against that package: both tables, soot and dust. From memory: the efficiency and asymmetry of bubbles, algae.

Spectra become RGB by the colour matching functions of CIE 1931 as fitted by [Wyman2013], brought to Rec.709 primaries,
negative lobes cut off, each normalised: a mean over what each channel sees.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._frazil import Medium, MultipleScattering

WAVELENGTHS_NM = np.arange(350.0, 751.0, 10.0)

_WARREN_2008 = np.array(
    "7.18e-4 6.98e-4 6.79e-4 6.61e-4 6.44e-4 7.43e-4 8.18e-4 9.38e-4 1.21e-3 1.79e-3 2.58e-3 3.62e-3 5.23e-3 7.49e-3 "
    "1.07e-2 1.48e-2 1.98e-2 2.60e-2 3.34e-2 4.22e-2 5.23e-2 6.37e-2 7.63e-2 9.01e-2 0.105 0.12 0.142 0.174 0.207 0.24 "
    "0.276 0.316 0.354 0.386 0.437 0.521 0.609 0.703 0.74 0.835 0.984".split(),
    dtype=float,
)
_PICARD_2016 = np.concatenate(
    [
        np.array(
            "0.0234 0.0214 0.0205 0.0197 0.0189 0.0183 0.0171 0.0159 0.0164 0.0168 0.0179 0.019 0.0209 0.0229 0.0258 "
            "0.029 0.0332 0.0379 0.0438 0.0506 0.0594 0.0696 0.0807 0.0933 0.109".split(),
            dtype=float,
        ),
        _WARREN_2008[25:],
    ]
)
_PURE_ICE = {"warren2008": _WARREN_2008, "picard2016": _PICARD_2016}

# Mass absorption in m²/kg at a wavelength, and Angstrom exponent.
_IMPURITIES = {
    "soot": (7500.0, 550.0, 1.0),  # [BondBergstrom2006]
    "dust": (110.0, 400.0, 4.1),  # Sahara (Libya), PM2.5 [Caponi2017]
}
# Absorption of algae per mass of chlorophyll a in m²/kg: lobes (value, peak and width in nm) of the blue and the red
# band of chlorophyll and of the pigments between, over a floor. The two peaks are those of [Bricaud1995] at 1 mg/m³,
# from memory; widths, shoulder and floor are ours.
_ALGAE_LOBES = ((3.6e4, 437.0, 28.0), (1.8e4, 485.0, 30.0), (1.8e4, 675.0, 11.0))
_ALGAE_FLOOR = 2.5e3
IMPURITIES = (*_IMPURITIES, "algae")
"""Kinds of impurity: soot and dust in kg, algae in kg of chlorophyll a, per kg of ice."""

ICE_DENSITY = 917.0
"""Density of pure ice, kg/m³."""

# Bubbles much larger than the wavelength: extinction efficiency and asymmetry in ice [MullenWarren1988].
_BUBBLE_EFFICIENCY, _BUBBLE_ASYMMETRY = 2.0, 0.86

# Measured media [Jensen2001]: reduced scattering and absorption in 1/mm, and index.
_MEASURED = {
    "apple": ((2.29, 2.39, 1.97), (0.0030, 0.0034, 0.046)),
    "chicken1": ((0.15, 0.21, 0.38), (0.015, 0.077, 0.19)),
    "chicken2": ((0.19, 0.25, 0.32), (0.018, 0.088, 0.20)),
    "cream": ((7.38, 5.47, 3.15), (0.0002, 0.0028, 0.0163)),
    "ketchup": ((0.18, 0.07, 0.03), (0.061, 0.97, 1.45)),
    "marble": ((2.19, 2.62, 3.00), (0.0021, 0.0041, 0.0071)),
    "potato": ((0.68, 0.70, 0.55), (0.0024, 0.0090, 0.12)),
    "skimmilk": ((0.70, 1.22, 1.90), (0.0014, 0.0025, 0.0142)),
    "skin1": ((0.74, 0.88, 1.01), (0.032, 0.17, 0.48)),
    "skin2": ((1.09, 1.59, 1.79), (0.013, 0.070, 0.145)),
    "spectralon": ((11.6, 20.4, 14.9), (0.00, 0.00, 0.00)),
    "wholemilk": ((2.55, 3.21, 3.77), (0.0011, 0.0024, 0.014)),
}


@dataclass(frozen=True)
class IceRecipe:
    """Bubbles and impurities of a kind of ice; a look to start from, not a measurement."""

    bubbles_per_m3: float
    bubble_radius: float
    soot: float = 0.0
    dust: float = 0.0
    algae: float = 0.0
    meaning: str = ""


PRESETS = {
    "blue_glacier_ice": IceRecipe(2e7, 3e-4, meaning="deep ice, its air pressed out: metres of blue"),
    "white_bubbly_ice": IceRecipe(1e9, 2e-4, meaning="shallow glacier ice, cloudy with old air"),
    "firn": IceRecipe(1e10, 2e-4, meaning="snow on its way to ice"),
    "lake_ice": IceRecipe(1e6, 5e-4, meaning="black ice of a lake: few large bubbles"),
    "sea_ice": IceRecipe(5e8, 2e-4, dust=1e-7, algae=2e-9, meaning="brine and bubbles, silt and a little algae"),
    "breath_frost": IceRecipe(1e12, 3e-5, meaning="white crystals of frozen breath"),
}


def absorption(data: str = "warren2008") -> np.ndarray:
    """Absorption of pure ice in 1/m, (41,), at WAVELENGTHS_NM; `data` is ``warren2008`` or ``picard2016``."""
    if data not in _PURE_ICE:
        raise ValueError(f"absorption: data must be one of {', '.join(_PURE_ICE)}, got {data!r}.")
    return _PURE_ICE[data].copy()


def impurity_absorption(kind: str, mass_fraction: float) -> np.ndarray:
    """Absorption in 1/m, (41,), that `mass_fraction` of ``soot``, ``dust`` (kg per kg of ice) or ``algae`` (kg of
    chlorophyll a per kg of ice) adds."""
    if kind not in IMPURITIES:
        raise ValueError(f"impurity_absorption: kind must be one of {', '.join(IMPURITIES)}, got {kind!r}.")
    if not (mass_fraction >= 0 and np.isfinite(mass_fraction)):
        raise ValueError(f"impurity_absorption: mass_fraction must be >= 0, got {mass_fraction}. It is kg per kg.")
    if kind == "algae":
        lobes = sum(a * np.exp(-0.5 * ((WAVELENGTHS_NM - peak) / width) ** 2) for a, peak, width in _ALGAE_LOBES)
        return mass_fraction * ICE_DENSITY * (lobes + _ALGAE_FLOOR)
    per_mass, at_nm, exponent = _IMPURITIES[kind]
    return mass_fraction * ICE_DENSITY * per_mass * (WAVELENGTHS_NM / at_nm) ** -exponent


def bubble_scattering(per_m3: float, radius: float) -> float:
    """Reduced scattering in 1/m of `per_m3` bubbles of effective `radius` (m): n pi r² Q (1 - g)."""
    for name, value in (("per_m3", per_m3), ("radius", radius)):
        if not (value >= 0 and np.isfinite(value)):
            raise ValueError(f"bubble_scattering: {name} must be >= 0, got {value}.")
    return per_m3 * np.pi * radius**2 * _BUBBLE_EFFICIENCY * (1.0 - _BUBBLE_ASYMMETRY)


def to_rgb(spectrum: np.ndarray) -> np.ndarray:
    """Mean of a spectrum (41,) over what each of R, G, B sees, (3,)."""
    spectrum = np.asarray(spectrum, float)
    if spectrum.shape != WAVELENGTHS_NM.shape:
        raise ValueError(f"to_rgb: spectrum must have shape {WAVELENGTHS_NM.shape}, got {spectrum.shape}.")
    if not np.isfinite(spectrum).all():
        raise ValueError("to_rgb: spectrum must be finite, got NaN or infinity.")
    w = WAVELENGTHS_NM

    def lobe(peak: float, below: float, above: float) -> np.ndarray:
        return np.exp(-0.5 * ((w - peak) / np.where(w < peak, below, above)) ** 2)

    x = 1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2)
    y = 0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1)
    z = 1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8)
    to_709 = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    seen = np.maximum(0.0, to_709 @ np.stack([x, y, z]))
    return (seen @ spectrum) / seen.sum(axis=1)


def ice(
    bubbles_per_m3: float,
    bubble_radius: float,
    *,
    soot: float = 0.0,
    dust: float = 0.0,
    algae: float = 0.0,
    data: str = "warren2008",
) -> Medium:
    """A medium of bubbles and impurities in pure ice; eta = 1.31.

    Parameters
    ----------
    bubbles_per_m3 : float
        Number of bubbles per m³, >= 0.
    bubble_radius : float
        Effective radius in m, >= 0.
    soot, dust, algae : float
        Mass fractions, see `impurity_absorption`.
    data : str
        Absorption of pure ice, ``warren2008`` or ``picard2016``.

    Raises
    ------
    ValueError
        For values that are negative or not finite, and unknown `data`.

    Examples
    --------
    >>> from frazil import optics
    >>> medium = optics.ice(1e9, 2e-4, dust=1e-7)
    >>> bool(medium.sigma_a[0] > medium.sigma_a[2])
    True
    """
    found = {"soot": soot, "dust": dust, "algae": algae}
    sigma_a = absorption(data) + sum(impurity_absorption(kind, fraction) for kind, fraction in found.items())
    return Medium(bubble_scattering(bubbles_per_m3, bubble_radius), [float(v) for v in to_rgb(sigma_a)], 1.31)


def preset(name: str, data: str = "warren2008") -> Medium:
    """One of PRESETS as a medium."""
    if name not in PRESETS:
        raise ValueError(f"preset: name must be one of {', '.join(PRESETS)}, got {name!r}.")
    recipe = PRESETS[name]
    found = {kind: getattr(recipe, kind) for kind in IMPURITIES}
    return ice(recipe.bubbles_per_m3, recipe.bubble_radius, data=data, **found)


def measured(name: str) -> Medium:
    """A medium of the table of [Jensen2001], e.g. ``marble``; eta = 1.3, marble 1.5."""
    if name not in _MEASURED:
        raise ValueError(f"measured: name must be one of {', '.join(_MEASURED)}, got {name!r}.")
    scatter, absorb = _MEASURED[name]
    eta = 1.5 if name == "marble" else 1.3
    return Medium([1000.0 * s for s in scatter], [1000.0 * a for a in absorb], eta)


def media() -> dict[str, Medium]:
    """Every preset and measured medium by name."""
    return {name: preset(name) for name in PRESETS} | {name: measured(name) for name in _MEASURED}


def media_lines() -> list[str]:
    """The table that ``frazil info --media`` prints: every medium with its units."""
    columns = ("medium", "sigma_s_prime (1/m)", "sigma_a (1/m)", "eta", "albedo R G B", "what")
    lines = ["{:<19} {:<28} {:<28} {:<5} {:<17} {}".format(*columns)]

    def row(name: str, medium: Medium, meaning: str) -> str:
        scatter, absorb = (" ".join(f"{v:<8.3g}" for v in values) for values in (medium.sigma_s_prime, medium.sigma_a))
        albedo = " ".join(f"{v:.3f}" for v in MultipleScattering(medium, 1.0).albedo)
        return f"{name:<19} {scatter:<28} {absorb:<28} {medium.eta:.2f}  {albedo} {meaning}"

    for name, recipe in PRESETS.items():
        parts = [f"{recipe.bubbles_per_m3:g} bubbles/m3 of {1e3 * recipe.bubble_radius:g} mm"]
        parts += [f"{kind} {getattr(recipe, kind):g} kg/kg" for kind in IMPURITIES if getattr(recipe, kind)]
        lines.append(row(name, preset(name), f"{recipe.meaning}; {', '.join(parts)}"))
    for name in _MEASURED:
        lines.append(row(name, measured(name), "measured, Jensen et al. 2001"))
    return lines
