"""Path-traced references of more shapes and media for bench/truth.py, with Mitsuba 3 (`pip install mitsuba`).

    python bench/references.py FOLDER [--only torus slab ...] [--size 40] [--samples 256]

Writes NAME.npz and NAME.ply per scene: index-matched, isotropic scattering, volpath; `stderr` is half the difference of
two renders. Prints the processor seconds that each took. Then: python bench/truth.py FOLDER/NAME.npz FOLDER/NAME.ply
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import trimesh


def blob() -> trimesh.Trimesh:
    shape = trimesh.creation.icosphere(subdivisions=5, radius=0.42)
    v = shape.vertices
    shape.vertices = v * (1 + 0.2 * np.sin(11 * v[:, :1]) * np.cos(9 * v[:, 1:2] + 1))
    return shape


def slab() -> trimesh.Trimesh:
    shape = trimesh.creation.box((1.0, 0.08, 1.0))
    return shape.apply_transform(trimesh.transformations.rotation_matrix(0.9, (1, 0.3, 0)))


def torus() -> trimesh.Trimesh:
    shape = trimesh.creation.torus(0.36, 0.13, major_sections=96, minor_sections=48)
    return shape.apply_transform(trimesh.transformations.rotation_matrix(-0.8, (1, 0.2, 0)))


def sphere() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=5, radius=0.42)


def turned_box(extents: tuple[float, float, float], about_y: float) -> trimesh.Trimesh:
    tilt = trimesh.transformations.rotation_matrix(0.6, (1, 0.3, 0))
    shape = trimesh.creation.box(extents).apply_transform(tilt)
    return shape.apply_transform(trimesh.transformations.rotation_matrix(about_y, (0, 1, 0)))


def cube() -> trimesh.Trimesh:
    return turned_box((0.6, 0.6, 0.6), 0.7)


def thick() -> trimesh.Trimesh:
    shape = trimesh.creation.box((1.0, 0.5, 1.0))
    return shape.apply_transform(trimesh.transformations.rotation_matrix(0.9, (1, 0.3, 0)))


def spires(size: int = 97) -> trimesh.Trimesh:
    """Nine cones of different height and width on a plate, as one closed height field."""
    x, z = np.meshgrid(*2 * [np.linspace(-0.45, 0.45, size)], indexing="ij")
    rng = np.random.default_rng(1)
    height = np.full(x.shape, -0.2)
    for cell in range(9):
        at = 0.27 * (np.array([cell % 3, cell // 3]) - 1) + rng.uniform(-0.05, 0.05, 2)
        top, radius = rng.uniform(0.25, 0.6), rng.uniform(0.06, 0.13)
        height = np.maximum(height, -0.2 + top * (1 - np.hypot(x - at[0], z - at[1]) / radius))
    grid = np.arange(size * size).reshape(size, size)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    top = np.concatenate([np.stack(corners, -1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))])
    rim = np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])
    low, after = rim + size * size, np.roll(rim, -1)
    sides = np.concatenate([np.stack((rim, low, after), -1), np.stack((after, low, after + size * size), -1)])
    floor = np.full(x.shape, -0.3)
    points = np.concatenate([np.stack((x, y, z), -1).reshape(-1, 3) for y in (height, floor)])
    shape = trimesh.Trimesh(points, np.concatenate([top, top[:, ::-1] + size * size, sides]), process=False)
    if shape.volume < 0:
        shape.invert()
    return shape


def capsule() -> trimesh.Trimesh:
    shape = trimesh.creation.capsule(0.8, 0.08).apply_translation((0, 0, -0.4))
    return shape.apply_transform(trimesh.transformations.rotation_matrix(0.7, (0.3, 1, 0)))


# A square lamp [centre, target, half size, radiance] and the radiance from all around.
FRONT = ([[1.4, 1.8, 1.2], [0.0, 0.0, 0.0], 0.45, 12.0], 0.4)
SIDE = ([[2.4, 0.3, -0.3], [0.0, 0.0, 0.0], 0.3, 30.0], 0.1)
BACK = ([[-0.6, 1.2, -2.0], [0.0, 0.0, 0.0], 0.45, 16.0], 0.2)
FAINT_BACK, FAINT_FRONT, FAINT_SIDE = (BACK[0], 0.1), (FRONT[0], 0.1), (SIDE[0], 0.05)

# Shape, sigma_s_prime and sigma_a in 1/m, light. Albedo from 0.5 to 0.9999, bodies from 4 to 50 mean free paths across.
SCENES = {
    "torus": (torus, (20.0, 20.0, 20.0), (0.4, 0.1, 0.03), FRONT),
    "slab": (slab, (25.0, 25.0, 25.0), (0.5, 0.1, 0.02), FRONT),
    "blob": (blob, (30.0, 30.0, 30.0), (1.0, 0.3, 0.003), FRONT),
    "blob_dark": (blob, (21.0, 24.0, 27.0), (9.0, 6.0, 3.0), FRONT),
    "torus_clear": (torus, (5.0, 5.0, 5.0), (0.2, 0.05, 0.01), FRONT),
    "blob_dense": (blob, (80.0, 80.0, 80.0), (0.8, 0.2, 0.04), FRONT),
    "sphere_dark": (sphere, (15.0, 21.0, 27.0), (15.0, 9.0, 3.0), FRONT),
    "sphere_side": (sphere, (24.25, 24.75, 24.975), (0.75, 0.25, 0.025), SIDE),
    "cube_dark": (cube, (15.0, 21.0, 27.0), (15.0, 9.0, 3.0), FRONT),
    "cube_back": (cube, (19.0, 19.7, 19.98), (1.0, 0.3, 0.02), BACK),
    "capsule_back": (capsule, (27.0, 29.1, 29.85), (3.0, 0.9, 0.15), FAINT_BACK),
    "thick": (thick, (48.0, 57.0, 59.7), (12.0, 3.0, 0.3), FAINT_FRONT),
    "thick_dark": (thick, (30.0, 42.0, 54.0), (30.0, 18.0, 6.0), FAINT_SIDE),
    "spires_dark": (spires, (28.0, 32.0, 36.0), (12.0, 8.0, 4.0), FRONT),
    "spires_side": (spires, (28.5, 29.4, 29.85), (1.5, 0.6, 0.15), SIDE),
}
CAMERA, FOV = [[0.3, 0.5, 2.4], [0.0, 0.0, 0.0]], 30.0


def render(mi, ply: Path, scatter, absorb, lit, size: int, samples: int, seed: int) -> np.ndarray:
    look = mi.ScalarTransform4f().look_at
    sigma_t = np.add(scatter, absorb)
    (centre, target, half, radiance), env = lit
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "volpath", "max_depth": 4000, "rr_depth": 2000},
            "sensor": {
                "type": "perspective", "fov": FOV, "to_world": look(*CAMERA, [0, 1, 0]),
                "film": {"type": "hdrfilm", "width": size, "height": size, "pixel_format": "rgb",
                         "rfilter": {"type": "box"}},
                "sampler": {"type": "independent", "sample_count": samples},
            },
            "ice": {
                "type": "ply", "filename": str(ply), "face_normals": True, "bsdf": {"type": "null"},
                "interior": {
                    "type": "homogeneous", "scale": float(sigma_t.max()),
                    "sigma_t": {"type": "rgb", "value": (sigma_t / sigma_t.max()).tolist()},
                    "albedo": {"type": "rgb", "value": (np.array(scatter) / sigma_t).tolist()},
                },
            },
            "env": {"type": "constant", "radiance": {"type": "rgb", "value": [env] * 3}},
            "light": {
                "type": "rectangle",
                "to_world": look(centre, target, [0, 1, 0]) @ mi.ScalarTransform4f().scale([half, half, 1]),
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [radiance] * 3}},
            },
        }
    )  # fmt: skip
    return np.array(mi.render(scene, seed=seed))


def coverage(shape: trimesh.Trimesh, size: int) -> np.ndarray:
    """1 where all of a pixel sees the body: by Frazil's own alpha."""
    import sys

    import frazil as fz

    sys.path.insert(0, str(Path(__file__).parent))
    from race import look_at

    scene = fz.Scene()
    mesh = scene.add_mesh(fz.Mesh(shape.vertices, shape.faces), "/body")
    scene.add_object("/body", mesh, scene.add_material("/grey", fz.StandardMaterial()))
    scene.add_light(fz.Light(fz.DomeLight(), path="/sky"))
    aperture = 100.0 * np.tan(np.radians(FOV) / 2)
    scene.camera = fz.Camera(
        matrix=look_at(*CAMERA), focal_length=50.0, horizontal_aperture=aperture, vertical_aperture=aperture
    )
    film = fz.render(scene, resolution=(size, size), samples=64, pixel_filter="box", aovs=["beauty"])
    return film["beauty"][..., 3]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--size", type=int, default=40)
    parser.add_argument("--samples", type=int, default=256)
    options = parser.parse_args()
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    options.folder.mkdir(parents=True, exist_ok=True)
    for name in options.only:
        make, scatter, absorb, lit = SCENES[name]
        shape, ply = make(), options.folder / f"{name}.ply"
        shape.export(ply)
        start = time.process_time()
        halves = [render(mi, ply, scatter, absorb, lit, options.size, options.samples // 2, seed) for seed in (1, 2)]
        seconds = time.process_time() - start
        params = {
            "mesh": ply.name, "sigma_s_prime": scatter, "sigma_a": absorb, "env": [lit[1]] * 3, "light": lit[0],
            "camera": CAMERA, "fov": FOV,
        }  # fmt: skip
        np.savez(
            options.folder / f"{name}.npz",
            radiance=0.5 * (halves[0] + halves[1]),
            stderr=0.5 * np.abs(halves[0] - halves[1]),
            coverage=coverage(shape, options.size),
            params=json.dumps(params),
        )
        print(f"{name}: {seconds:.1f} s of processor time", flush=True)


if __name__ == "__main__":
    main()
