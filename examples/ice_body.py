"""The ice of the example: spires on a broken block, as one field, and how frosted it is where.

Model: union of shards and a block in space bent by low noise; melting (scallops), layers and cracks are cut into it,
    fading towards tips, which stay sharp.
Units: metres, y up, ground near y = 0; frost is 0 (clear) .. 1 (white).
Not: snow, rocks and ground (see scenery.py).
"""

import numpy as np

from frazil.formations.noise import Noise, swirl
from spires import Spire, bounds, break_off, distance, make_spire, smooth_min

kLower = np.array([-4.2, -0.4, -3.0])
kUpper = np.array([4.2, 3.7, 2.6])
kBlend = 0.05  # metres over which shards grow together

# base x, z; tip x, y, z; radius at the base.
kShards = [
    (-0.55, -0.20, -0.36, 3.15, -0.45, 1.00),
    (-0.02, -0.35, 0.24, 2.52, -0.60, 0.74),
    (-1.02, 0.05, -1.24, 2.22, 0.00, 0.68),
    (-0.28, 0.35, -0.10, 1.72, 0.52, 0.52),
    (-1.40, -0.40, -1.92, 1.75, -0.60, 0.62),
    (1.15, -0.30, 1.46, 2.32, -0.45, 0.76),
    (0.82, 0.18, 0.80, 1.45, 0.38, 0.46),
    (1.62, 0.05, 2.04, 1.50, 0.15, 0.52),
    (0.62, -0.85, 0.74, 1.95, -1.15, 0.62),
    (-1.85, 0.10, -2.48, 1.08, 0.25, 0.46),
    (2.00, -0.30, 2.66, 1.28, -0.42, 0.52),
    (-0.95, 0.62, -1.18, 1.02, 0.88, 0.38),
    (0.28, 0.62, 0.42, 0.98, 0.88, 0.36),
    (1.40, 0.58, 1.64, 0.82, 0.82, 0.32),
]

kBroken = (4, 6, 9, 12)  # shards that have lost their tips


