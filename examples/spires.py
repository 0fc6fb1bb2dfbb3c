"""Spires of glacier ice: tapering shards with hollow faces between sharp ridges, ending in a point.

Model: a signed field, the maximum over the faces of a polygon that shrinks, turns and bends towards the tip; each face
    is hollow (melting hollows faces and keeps ridges), fluted along its height, and breaks where its knots lie.
Units: metres, y up; fields are negative inside.
Not: an exact distance: right to about 20 % near the surface, a lower bound away from it.
"""

from dataclasses import dataclass

import numpy as np

kRidge = 0.12  # of a shard's radius, over which its ridges are rounded
kThinRidge = 0.04  # metres: how thick a ridge counts


@dataclass(frozen=True)
class Spire:
    """A shard from `base` to `tip` (3,); `faces` rows are (angle, hollow, flute width, flute depth, phase)."""

    base: np.ndarray
    tip: np.ndarray
    radius: float
    faces: np.ndarray
    knots: np.ndarray  # heights 0..1 where faces break
    offsets: np.ndarray  # (faces, knots) distance of each face in units of the radius there
    twist: float  # radians from base to tip
    bend: np.ndarray  # sideways bulge half way up
    power: float  # 1 = straight sides, more = horn
    cut: np.ndarray  # where it broke off: unit normal (3,) and offset; far away on a whole shard


def make_spire(rng: np.random.Generator, base, tip, radius: float, **fixed) -> Spire:
    """A shard with random faces; `fixed` overrides fields of Spire."""
    base, tip = np.asarray(base, np.float64), np.asarray(tip, np.float64)
    count = int(rng.integers(4, 7))
    angles = (np.arange(count) + rng.uniform(-0.28, 0.28, count)) * 2.0 * np.pi / count + rng.uniform(0, 6.28)
    faces = np.stack(
        [
            angles,
            rng.uniform(0.05, 0.24, count),
            rng.uniform(0.16, 0.36, count),
            rng.choice([0.0, 0.04, 0.075], count),
            rng.uniform(0, 1, count),
        ],
        1,
    )
    knots = np.concatenate([[0.0], np.sort(rng.uniform(0.12, 0.85, 4)), [1.0]])
    offsets = rng.uniform(0.66, 0.95, (count, 1)) + rng.uniform(-0.20, 0.36, (count, len(knots)))
    length = np.linalg.norm(tip - base)
    values = dict(
        faces=faces,
        knots=knots,
        offsets=offsets,
        twist=rng.uniform(-0.9, 0.9),
        bend=rng.uniform(-0.085, 0.085, 3) * length * [1, 0, 1],
        power=rng.uniform(0.85, 1.3),
        cut=np.array([0.0, 1.0, 0.0, 1e3]),
    )
    return Spire(base, tip, radius, **(values | fixed))


def break_off(rng: np.random.Generator, base, tip) -> np.ndarray:
    """A steep plane (4,) through the upper part of a shard, for its `cut`."""
    turn = rng.uniform(0, 2 * np.pi)
    normal = np.array([np.cos(turn), rng.uniform(0.45, 1.0), np.sin(turn)])
    normal /= np.linalg.norm(normal)
    through = np.asarray(base) + rng.uniform(0.5, 0.72) * (np.asarray(tip) - np.asarray(base))
    return np.append(normal, normal @ through)


def distance(spire: Spire, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The field (N,) at points (N, 3), and how thick the shard is there (N,): its radius at that height (0 at the tip),
    less near ridges, which are rounded a little."""
    axis = spire.tip - spire.base
    length = np.linalg.norm(axis)
    axis = axis / length
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    depth = np.cross(side, axis)

    v = points - spire.base
    s = v @ axis / length
    inner = np.clip(s, 0.0, 1.0)
    v = v - (4.0 * inner * (1.0 - inner))[:, None] * spire.bend
    x, z = v @ side, v @ depth
    c, sn = np.cos(spire.twist * s), np.sin(spire.twist * s)
    x, z = c * x - sn * z, sn * x + c * z

    rest = 1.0 - s
    radius = spire.radius * np.where(rest > 0, np.maximum(rest, 1e-9) ** spire.power, rest)
    wide = np.maximum(radius, 1e-4)
    slope = 1.0 / np.hypot(1.0, spire.radius / length)
    result = np.full(len(points), -1e9)
    ridge = np.full(len(points), 1e9)  # how far the next face is from being the surface
    for (angle, hollow, width, flute, phase), offset in zip(spire.faces, spire.offsets, strict=True):
        ca, sa = np.cos(angle), np.sin(angle)
        across = (z * ca - x * sa) / wide
        out = x * ca + z * sa - np.interp(s, spire.knots, offset) * radius
        out += wide * hollow * np.maximum(1.0 - across * across, 0.0)
        if flute > 0:
            cup = 2.0 * np.mod(across / width + phase + 0.6 * np.sin(5.0 * s + 9.0 * phase), 1.0) - 1.0
            out += wide * flute * (1.0 - cup * cup)
        out *= slope
        ridge = np.where(out > result, np.minimum(out - result, 1e9), np.minimum(ridge, result - out))
        result = -smooth_min(-result, -out, kRidge * wide)
    np.maximum(result, points @ spire.cut[:3] - spire.cut[3], out=result)
    return np.maximum(result, -s * length - 0.1), np.clip(radius, 0.0, kThinRidge + ridge)


def bounds(spire: Spire) -> tuple[np.ndarray, np.ndarray]:
    """A box that holds the shard."""
    reach = 1.35 * spire.radius + np.abs(spire.bend)
    ends = np.stack([spire.base, spire.tip])
    return ends.min(0) - reach, ends.max(0) + [reach[0], 0.02, reach[2]]


def smooth_min(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    """The union of two fields with the crease between them rounded over `width`."""
    h = np.maximum(width - np.abs(a - b), 0.0) / width
    return np.minimum(a, b) - h * h * width * 0.25
