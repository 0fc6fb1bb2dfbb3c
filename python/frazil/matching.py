"""`match`: the recipe that brings a render nearest to a painted picture.

Model: the beauty is linear in light factors and in ramp colours, so least squares over the pixels finds them: one
factor and colour per light group, or one colour per knot; where both are asked for, in turn until neither changes. A
gain is one colour for the whole picture. Not negative unless allowed [LawsonHanson1974].
Units: the reference's values are linear Rec.709 light, from 0 to any brightness; PNGs are decoded from sRGB.
Valid: pictures of one size; a reference made by a recipe is found again (tests/python/test_matching.py).
Not: what is not linear: saturation, gamma; moving shapes.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .difference import flip_difference
from .film import Film
from .grading import Lights, grade

__all__ = ["Match", "match"]

WHAT = ("lights", "ramp", "gain")
_ROUNDS = 20  # of lights and ramp in turn
_MOST_LEVELS = 20_000  # values that are asked to round to the file's
_MOST_PIXELS = 200_000  # that take part; more tell nothing new about a handful of factors


@dataclass(frozen=True)
class Match:
    """A recipe, and how far its picture is from the reference: mean FLIP and RMS of linear light, before and after."""

    recipe: dict[str, Any]
    flip_before: float
    flip_after: float
    rms_before: float
    rms_after: float


def match(
    film: "Film | str | os.PathLike",
    reference: "np.ndarray | str | os.PathLike",
    *,
    what: Sequence[str] = ("lights",),
    mask: "np.ndarray | str | os.PathLike | None" = None,
    allow_negative: bool = False,
    per_channel: bool = True,
) -> Match:
    """Find the recipe that brings a render nearest to a picture.

    Parameters
    ----------
    film : Film or path-like
        With a layer per light group for ``lights``, and with ``translucency_ramp`` for ``ramp``.
    reference : (H, W, 3) array or path-like
        Linear light; a PNG or JPEG is taken as sRGB, an EXR as linear.
    what : sequence of str
        Of ``lights`` (intensity and colour of each group), ``ramp`` (colours of the knots) and ``gain`` (of it all).
    mask : (H, W) array or path-like, optional
        Which pixels count, and how much.
    allow_negative : bool
        Lights and gains may come out negative; ramp colours never.
    per_channel : bool
        Find colours; else one intensity per light, and one gain.

    Returns
    -------
    Match

    Raises
    ------
    ValueError
        For sizes that differ, an empty mask, unknown names in `what`, missing layers.
    OSError
        For files that cannot be read.
    """
    if not isinstance(film, Film):
        film = Film.load(film, keep_half=True)
    for name in what:
        if name not in WHAT:
            raise ValueError(f"match: what must be of {', '.join(WHAT)}, got {name!r}.")
    if "gain" in what and "lights" in what:
        raise ValueError("match: what must not have both lights and gain: lights give any gain.")
    target, steps = _picture(reference)
    size = (film.height, film.width)
    if target.shape[:2] != size:
        raise ValueError(_other_size("reference", target.shape, size))
    weights = np.ones(size, np.float32) if mask is None else _mask(mask)
    if weights.shape != size:
        raise ValueError(_other_size("mask", weights.shape, size))
    weights = np.where(np.all(np.isfinite(target), axis=2), np.clip(np.nan_to_num(weights), 0.0, None), 0.0)
    chosen = np.flatnonzero(weights)
    if len(chosen) == 0:
        raise ValueError("match: mask must leave some pixels, got none.")
    chosen = chosen[:: max(1, len(chosen) // _MOST_PIXELS)]

    problem = _Problem(
        film,
        target.reshape(-1, 3)[chosen],
        _confidence(weights, steps)[chosen],
        None if steps is None else steps.reshape(-1, 3)[chosen].astype(np.float64),
        chosen,
        allow_negative,
        per_channel,
    )
    recipe: dict[str, Any] = {}
    last = np.inf
    for _ in range(_ROUNDS if "lights" in what and "ramp" in what else 1):
        if "lights" in what:
            recipe |= problem.fit_lights(recipe)
        if "ramp" in what:
            recipe |= problem.fit_ramp(recipe)
        error = problem.error(recipe)
        if not error < last * (1.0 - 1e-6):
            break
        last = error
    recipe = problem.refine(recipe)
    if "gain" in what:
        recipe |= problem.fit_gain(recipe)

    before = film["beauty"][:, :, :3].astype(np.float32)
    after = grade(film, recipe)["beauty"][:, :, :3]
    return Match(
        recipe,
        _flip(target, before, weights),
        _flip(target, after, weights),
        _rms(target, before, weights),
        _rms(target, after, weights),
    )


class _Problem:
    """Least squares over the chosen pixels."""

    def __init__(self, film, target, weights, steps, chosen, allow_negative, per_channel):
        self.film, self.target, self.chosen = film, target.astype(np.float64), chosen
        self.root = np.sqrt(weights.astype(np.float64))  # (pixels, 3)
        self.steps = steps  # (pixels, 3): widths of the file's levels; None where it is exact
        self.allow_negative, self.per_channel = allow_negative, per_channel
        self._pixels: dict[str, np.ndarray] = {}

    def layer(self, name: str) -> np.ndarray:
        """(pixels, 3) of a layer."""
        if name not in self._pixels:
            rows = self.film[name].reshape(self.film.height * self.film.width, -1)
            self._pixels[name] = rows[self.chosen, :3].astype(np.float64)
        return self._pixels[name]

    def sum(self, terms) -> np.ndarray:
        total = np.zeros_like(self.target)
        for name, weight in terms:
            total += self.layer(name) * weight
        return total

    def error(self, recipe: dict[str, Any]) -> float:
        return float(np.sum(((self.sum(Lights(self.film, recipe).terms()) - self.target) * self.root) ** 2))

    def fit_lights(self, recipe: dict[str, Any]) -> dict[str, Any]:
        """Factors of all groups together, the ramp as it is in the recipe."""
        columns, target, groups = self._light_columns(recipe)
        factors = self._solve(columns, target, self.allow_negative)
        return {"lights": {group: _mix_of(factor) for group, factor in zip(groups, factors, strict=True)}}

    def _light_columns(self, recipe: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, list[str]]:
        """(groups, pixels, 3): the picture of each light group alone; what they shall sum to."""
        fixed = {key: value for key, value in recipe.items() if key != "lights"}
        groups = Lights(self.film, fixed).groups
        columns = []
        for group in groups:
            off = {"lights": {other: {"intensity": 0.0} for other in groups if other != group}}
            columns.append(self.sum(Lights(self.film, fixed | off).terms()))
        return np.stack(columns), self.target, groups

    def fit_ramp(self, recipe: dict[str, Any]) -> dict[str, Any]:
        """Colours of the knots of all ramps, energy not preserved, the lights as they are in the recipe."""
        fixed = {key: value for key, value in recipe.items() if key != "ramp"}
        knots = Lights(self.film, fixed).knots
        if not any(not knot["is_fixed"] for knot in knots):
            raise ValueError(
                "match: layer translucency_ramp0 must be in the picture, is missing. Render ice that has a ramp with "
                "--aov all,translucency_ramp."
            )
        own = [k for k, knot in enumerate(knots) if not knot["is_fixed"]]
        black = self.sum(Lights(self.film, fixed | _ramps(knots, np.zeros((len(own), 3)))).terms())
        columns = []
        for k in range(len(own)):
            colors = np.zeros((len(own), 3))
            colors[k] = 1.0
            columns.append(self.sum(Lights(self.film, fixed | _ramps(knots, colors)).terms()) - black)
        colors = self._solve(np.stack(columns), self.target - black, allow_negative=False, per_channel=True)
        return _ramps(knots, colors)

    def fit_gain(self, recipe: dict[str, Any]) -> dict[str, Any]:
        picture = self.sum(Lights(self.film, recipe).terms())
        gain = self._solve(picture[None], self.target, self.allow_negative)[0]
        return {"color": {"gain": [float(v) for v in gain]}}

    def _solve(self, columns, target, allow_negative, per_channel=None) -> np.ndarray:
        """(columns, 3) factors."""
        per_channel = self.per_channel if per_channel is None else per_channel
        columns, target = columns * self.root, target * self.root
        if per_channel:
            return np.stack(
                [_least_squares(columns[:, :, c].T, target[:, c], allow_negative) for c in range(3)], axis=1
            )
        factors = _least_squares(columns.reshape(len(columns), -1).T, target.ravel(), allow_negative)
        return np.repeat(factors[:, None], 3, axis=1)

    def refine(self, recipe: dict[str, Any]) -> dict[str, Any]:
        """A recipe whose picture rounds to the reference everywhere, where there is one; else the recipe as it is.

        Rounding errors of a light's smooth regions are all alike: least squares take them for light. That every value
        must round to the file's tells faint lights many times more exactly: a linear program.
        """
        if self.steps is None or "lights" not in recipe:
            return recipe
        columns, target, groups = self._light_columns(recipe)
        factors = []
        steps = np.broadcast_to(self.steps, self.target.shape)
        rows = [(columns[:, :, c].T, target[:, c], steps[:, c]) for c in range(3)]
        if not self.per_channel:
            rows = [tuple(np.concatenate([row[i] for row in rows]) for i in range(3))]
        for matrix, values, step in rows:
            known = np.flatnonzero(np.isfinite(step) & (step > 0.0))
            known = known[:: max(1, len(known) // _MOST_LEVELS)]
            solved = _within_steps(matrix[known], values[known], step[known], self.allow_negative)
            if solved is None:
                return recipe
            factors.append(solved)
        factors = np.stack(factors * (1 if self.per_channel else 3), axis=1)
        return recipe | {"lights": {group: _mix_of(factor) for group, factor in zip(groups, factors, strict=True)}}


def _least_squares(matrix: np.ndarray, target: np.ndarray, allow_negative: bool) -> np.ndarray:
    """Factors of the columns; 1 for columns that are empty."""
    from scipy.optimize import nnls

    size = np.sqrt(np.sum(matrix**2, axis=0))
    used = np.flatnonzero(size > 1e-9 * max(size.max(), 1e-30))
    factors = np.ones(matrix.shape[1])
    if len(used) == 0:
        return factors
    # A small square system has the same solution and needs no tall matrix; rows of R keep its conditioning.
    rotation, triangle = np.linalg.qr(matrix[:, used] / size[used])
    right = rotation.T @ target
    solved = np.linalg.lstsq(triangle, right, rcond=1e-6)[0] if allow_negative else nnls(triangle, right)[0]
    factors[used] = solved / size[used]
    return factors


def _within_steps(matrix: np.ndarray, target: np.ndarray, step: np.ndarray, allow_negative: bool) -> np.ndarray | None:
    """The factors whose sum keeps farthest from the ends of every value's level; None where no factors stay within."""
    from scipy.optimize import linprog

    size = np.abs(matrix).max(axis=0, initial=0.0)
    used = np.flatnonzero(size > 1e-9 * max(size.max(initial=0.0), 1e-30))
    if len(used) == 0 or len(matrix) <= len(used):
        return None
    rows, values = matrix[:, used] / size[used] / step[:, None], target / step
    # The rows that no least squares miss by a level; a painting of its own does by many.
    start = np.linalg.lstsq(rows, values, rcond=None)[0]
    if np.quantile(np.abs(rows @ start - values), 0.99) > 1.0:
        return None
    ones = np.ones((len(rows), 1))
    solved = linprog(
        np.append(np.zeros(len(used)), 1.0),
        A_ub=np.block([[rows, -ones], [-rows, -ones]]),
        b_ub=np.concatenate([values, -values]),
        bounds=[(None if allow_negative else 0.0, None)] * len(used) + [(0.0, None)],
        method="highs",
    )
    # Half a level, and what layers of half floats have lost.
    if not solved.success or solved.x[-1] > 0.75:
        return None
    factors = np.ones(matrix.shape[1])
    factors[used] = solved.x[:-1] / size[used]
    return factors


