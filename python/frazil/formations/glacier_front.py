"""The front of a tidewater glacier: a cliff of columns between crevasses that calves into the sea.

Units: metres, y up, water at y = 0; made 40 m high, then scaled.
"""

import numpy as np

from .floes import cells, prism
from .formation import CameraRow, Formation, check_parameters, check_within, triangle_budget
from .noise import Noise
from .randomness import generator
from .solids import block, union
from .surroundings import Part, ice, kWater, sky_and_lights, water
from .weathering import Melt, Progress, grow

kHeight = 40.0
_HALF, _DEPTH = 75.0, 46.0


def glacier_front(
    scale: float = 40.0,
    age: float = 0.45,
    seed: int = 0,
    detail: float = 1.0,
    triangles: int | None = None,
    crevasses: float = 0.5,
    progress: Progress | None = None,
) -> Formation:
    """The calving front of a glacier: seracs between crevasses above the sea.

    Parameters
    ----------
    scale : float
        Height of the cliff in metres; it is 3.75 times as wide.
    age : float
        0 freshly calved, sharp and blue .. 1 worn, banded and white.
    seed : int
        Another number, another front.
    detail : float
        Triangles grow with its square; 1 is 500,000.
    triangles : int, optional
        How many triangles the ice has, 10,000 to 20,000,000, instead of `detail`.
    crevasses : float
        How far the columns have come apart, 0 to 1.
    progress : callable, optional
        Called with a stage and how much of it is done.

    Returns
    -------
    Formation
    """
    check_parameters("glacier_front", scale, age, seed, detail, triangles)
    check_within("glacier_front", "crevasses", crevasses, 0.0, 1.0, "1 is a wreck.")
    rng = generator("glacier_front", seed)
    budget = triangle_budget(500_000, detail, triangles)
    noise = Noise(seed)

    def bay(x):
        # Where the front stands: bays and headlands.
        at = np.stack([np.atleast_1d(x), np.zeros(np.size(x)), np.zeros(np.size(x))], 1)
        return 7.0 * noise(at, 48.0, 2) + 2.5 * noise(at, 15.0, 3)

    solids = []
    for cell in cells(rng, (-_HALF, -_DEPTH), (_HALF, 2.0), 420, lambda c: 0.5 + 2.2 * crevasses, 0.35):
        x, z = cell.center
        front = float(bay(x)[0]) - z  # metres behind the front
        if front < -3.0:
            continue
        at = np.array([[x, 0.0, z]])
        crest = 33.0 + 5.0 * noise(at, 30.0, 5)[0] + 3.5 * noise(at, 9.0, 6)[0] + 0.10 * front
        loose = np.exp(-max(front, 0.0) / 9.0)
        crest += loose * rng.uniform(-13.0, 3.0) * (0.4 + crevasses)
        if front < 2.0:
            crest *= rng.uniform(0.25, 0.9)  # about to fall, or fallen in part
        slope = rng.normal(size=2) * (0.16 + 0.3 * loose * crevasses)
        top = np.clip(crest + (cell.outline - cell.center) @ slope, 3.0, kHeight)
        column = prism(cell.outline, -9.0, top, rng.uniform(0.0, 0.05))
        for _ in range(int(rng.integers(2, 6))):
            turn = rng.uniform(0, 2 * np.pi)
            normal = np.array([np.cos(turn), rng.uniform(0.25, 1.4), np.sin(turn)])
            normal /= np.linalg.norm(normal)
            edge = np.linalg.norm(cell.outline - cell.center, axis=1).mean()
            through = np.array([x, crest - rng.uniform(0.5, 6.0), z]) + normal * [1, 0, 1] * edge * rng.uniform(
                0.3, 0.9
            )
            column = column.trim_by_plane(tuple(-normal), -float(normal @ through))
        lean = loose * crevasses * (rng.normal(size=2) * 9.0 + [4.0, 0.0])
        column = column.translate((-x, 0, -z)).rotate((float(lean[0]), 0, float(lean[1]))).translate((x, 0, z))
        solids.append(column)
    # What lies behind and below the crevasses is one body.
    line = np.linspace(-_HALF, _HALF, 26)
    for a, b in zip(line[:-1], line[1:], strict=True):
        back = min(float(bay(0.5 * (a + b))[0]) - 3.0, 0.0)
        outline = np.array([[a - 0.5, -_DEPTH], [b + 0.5, -_DEPTH], [b + 0.5, back], [a - 0.5, back]])
        solids.append(prism(outline, -9.0, 19.0 + 3.0 * rng.random()))
    # Blocks half broken out of the face, and what has fallen.
    for _ in range(150):
        x, y = rng.uniform(-_HALF, _HALF), 30.0 * rng.random() ** 1.3
        size = rng.uniform(1.0, 3.6)
        at = (x, y, float(bay(x)[0]) - 2.2 - 0.08 * y + rng.normal())
        solids.append(block(rng, at, size * rng.uniform((0.7, 0.8, 0.6), (1.2, 1.9, 1.1)), 10, 0.35))
    for _ in range(60):
        x = rng.uniform(-_HALF, _HALF)
        out = float(bay(x)[0]) + 2.0 + 26.0 * rng.random() ** 2
        size = 0.4 + 2.6 * rng.random() ** 3
        solids.append(block(rng, (x, -0.1 * size, out), size * rng.uniform((0.7, 0.4, 0.7), (1.4, 0.9, 1.4)), 9, 0.5))
    body = union(solids)

    box = (np.array([-_HALF - 10, -15.0, -_DEPTH - 10]), np.array([_HALF + 10, 60.0, 45.0]))
    melt = Melt(
        noise, box, size=3.0, depth=0.35 + 0.35 * age, amount=0.15 + 0.5 * age, stretch=1.8, layers=1.7,
        band=0.12 * (0.4 + age), grain=0.09, cracks=22, dip=(0.10, 0.97, 0.12),
    )  # fmt: skip

    def large(p: np.ndarray, n: np.ndarray, step: float) -> np.ndarray:
        # Waves have cut a notch at the waterline, and old faces are fluted by meltwater.
        notch = 0.9 * np.exp(-(((p[:, 1] - 0.6) / 1.3) ** 2)) * (np.abs(n[:, 1]) < 0.8)
        flutes = 0.5 * age * np.abs(noise(p * [1.0, 0.12, 1.0], 1.6, 80)) * (np.abs(n[:, 1]) < 0.5)
        return melt.large(p, n, step) - notch - flutes

    surface = grow(body, budget, rounding=0.08 + 0.5 * age**1.5, large=large, fine=melt.fine, progress=progress)
    parts = [Part.of("Ice", surface, "Ice", "ice"), water(seed, 8.0, budget, surface, 60.0, reach=4.0)]
    image, lights = sky_and_lights(seed, (-0.9, 0.34, 0.12), budget, sun_light=3.6)
    return Formation(
        "glacier_front",
        dict(scale=scale, age=age, seed=seed, detail=detail, triangles=triangles, crevasses=crevasses),
        parts,
        {"Ice": ice("old_glacier", age, 12.0, refraction=0.1), "Water": kWater},
        lights,
        CameraRow((16.0, 7.0, 82.0), (-2.0, 15.0, 0.0), 30.0),
        image,
    ).scaled(scale / kHeight)
