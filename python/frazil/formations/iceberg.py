"""An iceberg: broken above, worn smooth below its waterline, with the benches of older waterlines.

Units: metres, y up, water at y = 0; made 12 m high above the water, then scaled.
"""

import numpy as np
from manifold3d import Manifold

from .formation import CameraRow, Formation, check_count, check_parameters, triangle_budget
from .noise import Noise
from .randomness import generator
from .solids import block, union
from .surroundings import Part, ice, kWater, sky_and_lights, water
from .weathering import Melt, Progress, grow

kHeight = 12.0


def iceberg(
    scale: float = 12.0,
    age: float = 0.4,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    peaks: int = 3,
    progress: Progress | None = None,
) -> Formation:
    """An iceberg in the sea: peaks and broken walls above, a notch at the waterline, most of it below.

    Parameters
    ----------
    scale : float
        Height above the water in metres.
    age : float
        0 freshly calved, sharp .. 1 worn, scalloped and white.
    seed : int
        Another number, another iceberg.
    detail : float
        Triangles grow with its square; 1 is 400,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    peaks : int
        1 (a block) to 6.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("iceberg", scale, age, seed, detail, triangles)
    check_count("iceberg", "peaks", peaks, 1, 6)
    rng = generator("iceberg", seed)
    budget = triangle_budget(400_000, detail, triangles)
    noise = Noise(seed)
    solids = []
    for k in range(peaks):
        t = (k + 0.5) / peaks - 0.5
        tall = kHeight * (1.0 if k == peaks // 2 else rng.uniform(0.45, 0.85))
        solids.append(_peak(rng, np.array([26.0 * t, 0.0, rng.uniform(-2.5, 2.5)]), tall, 21.0 / peaks + 4.0))
    solids.append(_keel(rng))
    body = union(solids)
    # Bites that calving took, and a low arch's worth of melting from the side.
    for _ in range(3):
        turn = rng.uniform(0, 2 * np.pi)
        at = np.array([13.0 * np.cos(turn), rng.uniform(1.0, 6.0), 7.5 * np.sin(turn)])
        bite = block(rng, at, rng.uniform((2.0, 3.0, 2.0), (5.0, 7.0, 4.0)), 10, 0.5)
        body = body - bite
    body = max(body.decompose(), key=lambda piece: piece.volume())
    body = union([body, *_brash(rng, body)])

    box = (np.array([-30.0, -40.0, -25.0]), np.array([30.0, 20.0, 25.0]))
    melt = Melt(
        noise, box, size=1.5, depth=0.16 + 0.22 * age, amount=0.25 + 0.6 * age, stretch=1.2, layers=0.8,
        band=0.05, grain=0.04, cracks=18, dip=(0.28, 0.94, 0.18),
    )  # fmt: skip
    tilt = np.array([rng.uniform(-0.25, 0.25), 1.0, rng.uniform(-0.15, 0.15)])
    tilt /= np.linalg.norm(tilt)
    benches = rng.uniform(1.8, 6.0, 3)

    def large(p: np.ndarray, n: np.ndarray, step: float) -> np.ndarray:
        wall = np.clip(1.3 - 1.6 * np.abs(n[:, 1]), 0.0, 1.0)
        y = p[:, 1] + 0.25 * noise(p, 5.0, 90)
        cut = 0.9 * np.exp(-(((y - 0.35) / 0.55) ** 2))
        # Older waterlines, tilted since: the ice below each was worn back a little.
        old = p @ tilt + 0.2 * noise(p, 6.0, 91)
        for height in benches:
            cut += (0.22 + 0.25 * age) * np.exp(-np.abs(old - height) / 0.35)
        # Water that ran down the walls left flutes.
        runnels = (0.25 + 0.35 * age) * np.abs(noise(p * [1.0, 0.10, 1.0], 0.9, 80)) * (y > 0.5)
        return melt.large(p, n, step) - wall * (cut + runnels)

    surface = grow(body, budget, rounding=0.06 + 0.4 * age**1.5, large=large, fine=melt.fine, progress=progress)
    parts = [Part.of("Ice", surface, "Ice", "ice"), water(seed, 6.0, budget, surface, 60.0, reach=2.5)]
    image, lights = sky_and_lights(seed, (-0.78, 0.38, 0.5), budget, sun_light=3.6)
    return Formation(
        "iceberg",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, peaks=peaks),
        parts,
        {"Ice": ice("weathered_white", 0.7 * age, 5.0, refraction=0.12), "Water": kWater},
        lights,
        CameraRow((9.0, 3.2, 42.0), (0.0, 4.4, 0.0), 35.0),
        image,
    ).scaled(scale / kHeight)


def _peak(rng: np.random.Generator, at: np.ndarray, tall: float, width: float) -> Manifold:
    # A tall block, cut by steep planes that lean inwards; the last cuts make its crest.
    half = np.array([0.62 * width, tall, 0.5 * width])
    solid = Manifold.cube(tuple(2 * half), True)
    for _ in range(11):
        turn = rng.uniform(0, 2 * np.pi)
        normal = np.array([np.cos(turn), rng.choice([0.12, 0.35, 0.8], p=[0.5, 0.3, 0.2]), np.sin(turn)])
        normal /= np.linalg.norm(normal)
        reach = np.hypot(half[0] * normal[0], half[2] * normal[2]) * rng.uniform(0.62, 0.95)
        through = normal * [1, 0, 1] * reach + np.array([0.0, tall * rng.uniform(0.25, 0.8) * (normal[1] > 0.3), 0.0])
        solid = solid.trim_by_plane(tuple(-normal), -float(normal @ through))
    solid = solid.rotate((rng.uniform(-9, 9), rng.uniform(0, 360), rng.uniform(-9, 9)))
    top = solid.bounding_box()[4]
    return solid.translate((float(at[0]), float(tall - top), float(at[2])))


def _keel(rng: np.random.Generator) -> Manifold:
    # Below the water: wider than what stands above, rounded, three times as deep.
    points = rng.normal(size=(60, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points *= rng.uniform(0.85, 1.0, (60, 1)) * np.array([17.0, 17.0, 10.0])
    solid = Manifold.hull_points(points + np.array([0.0, -15.0, 0.0]))
    return solid.trim_by_plane((0.0, -1.0, 0.05), -0.6)


def _brash(rng: np.random.Generator, body: Manifold) -> list[Manifold]:
    pieces = []
    for _ in range(26):
        turn = rng.uniform(0, 2 * np.pi)
        out = 1.0 + 0.7 * rng.random() ** 2
        size = 0.25 + 0.9 * rng.random() ** 3
        at = (19.0 * out * np.cos(turn), -0.12 * size, 12.0 * out * np.sin(turn))
        pieces.append(block(rng, at, size * rng.uniform((0.7, 0.4, 0.7), (1.5, 0.9, 1.5)), 9, 0.5))
    return pieces
