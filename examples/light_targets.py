"""One light, told to act on one component at a time: python examples/light_targets.py [OUT.png].

A spire on a floor under a grey sky, with a warm light behind it. Above, from left to right, it acts on everything, on
translucency alone, on specular, on diffuse; below on refraction, on volume, on translucency by -0.3, on nothing.
"""

from __future__ import annotations

import sys

import numpy as np

import frazil as fz
from frazil.image import write_png

COMPONENTS = ("translucency", "specular", "diffuse", "refraction", "volume")
TARGETS = (
    dict.fromkeys(COMPONENTS, 1.0),
    *({name: 1.0} for name in COMPONENTS),
    {"translucency": -0.3},
    {},
)


def spire(sides: int = 7, rings: int = 60) -> fz.Mesh:
    t, phi = np.linspace(0, 1, rings)[:, None], np.linspace(0, 2 * np.pi, sides, endpoint=False)[None]
    radius = 0.22 * (1 - t) ** 0.8 + 1e-3
    x, z = radius * np.cos(phi + 0.7 * t) + 0.08 * t**2, radius * np.sin(phi + 0.7 * t)
    ring = np.stack([x, np.broadcast_to(t, x.shape), z], -1).reshape(-1, 3)
    positions = np.concatenate([ring, [[0, 0, 0], [0.08, 1.02, 0]]])
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij"))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    faces = [np.stack([a, a + sides, b], 1), np.stack([b, a + sides, b + sides], 1)]
    k = np.arange(sides)
    top = (rings - 1) * sides
    faces += [np.stack([k, (k + 1) % sides, np.full(sides, len(ring))], 1)]
    faces += [np.stack([top + (k + 1) % sides, top + k, np.full(sides, len(ring) + 1)], 1)]
    return fz.Mesh(positions.astype(np.float32), np.concatenate(faces).astype(np.int32))


def look_at(eye, target) -> np.ndarray:
    z = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    x = np.cross([0, 1, 0], z) / np.linalg.norm(np.cross([0, 1, 0], z))
    matrix = np.eye(4)
    matrix[:4, :3] = [x, np.cross(z, x), z, eye]
    return matrix


def scene_with(multipliers: dict[str, float]) -> fz.Scene:
    scene = fz.Scene()
    medium = fz.Medium(sigma_s_prime=(12.0, 12.0, 12.0), sigma_a=(2.0, 0.4, 0.15), eta=1.31)
    ice = scene.add_material("/ice", fz.IceMaterial(medium, refraction=1.0, volume=1.0, roughness=0.25))
    grey = scene.add_material("/grey", fz.StandardMaterial(diffuse_color=(0.45, 0.45, 0.45), roughness=0.4))
    scene.add_object("/spire", scene.add_mesh(spire(), "/spire"), ice)
    corners = np.float32([[-9, 0, 9], [9, 0, 9], [9, 0, -9], [-9, 0, -9]])
    floor = scene.add_mesh(fz.Mesh(corners, np.int32([[0, 1, 2], [0, 2, 3]])), "/floor")
    scene.add_object("/floor", floor, grey)
    scene.add_light(fz.Light(fz.DomeLight(), radiance=[0.20, 0.23, 0.27], path="/sky"))
    rim = look_at((0.9, 1.2, -1.0), (0, 0.4, 0))
    off = dict.fromkeys(COMPONENTS, 0.0)
    scene.add_light(
        fz.Light(fz.RectLight(0.7, 0.7), matrix=rim, radiance=[34.0, 25.0, 15.0], path="/rim", **(off | multipliers))
    )
    scene.camera = fz.Camera(matrix=look_at((0.3, 0.75, 2.6), (0.06, 0.5, 0)), focal_length=52.0)
    return scene


def main(path: str = "light_targets.png") -> None:
    pictures = [fz.render(scene_with(chosen), resolution=(180, 240), samples=32, denoise=True) for chosen in TARGETS]
    rows = [np.concatenate([film["beauty"][:, :, :3] for film in pictures[k : k + 4]], axis=1) for k in (0, 4)]
    write_png(path, np.concatenate(rows))


if __name__ == "__main__":
    main(*sys.argv[1:2])
