"""The ice of the example: spires on a broken block, as one field, and how frosted it is where.

Model: union of shards and a block in space bent by low noise; melting (scallops), layers and cracks are cut into it,
    fading towards tips, which stay sharp.
Units: metres, y up, ground near y = 0; frost is 0 (clear) .. 1 (white).
Not: snow, rocks and ground (see scenery.py).
"""

import numpy as np
from noise import Noise
from spires import Spire, bounds, distance, make_spire, smooth_min

kLower = np.array([-3.9, -0.42, -2.7])
kUpper = np.array([3.9, 3.5, 2.3])
kBlend = 0.05  # metres over which shards grow together

# base x, z; tip x, y, z; radius at the base.
kShards = [
    (-0.55, -0.25, -0.28, 3.02, -0.45, 0.66),
    (-0.95, 0.05, -1.22, 2.15, 0.05, 0.42),
    (-0.10, 0.10, 0.22, 1.92, 0.25, 0.38),
    (0.95, -0.35, 1.48, 2.42, -0.55, 0.52),
    (1.30, 0.00, 2.00, 1.62, 0.10, 0.36),
    (0.55, -1.05, 0.62, 2.62, -1.45, 0.46),
    (-1.65, -0.55, -2.25, 1.92, -0.85, 0.44),
    (-2.10, -0.20, -2.85, 1.22, -0.10, 0.34),
    (2.00, -0.60, 2.75, 1.62, -0.95, 0.42),
    (2.45, -0.10, 3.05, 0.98, 0.15, 0.28),
    (-0.50, 0.75, -0.68, 1.22, 1.05, 0.26),
    (0.45, 0.75, 0.78, 1.02, 1.10, 0.24),
    (-1.25, 0.62, -1.72, 1.02, 0.92, 0.25),
    (1.35, 0.65, 1.72, 0.86, 0.98, 0.22),
]


