"""Pictures of grading and layers: one render of a block of ice, and what is made of it without another ray.

    python examples/grading.py [-o out/grading] [--size 180] [--samples 48]

Writes `block.exr` with all layers; `grading.png`, one recipe a tile; `layers.png`, one layer a tile. The tiles' names
are printed in the order in which they lie.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import frazil as fz
from frazil.formations.contour import contour
from frazil.image import write_png
from ice_looks import Block, frame, lifted, set_scene, to_mesh
from scenery import Rock

kRamp = {"ramp_distances": [0.0, 0.1, 0.4], "ramp_colors": [(1, 1, 1), (1, 1, 1), (1, 1, 1)]}
kLayers = ["translucency_ramp", "compensation_off", "overlay", "crypto_object", "uv"]

kExposure = 0.7  # of the tiles: the sunlit snow is bright

kRecipes = {
    "as rendered": {},
    "dusk: sun down, rim up": {
        "lights": {
            "sun": {"intensity": 0.25, "color": [1.0, 0.55, 0.3]},
            "sky": {"intensity": 0.6, "color": [0.75, 0.85, 1.0]},
            "rim": {"intensity": 2.5},
        }
    },
    "ramp: blue where light comes from afar": {
        "ramp": {"colors": [[1.0, 1.0, 1.0], [0.45, 0.8, 1.0], [0.05, 0.3, 0.9]]}
    },
    "without compensation": {"compensation": {"strength": 0.0}},
    "fresh: cracks and frost young": {"overlays": {"age": 0.3}},
    "frost taken off": {"overlays": {"frost": {"opacity": 0.0}}},
    "stone graded through its matte": {
        "mattes": {"stone": {"objects": ["/stone*"], "exposure": 1.2, "temperature": 4200.0, "saturation": 1.6}}
    },
    "translucency alone": {
        "components": {name: {"intensity": 0.0} for name in ("diffuse", "specular", "refraction", "background")}
    },
}
kShown = [
    "translucency", "specular", "refraction", "diffuse", "translucency_sun", "translucency_sky", "translucency_rim",
    "translucency_ramp0", "translucency_ramp1", "translucency_ramp2", "compensation_off", "albedo",
]  # fmt: skip


def scene() -> fz.Scene:
    """A block of ice with cracks and frost, a stone before it, on snow; sun, sky and a warm rim light."""
    made = set_scene((1.35, 0.95, 2.75), (0.0, 0.44, 0.0), 58.0, has_groups=True)
    block = Block((0.95, 1.1, 0.7), 4)
    ice = fz.ice_preset("arctic_blue", age=0.9, depth=8.0, spacing=0.02, **kRamp)
    mesh = to_mesh(contour(block, *block.bounds(), 0.02).largest_piece())
    made.add_object("/ice", made.add_mesh(mesh, "/ice"), made.add_material("/ice", ice), lifted(0.47))
    rock = Rock((0.62, 0.08, 0.62), (0.2, 0.16, 0.17), 7)
    stone = made.add_material("/stone", fz.StandardMaterial(diffuse_color=(0.16, 0.13, 0.11), roughness=0.6))
    surface = contour(rock, *rock.bounds(), 0.015).largest_piece()
    made.add_object("/stone", made.add_mesh(to_mesh(surface), "/stone"), stone)
    rim = frame((-1.6, 1.2, -1.2), (0.0, 0.5, 0.0))
    made.add_light(fz.Light(fz.RectLight(0.8, 0.8), radiance=(9.0, 4.5, 1.8), matrix=rim, path="/rim", group="rim"))
    return made


def tiles(pictures: list[np.ndarray], columns: int) -> np.ndarray:
    rows = [np.concatenate(pictures[i : i + columns], axis=1) for i in range(0, len(pictures), columns)]
    return np.ascontiguousarray(kExposure * np.concatenate(rows, axis=0))


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out/grading"), help="the folder to write into")
    parser.add_argument("--size", type=int, default=180, help="pixels along a side of one picture")
    parser.add_argument("--samples", type=int, default=48, help="per pixel")
    options = parser.parse_args(arguments)
    options.output.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    film = fz.render(scene(), resolution=(options.size, options.size), samples=options.samples, aovs=kLayers)
    film.save(options.output / "block.exr", "zip")
    print(f"rendered in {time.monotonic() - start:.1f} s, {len(film)} layers")

    start = time.monotonic()
    graded = [fz.grade(film, recipe)["beauty"][:, :, :3] for recipe in kRecipes.values()]
    print(f"{len(graded)} recipes in {time.monotonic() - start:.2f} s: {'; '.join(kRecipes)}")
    write_png(options.output / "grading.png", tiles(graded, 4))
    write_png(options.output / "layers.png", tiles([film[name] for name in kShown], 4))
    print(f"layers: {'; '.join(kShown)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
