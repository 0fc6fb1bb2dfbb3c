"""A burst of ice as a frozen breath leaves it: thin blades that spread from where it struck.

Units: metres, y up; made at a radius of 2 m, then scaled.
"""

import numpy as np

from .formation import CameraRow, Formation, check_count, check_parameters, check_within, triangle_budget
from .noise import Noise
from .randomness import generator
from .solids import block, kUp, shard, union
from .spires import keep_tips
from .surroundings import Part, ice, kSnow, sky_and_lights, snowfield
from .weathering import Melt, Progress, grow

kRadius = 2.0
_TOWARDS = np.array([0.25, 0.62, 0.55])


def breath_burst(
    scale: float = 2.0,
    age: float = 0.0,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    count: int = 170,
    spread: float = 1.15,
    progress: Progress | None = None,
) -> Formation:
    """Thin blades of clear ice that burst from where a freezing breath struck.

    Parameters
    ----------
    scale : float
        Reach of the blades in metres.
    age : float
        0 sharp and clear .. 1 worn and frosted.
    seed : int
        Another number, another burst.
    detail : float
        Triangles grow with its square; 1 is 250,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    count : int
        Blades, 3 to 400.
    spread : float
        Half angle in radians of the cone that they fill, 0.2 to 1.5.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("breath_burst", scale, age, seed, detail, triangles)
    check_count("breath_burst", "count", count, 3, 400)
    check_within("breath_burst", "spread", spread, 0.2, 1.5, "It is half of the cone's angle in radians.")
    rng = generator("breath_burst", seed)
    budget = triangle_budget(250_000, detail, triangles)
    step = 0.035 * np.sqrt(250_000 / np.clip(budget, 15_000, 250_000))
    axis = _TOWARDS / np.linalg.norm(_TOWARDS)
    side = np.cross(axis, kUp)
    side /= np.linalg.norm(side)
    over = np.cross(side, axis)
    solids, tips = [], []
    for k in range(count):
        # Golden angles around the axis; the outer blades are longer and curl back.
        t = (k + 0.5) / count
        tilt = spread * np.sqrt(t) * rng.uniform(0.85, 1.1)
        turn = 2.39996 * k + rng.uniform(-0.3, 0.3)
        around = np.cos(turn) * side + np.sin(turn) * over
        out = np.cos(tilt) * axis + np.sin(tilt) * around
        if out[1] < 0.02:
            out[1] = 0.02 + 0.2 * abs(out[1])
        out /= np.linalg.norm(out)
        length = kRadius * rng.choice([0.4, 0.65, 1.0], p=[0.3, 0.35, 0.35]) * rng.uniform(0.75, 1.0)
        base = -0.15 * out + rng.normal(size=3) * 0.09 * [1, 0.3, 1]
        # The broad side of a blade faces around the burst, as a splash tears into radial sheets.
        form = dict(
            faces=4, flat=rng.uniform(0.10, 0.2), turn=turn + rng.normal() * 0.6, hollow=(0.02, 0.12), flute=0.10,
            twist=0.9, bend=0.12, power=(0.7, 1.0), breaks=1, shaves=int(rng.integers(1, 4)),
            belly=rng.uniform(0.1, 0.22), is_broken=rng.random() < 0.02,
        )  # fmt: skip
        solids.append(shard(rng, base, base + length * out, length * rng.uniform(0.06, 0.115), step, **form))
        tips.append(base + length * out)
    for _ in range(16):
        at = (rng.normal() * 0.5, rng.uniform(-0.12, 0.0), rng.normal() * 0.4)
        solids.append(block(rng, at, rng.uniform(0.06, 0.2, 3) * [1.2, 0.5, 1.2], 9, 0.4))
    body = union(solids).trim_by_plane((0, 1, 0), -0.25)
    noise = Noise(seed)
    box = (np.full(3, -3.5), np.full(3, 3.5))
    melt = Melt(
        noise, box, size=0.12, depth=0.006 + 0.012 * age, amount=0.3 + 0.7 * age, stretch=1.0, grain=0.0015, cracks=12
    )
    points = np.array(tips)
    surface = grow(
        body,
        budget,
        rounding=0.03 * age**1.5,
        large=melt.large,
        fine=melt.fine,
        keep=lambda p: keep_tips(p, points, 0.3),
        progress=progress,
    )
    parts = [Part.of("Ice", surface, "Ice", "ice"), snowfield(seed, 1.0, budget, -0.10)]
    image, lights = sky_and_lights(seed, (-0.75, 0.45, -0.55), budget, sun_light=3.4)
    return Formation(
        "breath_burst",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, count=count, spread=spread),
        parts,
        {"Ice": ice("fresh_breath", age, 0.35, depth=2.4), "Snow": kSnow},
        lights,
        CameraRow((1.3, 0.8, 4.4), (0.2, 0.78, 0.2), 38.0),
        image,
    ).scaled(scale / kRadius)
