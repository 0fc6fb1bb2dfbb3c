"""Smooth random fields in space: cloud-like noise, and the bowls that melting leaves.

Model: noise is a cubic B-spline through random numbers on a periodic lattice; scallops are squared distances to the
    nearest of jittered points, so that bowls meet in cusps.
Units: `size` is the length of one feature. Values of noise lie in about -1 .. 1, of scallops in 0 .. 1.
Not: band-limited to more than a factor of two; equal at points 32 features apart (octaves are turned against that).
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

kPeriod = 32


class Noise:
    """Noise of one seed; calls with different `stream` are independent."""

    def __init__(self, seed: int):
        self.seed = seed
        self._tiles: dict[int, np.ndarray] = {}
        self._lines: dict[int, CubicSpline] = {}
        self._trees: dict[tuple, cKDTree] = {}

    def __call__(self, points: np.ndarray, size: float, stream: int = 0) -> np.ndarray:
        """Values (N,) at points (N, 3) with features of `size`."""
        if stream not in self._tiles:
            rng = np.random.default_rng((self.seed, stream))
            self._tiles[stream] = rng.uniform(-2.2, 2.2, (kPeriod,) * 3)
        at = (points @ _turn(stream)).T / size
        return map_coordinates(self._tiles[stream], at, order=3, mode="grid-wrap", prefilter=False)

    def fractal(self, points: np.ndarray, size: float, octaves: int, stream: int = 0, gain: float = 0.5) -> np.ndarray:
        """A sum of octaves, each half the size and `gain` times the height of the one before."""
        return sum(gain**k * self(points, size * 0.5**k, stream + k) for k in range(octaves))

    def vector(self, points: np.ndarray, size: float, stream: int = 0) -> np.ndarray:
        """Vectors (N, 3) of three independent noises."""
        return np.stack([self(points, size, stream + k) for k in range(3)], 1)

    def line(self, height: np.ndarray, size: float, stream: int = 0) -> np.ndarray:
        """Noise (N,) that depends on one coordinate alone."""
        if stream not in self._lines:
            rng = np.random.default_rng((self.seed, 104729, stream))
            knots = rng.uniform(-1.0, 1.0, 256)
            self._lines[stream] = CubicSpline(np.arange(257), np.append(knots, knots[0]), bc_type="periodic")
        return self._lines[stream](np.mod(height / size, 256.0))

    def scallops(self, points: np.ndarray, size, box, stream: int = 0) -> np.ndarray:
        """Depth (N,) of bowls, 1 in their middle and 0 on the cusps between; `size` (3,), `box` = (lower, upper)."""
        size = np.broadcast_to(np.asarray(size, np.float64), 3)
        key = (stream, *size)
        if key not in self._trees:
            rng = np.random.default_rng((self.seed, 7919, stream))
            low = np.floor(np.asarray(box[0]) / size).astype(int) - 1
            count = np.ceil(np.asarray(box[1]) / size).astype(int) + 1 - low
            lattice = low + np.indices(count).reshape(3, -1).T
            self._trees[key] = cKDTree(lattice + rng.uniform(0.0, 0.9, lattice.shape))
        distance, _ = self._trees[key].query(points / size, k=1, distance_upper_bound=1.5)
        return np.clip(1.0 - np.minimum(distance, 1.0) ** 2 / 0.55, 0.0, 1.0)


def swirl(points: np.ndarray, size: float, phase: float = 0.0) -> np.ndarray:
    """Cheap, slow vectors (N, 3) in about -1 .. 1: waves across each other, for bending space."""
    q = points * (2.1 / size)
    x, y, z = q.T
    p = phase
    return 0.55 * np.stack([
        np.sin(y + 1.7 * np.sin(0.6 * z + p)) + np.sin(1.9 * z + 0.7 * y + 2.0 + p),
        np.sin(x + 1.3 * np.sin(0.7 * y + p) + 4.0) + np.sin(1.7 * z + 0.5 * x + p),
        np.sin(1.2 * y + 1.5 * np.sin(0.8 * x + p)) + np.sin(2.1 * x + 0.6 * y + 1.0 + p),
    ], 1)  # fmt: skip


def _turn(stream: int) -> np.ndarray:
    # A rotation per stream, so that the lattices of octaves never line up.
    a, b = 0.7 + 1.9 * stream, 0.4 + 1.3 * stream
    ca, sa, cb, sb = np.cos(a), np.sin(a), np.cos(b), np.sin(b)
    return np.array([[ca, -sa, 0], [sa, ca, 0], [0, 0, 1.0]]) @ np.array([[1.0, 0, 0], [0, cb, -sb], [0, sb, cb]])
