"""Time and error of gathers on a mesh: points, tree build, gathers a second at a stated error, by N and light groups.

    python bench/gather.py MESH [--points 1000000] [--shading 1000000] [--groups 1 8] [--tolerance 0.01]

Errors are against PointTree.gather_exact, the sum over every point in double precision, at --check shading points.
Times are the best of three; `cpu` is processor time over threads, which other work on the machine disturbs less.
"""

from __future__ import annotations

import argparse
import os
import time

import numpy as np
import trimesh

import frazil as fz


class Points:
    """Random points with equal areas: enough to time a sum over points."""

    def __init__(self, mesh: trimesh.Trimesh, count: int, seed: int):
        rng = np.random.default_rng(seed)
        u = (rng.permutation(count) + rng.random(count)) / count  # stratified over area
        cumulative = np.cumsum(mesh.area_faces)
        face = np.minimum(np.searchsorted(cumulative, u * cumulative[-1]), len(mesh.faces) - 1)
        a, b = np.sqrt(rng.random(count))[:, None], rng.random(count)[:, None]
        v = mesh.triangles[face]
        self.positions = ((1 - a) * v[:, 0] + a * (1 - b) * v[:, 1] + a * b * v[:, 2]).astype(np.float32)
        self.normals = mesh.face_normals[face].astype(np.float32)
        self.areas = np.full(count, mesh.area / count, np.float32)
        self.spacing = float(np.sqrt(mesh.area / count))


def irradiance(points: Points, groups: int) -> np.ndarray:
    """A sun per group with a hard edge, over a weak sky."""
    rng = np.random.default_rng(7)
    out = np.empty((len(points.areas), groups, 3), np.float32)
    for g in range(groups):
        toward = rng.normal(size=3)
        toward /= np.linalg.norm(toward)
        sun = np.maximum(0.0, points.normals @ toward)[:, None] * [3.0, 2.7, 2.2]
        out[:, g] = sun + (0.2 if g == 0 else 0.0)
    return out


def clocked(work):
    best = None
    for _ in range(3):
        wall, cpu = time.perf_counter(), time.process_time()
        result = work()
        wall, cpu = time.perf_counter() - wall, (time.process_time() - cpu) / os.cpu_count()
        best = (wall, cpu) if best is None else (min(best[0], wall), min(best[1], cpu))
    return result, *best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh")
    parser.add_argument("--points", type=int, nargs="+", default=[1_000_000])
    parser.add_argument("--shading", type=int, default=1_000_000)
    parser.add_argument("--groups", type=int, nargs="+", default=[1, 8])
    parser.add_argument("--tolerance", type=float, nargs="+", default=[0.01])
    parser.add_argument("--estimator", nargs="+", default=["sum", "noise_free"])
    parser.add_argument("--profile", default="Dipole", help="Dipole, MultipleScattering, ... (default Dipole)")
    parser.add_argument("--check", type=int, default=100)
    options = parser.parse_args()

    mesh = trimesh.load(options.mesh, force="mesh")
    profile = getattr(fz, options.profile)(fz.Medium(sigma_s_prime=30.0, sigma_a=(0.6, 0.15, 0.05), eta=1.0))
    shading = Points(mesh, options.shading, seed=2).positions
    checked = slice(None, None, max(1, len(shading) // options.check))
    for count in options.points:
        points = Points(mesh, count, seed=1)
        for groups in options.groups:
            report(points, irradiance(points, groups), profile, shading, checked, options)


def report(points, light, profile, shading, checked, options) -> None:
    tree, wall, cpu = clocked(lambda: fz.PointTree(points, light, profile))
    million = len(points.areas) / 1e6
    print(f"{million:g} M points, G={light.shape[1]}: built {million / wall:.2f} M/s wall, {million / cpu:.2f} cpu")
    for estimator in options.estimator:
        exact = tree.gather_exact(shading[checked], "sum")
        for tolerance in options.tolerance:
            # The checked points are gathered in their usual neighbourhood, not alone.
            out, wall, cpu = clocked(lambda e=estimator, t=tolerance: tree.gather(shading, t, e))
            million = len(shading) / 1e6
            line = f"  {estimator} at {tolerance:g}: {million / wall:.3f} M/s wall, {million / cpu:.3f} cpu"
            for name in ("exitance", "coverage"):
                truth = getattr(exact, name)
                error = 100 * (getattr(out, name)[checked] / np.where(truth > 0, truth, 1) - 1)
                rms, worst = np.sqrt((error**2).mean()), np.abs(error).max()
                line += f"; {name} % RMS {rms:.3f} worst {worst:.2f} mean {error.mean():+.3f}"
            print(line, flush=True)


if __name__ == "__main__":
    main()
