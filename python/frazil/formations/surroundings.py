"""What most formations stand in: snow, boulders, water, and the light of a cold day.

Units: metres, y up.
"""

import numpy as np
from scipy.spatial import cKDTree

from .contour import Surface, corner_normals
from .formation import LightRow, MaterialRow, Part
from .noise import Noise, swirl
from .sky import make_sky
from .solids import boulder, kUp
from .weathering import grow

kDeep, kShallow = np.array([0.010, 0.030, 0.042]), np.array([0.07, 0.30, 0.33])
kDeepest = 8.0  # metres of ice that a body shows in colour, however large it is: more would be dark
kSnow = MaterialRow("UsdPreviewSurface", {"diffuseColor": (0.84, 0.88, 0.93), "roughness": 0.7, "ior": 1.31})
kRock = MaterialRow("UsdPreviewSurface", {"roughness": 0.45, "ior": 1.5}, uses_colors=True)
kWater = MaterialRow("UsdPreviewSurface", {"roughness": 0.08, "ior": 1.33}, uses_colors=True)


def ice(preset: str, age: float, size: float, depth: float | None = None, **inputs) -> MaterialRow:
    """frazil:ice of a preset, for a body of `size` metres that is as blue as one of `depth` metres.

    By default its absorption is that of real ice, up to a depth of kDeepest metres.
    """
    depth = min(float(size), kDeepest) if depth is None else float(depth)
    row = {"preset": preset, "preset_scale": float(size), "preset_depth": depth, "age": float(age)}
    return MaterialRow("frazil:ice", row | inputs)


def sky_and_lights(seed: int, sun, budget: int, sun_light: float = 4.4, sky_light: float = 0.9):
    """The sky image and its two lights: the dome, and the sun in direction `sun` (3,).

    The image is as fine as the ice, whose `budget` of triangles it is told.
    """
    sun = np.asarray(sun, np.float64)
    width = int(np.clip(1280 * np.sqrt(budget / 400_000), 512, 2048)) // 2 * 2
    image = make_sky(width, sun, seed)
    return image, [
        LightRow("Sky", "dome", sky_light),
        LightRow("Sun", "distant", sun_light, (1.0, 0.92, 0.82), toward=tuple(map(float, sun)), size=2.0),
    ]


def rock_part(rng, name: str, center, size, seed: int, triangles: int = 6000, rime: float = 0.6) -> Part:
    """A boulder of half axes `size` (3,): grey-brown stone in bands, rime on what faces up."""
    noise = Noise(seed)
    least = float(min(size))
    surface = grow(
        boulder(rng, center, size),
        max(2000, triangles),
        fine=lambda p, n, step: 0.05 * least * noise.fractal(p, 0.35 * least, 5, 5, 0.6),
    )
    p, up = surface.positions, surface.vertex_normals() @ kUp
    grain = noise.fractal(p, 0.45 * least, 4, 20, 0.6)
    band = noise.line(p @ [0.5, 0.8, 0.3] + 0.06 * least * grain, 0.15 * least, 30)
    stone = np.array([0.085, 0.078, 0.072]) * (1.0 + 0.45 * grain + 0.25 * band)[:, None]
    white = np.clip((up - 1.05 + 0.5 * rime + 0.5 * grain) / 0.3, 0.0, 1.0)[:, None] * 0.85
    color = np.clip(stone * (1.0 - white) + np.array([0.78, 0.82, 0.86]) * white, 0.0, 1.0)
    return Part.of(name, surface, "Rock", "rocks", 32.0, colors=color.astype(np.float32))


def sheet(height, extent: float, count: int, focus: float = 0.12) -> Surface:
    """A sheet y = height(points) around the origin, fine near it: `2 count` squares a side, `extent` metres out."""
    line = np.linspace(-1.0, 1.0, 2 * count + 1)
    line = extent * (focus * line + (1.0 - focus) * line**5)
    x, z = np.meshgrid(line, line, indexing="xy")
    p = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], 1)
    p[:, 1] = height(p)
    row = 2 * count + 1
    a = (np.arange(2 * count)[:, None] * row + np.arange(2 * count)).ravel()
    return Surface(p, np.concatenate([np.stack([a, a + row, a + 1], 1), np.stack([a + 1, a + row, a + row + 1], 1)]))


def snowfield(seed: int, size: float, budget: int, level: float = 0.0, extent: float = 40.0, lift=None) -> Part:
    """Wind-blown snow around a formation of `size` metres; a fifth of the ice's `budget` of triangles, at most 100,000.

    `lift` (N,) of points adds drifts.
    """
    count = int(np.sqrt(min(0.2 * budget, 100_000) / 8.0))
    noise = Noise(seed + 2000)

    def height(p: np.ndarray) -> np.ndarray:
        q = p / size
        far = np.hypot(q[:, 0], q[:, 2])
        h = 0.035 * swirl(q, 0.9)[:, 1] + 0.010 * noise(q * [1.0, 1.0, 2.2], 0.22, 1)
        h += 0.003 * noise(q * [0.7, 1.0, 2.6], 0.05, 2) + 0.4 * noise(q, 9.0, 3) * np.clip(far / 10 - 0.3, 0, 1)
        return level + size * h + (0.0 if lift is None else lift(p))

    return Part.of("Snowfield", sheet(height, extent * size, count), "Snow", "snow", 80.0, is_sheet=True)


def water(seed: int, size: float, budget: int, ice: Surface, extent: float, reach: float) -> Part:
    """The sea at y = 0 with waves of `size` metres, turquoise over ice that lies within `reach` metres below."""
    noise = Noise(seed + 3000)
    count = int(np.sqrt(min(0.25 * budget, 160_000) / 8.0))
    span = 1.3 * float(np.abs(ice.positions[:, [0, 2]]).max())

    def height(p: np.ndarray) -> np.ndarray:
        wave = noise(p * [1.0, 1.0, 1.8], size, 1) + 0.45 * noise(p * [1.3, 1.0, 2.2], 0.37 * size, 2)
        return 0.008 * size * wave

    surface = sheet(height, extent * span / 3.0, count, min(1.0, 4.5 / extent))
    below = ice.positions[ice.positions[:, 1] < 0.0]
    p = surface.positions
    # The upper hull of what lies below is what shows through.
    distance, _ = cKDTree(below[:, [0, 2]]).query(p[:, [0, 2]], distance_upper_bound=2.0 * reach)
    near = np.exp(-((np.minimum(distance, 2.0 * reach) / reach) ** 2) * 2.0)[:, None]
    color = kDeep * (1.0 - near) + kShallow * near
    return Part(
        "Water",
        p.astype(np.float32),
        surface.triangles.astype(np.int32),
        "Water",
        "water",
        corner_normals(surface, 80.0).astype(np.float32),
        colors=color.astype(np.float32),
        is_sheet=True,
    )
