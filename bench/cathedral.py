"""What the cathedral takes: a hall of ice where every path sees ice, 1920 x 1080 with a million points.

    python bench/cathedral.py [--aovs all] [--part 6] [--samples 64] [--shading-samples 8] [--work out]

Prints wall time and processor time of each whole command, its stages, rays and peak memory. `--aovs all` renders every
layer of the table, not only those that are made unasked (a matte of the rocks stands for mattes). `--part 6` renders a
sixth of the picture's width and height, left of its middle, at the same size of pixels: what a path takes there is near
to what it takes in the whole picture. Scene and pictures are kept in `--work`; a scene that is there is taken as it is.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import time
from pathlib import Path

from frazil.aovs import aov_table

SPACING_SCALE = 0.44  # 1.1 million points
PART = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
    defaultPrim = "World"
    subLayers = [@{scene}@]
)
over "World"
{{
    over "Camera"
    {{
        float horizontalAperture = {width}
        float verticalAperture = {height}
        float horizontalApertureOffset = -4
        float verticalApertureOffset = -3
    }}
}}
"""
APERTURE = (36.0, 20.25)  # of the formation's camera, mm


def run(*command: str) -> tuple[float, float]:
    """Wall seconds and processor seconds of a command."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--aovs", choices=("default", "all"), default="default")
    parser.add_argument("--part", type=int, default=1)
    parser.add_argument("--resolution", default="1920x1080")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--shading-samples", type=int, default=8)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--work", type=Path, default=Path("out"))
    options = parser.parse_args()

    options.work.mkdir(parents=True, exist_ok=True)
    scene = (options.work / "cathedral.usd").resolve()
    if not scene.exists():
        run("frazil", "formation", "cathedral", "-o", str(scene))
    width, height = (int(size) // options.part for size in options.resolution.split("x"))
    if options.part > 1:
        part = options.work / f"cathedral_part{options.part}.usda"
        part.write_text(PART.format(scene=scene, width=APERTURE[0] / options.part, height=APERTURE[1] / options.part))
        scene = part
    picture, stats = options.work / "cathedral.exr", options.work / "cathedral.json"
    layers = []
    if options.aovs == "all":
        # Mattes are named beside the table's other rows.
        names = [row["name"] for row in aov_table() if "matte" not in row["name"]]
        layers = ["--aov", ",".join(names), "--matte", "rocks=/World/cathedral/Rock1,/World/cathedral/Rock2"]
    wall, processor = run(
        *("frazil", "render", str(scene), "-o", str(picture), "--resolution", f"{width}x{height}"),
        *("--samples", str(options.samples), "--shading-samples", str(options.shading_samples), "--denoise"),
        *("--spacing-scale", str(SPACING_SCALE), "--threads", str(options.threads)),
        *("--progress", "none", "--quiet", "--stats", str(stats), *layers),
    )
    frame = json.loads(stats.read_text())["frames"][0]
    paths = frame["camera_rays"]
    print(f"{width} x {height}, {options.samples} samples, {frame['points']:,} points: {wall:.1f} s wall,", end=" ")
    print(f"{processor:.1f} s of processors, {frame['peak_memory'] / 1e9:.2f} GB at the peak")
    print(f"{paths:,} camera rays, {frame['other_rays'] / paths:.2f} further rays and", end=" ")
    print(f"{frame['gathers'] / paths:.4f} gathers for each")
    for stage, seconds in sorted(frame["seconds"].items(), key=lambda item: -item[1]):
        print(f"  {stage:10s} {seconds:7.1f} s")


if __name__ == "__main__":
    main()
