"""Two figures that defaults rest on: the error of a spacing, and what cutting large footprints does to coverage.

    python bench/spacing.py MESH [--bake-samples 256]

Renders a body of 30 mean free paths with plain and noise-free sums at spacings of 1, 0.5 and 0.25 mean free paths
against one of 0.125 (relative RMS of its translucency); and gathers the coverage of a plane at spacings of 1 to 4.
"""

import argparse
from pathlib import Path

import numpy as np

import frazil as fz
from noise_free import Setting, plane, read, rms


def translucency(mesh: fz.Mesh, spacing: float, estimator: str, bake_samples: int) -> np.ndarray:
    scene = fz.Scene()
    medium = fz.Medium(30.0, (0.6, 0.15, 0.05), eta=1.31)
    ice = scene.add_material("/ice", fz.IceMaterial(medium, specular=0.0))
    scene.add_object("/body", scene.add_mesh(mesh, "/body"), ice)
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(np.array([[0.3, 0.8, 0.5], [1, 0, 0], [0, 1, 0]]).T)[0][:, [1, 2, 0]].T
    scene.add_light(fz.Light(fz.DistantLight(0.0), radiance=[3.0, 2.7, 2.2], matrix=matrix, path="/sun"))
    scene.add_light(fz.Light(fz.DomeLight(), radiance=[0.1, 0.1, 0.1], path="/sky"))
    eye = np.eye(4)
    eye[3, :3] = mesh.positions.mean(0) + np.float32([0.0, 0.0, 2.0])
    scene.camera = fz.Camera(matrix=eye, focal_length=50.0, horizontal_aperture=25.0, vertical_aperture=25.0)
    film = fz.render(
        scene, resolution=(64, 64), samples=16, spacing=spacing, estimator=estimator, bake_bounces=0,
        bake_samples=bake_samples, pixel_filter="box",
    )  # fmt: skip
    return film["translucency"][..., :3]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--bake-samples", type=int, default=256)
    options = parser.parse_args()
    mesh, length = read(options.mesh), 1 / 30.6
    truth = translucency(mesh, 0.125 * length, "noise_free", options.bake_samples)
    print("| spacing, mean free paths | sum, error % | noise_free, error % |\n|---|---|---|")
    for spacing in (1.0, 0.5, 0.25):
        kinds = ("sum", "noise_free")
        errors = [rms(translucency(mesh, spacing * length, kind, options.bake_samples), truth) for kind in kinds]
        print(f"| {spacing} | {errors[0]:.2f} | {errors[1]:.2f} |", flush=True)

    profile = fz.MultipleScattering(fz.Medium(30.0, (0.6, 0.15, 0.05), eta=1.31))
    flat = Setting("plane", plane(), shading=5000)
    print("\n| spacing, mean free paths | coverage over albedo, mean | its spread % |\n|---|---|---|")
    for spacing in (1.0, 2.0, 4.0):
        points = fz.poisson_points(flat.mesh, spacing * length)
        tree = fz.PointTree(points, np.ones((len(points), 3)), profile, cells=fz.Cells(points, flat.mesh))
        covered = tree.gather(flat.shading).coverage / profile.albedo
        print(f"| {spacing} | {covered.mean():.4f} | {100 * covered.std():.2f} |", flush=True)


if __name__ == "__main__":
    main()
