"""Every figure that the lights are held to, in one table: what is measured, the bar, and whether it is met.

    python bench/lights.py [--points N] [--million]

Times are processor time, ratios interleaved in one run. `--million` bakes a million points (about a minute of processor
time); without it their time is scaled from --points. Beside it: bench/direct_light.py (Mitsuba 3, pixel by pixel).
"""

from __future__ import annotations

import argparse
import time
from types import SimpleNamespace

import numpy as np

import frazil as fz
from frazil import _frazil as core
from irradiance import knot, lights_about, relative_noise, scatter

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def swarm(count: int) -> list[fz.Light]:
    """Small spheres, disks and rects over a floor; the same total power for any count."""
    rng = np.random.default_rng(5)
    shapes = [fz.SphereLight(0.1), fz.DiskLight(0.15), fz.RectLight(0.3, 0.2)]
    lights = []
    for i in range(count):
        place = np.diag([count**-0.5] * 3 + [1.0])
        place[:3, :3] = place[:3, :3] @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # -z looks down
        place[3, :3] = rng.uniform((-3, 1, -3), (3, 2, 3))
        lights.append(fz.Light(shapes[i % 3], radiance=[10 * rng.random()] * 3, matrix=place, path=f"/{i}"))
    return lights


def noise_of_one_sample(lights: list[fz.Light], samples: int = 64) -> float:
    """Relative deviation of a path's direct light on a floor, in the mean over the picture."""
    scene = fz.Scene()
    corners = np.array([[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2]], np.float32)
    floor = scene.add_mesh(fz.Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]], np.int32)), "/floor")
    scene.add_object("/floor", floor, scene.add_material("/floor", fz.StandardMaterial(roughness=1.0)), np.eye(4))
    for light in lights:
        scene.add_light(light)
    down = np.eye(4)
    down[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    down[3, 1] = 0.9  # under the lights, which the camera does not see
    scene.camera = fz.Camera(matrix=down, focal_length=18)
    films = [fz.render(scene, resolution=(32, 18), samples=samples, max_bounces=0, seed=seed) for seed in range(8)]
    light = np.stack([film["diffuse"] @ WEIGHTS for film in films])
    return float(np.sqrt(light.var(axis=0, ddof=1).mean() * samples) / light.mean())


def through_a_window(portals: list[np.ndarray]) -> float:
    """Relative RMS of what 64 samples of a uniform dome give a floor under a roof with a window of 0.4 x 0.6 m."""
    s, x, z = 50.0, 0.2, 0.3
    walls = [(-s, -x, -s, s), (x, s, -s, s), (-x, x, -s, -z), (-x, x, z, s)]
    corners = np.float32([[a, 1.5, b] for x0, x1, z0, z1 in walls for a, b in ((x0, z0), (x1, z0), (x1, z1), (x0, z1))])
    faces = np.int32([[4 * i, 4 * i + k, 4 * i + k + 1] for i in range(4) for k in (1, 2)])
    roof = fz.RayScene([fz.Mesh(corners, faces)])
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 10), [0.0], np.linspace(-1, 1, 10)), -1).reshape(-1, 3)
    places = SimpleNamespace(positions=grid.astype(np.float32), normals=np.tile(np.float32([0, 1, 0]), (100, 1)))

    def bake(portals, samples):
        dome = fz.Light(fz.DomeLight(None, "/sky", portals), path="/sky")
        return fz.bake_irradiance(places, roof, [dome], eta=1.0, samples=samples)[:, 0, 1]

    truth = bake([WINDOW], 1 << 14)
    return float(np.sqrt(np.mean((bake(portals, 64) - truth) ** 2)) / truth.mean())


WINDOW = np.array([[0.4, 0, 0, 0], [0, 0, -0.6, 0], [0, 1, 0, 0], [0, 1.5, 0, 1.0]])  # -z looks down


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=6000)
    parser.add_argument("--million", action="store_true", help="bake a million points instead of 50,000")
    options = parser.parse_args()
    positions, triangles = knot()
    scene = core.RayScene([core.Mesh(positions, triangles)])
    low, high = positions.min(axis=0), positions.max(axis=0)
    sets = lights_about((low + high) / 2, float(np.linalg.norm(high - low)))
    points = scatter(positions, triangles, options.points)

    print(f"{'measured':58} {'figure':>10} {'bar':>8}")

    def say(what: str, figure: float, unit: str, bar: float | None = None, at_least: bool = False) -> None:
        met = "" if bar is None else "met" if (figure >= bar) == at_least else "MISSED"
        limit = "" if bar is None else f"{'>=' if at_least else '<='} {bar:g}"
        print(f"{what:58} {figure:8.3g} {unit:2}{limit:>8} {met}", flush=True)

    for name in ("sky image", "sky image of 4096", "dome + rect + sphere"):
        speeds = {True: [], False: []}
        for bare in (True, False) * 5:
            rays, seconds = core.measure_bake(points, scene, sets[name], 64, bare)
            speeds[bare].append(rays / seconds)
        say(f"bake over bare Embree: {name}", max(speeds[False]) / max(speeds[True]), "", 0.6, at_least=True)

    lit = sets["dome + rect + sphere"]
    count = 1_000_000 if options.million else 50_000
    many = scatter(positions, triangles, count)
    start = time.process_time()
    core.bake_irradiance(many, scene, lit, samples=128)
    seconds = (time.process_time() - start) * 1e6 / count
    say(f"a million points, 128 samples ({count} baked)", seconds, "s")
    say("their noise", 100 * relative_noise(points, scene, lit, 128), "%", 2.0)

    ten, thousands = noise_of_one_sample(swarm(10)), noise_of_one_sample(swarm(10_000))
    say("noise of 10,000 lights over that of ten", thousands / ten, "x", 3.0)
    say("noise through a window, with a portal over without", through_a_window([WINDOW]) / through_a_window([]), "")


if __name__ == "__main__":
    main()
