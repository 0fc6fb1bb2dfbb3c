"""Icicles under a ledge.

Model: an icicle's radius grows as the power 3/4 of the distance from its tip [Short2006, the limit far from the tip],
    with ripples a centimetre long [Ueno2007] that deepen upwards; they bend with the wind and merge at their roots.
Units: metres, y up; made at a length of 0.8 m, then scaled.
"""

import numpy as np

from .formation import CameraRow, Formation, check_count, check_parameters, triangle_budget
from .noise import Noise
from .randomness import generator
from .solids import block, kUp, swept, union
from .surroundings import Part, ice, kRock, kSnow, rock_part, sky_and_lights, snowfield
from .weathering import Melt, Progress, grow

kLength = 0.8
_RIPPLE = 0.0105  # metres


def icicles(
    scale: float = 0.8,
    age: float = 0.1,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    count: int = 26,
    progress: Progress | None = None,
) -> Formation:
    """Icicles with their ripples under a ledge of ice and rock.

    Parameters
    ----------
    scale : float
        Length of the longest in metres.
    age : float
        0 clear .. 1 worn and frosted.
    seed : int
        Another number, another row.
    detail : float
        Triangles grow with its square; 1 is 400,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    count : int
        Icicles, 1 to 200.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("icicles", scale, age, seed, detail, triangles)
    check_count("icicles", "count", count, 1, 200)
    rng = generator("icicles", seed)
    budget = triangle_budget(400_000, detail, triangles)
    step = 0.0035 * np.sqrt(400_000 / np.clip(budget, 15_000, 400_000))
    wind = rng.uniform(-0.05, 0.05, 2)
    solids = []
    for k in range(count):
        x = -0.95 + 1.9 * (k + rng.uniform(0.1, 0.9)) / count
        z = rng.normal() * 0.05
        length = kLength * rng.choice([0.25, 0.5, 0.75, 1.0], p=[0.35, 0.3, 0.2, 0.15]) * rng.uniform(0.8, 1.0)
        solids.append(_icicle(rng, np.array([x, 0.09, z]), length, wind, step))
        # Smaller ones grow together with it into a curtain.
        for _ in range(int(rng.integers(0, 4))):
            at = np.array([x + rng.normal() * 0.035, 0.08, z + rng.normal() * 0.02])
            solids.append(_icicle(rng, at, length * rng.uniform(0.15, 0.6), wind, step))
    for x in np.linspace(-1.15, 1.15, 40):
        at = (x + rng.uniform(-0.04, 0.04), rng.uniform(0.045, 0.13), rng.uniform(-0.10, 0.02))
        solids.append(block(rng, at, rng.uniform((0.05, 0.025, 0.05), (0.13, 0.075, 0.12)), 12, 0.5))
    body = union(solids)
    noise = Noise(seed)
    box = (np.array([-1.8, -1.2, -0.8]), np.array([1.8, 0.6, 0.8]))
    melt = Melt(noise, box, size=0.05, depth=0.004 + 0.004 * age, amount=0.5, stretch=1.0, grain=0.0005, dent=1.0)
    surface = grow(
        body, budget, rounding=0.012 + 0.010 * age, large=melt.large, fine=melt.fine, keep=_slim, progress=progress
    )
    parts = [Part.of("Ice", surface, "Ice", "ice", 60.0)]
    for k, x in enumerate(np.linspace(-1.25, 1.25, 6)):
        size = rng.uniform((0.28, 0.16, 0.22), (0.36, 0.24, 0.34))
        at = (x + rng.uniform(-0.08, 0.08), 0.16 + 0.6 * size[1], -0.24)
        parts.append(rock_part(rng, f"Rock{k + 1}", at, size, seed + 31 * k, rime=0.5))
    parts.append(snowfield(seed, 0.6, budget, -1.5))
    image, lights = sky_and_lights(seed, (0.45, 0.3, -0.85), budget, sun_light=4.2, sky_light=0.7)
    return Formation(
        "icicles",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, count=count),
        parts,
        {"Ice": ice("fresh_breath", 0.5 * age, 0.6, depth=5.0, refraction=0.9), "Rock": kRock, "Snow": kSnow},
        lights,
        CameraRow((0.25, -0.62, 1.8), (0.0, -0.24, 0.0), 35.0),
        image,
    ).scaled(scale / kLength)


def _icicle(rng: np.random.Generator, root: np.ndarray, length: float, wind: np.ndarray, step: float):
    radius = 0.050 * length**0.75 * rng.uniform(0.8, 1.2) + 0.004
    rows = int(np.clip(length / step, 8, 3000))
    columns = int(np.clip(2 * np.pi * radius / step, 6, 200))
    s = np.linspace(0.0, 1.0, rows + 1)[:-1]
    left = length * (1.0 - s)  # to the tip
    wave = rng.uniform(0.85, 1.15) * _RIPPLE
    drift = 0.35 * np.sin(np.cumsum(rng.normal(size=rows)) * 0.4)
    deep = np.clip(left / 0.25, 0.0, 1.0) * rng.uniform(0.008, 0.03)
    width = radius * (left / length) ** 0.75 * (1.0 + deep * np.cos(2 * np.pi * left / wave + drift))
    width = width * (1.0 + 0.5 * np.clip(1.0 - s / 0.14, 0.0, 1.0) ** 2)  # spreads where it hangs on
    turn = np.arange(columns) * 2 * np.pi / columns
    oval = 1.0 + rng.uniform(-0.12, 0.12) * np.cos(2 * turn + rng.uniform(0, 6.28))
    sway = np.stack(
        [np.interp(s, np.linspace(0, 1, 7), np.cumsum(rng.normal(size=7)) * 0.006 * length) for _ in "xz"], 1
    )
    spine = root - (length * s)[:, None] * kUp
    spine[:, [0, 2]] += sway - sway[0] + wind * (length * s**1.6)[:, None]
    tip = spine[-1] - left[-1] * kUp
    p = np.repeat(spine[None], columns, 0)
    p[..., 0] += (oval * np.cos(turn))[:, None] * width
    p[..., 2] += (oval * np.sin(turn))[:, None] * width
    return swept(p, root, tip)


def _slim(p: np.ndarray) -> np.ndarray:
    # The slim ends are left as they grew.
    return np.clip((p[:, 1] + 0.03) / 0.07, 0.04, 1.0)
