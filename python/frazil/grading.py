"""`grade`: change a rendered picture after the render, exactly where its layers keep what is linear linear.

Model: the new beauty is a weighted sum of additive layers: component x light group, ramp knots, compensation modes;
then colour corrections. What is exact and what is not: docs/grading.md.
Units: radiance.
Valid: within half precision of a new render for what is listed as exact (tests/python/test_grading.py).
Not: reading recipes (grade_recipe.py), anything that needs new rays.
"""

import json
import os
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from .aovs import aov_table, unknown_name
from .film import Film
from .grade_color import correct
from .grade_recipe import MODES, Compensation, Matte, RampChange, Recipe, read_recipe
from .warning import FrazilWarning

__all__ = ["Lights", "grade"]

# Layers of what a change of an overlay's opacity changes, and the component that each belongs to. An overlay tints the
# light that leaves the core and takes from what enters it: the product goes with the square of the change.
OVERLAY_PARTS = {
    "diffuse": "diffuse",
    "translucency": "translucency",
    "refraction": "refraction",
    "volume": "volume",
    "squared": "translucency",
}


def grade(
    film: "Film | str | os.PathLike",
    recipe: "Recipe | Mapping[str, Any] | str | os.PathLike",
    *,
    keep_layers: bool = False,
) -> Film:
    """Change a picture after its render.

    Parameters
    ----------
    film : Film or path-like
        Rendered layers, or the EXR that holds them; not changed. `Film.load(path, keep_half=True)` halves the memory.
    recipe : path-like, mapping or Recipe
        A TOML file, or a dict of the same shape: docs/grading.md.
    keep_layers : bool
        Give the additive layers too, graded, so that the result can be graded once more. Colour corrections are in the
        beauty alone. Else the result has the beauty and what is no light: depth, mattes, positions.

    Returns
    -------
    Film
        Layers that did not change are shared with `film`.

    Raises
    ------
    ValueError
        For a recipe out of range, or one that the picture's layers cannot serve; the message has the render option that
        makes the missing layer.
    OSError
        For files that cannot be read.

    Examples
    --------
    >>> import numpy as np, frazil as fz
    >>> layers = {name: np.ones((2, 2, 3), np.float32) for name in ("translucency", "specular")}
    >>> film = fz.Film(layers | {"beauty": np.full((2, 2, 4), 2, np.float32)})
    >>> float(fz.grade(film, {"components": {"specular": {"intensity": 0.5}}})["beauty"][0, 0, 0])
    1.5
    """
    recipe = read_recipe(recipe)
    if not isinstance(film, Film):
        film = Film.load(film, keep_half=True)
    lights = Lights(film, recipe)
    rgb = lights.beauty()
    correct(rgb, recipe.color)
    for name, matte in recipe.mattes.items():
        correct(rgb, matte.correction, _coverage(film, name, matte))

    source = film["beauty"]
    beauty = np.empty(source.shape, np.float32)
    beauty[:, :, :3] = rgb
    beauty[:, :, 3:] = source[:, :, 3:]
    layers = {"beauty": beauty}
    if keep_layers:
        layers |= lights.graded_layers()
    layers |= {name: array for name, array in film.layers.items() if name not in lights.names and name != "beauty"}
    return Film(layers, film.metadata, film.stats)


# ---- light -----------------------------------------------------------------------------------------------------------


