"""Spires and tips: shards of glacier ice that stand close together.

Units: metres, y up; made at a height of 4 m (spires) and 1 m (tips), then scaled.
"""

import numpy as np
from scipy.spatial import cKDTree

from .formation import CameraRow, Formation, check_count, check_parameters, check_within, triangle_budget
from .noise import Noise, swirl
from .randomness import generator
from .solids import block, kUp, shard, union
from .surroundings import Part, ice, kRock, kSnow, rock_part, sky_and_lights, snowfield
from .weathering import Melt, Progress, grow

kHeight = 4.0
_SUN = (-0.90, 0.42, -0.48)


def spire_cluster(
    scale: float = 4.0,
    age: float = 0.35,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    count: int = 22,
    lean: float = 0.35,
    progress: Progress | None = None,
) -> Formation:
    """Spires of broken glacier ice on a block, rocks frozen in, in snow.

    Parameters
    ----------
    scale : float
        Height in metres.
    age : float
        0 sharp and clear .. 1 worn, frosted and cracked.
    seed : int
        Another number, another cluster.
    detail : float
        Triangles grow with its square; 1 is 300,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    count : int
        Large spires, 1 to 60; splinters grow at their feet.
    lean : float
        Radians by which the outer spires lean outwards, 0 to 1.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("spire_cluster", scale, age, seed, detail, triangles)
    check_count("spire_cluster", "count", count, 1, 60)
    check_within("spire_cluster", "lean", lean, 0.0, 1.0, "It is in radians.")
    rng = generator("spire_cluster", seed)
    budget = triangle_budget(300_000, detail, triangles)
    step = 0.05 * np.sqrt(300_000 / max(min(budget, 300_000), 15_000))
    solids, tips = _cluster(rng, count, lean, step)
    floor = [
        block(rng, (x, rng.uniform(-0.22, 0.05), z), rng.uniform((0.25, 0.25, 0.25), (0.7, 0.42, 0.5)), 10, 0.35)
        for x, z in zip(rng.uniform(-2.1, 2.1, 22), rng.uniform(-1.0, 1.0, 22), strict=True)
    ]
    body = union(solids + floor).trim_by_plane((0, 1, 0), -0.35)

    noise = Noise(seed)
    box = (np.array([-5.0, -1.0, -5.0]), np.array([5.0, 5.0, 5.0]))
    melt = Melt(
        noise, box, size=0.34, depth=0.030 + 0.03 * age, amount=0.25 + 0.75 * age, stretch=2.2, layers=0.16,
        band=0.006, grain=0.004, cracks=16,
    )  # fmt: skip
    surface = grow(
        body,
        budget,
        rounding=0.10 * age**1.5,
        large=melt.large,
        fine=melt.fine,
        keep=lambda p: keep_tips(p, tips),
        progress=progress,
    )
    parts = [Part.of("Ice", surface, "Ice", "ice")]
    for k, (x, z, size) in enumerate([(-1.75, 1.05, 0.40), (2.15, 0.75, 0.46), (0.55, 1.25, 0.20)]):
        half = size * rng.uniform(0.75, 1.1, 3)
        at = (x + rng.uniform(-0.2, 0.2), 0.1 + 0.4 * half[1], z)
        parts.append(rock_part(rng, f"Rock{k + 1}", at, half, seed + 31 * k))

    def drift(p: np.ndarray) -> np.ndarray:
        away = np.sqrt((p[:, 0] / 2.7) ** 2 + (p[:, 2] / 1.5) ** 2)
        return 0.22 * np.exp(-np.maximum(away - 0.75, 0.0) / 0.25) * (0.8 + 0.4 * swirl(p, 0.8)[:, 0])

    parts.append(snowfield(seed, 2.0, budget, -0.12, lift=drift))
    image, lights = sky_and_lights(seed, _SUN, budget, sun_light=3.4)
    return Formation(
        "spire_cluster",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, count=count, lean=lean),
        parts,
        {"Ice": ice("arctic_blue", age, 1.0, depth=7.0), "Rock": kRock, "Snow": kSnow},
        lights,
        CameraRow((1.1, 0.85, 7.4), (0.0, 1.82, 0.0), 36.0),
        image,
    ).scaled(scale / kHeight)


def ice_tips(
    scale: float = 1.0,
    age: float = 0.1,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    count: int = 16,
    progress: Progress | None = None,
) -> Formation:
    """Slim tips of ice in a row, lit from behind: where translucency goes dark if it is not compensated.

    Parameters
    ----------
    scale : float
        Height in metres.
    age : float
        0 sharp and clear .. 1 worn and frosted.
    seed : int
        Another number, another row.
    detail : float
        Triangles grow with its square; 1 is 200,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    count : int
        Tips, 1 to 200.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("ice_tips", scale, age, seed, detail, triangles)
    check_count("ice_tips", "count", count, 1, 200)
    rng = generator("ice_tips", seed)
    budget = triangle_budget(200_000, detail, triangles)
    step = 0.014 * np.sqrt(200_000 / max(min(budget, 200_000), 15_000))
    solids, tips = [], []
    for x in np.linspace(-0.95, 0.95, count) if count > 1 else [0.0]:
        z = rng.uniform(-0.22, 0.16)
        at = np.array([x + rng.uniform(-0.05, 0.05), 0.02, z])
        height = rng.choice([0.34, 0.55, 0.8, 1.0], p=[0.3, 0.3, 0.25, 0.15]) * rng.uniform(0.85, 1.0)
        lean = np.array([rng.uniform(-0.16, 0.16) + 0.12 * x, 1.0, rng.uniform(-0.1, 0.1)])
        tip = at + height * lean
        tips.append(tip)
        width = height * rng.uniform(0.10, 0.17) + 0.02
        form = dict(twist=0.7, bend=0.05, power=(0.9, 1.35), breaks=1, shaves=1)
        solids.append(shard(rng, at - 0.1 * kUp, tip, width, step, **form))
        for _ in range(int(rng.integers(1, 4))):
            turn = rng.uniform(0, 2 * np.pi)
            out = np.array([np.cos(turn), 0.0, np.sin(turn)])
            small = height * rng.uniform(0.25, 0.55)
            end = at + out * (width + 0.25 * small) + small * kUp
            tips.append(end)
            solids.append(shard(rng, at + 0.7 * width * out - 0.1 * kUp, end, small * 0.14, step, breaks=1, shaves=0))
    for _ in range(12):
        at = (rng.uniform(-1.1, 1.1), rng.uniform(-0.10, -0.02), rng.uniform(-0.3, 0.25))
        solids.append(block(rng, at, rng.uniform(0.09, 0.26, 3)))
    body = union(solids).trim_by_plane((0, 1, 0), -0.22)
    noise = Noise(seed)
    box = (np.array([-2.0, -1.0, -2.0]), np.array([2.0, 2.0, 2.0]))
    melt = Melt(
        noise, box, size=0.075, depth=0.005 + 0.008 * age, amount=0.3 + 0.7 * age, stretch=2.0, grain=0.0009, cracks=10
    )
    points = np.array(tips)
    surface = grow(
        body,
        budget,
        rounding=0.02 * age**1.5,
        large=melt.large,
        fine=melt.fine,
        keep=lambda p: keep_tips(p, points, 0.16),
        progress=progress,
    )
    parts = [Part.of("Ice", surface, "Ice", "ice"), snowfield(seed, 0.5, budget, -0.10)]
    image, lights = sky_and_lights(seed, (0.55, 0.35, -0.75), budget, sun_light=3.4)
    return Formation(
        "ice_tips",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, count=count),
        parts,
        {"Ice": ice("arctic_blue", age, 0.5, depth=4.0), "Snow": kSnow},
        lights,
        CameraRow((0.15, 0.42, 2.1), (0.0, 0.42, 0.0), 35.0),
        image,
    ).scaled(scale)


