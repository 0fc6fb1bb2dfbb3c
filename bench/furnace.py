"""White furnace: ice that absorbs nothing under even light of radiance 1 must look 1 everywhere.

    python bench/furnace.py MESH.ply [--bounces 8] [--samples 64] [--bake-samples 256] [--size 96] [--modes M ...]

Per compensation: least, mean and greatest radiance over the pixels that the body fills, and the share within 2 % of 1.
"""

import argparse
from pathlib import Path

import numpy as np
import trimesh

import frazil as fz


def furnace(
    mesh: fz.Mesh,
    compensation: str,
    bounces: int,
    samples: int,
    spacing: float,
    eta: float = 1.31,
    size: int = 96,
    bake_samples: int = 256,
) -> np.ndarray:
    """Radiance, one channel, of the pixels that the body fills."""
    scene = fz.Scene()
    low, high = mesh.positions.min(0), mesh.positions.max(0)
    scale = float(np.linalg.norm(high - low))
    medium = fz.Medium(30.0 / scale, 0.0, eta=eta)
    ice = fz.IceMaterial(medium, compensation=compensation, roughness=0.3)
    scene.add_object("/body", scene.add_mesh(mesh, "/body"), scene.add_material("/ice", ice))
    scene.add_light(fz.Light(fz.DomeLight(), radiance=[1.0, 1.0, 1.0], path="/sky"))
    film = fz.render(
        scene,
        resolution=(size, size),
        samples=samples,
        bake_bounces=bounces,
        bake_samples=bake_samples,
        spacing=spacing,
        pixel_filter="box",
    )
    beauty = film["beauty"]
    return beauty[beauty[..., 3] == 1][:, 1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--bounces", type=int, default=8)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--bake-samples", type=int, default=256)
    parser.add_argument("--size", type=int, default=96, help="pixels along a side")
    parser.add_argument("--modes", nargs="+", default=["off", "ratio", "conserve", "depth"], help="of compensation")
    parser.add_argument("--spacing", type=float, default=0.0, help="metres; 0 = from the medium")
    parser.add_argument("--eta", type=float, default=1.31)
    options = parser.parse_args()
    shape = trimesh.load(options.mesh, force="mesh", process=False)
    mesh = fz.Mesh(np.asarray(shape.vertices), np.asarray(shape.faces))
    print("| compensation | least | mean | greatest | within 2 % |\n|---|---|---|---|---|")
    for mode in options.modes:
        bounces = options.bounces if mode in ("conserve", "depth") else 0  # others make energy with each
        values = furnace(
            mesh, mode, bounces, options.samples, options.spacing, options.eta, options.size, options.bake_samples
        )
        close = 100 * np.mean(np.abs(values - 1) <= 0.02)
        numbers = " | ".join(f"{v:.3f}" for v in (values.min(), values.mean(), values.max()))
        print(f"| {mode}, {bounces} bounces | {numbers} | {close:.1f} % |", flush=True)


if __name__ == "__main__":
    main()
