"""How fast and how clean the irradiance bake is.

Bare ray tracing is Embree's single-ray occlusion over the very rays that the bake traces, in the same order and
process; all times are processor time, and the ratio bake / bare is that of the least times. Noise is the relative RMS
error of irradiance against 4096 samples per point and light.

    python bench/irradiance.py [MESH] [--points N] [--samples N] [--triangles N]
"""

from __future__ import annotations

import argparse
import time
from types import SimpleNamespace

import numpy as np

from frazil import _frazil as fz


def knot(rings: int = 700, sides: int = 100) -> tuple[np.ndarray, np.ndarray]:
    """A trefoil tube with bumps, 140 k triangles: about as many crevices as an ice formation has."""
    t = np.linspace(0, 2 * np.pi, rings, endpoint=False)[:, None]
    center = np.concatenate([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1)
    tangent = np.roll(center, -1, axis=0) - np.roll(center, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, tangent)
    phi = np.linspace(0, 2 * np.pi, sides, endpoint=False)[None, :]
    radius = 0.5 + 0.08 * np.sin(9 * phi) * np.sin(40 * t)
    positions = center[:, None] + radius[..., None] * (
        np.cos(phi)[..., None] * side[:, None] + np.sin(phi)[..., None] * up[:, None]
    )
    i, j = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    corner = [((i + a) % rings) * sides + (j + b) % sides for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    triangles = np.concatenate([np.stack([corner[0], corner[k], corner[k + 1]], -1).reshape(-1, 3) for k in (1, 2)])
    return positions.reshape(-1, 3).astype(np.float32), triangles.astype(np.int32)


def scatter(positions: np.ndarray, triangles: np.ndarray, count: int) -> SimpleNamespace:
    """Points uniform by area, in random order, with the normals of their triangles."""
    rng = np.random.default_rng(0)
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    cross = np.cross(b - a, c - a)
    double_area = np.linalg.norm(cross, axis=1)
    chosen = rng.choice(len(triangles), size=count, p=double_area / double_area.sum())
    u, v = rng.random((2, count, 1))
    fold = u + v > 1
    u, v = np.where(fold, 1 - u, u), np.where(fold, 1 - v, v)
    points = a[chosen] * (1 - u - v) + b[chosen] * u + c[chosen] * v
    normals = cross[chosen] / double_area[chosen, None]
    return SimpleNamespace(positions=points.astype(np.float32), normals=normals.astype(np.float32))


def lights_about(center: np.ndarray, size: float) -> dict[str, list]:
    """The light sets that are timed, scaled to the mesh."""

    def at(offset: tuple[float, float, float]) -> np.ndarray:
        """A frame at `offset` mesh sizes from the centre whose -z looks at the centre."""
        z = np.asarray(offset) / np.linalg.norm(offset)
        x = np.cross([0.0, 1.0, 0.1], z)
        x /= np.linalg.norm(x)
        matrix = np.eye(4)
        matrix[:3, :3] = [x, np.cross(z, x), z]
        matrix[3, :3] = center + size * np.asarray(offset)
        return matrix

    def sky(height: int) -> fz.Light:
        y, x = np.mgrid[0:height, 0 : 2 * height] / height
        image = np.stack([0.2 + 0.5 * (1 - y)] * 3, axis=-1) * (0.6, 0.8, 1.0)
        image[(x - 1.367) ** 2 + (y - 0.234) ** 2 < 0.0117**2] = (3000, 2700, 2300)
        return fz.Light(fz.DomeLight(np.ascontiguousarray(image, np.float32)), path="/sky")

    dome = fz.Light(fz.DomeLight(), path="/dome")
    image = sky(512)
    rect = fz.Light(fz.RectLight(0.5 * size, 0.3 * size), matrix=at((0.6, 0.7, 0.5)), radiance=[8.0] * 3, path="/rect")
    disk = fz.Light(fz.DiskLight(0.1 * size), matrix=at((-0.6, 0.4, 0.8)), radiance=[30.0] * 3, path="/disk")
    ball = fz.Light(fz.SphereLight(0.1 * size), matrix=at((-0.9, 0.2, -0.3)), radiance=[30.0] * 3, path="/sphere")
    sun = fz.Light(fz.DistantLight(0.53), matrix=at((0.3, 1.0, 0.2)), radiance=[4e4] * 3, path="/sun")
    return {
        "uniform dome": [dome],
        "sky image": [image],
        "sky image of 4096": [sky(2048)],
        "rect": [rect],
        "disk": [disk],
        "sphere": [ball],
        "sun": [sun],
        "dome + rect + sphere": [dome, rect, ball],
        "sky + rect + sphere": [image, rect, ball],
    }


def relative_noise(points: SimpleNamespace, scene, lights: list, samples: int) -> float:
    few = SimpleNamespace(positions=points.positions[:2000], normals=points.normals[:2000])
    truth = fz.bake_irradiance(few, scene, lights, eta=1.0, samples=4096, seed=1)[..., 1].sum(axis=1)
    baked = fz.bake_irradiance(few, scene, lights, eta=1.0, samples=samples)[..., 1].sum(axis=1)
    return float(np.sqrt(np.mean((baked - truth) ** 2)) / np.mean(truth))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", nargs="?", help="any mesh that trimesh reads; default: a bumpy knot")
    parser.add_argument("--points", type=int, default=20_000)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--triangles", type=int, default=140_000, help="of the knot")
    parser.add_argument("--only", help="the one set of lights to run")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--million", action="store_true", help="time 1 M points under a dome and two area lights")
    options = parser.parse_args()
    if options.mesh:
        import trimesh

        loaded = trimesh.load(options.mesh, force="mesh", process=False)
        positions, triangles = np.asarray(loaded.vertices, np.float32), np.asarray(loaded.faces, np.int32)
    else:
        detail = (options.triangles / 140_000) ** 0.5
        positions, triangles = knot(round(700 * detail), round(100 * detail))
    scene = fz.RayScene([fz.Mesh(positions, triangles)])
    points = scatter(positions, triangles, options.points)
    low, high = positions.min(axis=0), positions.max(axis=0)
    sets = lights_about((low + high) / 2, float(np.linalg.norm(high - low)))

    print(f"{len(triangles)} triangles, {options.points} points, {options.samples} samples per point and light")
    print(f"{'lights':22} {'M rays':>7} {'bare M/s':>9} {'bake M/s':>9} {'bake/bare':>9} {'noise %':>8}")
    for name, lights in sets.items():
        if options.only not in (None, name):
            continue
        bare, bake, rays = [], [], 0
        for _ in range(options.repeats):
            rays, seconds = fz.measure_bake(points, scene, lights, options.samples, True)
            bare.append(rays / seconds / 1e6)
            rays, seconds = fz.measure_bake(points, scene, lights, options.samples, False)
            bake.append(rays / seconds / 1e6)
        ratio = max(bake) / max(bare)
        noise = 100 * relative_noise(points, scene, lights, options.samples)
        print(f"{name:22} {rays / 1e6:7.2f} {max(bare):9.2f} {max(bake):9.2f} {ratio:9.2f} {noise:8.2f}")
    if options.million:
        many = scatter(positions, triangles, 1_000_000)
        start, cpu = time.perf_counter(), time.process_time()
        fz.bake_irradiance(many, scene, sets["dome + rect + sphere"], samples=options.samples)
        print(
            f"1 M points, dome + rect + sphere, {options.samples} samples: {time.perf_counter() - start:.1f} s, "
            f"{time.process_time() - cpu:.1f} s of processor time"
        )


if __name__ == "__main__":
    main()
