"""Writes the example scene: glacier spires on a block of ice, two rocks, snow, a cold sky and a warm light behind.

    python examples/glacier.py -o out/glacier.usda [--detail 0.75] [--seed 3]

Beside the stage lie its meshes (glacier_meshes.usdc), the sky (glacier_sky.exr) and two look-up images for the ice. A
stage that is there already for the same detail, seed and scripts is left as it is.
"""

import argparse
import hashlib
import sys
import time
from pathlib import Path

import numpy as np

from frazil.formations.contour import contour, corner_normals
from frazil.formations.sky import make_sky, write_image
from ice_body import IceBody, kLower, kUpper
from scenery import Rock, Snow, make_snowfield
from stage import SceneWriter

kSun = np.array([-0.90, 0.38, -0.42])  # where the sun stands
kCell = 0.018  # metres between grid points at detail 1


def build(path: Path, detail: float, seed: int) -> None:
    """Write the stage and the files that it refers to."""
    cell = kCell / detail
    ice = IceBody(seed)
    writer = SceneWriter(path)

    surface = contour(ice, kLower, kUpper, cell).largest_piece()
    surface.sharpen(ice.tips, 4.0 * cell)
    normals = corner_normals(surface)
    vertex_normals = surface.vertex_normals()
    frost = ice.frost(surface.positions, vertex_normals)
    writer.add_mesh("Ice", surface, normals, st=np.stack([frost, ice.layer(surface.positions)], 1))

    snow = Snow(ice)
    drifts = contour(snow, *snow.bounds(), max(1.7 * cell, 0.02)).largest_piece()
    writer.add_mesh("Snow", drifts, corner_normals(drifts, 80.0))
    for name, center, size in (("RockLeft", (-1.52, 0.34, 0.80), (0.36, 0.30, 0.30)),
                               ("RockRight", (2.02, 0.16, 0.92), (0.42, 0.34, 0.36))):  # fmt: skip
        rock = Rock(center, size, seed + len(name))
        stone = contour(rock, *rock.bounds(), cell)
        writer.add_mesh(
            name, stone, corner_normals(stone, 30.0), color=rock.color(stone.positions, stone.vertex_normals())
        )
    field = make_snowfield(ice, 60.0, max(20, int(150 * detail)), seed)
    writer.add_mesh("Snowfield", field, corner_normals(field, 80.0))

    width = int(np.clip(1280 * detail, 256, 4096)) // 2 * 2
    write_image(path.with_name(path.stem + "_sky.exr"), make_sky(width, kSun, seed))
    writer.write(kSun, stamp(detail, seed))


def stamp(detail: float, seed: int) -> str:
    """What a stage was made from: its settings and the text of these scripts."""
    text = hashlib.sha256(f"{detail} {seed}".encode())
    for script in sorted(Path(__file__).parent.glob("*.py")):
        text.update(script.read_bytes())
    return text.hexdigest()[:16]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/glacier.usda"), help="the stage to write")
    parser.add_argument("--detail", type=float, default=0.75, help="finer meshes above 1, coarser below (0.05 .. 4)")
    parser.add_argument("--seed", type=int, default=3, help="another number, another glacier")
    options = parser.parse_args(arguments)
    if options.output.suffix != ".usda":
        parser.error(f"--output must end in .usda, got {options.output}.")
    if not 0.05 <= options.detail <= 4.0:
        parser.error(f"--detail must be in 0.05..4, got {options.detail}.")
    if options.seed < 0:
        parser.error(f"--seed must be >= 0, got {options.seed}.")
    if SceneWriter.stamp_of(options.output) == stamp(options.detail, options.seed):
        print(f"{options.output} is up to date.")
        return 0
    start = time.monotonic()
    try:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        build(options.output, options.detail, options.seed)
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{options.output} written in {time.monotonic() - start:.1f} s.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
