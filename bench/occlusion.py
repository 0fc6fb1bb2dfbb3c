"""Occlusion from points alone against occlusion by rays: error and speed.

    python bench/occlusion.py [--spacing S]

The truth is 4096 rays a point. Times are CPU seconds.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import frazil as fz
from irradiance import knot


def timed(work):
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacing", type=float, default=0.06)
    options = parser.parse_args()
    mesh = fz.Mesh(*knot())
    scene, points = fz.RayScene([mesh]), fz.poisson_points(mesh, options.spacing)
    truth, _ = fz.bake_occlusion(points, scene, samples=4096, seed=1)
    ways = {f"{n} rays": (lambda n=n: fz.bake_occlusion(points, scene, samples=n)) for n in (16, 64, 256)}
    ways |= {f"points, {t} sr": (lambda t=t: fz.point_occlusion(points, tolerance=t)) for t in (0.2, 0.05, 0.01)}
    print(f"{len(points.positions)} points, mean openness {truth.mean():.3f}")
    print(f"{'':14} {'CPU s':>7} {'RMS error':>10} {'mean error':>11}")
    for name, work in ways.items():
        (openness, _), seconds = timed(work)
        error = openness - truth
        print(f"{name:14} {seconds:7.2f} {np.sqrt(np.mean(error**2)):10.4f} {error.mean():11.4f}")


if __name__ == "__main__":
    main()
