"""Pictures of the ice material: presets at ages, rocks at three depths, breath ice, shells that run into each other.

    python examples/ice_looks.py sheet -o out/ice_sheet.png [--size 150] [--samples 16]
    python examples/ice_looks.py depths -o out/ice_depths.png
    python examples/ice_looks.py breath -o out/ice_breath.png
    python examples/ice_looks.py shells -o out/ice_shells.png

The scenes are made in Python, without USD: a piece of ice on dark rock under a cold sky, a low sun to the left. Of a
pixel's samples a third are shaded; pictures are denoised. Prints processor time.
"""

import argparse
import functools
import sys
import time
from pathlib import Path

import numpy as np

import frazil as fz
from frazil.formations.contour import Surface, contour, corner_normals
from frazil.formations.noise import Noise
from frazil.formations.sky import make_sky
from frazil.ice import ICE_PRESETS
from frazil.image import write_png
from gallery import save_small
from scenery import Rock

kSun = np.array([-0.85, 0.45, -0.05])  # to the left: it rakes over the face and shines through the edges
kSkyLight, kSunlight = 0.65, (7.5, 6.9, 6.1)
kRock = fz.StandardMaterial(diffuse_color=(0.07, 0.08, 0.10), roughness=1.0, ior=1.0)
kAges = (0.0, 0.5, 1.0)
kDepth = 8.0  # metres of ice that a block of one metre shows in colour


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


class Shard:
    """A field of a splinter of ice: nine walls that lean together, broken off aslant."""

    kTaper = 0.85

    def __init__(self, size, seed: int):
        self._half = np.asarray(size, float) / 2
        rng = np.random.default_rng(seed)
        self._walls = rng.normal(size=(9, 3))[:, ::2]
        self._walls /= np.linalg.norm(self._walls, axis=1, keepdims=True)
        self._reach = rng.uniform(0.55, 0.9, 9)
        self._noise = Noise(seed)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        height = np.clip(points[:, 1] / self._half[1] * 0.5 + 0.5, -0.1, 1.3)
        width = np.maximum(1.0 - self.kTaper * height, 0.05)
        x = (points[:, 0] - 0.25 * (height - 0.3)) / (0.25 + 0.75 * width)
        across = np.stack([x, points[:, 2] / width], 1) / self._half[[0, 2]]
        across += 0.06 * self._noise.vector(points, 0.4, 0)[:, [0, 2]]
        d = np.abs(points[:, 1]) - self._half[1]
        for wall, reach in zip(self._walls, self._reach, strict=True):
            d = np.maximum(d, (across @ wall - reach) * self._half.min() * width)
        d = np.maximum(d, 0.9 * (points @ [0.35, 0.9, 0.1] - 0.72 * self._half[1]))
        return 0.7 * d + 0.008 * self._noise.fractal(points, 0.15, 3, 5, 0.6)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return -self._half - 0.15, self._half + 0.15


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


@functools.cache
def sky_image(sun: tuple[float, float, float]) -> np.ndarray:
    """The sky of one sun, made once for all pictures."""
    return make_sky(1024, np.array(sun), 5)


