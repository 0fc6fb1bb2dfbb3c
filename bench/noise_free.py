"""How smooth a tenth of the points is: error and flicker of sparse gathers against a dense cloud, for each remedy.

For every scene: a cloud of 20 N points with the plain sum is the truth, the plain sum over N points the bar, and each
candidate has N/10 points. Errors are relative RMS over what a camera sees; flicker is the RMS change, over the mean of
both, between two seeds of the points. Light is a sun with ray-traced shadows over a weak sky; a step on the plane.

    python bench/noise_free.py [MESH ...] [--points 20000 100000] [--profile MultipleScattering] [--tolerance T]

Without meshes: the plane alone. Truth is gathered at a tolerance of 1e-3; the rest, without `--tolerance`, at the
default. `sum`: light at the points. `disc`: the kernel averaged over a disc of each point's
area. `disc, mean`: the same with light averaged over the cell. `cell, point`: the kernel averaged over the cell, light
at the points. `cell, mean`: both over the cell, without its centre of light. `cell`: with it, as renders do. A star
marks sums divided by W/Rd_total.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import trimesh

import frazil as fz

CANDIDATES = ("sum", "disc", "disc, mean", "cell, point", "cell, mean", "cell")
TRUTH_TOLERANCE = 1e-3
SUN = np.array([0.4, 0.7, 0.6]) / np.linalg.norm([0.4, 0.7, 0.6])
EYE = np.array([0.2, 0.35, 0.92]) / np.linalg.norm([0.2, 0.35, 0.92])


def plane() -> fz.Mesh:
    corners = 0.5 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    return fz.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def read(path: Path) -> fz.Mesh:
    """A mesh from a file, its bounding box's diagonal 1 m."""
    shape = trimesh.load(path, force="mesh", process=False)
    vertices = np.asarray(shape.vertices, float)
    return fz.Mesh((vertices - vertices.min(0)) / np.linalg.norm(np.ptp(vertices, axis=0)), np.asarray(shape.faces))


class Setting:
    """A mesh, its light, and what of it is looked at. A flat one (z = 0) has a step of light, others a sun."""

    def __init__(self, name: str, mesh: fz.Mesh, shading: int = 20000, tolerance: float | None = None):
        self.name, self.mesh = name, mesh
        self.tolerance = {} if tolerance is None else {"tolerance": tolerance}
        self.is_flat = not np.any(mesh.positions[:, 2])
        self.rays = fz.RayScene([mesh])
        shape = trimesh.Trimesh(mesh.positions, mesh.triangles, process=False)
        self.area = shape.area
        # Random places that the eye sees, away from a plane's edge.
        places, faces = trimesh.sample.sample_surface(shape, 3 * shading, seed=5)
        normals = shape.face_normals[faces]
        seen = (normals @ EYE > 0.1) & ~self.occluded(places, normals, EYE)
        if self.is_flat:
            seen &= np.abs(places).max(1) < 0.7 * np.abs(mesh.positions).max()
        self.shading = places[seen][:shading].astype(np.float32)

    def occluded(self, positions: np.ndarray, normals: np.ndarray, toward: np.ndarray) -> np.ndarray:
        starts = (positions + 1e-4 * normals).astype(np.float32)
        return self.rays.are_occluded(starts, np.broadcast_to(np.float32(toward), starts.shape))

    def light(self, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Irradiance at places, (M, 3)."""
        if self.is_flat:
            lit = positions[:, 0] + 0.3 * positions[:, 1] > 0.0123
        else:
            lit = np.maximum(0.0, normals @ SUN) * ~self.occluded(positions, normals, SUN)
        return (np.asarray(lit, float)[:, None] * [3.0, 2.7, 2.2] + [0.15, 0.2, 0.3]).astype(np.float32)

    def gather(self, candidate: str, profile, count: int, seed: int, places: int = 256, tolerance: dict | None = None):
        points = fz.poisson_points(self.mesh, count=count, seed=seed)
        at_points = self.light(points.positions, points.normals)

        def gathered(light: np.ndarray, cells=None, estimator: str = "noise_free"):
            tree = fz.PointTree(points, light, profile, cells=cells)
            return tree.gather(self.shading, estimator=estimator, **(tolerance or self.tolerance))

        if candidate == "sum":
            return gathered(at_points, estimator="sum")
        if candidate == "disc":
            return gathered(at_points)
        cells = fz.Cells(points, self.mesh, places=places, seed=seed)
        if candidate == "cell, point":
            return gathered(at_points, cells)
        light = self.light(cells.positions, cells.normals)
        if candidate == "cell":
            return gathered(light, cells)
        mean = (
            np.stack([np.bincount(cells.owners, cells.weights * light[:, c], len(points)) for c in range(3)], axis=1)
            / np.maximum(1e-30, np.bincount(cells.owners, cells.weights, len(points)))[:, None]
        )
        return gathered(mean, None if candidate == "disc, mean" else cells)


def rms(values: np.ndarray, truth: np.ndarray) -> float:
    """Percent, relative to the RMS of the truth."""
    return 100.0 * float(np.sqrt(np.mean((values - truth) ** 2) / np.mean(truth**2)))


def measure(setting: Setting, profile, count: int, candidates=CANDIDATES) -> dict[str, tuple[float, float, float]]:
    """Per candidate error, error of the sum over W/Rd_total, flicker; percent. `bar` is the plain sum at `count`."""
    dense = setting.gather("sum", profile, 20 * count, seed=99, tolerance={"tolerance": TRUTH_TOLERANCE})
    truth, total = dense.exitance[:, 0], profile.albedo
    found = {}
    for name in ("bar", *candidates):
        kind, n = ("sum", count) if name == "bar" else (name, count // 10)
        first, second = (setting.gather(kind, profile, n, seed) for seed in (1, 2))
        a, b = first.exitance[:, 0], second.exitance[:, 0]
        both = np.hypot(rms(a, truth), rms(b, truth)) / np.sqrt(2.0)
        even = truth * total / dense.coverage
        evened = np.hypot(rms(a * total / first.coverage, even), rms(b * total / second.coverage, even)) / np.sqrt(2.0)
        found[name] = (both, evened, rms(a, b))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path, nargs="*")
    parser.add_argument("--points", type=int, nargs="+", default=[20_000])
    parser.add_argument("--profile", default="MultipleScattering")
    parser.add_argument("--scattering", type=float, default=30.0, help="1/m, for a body of 1 m (default 30)")
    parser.add_argument("--tolerance", type=float)
    parser.add_argument("--candidates", nargs="+", choices=CANDIDATES, default=CANDIDATES)
    options = parser.parse_args()
    scattering = options.scattering
    medium = fz.Medium(scattering, np.array([0.6, 0.15, 0.05]) * scattering / 30, eta=1.31)
    profile = getattr(fz, options.profile)(medium)
    columns = ("scene", "N", "points", "spacing, mean free paths", "error %", "error % *", "flicker %")
    print("| " + " | ".join(columns) + " |\n" + "|---" * len(columns) + "|")
    scenes = [(path.stem, read(path)) for path in options.meshes] or [("plane", plane())]
    for name, mesh in scenes:
        setting = Setting(name, mesh, tolerance=options.tolerance)
        for count in options.points:
            for kind, found in measure(setting, profile, count, options.candidates).items():
                n = count if kind == "bar" else count // 10
                spacing = np.sqrt(0.7 * setting.area / n) / float(medium.mean_free_path.min())
                numbers = " | ".join(f"{value:.2f}" for value in (spacing, *found))
                print(f"| {name} | {count} | {n} {kind} | {numbers} |", flush=True)


if __name__ == "__main__":
    main()
