"""A cathedral of ice: a hall of contorted columns under a pointed vault, open to the sky, rocks frozen in.

Model: the hall is a field (a pointed arch along a swaying axis, closed by an apse, columns that flare into floor and
    vault, a shaft to the sky, a portal), contoured once; daggers, spires and fallen blocks are joined to it as solids.
Units: metres, y up; made at a height of 12 m, then scaled.
Not: the outside, which is a plain shell.
"""

from dataclasses import dataclass

import numpy as np

from .contour import contour
from .formation import CameraRow, Formation, Part, check_count, check_parameters, check_within, triangle_budget
from .noise import Noise, swirl
from .randomness import generator
from .solids import block, kUp, shard, solid_of, union
from .spires import keep_tips
from .surroundings import ice, kRock, rock_part, sky_and_lights
from .weathering import Melt, Progress, grow

kHeight = 12.0
_HALF_WIDTH, _TOP = 6.6, 11.2
_SWAY = 0.9
_LOWER, _UPPER = np.array([-12.0, -2.6, -21.5]), np.array([12.0, 16.5, 14.5])
_SUN = (0.22, 0.88, -0.42)


def cathedral(
    scale: float = 12.0,
    age: float = 0.4,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    columns: int = 9,
    opening: float = 1.0,
    rocks: int = 9,
    progress: Progress | None = None,
) -> Formation:
    """A hall of contorted columns of ice with an opening to the sky, rocks frozen in; the camera stands inside.

    Parameters
    ----------
    scale : float
        Height in metres.
    age : float
        0 sharp and clear .. 1 worn, scalloped and frosted.
    seed : int
        Another number, another hall.
    detail : float
        Triangles grow with its square; 1 is 500,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    columns : int
        0 to 24.
    opening : float
        Width of the shaft to the sky, 0 (closed) to 2.
    rocks : int
        Boulders frozen in, 0 to 12.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("cathedral", scale, age, seed, detail, triangles)
    check_count("cathedral", "columns", columns, 0, 24)
    check_count("cathedral", "rocks", rocks, 0, 12)
    check_within("cathedral", "opening", opening, 0.0, 2.0, "1 is about 4 m wide at 12 m of height.")
    rng = generator("cathedral", seed)
    budget = triangle_budget(500_000, detail, triangles)
    hall = _Hall(rng, seed, int(columns), opening)
    cell = 0.24 * np.sqrt(np.clip(160_000 / budget, 1.0, 5.0))
    shell = contour(hall, _LOWER, _UPPER, cell).largest_piece()
    solids, tips = _shards(rng, hall, 2.0 * cell)
    body = union([solid_of(shell.positions, shell.triangles), *solids])

    melt = Melt(
        Noise(seed), (_LOWER - 2.0, _UPPER + 2.0), size=0.95, depth=0.10 + 0.10 * age, amount=0.5 + 0.5 * age,
        stretch=1.3, layers=0.42, band=0.035, grain=0.016,
    )  # fmt: skip
    surface = grow(
        body,
        budget,
        rounding=0.10 + 0.25 * age**1.5,
        large=melt.large,
        fine=melt.fine,
        keep=lambda p: keep_tips(p, tips, 0.8),
        progress=progress,
    )
    parts = [Part.of("Ice", surface, "Ice", "ice", 50.0)]
    parts += _rocks(rng, hall, int(rocks), seed)
    image, lights = sky_and_lights(seed, _SUN, budget, sun_light=10.0, sky_light=0.85)
    return Formation(
        "cathedral",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, columns=columns, opening=opening,
             rocks=rocks),
        parts,
        {"Ice": ice("old_glacier", age, 3.0, depth=8.0, roughness=0.2, refraction=0.4), "Rock": kRock},
        lights,
        CameraRow((0.4, 1.9, 8.2), (-0.1, 4.1, -4.0), 20.0),
        image,
    ).scaled(scale / kHeight)  # fmt: skip


@dataclass(frozen=True)
class _Column:
    foot: np.ndarray  # (x, z)
    lean: np.ndarray  # metres sideways per metre of height
    bend: np.ndarray  # (2, 3): amplitude, wavelength, phase in x and z
    radius: float
    faces: np.ndarray  # rows of angle, distance, hollow
    twist: float  # radians per metre
    flare: tuple[float, float]


class _Hall:
    """The field of the hall, negative in ice."""

    def __init__(self, rng: np.random.Generator, seed: int, count: int, opening: float):
        self.noise = Noise(seed)
        self.opening = opening
        self.phase = rng.uniform(0, 6.28)
        self.columns = [_make_column(rng, k, count) for k in range(count)]
        self.shaft = np.array([rng.uniform(-0.6, 0.9), 0.0, -4.2 + rng.uniform(-0.8, 0.8)])
        self._ribs = rng.uniform(0.75, 1.15, 7)
        offset = (_TOP**2 - _HALF_WIDTH**2) / (2.0 * _HALF_WIDTH)
        self._arch = (offset, _HALF_WIDTH + offset)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        p = points + 0.45 * swirl(points, 6.0, self.phase) + 0.16 * swirl(points, 1.9, 1.0)
        arch = self.vault(p)
        outer = np.maximum(self.vault(points) - 2.1, -1.6 - points[:, 1])
        outer = np.maximum(outer, -13.5 + points[:, 2])
        d = np.maximum(-arch, -1e3)
        d = np.minimum(d, p[:, 1] - self.floor(p))
        for column in self.columns:
            near = np.hypot(p[:, 0] - column.foot[0], p[:, 2] - column.foot[1]) < 7.0
            c = _column_distance(column, p[near])
            d[near] = _blend(d[near], c, 0.9)
        d = np.maximum(d, -self._shaft_distance(p))
        d = np.maximum(d, -self._portal(p))
        return np.maximum(0.8 * d, outer)

    def vault(self, p: np.ndarray) -> np.ndarray:
        """The hall without floor, negative in the air."""
        offset, radius = self._arch
        x, y, z = p.T
        x = x - _SWAY * np.sin(0.21 * z + self.phase)
        end = np.maximum(-z - 6.0, 0.0) * 0.95 + np.maximum(z - 3.0, 0.0) * 1.35
        return np.sqrt((np.abs(x) + offset) ** 2 + np.maximum(y, 0.0) ** 2 + end**2) - radius

    def floor(self, p: np.ndarray) -> np.ndarray:
        """Height of the floor (N,): bowed up towards the walls."""
        side = np.abs(p[:, 0]) / _HALF_WIDTH
        return 0.25 * swirl(p * [1, 0, 1], 4.5)[:, 1] + 0.9 * side**3

    def _shaft_distance(self, p: np.ndarray) -> np.ndarray:
        # Negative inside the shaft, which leans towards the sun and opens upwards between broken ribs.
        if self.opening <= 0.0:
            return np.full(len(p), 1e3)
        up = p[:, 1] - 7.0
        x = p[:, 0] - self.shaft[0] - 0.16 * up
        z = p[:, 2] - self.shaft[2] + 0.30 * up
        turn = np.arctan2(z, x)
        rib = np.interp(np.mod(turn, 2 * np.pi), np.linspace(0, 2 * np.pi, 8), np.append(self._ribs, self._ribs[0]))
        radius = self.opening * (1.9 + 0.22 * np.maximum(up, 0.0)) * rib
        return np.maximum(np.hypot(x, 0.75 * z) - radius, -up)

    def _portal(self, p: np.ndarray) -> np.ndarray:
        x, y, z = p.T
        arch = np.sqrt((np.abs(x) + 1.6) ** 2 + np.maximum(y, 0.0) ** 2) - 4.7
        return np.maximum(np.maximum(arch, 7.0 - z), self.floor(p) - y)


def _make_column(rng: np.random.Generator, k: int, count: int) -> _Column:
    # Two rows along the hall, the last ones around the apse.
    side = 1.0 if k % 2 else -1.0
    row = (k // 2 + 0.5) / max((count + 1) // 2, 1)
    z = 4.6 - 16.5 * row + rng.uniform(-0.9, 0.9)
    x = side * (3.9 - 2.0 * max(row - 0.6, 0.0)) + rng.uniform(-0.8, 0.8)
    faces = int(rng.integers(4, 7))
    angles = (np.arange(faces) + rng.uniform(-0.25, 0.25, faces)) * 2 * np.pi / faces
    return _Column(
        np.array([x, z]),
        rng.uniform(-0.10, 0.10, 2),
        np.stack([rng.uniform(0.25, 0.75, 2), rng.uniform(5.0, 9.0, 2), rng.uniform(0, 6.28, 2)], 1),
        rng.uniform(0.42, 0.95),
        np.stack([angles, rng.uniform(0.75, 1.15, faces), rng.uniform(0.1, 0.32, faces)], 1),
        rng.uniform(0.10, 0.32) * rng.choice([-1.0, 1.0]),
        (rng.uniform(1.2, 2.4), rng.uniform(1.6, 3.0)),
    )


def _column_distance(column: _Column, p: np.ndarray) -> np.ndarray:
    x, y, z = p.T
    (ax, lx, px), (az, lz, pz) = column.bend
    x = x - column.foot[0] - column.lean[0] * y - ax * np.sin(2 * np.pi * y / lx + px)
    z = z - column.foot[1] - column.lean[1] * y - az * np.sin(2 * np.pi * y / lz + pz)
    low, high = np.clip(1.0 - y / 3.2, 0.0, 1.3), np.clip((y - 4.6) / 5.0, 0.0, 1.5)
    radius = column.radius * (1.0 + column.flare[0] * low**2.2 + column.flare[1] * high**2.0)
    turn = column.twist * y
    c, s = np.cos(turn), np.sin(turn)
    x, z = c * x - s * z, s * x + c * z
    d = np.full(len(p), -np.inf)
    for angle, distance, hollow in column.faces:
        ca, sa = np.cos(angle), np.sin(angle)
        across = (z * ca - x * sa) / radius
        out = x * ca + z * sa - distance * radius + radius * hollow * np.maximum(1.0 - across * across, 0.0)
        np.maximum(d, out, out=d)
    return 0.8 * d


def _shards(rng: np.random.Generator, hall: _Hall, step: float):
    solids, tips = [], []

    def add(base, tip, radius, **more):
        solids.append(shard(rng, base, tip, radius, step, **more))
        tips.append(tip)

    # Daggers hang where the vault comes down to the columns and around the shaft.
    for _ in range(26):
        x, z = rng.uniform(-5.0, 5.0), rng.uniform(-13.0, 6.0)
        line = np.stack([np.full(60, x), np.linspace(3.0, 12.5, 60), np.full(60, z)], 1)
        solid = np.flatnonzero((hall(line) < 0)[1:] & (hall(line) >= 0)[:-1])
        if len(solid) == 0:
            continue
        root = line[solid[-1] + 1] + 0.5 * kUp
        length = rng.uniform(0.7, 2.6) * (1.4 if rng.random() < 0.25 else 1.0)
        tip = root - length * kUp + rng.uniform(-0.12, 0.12, 3) * length * [1, 0, 1]
        add(root, tip, 0.10 * length + 0.08, bend=0.04, shaves=1, breaks=1, power=(0.9, 1.4))

    # Spires lean out from the columns' feet.
    for column in hall.columns:
        for _ in range(int(rng.integers(2, 5))):
            turn = rng.uniform(0, 2 * np.pi)
            out = np.array([np.cos(turn), 0.0, np.sin(turn)])
            at = np.array([column.foot[0], 0.0, column.foot[1]]) + out * column.radius * rng.uniform(1.6, 2.6)
            at[1] = hall.floor(at[None])[0]
            height = rng.uniform(0.6, 2.4)
            tip = at + height * (kUp + out * rng.uniform(0.15, 0.5))
            add(at - 0.5 * kUp, tip, 0.17 * height + 0.05, is_broken=rng.random() < 0.2)

    # Blocks that fell from the shaft.
    for _ in range(9):
        at = hall.shaft + [rng.normal() * 1.5, 0.0, rng.normal() * 1.6 + 1.0]
        half = rng.uniform(0.2, 0.7, 3)
        at[1] = hall.floor(at[None])[0] + 0.35 * half[1]
        solids.append(block(rng, at, half, lean=0.5))
    return solids, np.array(tips) if tips else np.full((1, 3), 1e3)


def _rocks(rng: np.random.Generator, hall: _Hall, count: int, seed: int) -> list[Part]:
    # Half in the floor or in the foot of a wall.
    parts = []
    for k in range(count):
        side = 1.0 if k % 2 else -1.0
        z = rng.uniform(-8.0, 4.5)
        x = side * rng.uniform(1.4, 5.3)
        size = rng.uniform(0.35, 0.95) * rng.uniform(0.75, 1.2, 3)
        y = hall.floor(np.array([[x, 0.0, z]]))[0] + 0.2 * size[1]
        parts.append(rock_part(rng, f"Rock{k + 1}", (x, y, z), size, seed + 31 * k, rime=0.35))
    return parts


def _blend(a: np.ndarray, b: np.ndarray, width: float) -> np.ndarray:
    h = np.maximum(width - np.abs(a - b), 0.0) / width
    return np.minimum(a, b) - h * h * width * 0.25
