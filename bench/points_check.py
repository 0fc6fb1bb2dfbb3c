"""Check from outside that points keep what poisson_points promises, on any mesh, by scipy's k-d tree.

    python bench/points_check.py MESH [MESH ...] --count 100000 --samples 2000000

Takes two million random places on each mesh and asks: are two points on the same side nearer than the spacing; is any
place farther than the spacing from the nearest point on its side; are all areas those counted by the places; do they
sum to the mesh's; are 1 and 2 threads the same to the bit. With and without the walls of thin sheets told apart. Exit
status 1 where anything is broken.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import frazil as fz
from frazil.mesh_io import read_mesh

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "python"))
from point_checks import nearest_pair, nearest_points, sample_surface  # noqa: E402

CHUNK = 200_000  # places at once, for memory


def check(mesh: fz.Mesh, count: int, samples: int, thin_walls: bool) -> tuple[dict, list[str]]:
    """What was measured, and what of it is broken."""
    spacing = fz.poisson_points(mesh, count=count).spacing
    start = time.process_time()
    points = fz.poisson_points(mesh, spacing, thin_walls=thin_walls, threads=2)
    seconds = time.process_time() - start
    alone = fz.poisson_points(mesh, spacing, thin_walls=thin_walls, threads=1)
    names = ("positions", "normals", "areas", "triangles", "barycentrics")
    is_same = all(getattr(points, name).tobytes() == getattr(alone, name).tobytes() for name in names)
    nearest, _ = nearest_pair(points, thin_walls, 1.2 * spacing)
    gap, counted = 0.0, np.zeros(len(points))
    for chunk in range(0, samples, CHUNK):
        places, _, normals, area, _, _ = sample_surface(
            mesh.positions, mesh.triangles, min(CHUNK, samples - chunk), seed=1 + chunk
        )
        distance, owner = nearest_points(points, places, normals, thin_walls, 1.5 * spacing)
        gap = max(gap, distance.max())
        counted += np.bincount(owner[owner >= 0], minlength=len(points))
    areas = points.areas.astype(np.float64)
    expected = areas / area * samples
    score = (counted - expected) / np.sqrt(np.maximum(expected, 1))
    # Positions are floats: places far from the origin are only so exact.
    rounding = np.abs(mesh.positions).max() * 1.2e-7 / spacing
    result = {
        "points": len(points),
        "nearest": nearest / spacing,
        "gap": gap / spacing,
        "area": areas.sum() / area - 1,
        "deviation": float(np.sqrt(np.mean(score**2))),
        "worst": float(np.abs(score).max()),
        "same": is_same,
        "seconds": seconds,
    }
    rules = {
        "two points are nearer than the spacing": nearest >= spacing,
        "a gap is wider than the spacing": gap <= spacing * (1 + 1e-6 + rounding),
        "areas do not sum to the mesh's": abs(result["area"]) < 1e-4,
        "areas are not those of the nearest surface": result["deviation"] < 1.1 and result["worst"] < 8,
        "the number of threads changes bits": is_same,
    }
    return result, [rule for rule, holds in rules.items() if not holds]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="+")
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--samples", type=int, default=2_000_000)
    options = parser.parse_args()
    print("mesh                     walls      points   nearest       gap      area    dev  worst same  s")
    is_broken = False
    for path in options.meshes:
        mesh = read_mesh(path)
        for thin_walls in (True, False):
            got, broken = check(mesh, options.count, options.samples, thin_walls)
            print(
                f"{path.name[:24]:<24} {'both' if thin_walls else 'strict':<7} {got['points']:9,} "
                f"{got['nearest']:9.6f} {got['gap']:9.6f} {got['area']:9.1e} {got['deviation']:6.3f} "
                f"{got['worst']:6.2f} {got['same']!s:<5} {got['seconds']:.2f}",
                flush=True,
            )
            for rule in broken:
                print(f"{path}: {rule}")
            is_broken |= bool(broken)
    sys.exit(is_broken)


if __name__ == "__main__":
    main()
