"""Pictures of the ice material: presets at three ages, rocks at three depths, and breath ice with its volume.

    python examples/ice_looks.py sheet -o out/ice_sheet.png [--size 160] [--samples 48]
    python examples/ice_looks.py depths -o out/ice_depths.png
    python examples/ice_looks.py breath -o out/ice_breath.png

The scenes are made in Python, without USD: a broken block of ice on snow under a cold sky and a low sun.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import frazil as fz
from frazil.formations.contour import Surface, contour, corner_normals
from frazil.formations.sky import make_sky
from frazil.ice import ICE_PRESETS
from frazil.image import write_png
from scenery import Rock

kSun = np.array([-0.75, 0.42, -0.55])  # behind the ice, to the left
kAges = (0.0, 0.5, 1.0)


class Block:
    """A field of a sawn and broken block of ice: a box with bevelled, slightly hollow faces."""

    def __init__(self, size, seed: int):
        self._half = np.asarray(size, float) / 2
        self._rock = Rock((0, 0, 0), 1.32 * self._half, seed)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        box = (np.abs(points) - self._half).max(1)
        return np.maximum(box, self._rock(points))

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return -self._half - 0.06, self._half + 0.06


def to_mesh(surface: Surface, crease: float = 30.0) -> fz.Mesh:
    normals = corner_normals(surface, crease).astype(np.float32)
    return fz.Mesh(
        surface.positions.astype(np.float32),
        surface.triangles.astype(np.int32),
        normals=normals.reshape(-1, 3),
    )


def frame(at, to) -> np.ndarray:
    """A camera or light at `at` that looks at `to`: (4, 4) for row vectors."""
    z = np.asarray(at, float) - to
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[0, :3], matrix[1, :3], matrix[2, :3], matrix[3, :3] = x, np.cross(z, x), z, at
    return matrix


def set_scene(eye, to, focal_length: float = 50.0) -> fz.Scene:
    """Snow, sky and sun."""
    scene = fz.Scene()
    ground = fz.Mesh(
        np.array([[-40, 0, 40], [40, 0, 40], [40, 0, -40], [-40, 0, -40]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    )
    snow = fz.StandardMaterial(diffuse_color=(0.82, 0.86, 0.91), roughness=0.7, ior=1.31)
    scene.add_object("/snow", scene.add_mesh(ground, "/snow"), scene.add_material("/snow", snow))
    sky = make_sky(512, kSun, 5)
    scene.add_light(fz.Light(fz.DomeLight(sky), radiance=(0.75, 0.75, 0.75), path="/sky", group="sky"))
    scene.add_light(
        fz.Light(
            fz.DistantLight(2.5),
            radiance=(3.4, 2.9, 2.3),
            normalize=True,
            matrix=frame(kSun, (0, 0, 0)),
            path="/sun",
            group="sun",
        )
    )
    scene.camera = fz.Camera(
        matrix=frame(eye, to), focal_length=focal_length, horizontal_aperture=36, vertical_aperture=36
    )
    return scene


def lifted(height: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[3, 1] = height
    return matrix


def picture(scene: fz.Scene, width: int, height: int, samples: int) -> np.ndarray:
    return fz.render(scene, resolution=(width, height), samples=samples)["beauty"][..., :3]


def sheet(size: int, samples: int) -> np.ndarray:
    """Presets from top to bottom, ages from left to right."""
    block = Block((0.95, 1.05, 0.7), 4)
    mesh = to_mesh(contour(block, *block.bounds(), 0.022).largest_piece())
    rows = []
    for name in ICE_PRESETS:
        row = []
        for age in kAges:
            scene = set_scene((1.4, 0.85, 2.6), (0.02, 0.44, 0.0), 78.0)
            material = scene.add_material("/ice", fz.ice_preset(name, age=age, spacing=0.02))
            scene.add_object("/ice", scene.add_mesh(mesh, "/ice"), material, lifted(0.44))
            row.append(picture(scene, size, size, samples))
        rows.append(np.concatenate(row, 1))
    return np.concatenate(rows, 0)


def depths(size: int, samples: int) -> np.ndarray:
    """Three like stones, 5, 25 and 50 cm behind the front of a block of arctic blue ice."""
    scene = set_scene((0.35, 0.75, 3.4), (0.0, 0.42, 0.0), 62.0)
    block = Block((2.0, 1.0, 1.1), 4)
    mesh = to_mesh(contour(block, *block.bounds(), 0.025).largest_piece())
    ice = scene.add_material("/ice", fz.ice_preset("arctic_blue", age=0.12, roughness=0.04, refraction_roughness=0.05))
    scene.add_object("/ice", scene.add_mesh(mesh, "/ice"), ice, lifted(0.46))
    stone = scene.add_material("/stone", fz.StandardMaterial(diffuse_color=(0.16, 0.13, 0.11), roughness=0.6))
    for number, (x, depth) in enumerate(((-0.52, 0.05), (0.0, 0.25), (0.52, 0.5))):
        rock = Rock((x, 0.42, 0.5 - depth - 0.13), (0.15, 0.13, 0.13), 7)
        surface = contour(rock, *rock.bounds(), 0.014).largest_piece()
        scene.add_object(f"/stone{number}", scene.add_mesh(to_mesh(surface), "/stone"), stone)
    return picture(scene, 2 * size, size, samples)


def breath(size: int, samples: int) -> np.ndarray:
    """Fresh breath ice: without and with the light that it scatters once."""
    block = Block((0.95, 1.05, 0.7), 6)
    mesh = to_mesh(contour(block, *block.bounds(), 0.022).largest_piece())
    pictures = []
    for volume in (0.0, 1.0):
        scene = set_scene((1.4, 0.85, 2.6), (0.02, 0.44, 0.0), 78.0)
        material = scene.add_material("/ice", fz.ice_preset("fresh_breath", age=0.35, spacing=0.02, volume=volume))
        scene.add_object("/ice", scene.add_mesh(mesh, "/ice"), material, lifted(0.44))
        pictures.append(picture(scene, size, size, samples))
    return np.concatenate(pictures, 1)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("sheet", "depths", "breath"))
    parser.add_argument("-o", "--output", type=Path, required=True, help="the PNG to write")
    parser.add_argument("--size", type=int, default=160, help="pixels along a side of one picture")
    parser.add_argument("--samples", type=int, default=48, help="per pixel")
    options = parser.parse_args(arguments)
    start = time.monotonic()
    pixels = {"sheet": sheet, "depths": depths, "breath": breath}[options.what](options.size, options.samples)
    try:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        write_png(options.output, np.ascontiguousarray(pixels))
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{options.output} rendered in {time.monotonic() - start:.1f} s.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
