"""What lies around the ice: rocks frozen into it, snow on its ledges, the snowfield below.

Model: fields as in ice_body.py; snow is the ice lifted by the depth of the snow and kept where it rises out of the ice,
    so that it lies on what faces up, thins out towards slopes, and leaves walls bare. Spires shed it: it ends above
    the block.
Units: metres, y up; fields are negative inside.
Not: snow that has slid or drifted against walls.
"""

import numpy as np

from frazil.formations.contour import Surface
from frazil.formations.noise import Noise, swirl
from ice_body import IceBody, kLower, kUpper

kSnowTop = 0.72  # metres above which no snow holds
kSnowRoot = 0.025  # metres that snow reaches into the ice below; deeper, it would show through walls


class Rock:
    """A field of one angular boulder around `center` (3,) with half axes `size` (3,)."""

    def __init__(self, center, size, seed: int):
        rng = np.random.default_rng((seed, 17))
        self.center, self.size = np.asarray(center, float), np.asarray(size, float)
        normals = rng.normal(size=(15, 3))
        self._normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._reach = rng.uniform(0.5, 0.86, 15)
        self._noise = Noise(seed + 1000)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        q = (points - self.center) / self.size
        q = q + 0.05 * self._noise.vector(points, 0.35, 0)
        d = np.linalg.norm(q, axis=1) - 1.0
        for normal, reach in zip(self._normals, self._reach, strict=True):
            d = np.maximum(d, q @ normal - reach)
        return d * self.size.min() + 0.012 * self._noise.fractal(points, 0.11, 4, 5, 0.6)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """A box that holds the rock."""
        return self.center - 1.25 * self.size - 0.06, self.center + 1.25 * self.size + 0.06

    def color(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Albedo (N, 3): grey-brown stone in bands, rime on what faces up."""
        grain = self._noise.fractal(points, 0.16, 4, 20, 0.6)
        band = self._noise.line(points @ [0.5, 0.8, 0.3] + 0.02 * grain, 0.05, 30)
        stone = np.array([0.085, 0.078, 0.072]) * (1.0 + 0.45 * grain + 0.25 * band)[:, None]
        rime = np.clip((normals[:, 1] - 0.45 + 0.5 * grain) / 0.3, 0.0, 1.0)[:, None] * 0.85
        return np.clip(stone * (1.0 - rime) + np.array([0.78, 0.82, 0.86]) * rime, 0.0, 1.0)


class Snow:
    """A field of the snow that lies on the ice."""

    def __init__(self, ice: IceBody, depth: float = 0.10):
        self._ice, self._depth = ice, depth

    def __call__(self, points: np.ndarray) -> np.ndarray:
        ice = self._ice(points)
        # Snow can only be near the surface: elsewhere a bound does.
        result = np.maximum(ice - 1.2 * self._depth, -(ice + kSnowRoot))
        near = np.flatnonzero((ice > -kSnowRoot - 0.03) & (ice < 3.0 * self._depth))
        p = points[near]
        patch = 0.75 + 0.45 * self._ice.noise(p, 0.42, 110)
        high = np.clip((kSnowTop - p[:, 1]) / 0.3, 0.0, 1.0)
        depth = self._depth * np.clip(patch, 0.15, 1.2) * high
        snow = self._ice.bare(p - depth[:, None] * [0.0, 1.0, 0.0]) + self._depth * (1.0 - 0.42 * high)
        result[near] = np.maximum(snow, -(ice[near] + kSnowRoot))
        return np.maximum(result, points[:, 1] - kSnowTop)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """A box that holds the snow."""
        return kLower, np.array([kUpper[0], kSnowTop + 0.15, kUpper[2]])


def make_snowfield(ice: IceBody, extent: float, count: int, seed: int) -> Surface:
    """A sheet of drifts around the ice, fine near the origin and coarse far out, `2 count` squares a side."""
    noise = Noise(seed + 2000)
    line = np.linspace(-1.0, 1.0, 2 * count + 1)
    line = extent * (0.12 * line + 0.88 * line**5)
    x, z = np.meshgrid(line, line, indexing="xy")
    p = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], 1)
    far = np.hypot(p[:, 0], p[:, 2])
    height = 0.05 * swirl(p, 1.7)[:, 1] + 0.02 * noise(p * [1.0, 1.0, 2.2], 0.5, 1)
    height += 0.006 * noise(p * [0.7, 1.0, 2.6], 0.12, 2) + 0.5 * noise(p, 14.0, 3) * np.clip(far / 15.0 - 0.5, 0, 1)
    # Drifts lean against the ice.
    height += 0.14 * np.exp(-np.maximum(ice(p + [0.0, 0.1, 0.0]), 0.0) / 0.28)
    p[:, 1] = height - 0.09
    row = 2 * count + 1
    a = (np.arange(2 * count)[:, None] * row + np.arange(2 * count)).ravel()
    triangles = np.concatenate([np.stack([a, a + row, a + 1], 1), np.stack([a + 1, a + row, a + row + 1], 1)])
    return Surface(p, triangles)