def _mix_of(factor: np.ndarray) -> dict[str, Any]:
    """A factor per channel as intensity (the largest), colour and sign."""
    peak = float(np.max(np.abs(factor)))
    if peak == 0.0:
        return {"intensity": 0.0}
    sign = 1 if factor[np.argmax(np.abs(factor))] > 0 else -1
    mix: dict[str, Any] = {"intensity": peak, "color": [float(v) for v in sign * factor / peak]}
    return mix | ({"sign": -1} if sign < 0 else {})


def _ramps(knots: Sequence[dict[str, Any]], colors: np.ndarray) -> dict[str, Any]:
    own = [knot["material"] for knot in knots if not knot["is_fixed"]]
    ramps: dict[str, Any] = {}
    for material, color in zip(own, colors, strict=True):
        table = ramps.setdefault(material, {"colors": [], "preserve_energy": False})
        table["colors"].append([float(v) for v in color])
    return {"ramp": ramps}


# ---- pictures --------------------------------------------------------------------------------------------------------


def _picture(source: "np.ndarray | str | os.PathLike") -> tuple[np.ndarray, np.ndarray | None]:
    """(H, W, 3) float32, linear, and how exactly the file tells its values."""
    if isinstance(source, np.ndarray):
        if source.ndim != 3 or source.shape[2] < 3:
            raise ValueError(f"match: reference must be of shape (H, W, 3), got {source.shape}.")
        return source[:, :, :3].astype(np.float32), None
    from .image import read_picture, read_picture_steps

    return read_picture(source), read_picture_steps(source)