class Lights:
    """The additive layers of a film, and what a recipe makes of each."""

    def __init__(self, film: Film, recipe: "Recipe | Mapping[str, Any]"):
        recipe = read_recipe(recipe)
        if "beauty" not in film:
            raise ValueError("grade: picture must have a beauty (R, G, B), got none. Add beauty to --aov.")
        self.film, self.recipe = film, recipe
        self.groups = _json(film, "frazil:light_groups") or _groups_by_name(film)
        expected = _json(film, "frazil:additive") or [row["name"] for row in aov_table() if row["is_additive"]]
        self.components = [name for name in expected if name in film]
        self.is_complete = len(self.components) == len(expected) or not film.metadata
        self.knots = _json(film, "frazil:ramp_knots") or []
        self.overlays = _json(film, "frazil:overlays") or []
        self.names = self._names_of_light()
        self._refuse_what_is_missing()

    def beauty(self) -> np.ndarray:
        """(H, W, 3) float32: the sum of all light, graded."""
        terms = self.terms()
        adds_layers = self._changes_translucency or self._overlay_terms()
        if not adds_layers and all(np.all(weight == 1.0) for _, weight in terms):
            return self.film["beauty"][:, :, :3].astype(np.float32)
        if self.is_complete:
            return self._with_overlaps(self._sum(terms))
        # Some components are not in the file: what changes is added to the beauty.
        changes: list[tuple[str, np.ndarray]] = []
        for component in self.components:
            own = self._terms_of(component)
            if any(np.any(weight != 1.0) for _, weight in own):
                changes += [*own, (component, -np.ones(3))]
        changed = self._sum(changes + self._indirect_terms() + self._overlay_terms())
        changed += self.film["beauty"][:, :, :3]
        return self._with_overlaps(changed)

    def terms(self) -> list[tuple[str, np.ndarray]]:
        """The layers that sum to the graded beauty, each with its (3,) weight."""
        terms = [term for component in self.components for term in self._terms_of(component)]
        return terms + self._indirect_terms() + self._overlay_terms()

    def _terms_of(self, component: str) -> list[tuple[str, np.ndarray]]:
        if component == "translucency" and self._changes_translucency:
            return self._translucency_terms()
        return self._terms(component)

    @property
    def _changes_translucency(self) -> bool:
        return bool(self.recipe.ramp or self.recipe.compensation)

    def graded_layers(self) -> dict[str, np.ndarray]:
        """Every additive layer, graded. What changes of ice that is seen by way of other lobes is in `refraction`."""
        layers = {}
        for component in self.components:
            if component == "translucency" and self._changes_translucency:
                layers |= self._graded_translucency()
                continue
            for group, name in self._part_names(component).items():
                terms = [(name, self._weight(group, component)), *self._overlay_terms(component, group)]
                if component == "refraction":
                    terms += self._indirect_terms(only=group)
                layers[name] = self._with_overlaps(self._sum(terms), component, group)
            if component not in layers:
                terms = self._terms(component) + self._overlay_terms(component)
                terms += self._indirect_terms() if component == "refraction" else []
                layers[component] = self._with_overlaps(self._sum(terms), component)
        return layers

    def _graded_translucency(self) -> dict[str, np.ndarray]:
        names = self._part_names("translucency")
        parts = {}
        for group, name in names.items():
            terms = self._translucency_terms(only=group) + self._overlay_terms("translucency", group)
            parts[name] = self._with_overlaps(self._sum(terms), "translucency", group)
        if len(names) > 1:
            parts["translucency"] = sum(parts.values())
        return parts

    def _terms(self, component: str) -> list[tuple[str, np.ndarray]]:
        parts = self._parts(component)
        if len(parts) > 1 and all(np.array_equal(weight, parts[0][1]) for _, weight in parts):
            return [(component, parts[0][1])]
        return parts

    def _parts(self, component: str) -> list[tuple[str, np.ndarray]]:
        return [(name, self._weight(group, component)) for group, name in self._part_names(component).items()]

    def _part_names(self, layer: str) -> dict[str, str]:
        """The layers that sum to this one, by light group; itself where it is not kept apart."""
        names = {group: f"{layer}_{group}" for group in self.groups}
        if len(self.groups) > 1 and all(name in self.film for name in names.values()):
            return names
        return {self.groups[0] if len(self.groups) == 1 else "": layer}

    def _weight(self, group: str, component: str) -> np.ndarray:
        recipe = self.recipe
        mixes = (
            recipe.lights.get(group),
            recipe.light_components.get((group, component)),
            recipe.components.get(component),
        )
        weight = np.ones(3)
        for mix in mixes:
            if mix is not None:
                weight = weight * mix.factor
        return weight

    def _sum(self, terms: list[tuple[str, np.ndarray]]) -> np.ndarray:
        from . import _frazil

        out = np.empty((self.film.height, self.film.width, 3), np.float32)
        layers = [_rgb(self.film, name) for name, _ in terms]
        weights = np.array([weight for _, weight in terms], np.float32).reshape(-1, 3)
        _frazil.mix_layers(layers, weights, out)
        return out

    # ---- translucency: ramp and compensation ----

    def _translucency_terms(self, only: str | None = None) -> list[tuple[str, np.ndarray]]:
        """The layers that translucency is made of anew; of one light group `only`."""
        if self.recipe.ramp and self.recipe.compensation:
            raise ValueError(
                "grade: ramp and compensation must not be changed in one recipe: their product is not in the layers. "
                "Render with the new compensation."
            )
        return [
            (name, self._weight(group, "translucency") * share)
            for layer, share in self._translucency_shares()
            for group, name in self._part_names(layer).items()
            if only is None or group == only
        ]

    def _indirect_terms(self, only: str | None = None) -> list[tuple[str, np.ndarray]]:
        """What changes where ice is seen by way of other lobes: of their weights, the mean."""
        if not self._changes_translucency or "indirect_translucency" not in self.film:
            return []
        shares = [*self._translucency_shares(), ("translucency", -np.ones(3))]
        lobes = ("diffuse", "specular", "refraction")
        return [
            (name, np.mean([self._weight(group, lobe) for lobe in lobes], axis=0) * share)
            for layer, share in shares
            for group, name in self._part_names(f"indirect_{layer}").items()
            if only is None or group == only
        ]

    def _translucency_shares(self) -> list[tuple[str, np.ndarray]]:
        return self._ramp_shares() if self.recipe.ramp else self._compensation_shares()

    def _ramp_shares(self) -> list[tuple[str, np.ndarray]]:
        """Every knot layer and the colour that it gets."""
        materials = list(dict.fromkeys(knot["material"] for knot in self.knots if not knot["is_fixed"]))
        changes: dict[str, RampChange] = {}
        for material, change in self.recipe.ramp.items():
            if material == "" and len(materials) != 1:
                names = ", ".join(f'[ramp."{name}"]' for name in materials) or "none: no ice has a ramp"
                raise ValueError(f"grade: ramp must name its material, there are {names}.")
            if material and material not in materials:
                raise ValueError(f"grade: ramp must be of one of {', '.join(materials)}, got {material!r}.")
            changes[material or materials[0]] = change
        shares = []
        for material in dict.fromkeys(knot["material"] for knot in self.knots):
            own = [(k, knot) for k, knot in enumerate(self.knots) if knot["material"] == material]
            change = changes.get(material)
            colors = np.array(change.colors if change else [knot["color"] for _, knot in own], np.float64)
            if len(colors) != len(own):
                raise ValueError(
                    f"grade: ramp colors must be {len(own)} for {material}, one per knot, got {len(colors)}."
                )
            preserves = own[0][1]["preserves_energy"]
            if change is not None and change.preserve_energy is not None:
                preserves = change.preserve_energy
            if preserves:
                energy = (colors * [knot["share"] for _, knot in own]).sum(axis=0)
                if np.any(energy <= 1e-9):
                    raise ValueError(f"grade: ramp colors must leave some energy to preserve for {material}, got none.")
                colors = colors / energy
            shares += [(f"translucency_ramp{k}", color) for (k, _), color in zip(own, colors, strict=True)]
        return shares

    def _compensation_shares(self) -> list[tuple[str, np.ndarray]]:
        change = self.recipe.compensation or Compensation()
        ones = np.ones(3)
        if change.mode is not None:
            strength = 0.0 if change.mode == "off" else 1.0 if change.strength is None else change.strength
            shares = [(f"compensation_{change.mode}", strength * ones), ("compensation_off", (1.0 - strength) * ones)]
        else:
            strength = 1.0 if change.strength is None else change.strength
            rendered = _json(self.film, "frazil:compensation") or []
            strengths = {entry["strength"] for entry in rendered}
            if len(strengths) != 1 or 0.0 in strengths:
                raise ValueError(
                    "grade: compensation must have a mode, as the picture was not rendered with one strength above 0."
                )
            relative = strength / strengths.pop()
            shares = [("translucency", relative * ones), ("compensation_off", (1.0 - relative) * ones)]
        return [(name, share) for name, share in shares if np.any(share != 0.0)]

    # ---- overlays ----

    def _overlay_terms(self, component: str | None = None, only: str | None = None) -> list[tuple[str, np.ndarray]]:
        """What the changes of the overlays' opacities add: to one component and light group, or to all."""
        terms = []
        for overlay, factor in self._overlay_factors().items():
            for part, of in OVERLAY_PARTS.items():
                layer = f"overlay_{overlay}_{part}"
                if factor == 1.0 or component not in (None, of) or layer not in self.film:
                    continue
                change = (factor - 1.0) ** (2 if part == "squared" else 1)
                terms += [
                    (name, self._weight(group, of) * change)
                    for group, name in self._part_names(layer).items()
                    if only is None or group == only
                ]
        return terms

    def _with_overlaps(self, light: np.ndarray, component: str | None = None, only: str | None = None) -> np.ndarray:
        """The light, and what several overlays that change change together: in place.

        Overlays that lie over one another multiply what they leave of the light from below. Each one's own change is in
        `_overlay_terms`; the product of what all leave is more or less than their sum.
        """
        factors = {name: factor for name, factor in self._overlay_factors().items() if factor != 1.0}
        if len(factors) < 2:
            return light
        for part in (component,) if component else ("translucency", "refraction", "volume"):
            if part not in ("translucency", "refraction", "volume") or part not in self.film:
                continue
            for group, name in self._part_names(part).items():
                if only is None or group == only:
                    light += self._overlap(factors, part, name) * self._weight(group, part).astype(np.float32)
        return light

    def _overlap(self, factors: Mapping[str, float], part: str, layer: str) -> np.ndarray:
        """By how much the product of the overlays' changes differs from their sum, for one layer."""
        rendered = self.film[layer].astype(np.float32)
        is_lit = np.abs(rendered) > 1e-6
        product, total = np.ones_like(rendered), np.ones_like(rendered)
        for overlay, factor in factors.items():
            change = self._change(overlay, part, layer) * np.float32(factor - 1.0)
            if part == "translucency":
                change += self._change(overlay, "squared", layer) * np.float32((factor - 1.0) ** 2)
            relative = np.divide(change, rendered, out=np.zeros_like(change), where=is_lit)
            product *= np.clip(1.0 + relative, 0.0, 1e3)
            total += relative
        return (product - total) * rendered

    def _change(self, overlay: str, part: str, layer: str) -> np.ndarray:
        """The change by an overlay that belongs to a component's layer; 0 where the picture lacks it."""
        name = f"overlay_{overlay}_{part}" + layer[len("translucency" if part == "squared" else part) :]
        return self.film[name].astype(np.float32) if name in self.film else np.zeros_like(self.film[layer], np.float32)

    def _overlay_factors(self) -> dict[str, float]:
        """By what the opacity of each overlay is multiplied; refused where it would leave 0..1."""
        recipe = self.recipe
        if recipe.age is None and not recipe.overlays:
            return {}
        known = list(dict.fromkeys(row["name"] for row in self.overlays))
        for name in recipe.overlays:
            if name not in known:
                raise ValueError(unknown_name("grade: overlays", name, known or ["none: no ice has overlays"]))
        factors: dict[str, float] = {}
        for row in self.overlays:
            name, rendered = row["name"], _age_weight(row, row["age"])
            factor = recipe.overlays.get(name, 1.0)
            if recipe.age is not None:
                wanted = _age_weight(row, recipe.age)
                if rendered == 0.0 and wanted > 0.0:
                    raise ValueError(
                        f"grade: overlays.age must be at most {row['age_begin']:g}, where {name} of {row['material']} "
                        f"begins, got {recipe.age:g}: at the rendered age {row['age']:g} it is not in the picture. "
                        "Render at a greater age."
                    )
                factor *= wanted / rendered if rendered > 0.0 else 1.0
            if factor * rendered * row["opacity"] > 1.0 + 1e-6:
                raise ValueError(
                    f"grade: overlays.{name}.opacity must be <= {1.0 / (rendered * row['opacity']):g}, got {factor:g}: "
                    f"it was rendered with opacity {rendered * row['opacity']:g}."
                )
            if factors.setdefault(name, factor) != factor:
                raise ValueError(
                    f"grade: overlays.age must change {name} of all materials alike, as they share its layers. "
                    "Give overlays of different ages names of their own."
                )
        return factors

    # ---- what the film must have ----

    def _names_of_light(self) -> set[str]:
        """All layers that are light: those that a graded picture has no use for."""
        tops = set(self.components)
        tops |= {f"translucency_ramp{k}" for k in range(len(self.knots))}
        tops |= {f"compensation_{mode}" for mode in MODES}
        tops |= {f"indirect_{top}" for top in tops}
        tops |= {f"overlay_{row['name']}_{part}" for row in self.overlays for part in OVERLAY_PARTS}
        names = tops | {f"{top}_{group}" for top in tops for group in self.groups}
        return {name for name in names if name in self.film}

    def _refuse_what_is_missing(self) -> None:
        recipe = self.recipe
        for group in dict.fromkeys([*recipe.lights, *(group for group, _ in recipe.light_components)]):
            if group not in self.groups:
                known = ", ".join(self.groups) or "none"
                raise ValueError(
                    f"grade: lights must be of a light group of the picture ({known}), got {group!r}. "
                    "Give lights a frazil:lightGroup before the render."
                )
        wanted = set(recipe.components) | {component for _, component in recipe.light_components}
        if recipe.lights and len(self.groups) > 1:
            wanted |= set(self.components)
        for component in sorted(wanted):
            self._require(component, f"--aov {component}")
        if recipe.lights or recipe.light_components:
            if not self.components:
                self._require("translucency", "all layers, without --aov")
            for component in self.components:
                parts = self._part_names(component)
                if len(self.groups) > 1 and len(parts) == 1:
                    raise ValueError(
                        f"grade: layers {component}_{self.groups[0]}, ... must be in the picture to change lights. "
                        "Render without --aov, or with --aov naming the component."
                    )
        if recipe.ramp:
            if not self.knots:
                self._require("translucency_ramp0", "--aov translucency_ramp")
            for k in range(len(self.knots)):
                self._require(f"translucency_ramp{k}", "--aov translucency_ramp")
        if recipe.compensation:
            for name, _ in self._compensation_shares():
                self._require(name, f"--aov {name}")

        if (recipe.overlays or recipe.age is not None) and not self.overlays:
            raise ValueError(
                "grade: layers overlay_... must be in the picture, are missing. Render ice that has overlays with "
                "--aov all,overlay."
            )
        for name, factor in self._overlay_factors().items():
            if factor != 1.0:
                self._require(f"overlay_{name}_diffuse", "--aov all,overlay")

    def _require(self, name: str, option: str) -> None:
        if name not in self.film:
            raise ValueError(f"grade: layer {name} must be in the picture, is missing. Render with {option}.")


