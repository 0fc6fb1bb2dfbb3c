"""The Utah teapot from its Bezier patches, and the points of the talk's Figure 5 on it.

    python examples/teapot.py -o docs/images/points_teapot.png

Draws points made by cutting triangles regularly, as a micropolygon renderer does, beside Poisson points of the same
number, coloured by the surface that each stands for, with the spread of nearest distances and areas below. Prints the
statistics. Needs matplotlib.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import frazil as fz

# Control points [Newell1975] of one quarter of the round parts and one half of handle and spout; z is up.
CONTROL_POINTS = np.array(
    """
    0.2 0 2.7  0.2 -.112 2.7  .112 -.2 2.7  0 -.2 2.7  1.3375 0 2.53125  1.3375 -.749 2.53125  .749 -1.3375 2.53125
    0 -1.3375 2.53125  1.4375 0 2.53125  1.4375 -.805 2.53125  .805 -1.4375 2.53125  0 -1.4375 2.53125  1.5 0 2.4
    1.5 -.84 2.4  .84 -1.5 2.4  0 -1.5 2.4  1.75 0 1.875  1.75 -.98 1.875  .98 -1.75 1.875  0 -1.75 1.875  2 0 1.35
    2 -1.12 1.35  1.12 -2 1.35  0 -2 1.35  2 0 .9  2 -1.12 .9  1.12 -2 .9  0 -2 .9  -2 0 .9  2 0 .45  2 -1.12 .45
    1.12 -2 .45  0 -2 .45  1.5 0 .225  1.5 -.84 .225  .84 -1.5 .225  0 -1.5 .225  1.5 0 .15  1.5 -.84 .15  .84 -1.5 .15
    0 -1.5 .15  -1.6 0 2.025  -1.6 -.3 2.025  -1.5 -.3 2.25  -1.5 0 2.25  -2.3 0 2.025  -2.3 -.3 2.025  -2.5 -.3 2.25
    -2.5 0 2.25  -2.7 0 2.025  -2.7 -.3 2.025  -3 -.3 2.25  -3 0 2.25  -2.7 0 1.8  -2.7 -.3 1.8  -3 -.3 1.8  -3 0 1.8
    -2.7 0 1.575  -2.7 -.3 1.575  -3 -.3 1.35  -3 0 1.35  -2.5 0 1.125  -2.5 -.3 1.125  -2.65 -.3 .9375  -2.65 0 .9375
    -2 -.3 .9  -1.9 -.3 .6  -1.9 0 .6  1.7 0 1.425  1.7 -.66 1.425  1.7 -.66 .6  1.7 0 .6  2.6 0 1.425  2.6 -.66 1.425
    3.1 -.66 .825  3.1 0 .825  2.3 0 2.1  2.3 -.25 2.1  2.4 -.25 2.025  2.4 0 2.025  2.7 0 2.4  2.7 -.25 2.4
    3.3 -.25 2.4  3.3 0 2.4  2.8 0 2.475  2.8 -.25 2.475  3.525 -.25 2.49375  3.525 0 2.49375  2.9 0 2.475
    2.9 -.15 2.475  3.45 -.15 2.5125  3.45 0 2.5125  2.8 0 2.4  2.8 -.15 2.4  3.2 -.15 2.4  3.2 0 2.4  0 0 3.15
    .8 0 3.15  .8 -.45 3.15  .45 -.8 3.15  0 -.8 3.15  0 0 2.85  1.4 0 2.4  1.4 -.784 2.4  .784 -1.4 2.4  0 -1.4 2.4
    .4 0 2.55  .4 -.224 2.55  .224 -.4 2.55  0 -.4 2.55  1.3 0 2.55  1.3 -.728 2.55  .728 -1.3 2.55  0 -1.3 2.55
    1.3 0 2.4  1.3 -.728 2.4  .728 -1.3 2.4  0 -1.3 2.4  0 0 0  1.425 -.798 0  1.5 0 .075  1.425 0 0  .798 -1.425 0
    0 -1.5 .075  0 -1.425 0  1.5 -.84 .075  .84 -1.5 .075
    """.split(),
    float,
).reshape(-1, 3)
ROUND_PATCHES = np.array(
    """
    102 103 104 105 4 5 6 7 8 9 10 11 12 13 14 15  12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27
    24 25 26 27 29 30 31 32 33 34 35 36 37 38 39 40  96 96 96 96 97 98 99 100 101 101 101 101 0 1 2 3
    0 1 2 3 106 107 108 109 110 111 112 113 114 115 116 117
    118 118 118 118 124 122 119 121 123 126 125 120 40 39 38 37
    """.split(),
    int,
).reshape(-1, 4, 4)
HALF_PATCHES = np.array(
    """
    41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56  53 54 55 56 57 58 59 60 61 62 63 64 28 65 66 67
    68 69 70 71 72 73 74 75 76 77 78 79 80 81 82 83  80 81 82 83 84 85 86 87 88 89 90 91 92 93 94 95
    """.split(),
    int,
).reshape(-1, 4, 4)


def bezier_grid(patch: np.ndarray, steps: int) -> np.ndarray:
    """The patch (4, 4, 3) at (steps + 1)² regular parameters."""
    t = np.linspace(0, 1, steps + 1)[:, None]
    basis = np.hstack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    return np.einsum("ui,vj,ijk->uvk", basis, basis, patch)


def teapot(steps: int = 8) -> fz.Mesh:
    """The teapot, y up and 3.15 high, every patch cut into steps² quads; 32 patches, open at the rim."""
    patches = [(CONTROL_POINTS[p], sx, sy) for p in ROUND_PATCHES for sx in (1, -1) for sy in (1, -1)]
    patches += [(CONTROL_POINTS[p], 1, sy) for p in HALF_PATCHES for sy in (1, -1)]
    row = np.arange(steps)
    first = (row[:, None] * (steps + 1) + row).ravel()
    quads = np.stack([first, first + 1, first + steps + 2, first + steps + 1], axis=1)
    positions, triangles = [], []
    for number, (patch, sx, sy) in enumerate(patches):
        grid = bezier_grid(patch * [sx, sy, 1], steps)
        positions.append(grid.reshape(-1, 3))
        cut = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        triangles.append((cut if sx * sy > 0 else cut[:, ::-1]) + number * (steps + 1) ** 2)
    x, y, z = np.concatenate(positions).T
    return fz.Mesh(np.float32(np.stack([x, z, -y], axis=1)), np.int32(np.concatenate(triangles)))


class View:
    """An orthographic view from the side and a little above, with a depth buffer of the mesh."""

    def __init__(self, mesh: fz.Mesh, size: int = 500, turn: float = 0.45, tilt: float = 0.42):
        around = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
        down = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
        self.axes = down @ around  # rows: right, up, towards the eye
        corners = mesh.positions[mesh.triangles].astype(float)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        random = np.random.default_rng(0)
        chosen = corners[random.choice(len(corners), 3_000_000, p=area / area.sum())]
        u, v = np.sort(random.random((2, len(chosen), 1)), axis=0)
        places = self.see(chosen[:, 0] * u + chosen[:, 1] * (v - u) + chosen[:, 2] * (1 - v))
        self.low, self.scale, self.size = places.min(axis=0), (size - 1) / np.ptp(places, axis=0)[:2].max(), size
        self.depth = np.full((size, size), -np.inf)
        np.maximum.at(self.depth, self._pixels(places), places[:, 2])

    def see(self, places: np.ndarray) -> np.ndarray:
        return np.asarray(places, float) @ self.axes.T

    def _pixels(self, seen: np.ndarray):
        return tuple(((seen[:, :2] - self.low[:2]) * self.scale).astype(int).T)

    def visible(self, points: fz.PointSet) -> tuple[np.ndarray, np.ndarray]:
        """Places (N, 3) in the view and which of them nothing hides."""
        seen = self.see(points.positions)
        facing = np.abs(points.normals @ self.axes[2].astype(np.float32))
        pixels = tuple(np.clip(p, 0, self.size - 1) for p in self._pixels(seen))
        slack = 3 / self.scale * (1 + 1 / np.maximum(facing, 0.2))
        return seen, seen[:, 2] > self.depth[pixels] - slack


def poisson_like(mesh: fz.Mesh, points: fz.PointSet) -> fz.PointSet:
    """Poisson points, as many as there are points."""
    return fz.poisson_points(mesh, count=len(points))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/points_teapot.png"))
    parser.add_argument("--edge", type=float, default=0.21, help="largest edge of the regular points")
    parser.add_argument("--steps", type=int, default=8, help="quads along each patch")
    options = parser.parse_args()
    draw(options.output, options.edge, options.steps)


def draw(output: Path, edge: float = 0.21, steps: int = 8) -> dict[str, fz.PointStatistics]:
    """Write the picture and return the statistics of both kinds of points."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    mesh = teapot(steps)
    regular = fz.tessellated_points(mesh, edge)
    sets = {"tessellated": regular, "Poisson": poisson_like(mesh, regular)}
    measured = {name: fz.point_statistics(points, mesh) for name, points in sets.items()}
    view = View(mesh)
    figure = plt.figure(figsize=(11, 6.2))
    grid = figure.add_gridspec(2, 4, height_ratios=(2.2, 1), hspace=0.08, wspace=0.32)
    least, most = -0.7, 0.7
    for column, (name, points) in enumerate(sets.items()):
        axis = figure.add_subplot(grid[0, 2 * column : 2 * column + 2])
        seen, is_visible = view.visible(points)
        order = np.argsort(seen[is_visible, 2])
        ratio = np.log10(points.areas[is_visible] / points.areas.mean())[order]
        dots = axis.scatter(*seen[is_visible][order, :2].T, c=ratio, s=2.2, cmap="coolwarm", vmin=least, vmax=most)
        axis.set(aspect="equal", xticks=[], yticks=[], facecolor="#1d2228")
        axis.set_title(f"{name}: {len(points):,} points", fontsize=11)
        for spine in axis.spines.values():
            spine.set_visible(False)
    bar = figure.colorbar(dots, ax=figure.axes, fraction=0.018, pad=0.01, ticks=np.log10([0.2, 0.5, 1, 2, 5]))
    bar.ax.set_yticklabels(["1/5", "1/2", "mean", "2 x", "5 x"], fontsize=8)
    bar.set_label("area of a point", fontsize=9)
    colors = {"tessellated": "#b5543c", "Poisson": "#2f6db3"}
    near, areas = figure.add_subplot(grid[1, :2]), figure.add_subplot(grid[1, 2:])
    for name, points in sets.items():
        from scipy.spatial import cKDTree

        distances = cKDTree(points.positions).query(points.positions, k=2)[0][:, 1]
        style = {"histtype": "stepfilled", "alpha": 0.6, "color": colors[name], "label": name}
        near.hist(distances / distances.mean(), np.linspace(0, 3, 91), **style)
        areas.hist(np.log10(points.areas / points.areas.mean()), np.linspace(-3, 1, 91), **style)
    near.set(xlabel="distance to the nearest point / mean", yticks=[])
    areas.set(xlabel="area / mean", yticks=[], xticks=[-3, -2, -1, 0, 1])
    areas.set_xticklabels(["1/1000", "1/100", "1/10", "1", "10"])
    near.legend(fontsize=9, frameon=False)
    output.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(output, dpi=90, bbox_inches="tight", facecolor="white")
    plt.close(figure)
    quantise(output)
    for name, statistics in measured.items():
        print(
            f"{name:<12} {statistics.count} points, nearest pair {statistics.min_distance:.4f}, "
            f"gap {statistics.gap:.4f}, distance spread {statistics.distance_spread:.3f}, "
            f"area spread {statistics.area_spread:.3f}"
        )
    return measured


def quantise(path: Path) -> None:
    """A PNG of 128 colours: a third of the size."""
    from PIL import Image

    Image.open(path).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main()