class IceBody:
    """A field of the whole ice; `tips` (K, 3) are the points in which its shards end."""

    def __init__(self, seed: int):
        rng = np.random.default_rng(seed)
        self.noise = Noise(seed)
        self.shards = [make_spire(rng, (x, 0.1, z), (tx, ty, tz), r) for x, z, tx, ty, tz, r in kShards]
        self.shards += [self._splinter(rng) for _ in range(26)]
        angles = np.linspace(0, 2 * np.pi, 11, endpoint=False) + rng.uniform(-0.2, 0.2, 11)
        reach = rng.uniform(0.86, 1.06, 11)
        self._walls = np.stack([angles, reach, rng.uniform(-0.1, 0.35, 11)], 1)
        self._cracks = [(_direction(rng), rng.uniform(-1.2, 1.2)) for _ in range(7)]
        self.tips = self._find_tips()

    def _splinter(self, rng: np.random.Generator) -> Spire:
        # A small shard that leans away from a large one.
        parent = self.shards[rng.integers(0, 9)]
        turn = rng.uniform(0, 2 * np.pi)
        out = np.array([np.cos(turn), 0.0, np.sin(turn)])
        at = parent.base + out * parent.radius * rng.uniform(0.5, 0.95)
        height = (parent.tip[1] - parent.base[1]) * rng.uniform(0.22, 0.52)
        lean = 0.5 * (parent.tip - parent.base) * [1, 0, 1] / max(parent.tip[1], 1.0) + out * rng.uniform(0.1, 0.4)
        tip = at + height * (np.array([0.0, 1.0, 0.0]) + lean)
        return make_spire(rng, at, tip, height * rng.uniform(0.16, 0.25))

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """The field (N,), negative inside, at points (N, 3)."""
        p = self._bend(points)
        d, thickness = self._union(p)
        return d + self._melt(points, d, thickness)

    def frost(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """How white the ice is (N,): dusted ledges, frosted cracks, bubbly layers, thin tips."""
        p = self._bend(points)
        _, thickness = self._union(p)
        dust = np.clip((normals[:, 1] - 0.35 + 0.35 * self.noise.fractal(points, 0.35, 3, 70)) / 0.35, 0, 1)
        crack = np.zeros(len(points))
        for k, (direction, offset) in enumerate(self._cracks):
            side = self._crack_side(points, direction, offset, k)
            fan = np.clip(self.noise(points, 0.5, 60 + k) + 0.2, 0, 1)
            crack = np.maximum(crack, np.maximum(np.exp(-np.abs(side) / 0.012), fan * _one_sided(side, 0.14)))
        bubbles = np.clip(self._layer(p) * 1.3 - 0.1, 0, 1) * 0.45
        thin = np.clip(1.0 - thickness / 0.10, 0, 1) * 0.55
        mottle = np.clip(self.noise.fractal(points, 0.5, 4, 80) - 0.1, 0, 1) * 0.5
        white = 1.0 - (1.0 - 0.9 * dust) * (1.0 - 0.85 * crack) * (1.0 - bubbles) * (1.0 - thin) * (1.0 - mottle)
        return np.clip(white, 0.0, 1.0)

    def _bend(self, points: np.ndarray) -> np.ndarray:
        return points + 0.075 * self.noise.vector(points, 0.95, 10) + 0.016 * self.noise.vector(points, 0.26, 20)

    def _union(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        d = self._block(p)
        thickness = np.full(len(p), 1.0)
        low, high = p.min(0), p.max(0)
        for shard in self.shards:
            a, b = bounds(shard)
            gap = 2.0 * kBlend
            if np.any(low > b + gap) or np.any(high < a - gap):
                # Far from every point: its box is a lower bound of its distance.
                box = np.linalg.norm(np.maximum(np.maximum(a - p, p - b), 0.0), axis=1)
                np.minimum(d, box + 1e-3, out=d)
                continue
            near = np.all((p > a - gap) & (p < b + gap), axis=1)
            box = np.linalg.norm(np.maximum(np.maximum(a - p[~near], p[~near] - b), 0.0), axis=1)
            d[~near] = np.minimum(d[~near], box + 1e-3)
            s, radius = distance(shard, p[near])
            thickness[near] = np.where(s < d[near], radius, thickness[near])
            d[near] = smooth_min(d[near], s, kBlend)
        return d, thickness

    def _block(self, p: np.ndarray) -> np.ndarray:
        # Two terraces of broken slabs.
        x, y, z = p.T
        floor = 0.30 + 0.10 * self.noise(p * [1, 0, 1], 0.9, 30) + 0.05 * x * (x < 0)
        d = np.maximum(y - floor, -0.30 - y)
        upper = np.maximum(y - floor - 0.26, -y)
        for angle, reach, lean in self._walls:
            n = np.array([np.cos(angle), np.sin(angle)])
            support = np.hypot(3.15 * n[0], 1.55 * n[1])
            out = (n[0] * x + n[1] * z - support * reach + lean * (y - 0.3)) / np.hypot(1.0, lean)
            d = np.maximum(d, out)
            upper = np.maximum(upper, out + 0.55 + 0.25 * np.sin(7.0 * angle))
        return smooth_min(d, upper, 0.04)

    def _melt(self, points: np.ndarray, d: np.ndarray, thickness: np.ndarray) -> np.ndarray:
        # Nothing is cut far from the surface, and ever less towards the tips.
        result = np.zeros(len(points))
        near = np.abs(d) < 0.16
        p, keep = points[near], np.clip(thickness[near] / 0.22, 0.0, 1.0)
        box = (kLower - 0.3, kUpper + 0.3)
        where = np.clip(0.5 + 1.2 * self.noise(p, 0.8, 40), 0.0, 1.0) * np.clip(1.5 - 0.45 * p[:, 1], 0.25, 1.0)
        wavy = p + 0.03 * self.noise.vector(p, 0.2, 44)
        cut = 0.034 * where * self.noise.scallops(wavy, (0.17, 0.30, 0.17), box, 1)
        cut += 0.010 * where * self.noise.scallops(wavy, (0.07, 0.09, 0.07), box, 2)
        cut += 0.008 * self.noise.fractal(p, 0.13, 2, 46)
        cut += 0.010 * np.clip(self._layer(p), -0.3, 1.0)
        for k, (direction, offset) in enumerate(self._cracks):
            cut += 0.02 * np.exp(-((self._crack_side(p, direction, offset, k) / 0.011) ** 2))
        result[near] = cut * keep
        return result

    def _layer(self, p: np.ndarray) -> np.ndarray:
        # Years of snow, tilted: noise along one axis only.
        height = p @ np.array([0.22, 0.96, -0.15]) + 0.03 * self.noise(p, 0.8, 50)
        line = np.stack([np.full_like(height, 3.3), height, np.full_like(height, 1.7)], 1)
        return self.noise(line, 0.11, 52) + 0.5 * self.noise(line, 0.045, 53)

    def _crack_side(self, p: np.ndarray, direction: np.ndarray, offset: float, k: int) -> np.ndarray:
        return p @ direction - offset + 0.10 * self.noise(p, 0.6, 90 + k) + 0.012 * self.noise(p, 0.09, 100 + k)

    def _find_tips(self) -> np.ndarray:
        # The point that bending carries to each shard's tip, by fixed-point iteration; hidden tips are left out.
        goal = np.stack([s.tip for s in self.shards])
        tips = goal.copy()
        for _ in range(25):
            tips += goal - self._bend(tips)
        return tips[np.abs(self(tips)) < 0.004]


def _direction(rng: np.random.Generator) -> np.ndarray:
    n = rng.normal(size=3) * [1.0, 0.7, 0.6]
    return n / np.linalg.norm(n)


def _one_sided(side: np.ndarray, width: float) -> np.ndarray:
    return np.where(side > 0, np.exp(-np.maximum(side, 0) / width), 0.0) * 0.6