def _confidence(weights: np.ndarray, steps: np.ndarray | None) -> np.ndarray:
    """(pixels, 3): how much each value counts.

    A file of whole numbers tells dark values more exactly than bright ones, and of those at its ends only that they are
    beyond; least squares then are those of the values as encoded.
    """
    values = np.repeat(weights.reshape(-1, 1).astype(np.float64), 3, axis=1)
    if steps is None:
        return values
    exactness = 1.0 / np.maximum(steps.reshape(-1, 3).astype(np.float64), 1e-30) ** 2
    if not np.any(exactness * values):
        return values  # nothing but ends: better than no answer
    return values * exactness / exactness.max()


def _mask(source: "np.ndarray | str | os.PathLike") -> np.ndarray:
    if isinstance(source, np.ndarray):
        return (source[:, :, 0] if source.ndim == 3 else source).astype(np.float32)
    from .image import read_picture

    return read_picture(source, is_data=True)[:, :, 0]


def _other_size(what: str, got: Sequence[int], size: tuple[int, int]) -> str:
    return (
        f"match: {what} must be {size[1]}x{size[0]} like the render, got {got[1]}x{got[0]}. "
        "Scale it, or render at its size."
    )


def _flip(target: np.ndarray, picture: np.ndarray, weights: np.ndarray) -> float:
    # What lies outside the mask must not be seen across its edge.
    return flip_difference(np.where(weights[:, :, None] > 0.0, target, picture), picture, weights)


def _rms(target: np.ndarray, picture: np.ndarray, weights: np.ndarray) -> float:
    square = np.mean((np.nan_to_num(target) - picture) ** 2, axis=2)
    return float(np.sqrt(np.sum(square * weights) / np.sum(weights)))
