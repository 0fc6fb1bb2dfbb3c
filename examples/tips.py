"""Ice tips with and without area compensation, in the way of Figure 4 of [Xie2014].

    python examples/tips.py [OUT.png] [--samples 64]

A fan of spires stands under an even white sky, in ice that absorbs almost nothing, so that every part of it should send
back nearly what it gets. Prints the mean radiance at tips (the uppermost tenth of each spire) over that on flanks.
"""

from __future__ import annotations

import argparse

import numpy as np
import trimesh

import frazil as fz

MODES = ("off", "ratio", "depth")
HEIGHT, SPACING, SPIRES = 0.6, 0.24, 5


def spires() -> fz.Mesh:
    """Closed six-sided spires of growing thickness beside each other, each finely cut."""
    parts = []
    for k in range(SPIRES):
        cone = trimesh.creation.cone(radius=0.03 + 0.015 * k, height=HEIGHT, sections=6)
        cone = cone.subdivide_to_size(0.05)
        cone.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
        parts.append(cone.apply_translation(((k - (SPIRES - 1) / 2) * SPACING, 0, 0)))
    shape = trimesh.util.concatenate(parts)
    return fz.Mesh(np.asarray(shape.vertices), np.asarray(shape.faces))


def make_scene(compensation: str) -> fz.Scene:
    scene = fz.Scene()
    mesh = scene.add_mesh(spires(), "/spires")
    medium = fz.Medium(sigma_s_prime=25.0, sigma_a=(0.10, 0.03, 0.01), eta=1.31)
    ice = fz.IceMaterial(medium, specular=0.0, refraction=0.0, compensation=compensation)
    scene.add_object("/spires", mesh, scene.add_material("/ice", ice))
    scene.add_light(fz.Light(fz.DomeLight(), radiance=[1.0, 1.0, 1.0], path="/sky"))
    matrix = np.eye(4)
    matrix[3, :3] = (0.0, HEIGHT / 2, 4.0)
    scene.camera = fz.Camera(matrix=matrix, focal_length=50.0, horizontal_aperture=18.0, vertical_aperture=9.0)
    return scene


def tip_over_flank(image: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Mean radiance of the uppermost tenth over that of the middle third, per channel."""
    inside = alpha > 0.99
    rows = np.flatnonzero(inside.any(1))
    top, height = rows[0], rows[-1] - rows[0]
    y = np.arange(len(image))[:, None]
    tip = inside & (y < top + 0.1 * height)
    flank = inside & (y > top + 0.4 * height) & (y < top + 0.7 * height)
    return image[tip].mean(0) / image[flank].mean(0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", nargs="?", default="tips.png")
    parser.add_argument("--samples", type=int, default=64)
    options = parser.parse_args()
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(MODES), figsize=(13, 3.2))
    for mode, axis in zip(MODES, axes, strict=True):
        film = fz.render(make_scene(mode), resolution=(320, 160), samples=options.samples)
        image, alpha = film["translucency"][..., :3], film["beauty"][..., 3]
        ratio = tip_over_flank(image, alpha)
        print(f"{mode:<8} tips over flanks, R G B: " + " ".join(f"{v:.2f}" for v in ratio))
        shown = image + 0.08 * (1 - alpha[..., None])
        axis.imshow(np.clip(0.8 * shown, 0, 1) ** (1 / 2.2))
        axis.set_title({"off": "off", "ratio": "ratio", "depth": "depth (default)"}[mode])
        axis.axis("off")
    figure.tight_layout()
    figure.savefig(options.path, dpi=75)


if __name__ == "__main__":
    main()