def _age_weight(overlay: Mapping[str, Any], age: float) -> float:
    """How much of its opacity an overlay has at an age: a smooth step (material/overlay.cpp)."""
    begin, end = overlay["age_begin"], overlay["age_end"]
    if age >= end:
        return 1.0
    t = max(0.0, (age - begin) / (end - begin))
    return t * t * (3.0 - 2.0 * t)


def _rgb(film: Film, name: str) -> np.ndarray:
    array = film[name]
    if array.shape[2] != 3:
        raise ValueError(f"grade: layer {name} must have three channels, got {array.shape[2]}.")
    if array.dtype not in (np.float16, np.float32):
        array = array.astype(np.float32)
    return np.ascontiguousarray(array)


def _json(film: Film, key: str) -> Any:
    value = film.metadata.get(key)
    return json.loads(value) if isinstance(value, str) else value


def _groups_by_name(film: Film) -> list[str]:
    """Light groups by the names of layers, for pictures whose metadata was lost."""
    prefix = "diffuse_"
    return [name[len(prefix) :] for name in film if name.startswith(prefix)] or ["default"]


# ---- mattes ----------------------------------------------------------------------------------------------------------


def _coverage(film: Film, name: str, matte: Matte) -> np.ndarray:
    """(H, W) in 0..1: how much of each pixel a matte holds."""
    if matte.layer is not None:
        if matte.layer not in film:
            raise ValueError(f"grade: mattes.{name}: layer must be in the picture, got {matte.layer!r}: {film!r}.")
        coverage = film[matte.layer][:, :, 0].astype(np.float32)
    else:
        from .cryptomatte import matte_of

        picks = {"object": matte.objects, "material": matte.materials, "asset": matte.assets}
        coverage = np.zeros((film.height, film.width), np.float32)
        for kind, patterns in picks.items():
            if not patterns:
                continue
            found, matched = matte_of(film, kind, patterns, refracted=matte.refracted)
            if not matched:
                message = f"grade: mattes.{name}: no {kind} in the picture is named {', '.join(patterns)}."
                warnings.warn(message, FrazilWarning, stacklevel=3)
            coverage += found
    coverage = np.clip(np.nan_to_num(coverage), 0.0, 1.0)
    return 1.0 - coverage if matte.invert else coverage
