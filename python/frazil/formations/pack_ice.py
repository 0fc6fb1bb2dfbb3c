"""Pack ice: floes on dark water, some rafted, ridges of rubble where they were pressed together.

Units: metres, y up, water at y = 0; made 60 m wide, then scaled.
"""

import numpy as np

from .floes import Cell, cells, prism
from .formation import CameraRow, Formation, check_count, check_parameters, check_within, triangle_budget
from .noise import Noise
from .randomness import generator
from .solids import block, union
from .surroundings import Part, ice, kWater, sky_and_lights, water
from .weathering import Melt, Progress, grow

kWidth = 60.0


def pack_ice(
    scale: float = 60.0,
    age: float = 0.5,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    count: int = 70,
    leads: float = 0.35,
    progress: Progress | None = None,
) -> Formation:
    """Floes of pack ice on dark water, with pressure ridges and brash ice in the leads.

    Parameters
    ----------
    scale : float
        Width of the field in metres.
    age : float
        0 freshly broken .. 1 worn round, under snow.
    seed : int
        Another number, another field.
    detail : float
        Triangles grow with its square; 1 is 400,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    count : int
        Floes, 4 to 600.
    leads : float
        How much open water lies between floes, 0 to 1.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("pack_ice", scale, age, seed, detail, triangles)
    check_count("pack_ice", "count", count, 4, 600)
    check_within("pack_ice", "leads", leads, 0.0, 1.0, "0 leaves cracks only.")
    rng = generator("pack_ice", seed)
    budget = triangle_budget(400_000, detail, triangles)
    noise = Noise(seed)
    half = 0.5 * kWidth
    typical = kWidth / np.sqrt(count)

    def gap(center: np.ndarray) -> float:
        # Leads open along a few bent lines; elsewhere floes touch almost.
        at = np.array([[center[0], 0.0, center[1]]])
        lead = np.exp(-((noise(at * [1.0, 1.0, 0.45], 14.0, 3)[0] / 0.22) ** 2))
        return typical * (0.02 + leads * (0.06 + 0.55 * lead))

    floes = cells(rng, (-half, -half), (half, half), count, gap, 0.4)
    solids = []
    for floe in floes:
        thick = rng.uniform(0.7, 1.6)
        free = 0.16 * thick + rng.uniform(0.02, 0.22)
        tilt = rng.normal(size=2) * 0.008 * (4.0 if rng.random() < 0.08 else 1.0)
        outline = _ragged(rng, floe)
        top = free + (outline - floe.center) @ tilt
        solids.append(prism(outline, free - thick, top, rng.uniform(-0.02, 0.04)))
    ridges = [(k, j) for k, floe in enumerate(floes) for j in floe.neighbours if j > k]
    for k, j in ridges:
        line = 0.5 * (floes[k].center + floes[j].center)
        along = floes[j].center - floes[k].center
        if rng.random() > 0.28 or gap(line) > 0.14 * typical:
            continue
        along = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        for _ in range(int(rng.integers(10, 26))):
            t = rng.uniform(-0.45, 0.45) * typical
            at = line + t * along + rng.normal(size=2) * 0.35
            size = 0.2 + 0.6 * rng.random() ** 2
            rise = rng.uniform(0.1, 0.75) * (1.0 - (2.0 * t / typical) ** 2)
            shape = size * rng.uniform((0.6, 0.18, 0.5), (1.2, 0.4, 1.0))
            solids.append(block(rng, (at[0], 0.15 + rise, at[1]), shape, 6, 0.7))
    for _ in range(3 * count):
        at = rng.uniform(-half, half, 2)
        size = 0.45 * rng.random() ** 2 + 0.12
        shape = size * rng.uniform((0.6, 0.4, 0.6), (1.3, 0.7, 1.3))
        solids.append(block(rng, (at[0], rng.uniform(-0.1, 0.08), at[1]), shape, 7, 0.3))
    body = union(solids)
    box = (np.array([-half - 4, -5.0, -half - 4]), np.array([half + 4, 5.0, half + 4]))
    melt = Melt(
        noise, box, size=1.1, depth=0.05 + 0.05 * age, amount=0.35 * age, stretch=1.0, grain=0.02, dent=0.9, cracks=6
    )
    surface = grow(body, budget, rounding=0.02 + 0.12 * age**1.5, large=melt.large, fine=melt.fine, progress=progress)
    parts = [Part.of("Ice", surface, "Ice", "ice"), water(seed, 3.0, budget, surface, 40.0, reach=0.9)]
    image, lights = sky_and_lights(seed, (-0.7, 0.22, -0.7), budget, sun_light=3.0, sky_light=0.55)
    return Formation(
        "pack_ice",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, count=count, leads=leads),
        parts,
        {"Ice": ice("sea_ice", 0.4 + 0.6 * age, 0.8), "Water": kWater},
        lights,
        CameraRow((3.0, 3.6, 32.0), (0.0, 0.4, 6.0), 32.0),
        image,
    ).scaled(scale / kWidth)


def _ragged(rng: np.random.Generator, floe: Cell) -> np.ndarray:
    # Corners are broken off, so that no floe is a clean polygon.
    corners = []
    size = np.linalg.norm(floe.outline - floe.center, axis=1).mean()
    for k, here in enumerate(floe.outline):
        for other in (floe.outline[k - 1], floe.outline[(k + 1) % len(floe.outline)]):
            away = np.linalg.norm(other - here)
            corners.append(here + (other - here) * min(0.45, rng.uniform(0.05, 0.28) * size / max(away, 1e-9)))
    return np.array(corners)