class IceBody:
    """A field of the whole ice; `tips` (K, 3) are the points in which its shards end."""

    def __init__(self, seed: int):
        rng = np.random.default_rng(seed)
        self.noise = Noise(seed)
        self.shards = []
        for k, (x, z, tx, ty, tz, r) in enumerate(kShards):
            broken = {"cut": break_off(rng, (x, 0.1, z), (tx, ty, tz))} if k in kBroken else {}
            self.shards.append(make_spire(rng, (x, 0.1, z), (tx, ty, tz), r, **broken))
        self.shards += [self._splinter(rng) for _ in range(44)]
        angles = np.linspace(0, 2 * np.pi, 11, endpoint=False) + rng.uniform(-0.2, 0.2, 11)
        reach = rng.uniform(0.86, 1.06, 11)
        self._walls = np.stack([angles, reach, rng.uniform(-0.15, 0.22, 11)], 1)
        self._cracks = [(_direction(rng), rng.uniform(-1.2, 1.2)) for _ in range(11)]
        self.tips = self._find_tips()

    def _splinter(self, rng: np.random.Generator) -> Spire:
        # A small shard that leans away from a large one.
        parent = self.shards[rng.integers(0, 11)]
        turn = rng.uniform(0, 2 * np.pi)
        out = np.array([np.cos(turn), 0.0, np.sin(turn)])
        at = parent.base + out * parent.radius * rng.uniform(0.5, 0.95)
        height = (parent.tip[1] - parent.base[1]) * rng.uniform(0.22, 0.52)
        lean = 0.5 * (parent.tip - parent.base) * [1, 0, 1] / max(parent.tip[1], 1.0) + out * rng.uniform(0.1, 0.4)
        tip = at + height * (np.array([0.0, 1.0, 0.0]) + lean)
        broken = {"cut": break_off(rng, at, tip)} if rng.random() < 0.3 else {}
        return make_spire(rng, at, tip, height * rng.uniform(0.16, 0.25), **broken)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """The field (N,), negative inside, at points (N, 3)."""
        if len(points) == 0:
            return np.zeros(0)
        p = self._bend(points)
        d, thickness = self._union(p)
        return d + self._melt(points, d, thickness)

    def bare(self, points: np.ndarray) -> np.ndarray:
        """The field (N,) of the shards and the block before anything has melted or cracked."""
        return self._union(self._bend(points))[0] if len(points) else np.zeros(0)

    def frost(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """How white the ice is (N,): dusted ledges, frosted cracks, bubbly layers, thin tips."""
        p = self._bend(points)
        _, thickness = self._union(p)
        dust = np.clip((normals[:, 1] - 0.35 + 0.35 * self.noise.fractal(points, 0.35, 3, 70)) / 0.35, 0, 1)
        crack = np.zeros(len(points))
        bent = _crumple(points)
        for k, (direction, offset) in enumerate(self._cracks):
            side = bent @ direction - offset
            fan = np.clip(self.noise(points, 0.5, 60 + k) + 0.2, 0, 1)
            crack = np.maximum(crack, np.maximum(np.exp(-((side / 0.02) ** 2)), fan * _one_sided(side, 0.14)))
        bubbles = np.clip(self._layer(p) * 1.3 - 0.2, 0, 1) * np.clip(0.35 + self.noise(p, 0.7, 85), 0, 1) * 0.5
        thin = np.clip(1.0 - thickness / 0.12, 0, 1) * 0.75
        mottle = np.clip(self.noise.fractal(points, 0.5, 4, 80) - 0.1, 0, 1) * 0.5
        white = 1.0 - (1.0 - 0.9 * dust) * (1.0 - 0.95 * crack) * (1.0 - bubbles) * (1.0 - thin) * (1.0 - mottle)
        return np.clip(white, 0.0, 1.0)

    def layer(self, points: np.ndarray) -> np.ndarray:
        """Which of the year's layers (N,), 0 (clear) .. 1 (full of bubbles)."""
        return np.clip(0.5 + 0.5 * self._layer(self._bend(points)), 0.0, 1.0)

    def _bend(self, points: np.ndarray) -> np.ndarray:
        return points + 0.05 * swirl(points, 0.9) + 0.008 * swirl(points, 0.23, 1.0)

    def _union(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        d = self._block(p)
        x, y, z = np.ascontiguousarray(p.T)
        thickness = np.full(len(p), 1.0)
        low, high = p.min(0), p.max(0)
        for shard in self.shards:
            # Far from a shard its box is a lower bound of its distance.
            a, b = bounds(shard)
            gap = np.maximum(a - high, low - b).max()
            if gap > 0.3:
                np.minimum(d, gap, out=d)
                continue
            box = np.maximum(x - b[0], a[0] - x)
            for k, column in ((1, y), (2, z)):
                np.maximum(box, column - b[k], out=box)
                np.maximum(box, a[k] - column, out=box)
            near = np.flatnonzero(box < 2.0 * kBlend)
            np.minimum(d, np.where(box < 2.0 * kBlend, np.inf, box), out=d)
            if len(near):
                s, radius = distance(shard, p[near])
                thickness[near] = np.where(s < d[near], radius, thickness[near])
                d[near] = smooth_min(d[near], s, kBlend)
        return np.maximum(d, -0.15 - p[:, 1]), thickness

    def _block(self, p: np.ndarray) -> np.ndarray:
        # A broken slab.
        x, y, z = p.T
        floor = 0.34 + 0.11 * swirl(p * [1, 0, 1], 0.9)[:, 1] + 0.03 * x - 0.05 * z
        rough = 0.09 * swirl(p * [1.0, 0.5, 1.0], 0.55, 5.0)[:, 1]
        d = np.maximum(y - floor, -0.15 - y)
        for angle, reach, lean in self._walls:
            n = np.array([np.cos(angle), np.sin(angle)])
            support = np.hypot(2.75 * n[0], 1.25 * n[1])
            out = (n[0] * x + n[1] * z - support * reach + lean * (y - 0.3)) / np.hypot(1.0, lean)
            d = np.maximum(d, out + rough)
        return d

    def _melt(self, points: np.ndarray, d: np.ndarray, thickness: np.ndarray) -> np.ndarray:
        # Nothing is cut far from the surface, and ever less towards the tips.
        result = np.zeros(len(points))
        near = np.abs(d) < 0.16
        p, keep = points[near], np.clip(thickness[near] / 0.22, 0.0, 1.0)
        box = (kLower - 0.3, kUpper + 0.3)
        where = np.clip(0.5 + 1.2 * self.noise(p, 0.8, 40), 0.0, 1.0) * np.clip(1.5 - 0.45 * p[:, 1], 0.25, 1.0)
        wavy = p + 0.02 * swirl(p, 0.25, 3.0)
        cut = 0.03 * where * self.noise.scallops(wavy, (0.17, 0.30, 0.17), box, 1)
        cut += 0.010 * where * self.noise.scallops(wavy, (0.07, 0.09, 0.07), box, 2)
        cut += 0.005 * self.noise.fractal(p, 0.15, 2, 46)
        cut += 0.007 * np.clip(self._layer(p), -0.3, 1.0)
        bent = _crumple(p)
        for direction, offset in self._cracks:
            cut += 0.022 * np.exp(-(((bent @ direction - offset) / 0.014) ** 2))
        result[near] = cut * keep
        return result

    def _layer(self, p: np.ndarray) -> np.ndarray:
        # Years of snow, tilted: noise along one axis only.
        height = p @ np.array([0.22, 0.96, -0.15]) + 0.02 * swirl(p, 0.7)[:, 0]
        return 0.7 * self.noise.line(height, 0.10, 52) + 0.4 * self.noise.line(height, 0.04, 53)

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


def _crumple(points: np.ndarray) -> np.ndarray:
    return points + 0.08 * swirl(points, 0.7, 0.5) + 0.012 * swirl(points, 0.11, 2.0)


def _one_sided(side: np.ndarray, width: float) -> np.ndarray:
    return np.where(side > 0, np.exp(-np.maximum(side, 0) / width), 0.0) * 0.6