def set_scene(
    eye, to, focal_length: float = 50.0, sun=kSun, skylight=kSkyLight, sunlight=kSunlight, has_groups: bool = False
):
    """Dark ground, sky and sun; each light is a light group of its own with `has_groups`."""
    scene = fz.Scene()
    plane = fz.Mesh(
        np.array([[-40, 0, 40], [40, 0, 40], [40, 0, -40], [-40, 0, -40]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
    )
    scene.add_object("/ground", scene.add_mesh(plane, "/ground"), scene.add_material("/ground", kRock))
    groups = ("sky", "sun") if has_groups else ("", "")
    scene.add_light(
        fz.Light(fz.DomeLight(sky_image(tuple(sun))), radiance=3 * (skylight,), path="/sky", group=groups[0])
    )
    scene.add_light(
        fz.Light(
            fz.DistantLight(2.5),
            radiance=sunlight,
            normalize=True,
            matrix=frame(sun, (0, 0, 0)),
            path="/sun",
            group=groups[1],
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
    options = {"samples": samples, "shading_samples": max(1, samples // 3)}
    return fz.render(scene, resolution=(width, height), **options, denoise=True)["beauty"][..., :3]


@functools.cache
def shard_mesh(cell: float) -> fz.Mesh:
    """The splinter that the looks are shown on, of triangles of `cell` metres."""
    shard = Shard((1.1, 1.7, 0.7), 9)
    return to_mesh(contour(shard, *shard.bounds(), cell).largest_piece())


def add_shard(scene: fz.Scene, ice: fz.IceMaterial) -> None:
    mesh = scene.add_mesh(shard_mesh(0.02), "/ice")
    scene.add_object("/ice", mesh, scene.add_material("/ice", ice), lifted(0.77))


def sheet(size: int, samples: int) -> np.ndarray:
    """Presets from top to bottom, ages from left to right."""
    rows = []
    for name in ICE_PRESETS:
        row = []
        for age in kAges:
            scene = set_scene((1.4, 0.8, 3.2), (0.0, 0.66, 0.0), 70.0)
            add_shard(scene, fz.ice_preset(name, age=age, depth=kDepth, spacing=0.025))
            row.append(picture(scene, size, size, samples))
        rows.append(np.concatenate(row, 1))
    return np.concatenate(rows, 0)


def depths(size: int, samples: int) -> np.ndarray:
    """Three like stones, 5, 25 and 50 cm behind the front of a block of arctic blue ice."""
    scene = set_scene((0.35, 0.75, 3.4), (0.0, 0.42, 0.0), 62.0)
    block = Block((2.0, 1.0, 1.1), 4)
    mesh = to_mesh(contour(block, *block.bounds(), 0.025).largest_piece())
    ice = scene.add_material(
        "/ice",
        fz.ice_preset("arctic_blue", age=0.12, depth=kDepth, scale=2.0, roughness=0.04, refraction_roughness=0.05),
    )
    scene.add_object("/ice", scene.add_mesh(mesh, "/ice"), ice, lifted(0.46))
    stone = scene.add_material("/stone", fz.StandardMaterial(diffuse_color=(0.16, 0.13, 0.11), roughness=0.6))
    for number, (x, depth) in enumerate(((-0.52, 0.05), (0.0, 0.25), (0.52, 0.5))):
        rock = Rock((x, 0.42, 0.5 - depth - 0.13), (0.15, 0.13, 0.13), 7)
        surface = contour(rock, *rock.bounds(), 0.014).largest_piece()
        scene.add_object(f"/stone{number}", scene.add_mesh(to_mesh(surface), "/stone"), stone)
    return picture(scene, 2 * size, size, samples)


def breath(size: int, samples: int) -> np.ndarray:
    """Milky breath ice: without and with the light that it scatters once, and that in clouds of bubbles.

    What is scattered once shows against the dark, with the light behind it: under a white sky it replaces as much as it
    adds.
    """
    clouds = fz.Density(contrast=1.3, size=0.35, octaves=4, absorption=0.0, seed=2)
    sun = np.array([-0.35, 0.5, -0.8])
    pictures = []
    for volume, density in ((0.0, fz.Density()), (1.0, fz.Density()), (1.0, clouds)):
        scene = set_scene((1.0, 0.5, 3.0), (0.0, 0.6, 0.0), 90.0, sun, 0.08, (9.0, 9.4, 10.0))
        ice = fz.ice_preset(
            "fresh_breath", age=0.15, depth=6.0, spacing=0.03, volume=volume, density=density, anisotropy=0.6
        )
        ice.medium = fz.Medium((4.0, 4.0, 4.0), ice.medium.sigma_a)  # breath: milky within a hand's breadth or two
        add_burst(scene, ice)
        pictures.append(picture(scene, size, size, samples))
    return np.concatenate(pictures, 1)


def add_burst(scene: fz.Scene, ice: fz.IceMaterial) -> None:
    """Nine blades that stand out from where a breath struck, as one body of ice."""
    shard = Shard((0.8, 1.5, 0.6), 4)
    mesh = to_mesh(contour(shard, *shard.bounds(), 0.025).largest_piece())
    material, geometry = scene.add_material("/ice", ice), scene.add_mesh(mesh, "/ice")
    rng = np.random.default_rng(3)
    for number in range(9):
        turn = 2 * np.pi * number / 9 + rng.uniform(-0.3, 0.3)
        lean = rng.uniform(0.25, 0.95) if number else 0.1
        size = rng.uniform(0.45, 0.8) if number else 1.0
        c, s = np.cos(turn), np.sin(turn)
        upright = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        tilted = np.array([[np.cos(lean), np.sin(lean), 0], [-np.sin(lean), np.cos(lean), 0], [0, 0, 1]])
        matrix = np.eye(4)
        matrix[:3, :3] = size * np.diag([0.6, 1.0, 0.6]) @ tilted @ upright
        matrix[3, :3] = 0.62 * matrix[1, :3] - [0.0, 0.05, 0.0]
        scene.add_object(f"/ice{number}", geometry, material, matrix, translucency_set="ice")


def shells(size: int, samples: int) -> np.ndarray:
    """Seven splinters that run into each other: each for itself, and as one translucency set."""
    mesh = shard_mesh(0.03)
    rng = np.random.default_rng(1)
    places = []
    for number in range(7):
        turn, lean = 2 * np.pi * number / 7 + rng.uniform(-0.3, 0.3), rng.uniform(0.1, 0.45)
        c, s = np.cos(turn), np.sin(turn)
        upright = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        tilted = np.array([[np.cos(lean), np.sin(lean), 0], [-np.sin(lean), np.cos(lean), 0], [0, 0, 1]])
        matrix = np.eye(4)
        matrix[:3, :3] = rng.uniform(0.55, 0.9) * tilted @ upright
        matrix[3, :3] = 0.28 * c, 0.33, 0.28 * s
        places.append(matrix)
    pictures = []
    for together in ("", "ice"):
        scene = set_scene((1.4, 0.85, 2.6), (0.0, 0.42, 0.0), 64.0)
        ice = fz.ice_preset("old_glacier", age=0.2, depth=kDepth, spacing=0.03, overlays=[])
        material, geometry = scene.add_material("/ice", ice), scene.add_mesh(mesh, "/ice")
        for number, matrix in enumerate(places):
            scene.add_object(f"/ice{number}", geometry, material, matrix, translucency_set=together)
        pictures.append(picture(scene, size, size, samples))
    return np.concatenate(pictures, 1)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("sheet", "depths", "breath", "shells"))
    parser.add_argument("-o", "--output", type=Path, required=True, help="the PNG to write")
    parser.add_argument("--docs", type=Path, help="a small copy, of 6 bits a channel")
    parser.add_argument("--size", type=int, default=150, help="pixels along a side of one picture")
    parser.add_argument("--samples", type=int, default=16, help="per pixel")
    options = parser.parse_args(arguments)
    start = time.process_time()
    pixels = {"sheet": sheet, "depths": depths, "breath": breath, "shells": shells}[options.what](
        options.size, options.samples
    )
    try:
        options.output.parent.mkdir(parents=True, exist_ok=True)
        write_png(options.output, np.ascontiguousarray(pixels))
        if options.docs:
            save_small(options.output, options.docs)
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{options.output}: {time.process_time() - start:.1f} s of processor time.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
