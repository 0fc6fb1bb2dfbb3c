"""Frazil against path-traced truth: relative RMS error by compensation mode and number of bounces.

A reference is an .npz with `radiance` (H, W, 3), `coverage` (H, W) and `params`, a JSON text: mesh, sigma_s_prime and
sigma_a in 1/unit, env (radiance from all around), light [centre, target, half size, radiance], camera [origin, target],
fov in degrees across the width. The boundary is index-matched (eta = 1). Only pixels that the object fills count.

    python bench/truth.py REFERENCE.npz MESH.ply [--out DIR]
"""

import argparse
import itertools
import json
import time
from pathlib import Path

import numpy as np
import trimesh

import frazil as fz
from race import look_at

MODES = ("ratio", "conserve", "depth")


def reference_scene(params: dict, mesh_file: Path, compensation: str, volume: float = 0.0) -> fz.Scene:
    """The reference's scene, made in Python; `volume` is how much of the light that is scattered once is traced."""
    shape = trimesh.load(mesh_file, process=False)
    scene = fz.Scene()
    mesh = scene.add_mesh(fz.Mesh(np.asarray(shape.vertices), np.asarray(shape.faces)), f"/{mesh_file.stem}")
    medium = fz.Medium(sigma_s_prime=params["sigma_s_prime"], sigma_a=params["sigma_a"], eta=1.0)
    ice = scene.add_material("/ice", fz.IceMaterial(medium, compensation=compensation, volume=volume))
    scene.add_object(f"/{mesh_file.stem}", mesh, ice)
    scene.add_light(fz.Light(fz.DomeLight(), radiance=params["env"], path="/env"))
    centre, target, half, radiance = params["light"]
    rect = fz.RectLight(2 * half, 2 * half)
    scene.add_light(fz.Light(rect, radiance=[radiance] * 3, matrix=look_at(centre, target), path="/light"))
    aperture = 2 * 50.0 * np.tan(np.radians(params["fov"]) / 2)
    scene.camera = fz.Camera(
        matrix=look_at(*params["camera"]),
        focal_length=50.0,
        horizontal_aperture=aperture,
        vertical_aperture=aperture,
    )
    return scene


def compare(radiance: np.ndarray, truth: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Relative RMS error per channel, and the mean of truth over render."""
    mine, true = radiance[inside], truth[inside]
    rms = np.sqrt(np.mean((mine - true) ** 2, axis=0)) / np.sqrt(np.mean(true**2, axis=0))
    return rms, np.mean(true, axis=0) / np.mean(mine, axis=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("reference", type=Path, help="the .npz")
    parser.add_argument("mesh", type=Path, help="the mesh that it shows")
    parser.add_argument("--samples", type=int, default=16, help="camera samples per pixel (default 16)")
    parser.add_argument("--bake-samples", type=int, default=256, help="shadow rays per point and light (default 256)")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=MODES, help="compensations (default: all)")
    parser.add_argument("--bounces", type=int, nargs="+", default=[0, 1, 4], help="bake bounces (default 0 1 4)")
    parser.add_argument(
        "--volume", type=float, default=0.0, help="of light that is scattered once, what rays trace (default 0)"
    )
    parser.add_argument("--out", type=Path, help="folder for an EXR per mode (default: none is written)")
    args = parser.parse_args()

    reference = np.load(args.reference)
    params = json.loads(str(reference["params"]))
    truth, inside = reference["radiance"], reference["coverage"] == 1
    height, width = inside.shape
    noise = np.sqrt(np.mean(reference["stderr"][inside] ** 2, axis=0) / np.mean(truth[inside] ** 2, axis=0))
    own = " ".join(f"{100 * value:.1f}" for value in noise)
    print(f"{args.reference.stem}: {inside.sum()} pixels; noise of the reference itself, in all errors: {own} %")
    print(
        "| compensation | bounces | RMS R G B, % | truth / render R G B | points | seconds |\n|---|---|---|---|---|---|"
    )
    for mode, bounces in itertools.product(args.modes, args.bounces):
        start = time.perf_counter()
        film = fz.render(
            reference_scene(params, args.mesh, mode, args.volume),
            resolution=(width, height),
            samples=args.samples,
            bake_samples=args.bake_samples,
            bake_bounces=bounces,
            pixel_filter="box",
        )
        seconds = time.perf_counter() - start
        rms, gain = compare(film["beauty"][..., :3], truth, inside)
        errors = " ".join(f"{100 * value:.1f}" for value in rms)
        gains = " ".join(f"{value:.2f}" for value in gain)
        print(f"| {mode} | {bounces} | {errors} | {gains} | {film.stats['points']} | {seconds:.1f} |", flush=True)
        if args.out:
            args.out.mkdir(parents=True, exist_ok=True)
            film.save(args.out / f"{args.reference.stem}_{mode}_{bounces}.exr")
            film.save_preview(args.out / f"{args.reference.stem}_{mode}_{bounces}.png")


if __name__ == "__main__":
    main()
