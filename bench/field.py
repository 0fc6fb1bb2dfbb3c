"""Memory of a field of instances: the peak of a render, less the scene, over its points in effect.

    python examples/ice_field.py -o out/ice_field.usdc --count 500
    python bench/field.py out/ice_field.usdc [--spacing 0.005] [--bake-samples 8] [--bounces 4]

The peak is the operating system's (ru_maxrss). Rays of the bake grow with the points in effect: 88 million with two
bake samples and one bounce take some 1,400 s of processor time.
"""

from __future__ import annotations

import argparse
import resource
import time
from pathlib import Path

import frazil as fz


def peak_bytes() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--spacing", type=float, default=0.0, help="metres; 0 = from the material")
    parser.add_argument("--bake-samples", type=int, default=8)
    parser.add_argument("--bounces", type=int, default=4)
    options = parser.parse_args()
    scene = fz.load_usd(options.scene)
    # A render of few points takes all that does not depend on them: meshes, rays, film.
    settings = dict(resolution=(64, 36), samples=1, bake_samples=options.bake_samples, bake_bounces=options.bounces)
    fz.render(scene, spacing=1.0, **settings)
    before, clock = peak_bytes(), time.process_time()
    film = fz.render(scene, spacing=options.spacing, **settings)
    peak, seconds, points = peak_bytes(), time.process_time() - clock, film.stats["points"]
    print(
        f"{points / 1e6:.2f} M points in effect, {len(scene.lights)} lights: {before / 1e9:.2f} GB before, "
        f"{peak / 1e9:.2f} GB at the peak, {(peak - before) / points:.0f} bytes a point; "
        f"{seconds:.0f} s of processor time ({', '.join(f'{k} {v:.0f}' for k, v in film.stats['seconds'].items())})"
    )


if __name__ == "__main__":
    main()
