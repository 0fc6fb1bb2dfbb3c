"""Random walks in a half space: what profiles are measured against. Lengths in mean free paths, isotropic scattering.

Light enters at the origin, straight down or from all around (cosine-distributed outside, refracted at the boundary);
weights are per unit of light that has entered. A walk scatters, is absorbed by weight, reflects inside by Fresnel's
equations and leaves at a radius; light of one scattering is kept apart from light of more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def fresnel(cos_theta: np.ndarray, eta: float) -> np.ndarray:
    """Reflected fraction; `eta` = index that the light would enter over the index that it is in."""
    sin2 = (1.0 - cos_theta**2) / eta**2
    cos_t = np.sqrt(np.maximum(0.0, 1.0 - sin2))
    parallel = (eta * cos_theta - cos_t) / (eta * cos_theta + cos_t)
    perpendicular = (cos_theta - eta * cos_t) / (cos_theta + eta * cos_t)
    return np.where(sin2 >= 1.0, 1.0, 0.5 * (parallel**2 + perpendicular**2))


@dataclass
class Walks:
    """Light that left, per ring between `edges` (radii); the last ring holds all beyond."""

    edges: np.ndarray
    single: np.ndarray
    multiple: np.ndarray

    def within(self, which: str) -> np.ndarray:
        """What left within every edge but the first, 0."""
        return np.cumsum(getattr(self, which))[:-1]

    @property
    def albedo(self) -> float:
        return float(self.single.sum() + self.multiple.sum())


def _entering(count: int, eta: float, entry: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Directions (cosine to the inward normal) and weights of mean 1."""
    if entry == "normal":
        return np.ones(count), np.ones(count)
    outside = np.sqrt((np.arange(count) + rng.random(count)) / count)
    weight = 1.0 - fresnel(outside, eta)
    return np.sqrt(1.0 - (1.0 - outside**2) / eta**2), weight / weight.mean()


def walk(
    alpha: float, eta: float = 1.0, entry: str = "normal", count: int = 100_000, seed: int = 1, rings: int = 60
) -> Walks:
    """Follow `count` walks at single-scattering albedo `alpha`; deterministic in its arguments."""
    rng = np.random.default_rng(seed)
    edges = np.concatenate([[0.0], np.geomspace(1e-2, 300.0, rings)])
    out = np.zeros((2, rings + 1))
    mu, weight = _entering(count, eta, entry, rng)
    sine = np.sqrt(np.maximum(0.0, 1.0 - mu**2))
    direction = np.stack([sine, np.zeros(count), -mu])
    position = np.zeros((3, count))
    order = np.zeros(count, int)
    while order.size:
        step = rng.exponential(size=order.size)
        to = position + direction * step
        crossing = to[2] > 0.0
        inside = ~crossing
        # Leave, or reflect and go on from the boundary.
        back = position[:, crossing] - direction[:, crossing] * (position[2, crossing] / direction[2, crossing])
        reflects = rng.random(back.shape[1]) < fresnel(direction[2, crossing], 1.0 / eta)
        leaves = np.flatnonzero(crossing)[~reflects]
        radius = np.hypot(back[0, ~reflects], back[1, ~reflects])
        ring = np.searchsorted(edges, radius, side="right") - 1
        # Light that was reflected inside before it left counts as scattered more than once.
        for kind, chosen in ((0, order[leaves] == 1), (1, order[leaves] > 1)):
            out[kind] += np.bincount(ring[chosen], weight[leaves][chosen], rings + 1)
        stays = np.flatnonzero(crossing)[reflects]
        turned = direction[:, stays] * np.array([[1.0], [1.0], [-1.0]])
        # Scatter.
        cosine, angle = rng.uniform(-1, 1, inside.sum()), rng.uniform(0, 2 * np.pi, inside.sum())
        around = np.sqrt(1.0 - cosine**2)
        position = np.concatenate([to[:, inside], back[:, reflects]], axis=1)
        position[2, inside.sum() :] = 0.0
        direction = np.concatenate([np.stack([around * np.cos(angle), around * np.sin(angle), cosine]), turned], axis=1)
        weight = np.concatenate([weight[inside] * alpha, weight[stays]])
        order = np.concatenate([order[inside] + 1, np.where(order[stays] >= 1, np.maximum(order[stays], 2), 0)])
        # Russian roulette on faint walks.
        faint = weight < 0.02
        survives = ~faint | (rng.random(weight.size) < weight / 0.1)
        weight = np.where(faint, 0.1, weight)[survives]
        position, direction, order = position[:, survives], direction[:, survives], order[survives]
    return Walks(edges, *(out / count))