def _cluster(rng: np.random.Generator, count: int, lean: float, step: float):
    # Heights fall from the middle outwards; each spire has splinters at its foot.
    solids, tips = [], []
    for k in range(count):
        out = 0.0 if k == 0 else np.sqrt(k / count) * rng.uniform(0.85, 1.1)
        turn = 2.39996 * k + rng.uniform(-0.5, 0.5)
        at = np.array([2.0 * out * np.cos(turn), 0.1, 0.85 * out * np.sin(turn)])
        height = kHeight * (1.0 if k == 0 else (1.0 - 0.55 * min(out, 1.0)) * rng.uniform(0.45, 1.1))
        tilt = np.tan(lean * min(out, 1.0) * rng.uniform(0.6, 1.4))
        away = np.array([np.cos(turn), 0.0, 0.6 * np.sin(turn)])
        tip = at + height * (kUp + tilt * away + rng.uniform(-0.07, 0.07, 3) * [1, 0, 1])
        tip[1] = min(tip[1], kHeight) if k else kHeight
        width = (0.12 + 0.165 * height) * rng.uniform(0.85, 1.2)
        is_broken = k > 2 and rng.random() < 0.22
        solids.append(
            shard(
                rng,
                at - 0.4 * kUp,
                tip,
                width,
                step,
                shaves=int(rng.integers(3, 7)),
                is_broken=is_broken,
                bend=0.07,
                breaks=3,
            )
        )
        tips.append(tip)
        for _ in range(int(rng.integers(3, 7))):
            turn = rng.uniform(0, 2 * np.pi)
            side = np.array([np.cos(turn), 0.0, np.sin(turn)])
            small = height * rng.uniform(0.16, 0.5)
            foot = at + side * width * rng.uniform(0.5, 1.0)
            end = foot + small * (kUp + 0.7 * tilt * away + side * rng.uniform(0.1, 0.5))
            solids.append(
                shard(rng, foot - 0.25 * kUp, end, small * rng.uniform(0.12, 0.2), step, shaves=1, breaks=1,
                      is_broken=rng.random() < 0.2)
            )  # fmt: skip
            tips.append(end)
    return solids, np.array(tips)


def keep_tips(points: np.ndarray, tips: np.ndarray, reach: float = 0.55) -> np.ndarray:
    """How much (N,) of wear a place takes: little at tips (K, 3), all of it `reach` metres from them."""
    distance, _ = cKDTree(tips).query(points, distance_upper_bound=reach)
    return np.clip(np.minimum(distance, reach) / reach, 0.05, 1.0)
