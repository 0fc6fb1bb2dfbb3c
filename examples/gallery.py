"""Renders the eight formations: EXR and PNG into out/gallery, small PNGs into a folder of the documentation.

python examples/gallery.py [NAME ...] [-o out/gallery] [--docs docs/images/gallery] [--samples 12]
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

import frazil as fz
from frazil.formations import FORMATIONS, make_formation, write_formation

# Seeds that were chosen by looking at a few.
kChosen = {"spire_cluster": {"seed": 0}, "cathedral": {"seed": 0}}


def render(name: str, folder: Path, resolution: tuple[int, int], samples: int) -> Path:
    """Make, write and render one formation; returns its PNG."""
    start = time.process_time()
    made = make_formation(name, **kChosen.get(name, {}))
    stage = folder / f"{name}.usdc"
    write_formation(made, stage)
    scene = fz.load_usd(stage)
    film = fz.render(
        scene,
        resolution=resolution,
        samples=samples,
        shading_samples=max(1, samples // 3),
        spacing_pixels=2.0,
        bake_samples=16,
        max_bounces=3,
        denoise=True,
    )
    film.save(folder / f"{name}.exr")
    film.save_preview(folder / f"{name}.png")
    points, seconds = film.stats["points"], time.process_time() - start
    print(f"{name}: {made.triangle_count} triangles, {points} points, {seconds:.0f} s of processor time", flush=True)
    return folder / f"{name}.png"


def save_small(source: Path, target: Path) -> None:
    """A copy with 6 bits a channel, which PNG packs to a third."""
    pixels = oiio.ImageBuf(str(source)).get_pixels(oiio.UINT8)[..., :3]
    pixels = (pixels.astype(np.uint16) + 2) // 4 * 4
    image = oiio.ImageBuf(np.ascontiguousarray(np.minimum(pixels, 255).astype(np.uint8)))
    image.specmod().attribute("png:compressionLevel", 9)
    if not image.write(str(target)):
        raise OSError(f"{target}: cannot be written: {image.geterror()}")


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(FORMATIONS), metavar="NAME", help="formations; all by default")
    parser.add_argument("-o", "--output", type=Path, default=Path("out/gallery"), help="folder of scenes and pictures")
    parser.add_argument("--docs", type=Path, help="folder of the small PNGs")
    parser.add_argument("--resolution", default="480x270", help="WxH pixels")
    parser.add_argument("--samples", type=int, default=12, help="per pixel; a third of them are shaded")
    options = parser.parse_args(arguments)
    width, height = map(int, options.resolution.split("x"))
    options.output.mkdir(parents=True, exist_ok=True)
    try:
        for name in options.names:
            picture = render(name, options.output, (width, height), options.samples)
            if options.docs:
                options.docs.mkdir(parents=True, exist_ok=True)
                save_small(picture, options.docs / f"{name}.png")
    except (OSError, ValueError, KeyError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
