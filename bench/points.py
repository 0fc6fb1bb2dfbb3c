"""Poisson points against the samplers that geometry people use today, on one mesh, in one run.

    python bench/points.py [MESH] --counts 100000 1000000 -o bench/results/points

Without a mesh the teapot of examples/teapot.py is taken. Makes a virtual environment for the peers (pymeshlab, libigl,
Open3D, trimesh) unless --peers-python names one; Open3D wants the Debian package libusb-1.0-0, which is installed where
apt-get may, else its row says what is missing. Every sampler runs in a process of its own, so that its time and peak
memory are its own. Gaps, nearest pairs and the pair correlation are measured alike for all, by scipy. Writes a table
(.md), all numbers (.json) and a plot (.png).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from ctypes.util import find_library
from pathlib import Path

import numpy as np

PEERS_FOLDER = Path("build/peers")
PEERS = ("pymeshlab", "libigl", "open3d", "trimesh", "mitsuba", "bpy")

# Each runs as `python -c SCRIPT mesh count spacing output threads`: load, then time the sampler alone.
COMMON = """
import sys, time, numpy as np
def highest():  # of this process; ru_maxrss would begin with that of its parent
    for line in open('/proc/self/status'):
        if line.startswith('VmHWM'): return int(line.split()[1]) * 1024
path, count, spacing, output, threads = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[4], int(sys.argv[5])
data = np.load(path)
V, F = data['V'], data['F']
"""
FINISH = """
seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
peak = highest()
np.savez(output, P=np.asarray(P, np.float64), seconds=seconds, cpu=cpu, base=base, peak=peak, **extra)
"""
BASE = "base = highest(); extra = {}; start = time.perf_counter(); cpu = time.process_time()\n"
SCRIPTS = {
    "frazil": COMMON
    + "import frazil as fz\nmesh = fz.Mesh(V.astype(np.float32), F.astype(np.int32))\n"
    + BASE
    + "points = fz.poisson_points(mesh, spacing, threads=threads)\nP = points.positions; extra['A'] = points.areas\n"
    + FINISH,
    "frazil, strict": COMMON
    + "import frazil as fz\nmesh = fz.Mesh(V.astype(np.float32), F.astype(np.int32))\n"
    + BASE
    + "points = fz.poisson_points(mesh, spacing, thin_walls=False, threads=threads)\n"
    + "P = points.positions; extra['A'] = points.areas\n"
    + FINISH,
    "pymeshlab": COMMON
    + "import pymeshlab\nms = pymeshlab.MeshSet(); ms.add_mesh(pymeshlab.Mesh(V, F))\n"
    + BASE
    + "ms.generate_sampling_poisson_disk(samplenum=count)\nP = ms.current_mesh().vertex_matrix()\n"
    + FINISH,
    "libigl": COMMON
    + "import igl\n"
    + BASE
    + "B, I, P = igl.blue_noise(V, F.astype(np.int64), spacing)[:3]\n"
    + FINISH,
    "open3d": COMMON
    + "import open3d as o3d\n"
    + "m = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(V), o3d.utility.Vector3iVector(F))\n"
    + BASE
    + "P = np.asarray(m.sample_points_poisson_disk(count).points)\n"
    + FINISH,
    "trimesh": COMMON
    + "import trimesh\nm = trimesh.Trimesh(V, F, process=False)\n"
    + BASE
    + "P = trimesh.sample.sample_surface_even(m, count)[0]\n"
    + FINISH,
}


def run(python: str, name: str, mesh: Path, count: int, spacing: float, threads: int, folder: Path, limit: float):
    """One sampler in one process; its arrays, or the reason why there are none."""
    output = folder / "out.npz"
    output.unlink(missing_ok=True)
    command = [python, "-c", SCRIPTS[name], str(mesh), str(count), str(spacing), str(output), str(threads)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit)
    except subprocess.TimeoutExpired:
        return f"more than {limit:.0f} s"
    if not output.exists():
        return (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1][:120]
    return dict(np.load(output))


def measure(points: np.ndarray, places: np.ndarray, area: float) -> dict:
    """Nearest pair, largest gap over places on the surface (both through the air), spread, pair correlation.

    The relative radius is the nearest pair over that of the densest packing of as many points [Lagae2008]; the pair
    correlation is 1 where a distance is as frequent as among points at random."""
    from scipy.spatial import cKDTree

    tree = cKDTree(points)
    nearest = tree.query(points, k=2)[0][:, 1]
    gap = tree.query(places)[0].max()
    scale = np.median(nearest)
    some = np.random.default_rng(0).choice(len(points), min(len(points), 4000), replace=False)
    edges = np.linspace(0, 4 * scale, 81)
    near = tree.query_ball_point(points[some], edges[-1])
    distances = np.concatenate([np.linalg.norm(points[n] - points[i], axis=1) for i, n in zip(some, near, strict=True)])
    counts = np.histogram(distances[distances > 0], edges)[0]
    ring = np.pi * (edges[1:] ** 2 - edges[:-1] ** 2)
    correlation = counts / ring / len(some)
    correlation /= correlation[-20:].mean()
    middles = 0.5 * (edges[1:] + edges[:-1]) / scale
    return {
        "relative_radius": float(nearest.min() / np.sqrt(2 / np.sqrt(3) * area / len(points))),
        "close_pairs": float(correlation[middles < 0.9].mean()),
        "peak": float(correlation.max()),
        "peak_radius": float(middles[correlation.argmax()]),
        # How far the curve still swings: 0 = no order at a distance.
        "swing": float(np.abs(correlation[(middles > 1.5) & (middles < 3)] - 1).mean()),
        "min": float(nearest.min()),
        "gap": float(gap),
        "gap_over_min": float(gap / nearest.min()) if nearest.min() > 0 else None,
        "spread": float(nearest.std() / nearest.mean()),
        "correlation": correlation.tolist(),
        "radius_over_median": middles.tolist(),
    }


def sample(vertices, faces, count):
    corners = vertices[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    random = np.random.default_rng(7)
    chosen = random.choice(len(faces), count, p=area / area.sum())
    u, v = random.random((2, count))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    c = corners[chosen]
    return c[:, 0] * (1 - u - v)[:, None] + c[:, 1] * u[:, None] + c[:, 2] * v[:, None], area.sum()


def peers_python(folder: Path) -> str:
    """A virtual environment with the peers, made once."""
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "-q", "numpy", "scipy", "matplotlib"], check=True)
        for peer in PEERS:  # a peer without a package for this Python is a row that says so
            subprocess.run([str(python), "-m", "pip", "install", "-q", peer])
    return str(python)


def table(rows: list[dict], mesh: str) -> list[str]:
    """The rows as markdown."""
    lines = [
        f"`{mesh}`; times of the sampler alone, without loading; processor time of all its threads; "
        f"gap and nearest pair through the air.",
        "",
        "| sampler | asked | points | s | processor s | points/s | x slower | gap / nearest pair | distance spread "
        "| bytes/point |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if "error" in row:
            lines.append(f"| {row['sampler']} | {row['asked']} | - | - | - | {row['error']} | | | | |")
            continue
        gap = f"{row['gap_over_min']:.2f}" if row["gap_over_min"] else "-"
        lines.append(
            f"| {row['sampler']} | {row['asked']:,} | {row['points']:,} | {row['seconds']:.2f} | {row['cpu']:.2f} "
            f"| {row['rate']:,.0f} "
            f"| {row['slower']:.1f} | {gap} | {row['spread']:.3f} | {row['bytes']:,.0f} |"
        )
    return lines


def quality_table(rows: list[dict]) -> list[str]:
    """What the points are as blue noise, as markdown."""
    lines = [
        "| sampler | points | relative radius | gap / nearest pair | spread | close pairs | peak | at | swing |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if "error" in row:
            continue
        gap = f"{row['gap_over_min']:.2f}" if row["gap_over_min"] else "-"
        lines.append(
            f"| {row['sampler']} | {row['points']:,} | {row['relative_radius']:.2f} | {gap} | {row['spread']:.3f} "
            f"| {row['close_pairs']:.3f} | {row['peak']:.2f} | {row['peak_radius']:.2f} | {row['swing']:.3f} |"
        )
    return lines


def plot_correlation(axis, rows: list[dict], colors: dict, title: str) -> None:
    """The pair correlation of each row with one."""
    for row in rows:
        style = {"lw": 2.2 if row["sampler"].startswith("frazil") else 1.2, "color": colors[row["sampler"]]}
        axis.plot(row["radius_over_median"], row["correlation"], label=row["sampler"], **style)
    axis.axhline(1, color="0.8", lw=0.8, zorder=0)
    axis.set(xlabel="distance / median nearest distance", ylabel="pair correlation", title=title, ylim=0, xlim=(0, 4))
    axis.legend(frameon=False, fontsize=9)


def write(rows: list[dict], mesh: str, area: float, options: argparse.Namespace) -> None:
    output = options.output
    output.parent.mkdir(parents=True, exist_ok=True)
    output.with_suffix(".json").write_text(json.dumps({"mesh": mesh, "area": area, "rows": rows}, indent=1))
    lines = [*table(rows, mesh), "", *quality_table(rows)]
    output.with_suffix(".md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    python = options.peers_python or str(PEERS_FOLDER / "bin" / "python")
    command = [python, __file__, "--draw", str(output.with_suffix(".json"))]
    subprocess.run(command + (["--plot", str(options.plot)] if options.plot else []), check=True)


def draw(results: Path, plot: Path | None) -> None:
    """The figures of a run's .json; runs where matplotlib is, among the peers."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    data = json.loads(results.read_text())
    rows, mesh = data["rows"], data["mesh"]
    figure, (axis, bars) = plt.subplots(1, 2, figsize=(11, 3.8), gridspec_kw={"width_ratios": (3, 2)})
    least = min(row["asked"] for row in rows)
    shown = [row for row in rows if "correlation" in row]
    colors = {name: f"C{i}" for i, name in enumerate(SCRIPTS)}
    correlated = [row for row in shown if row["asked"] == least]
    plot_correlation(axis, correlated, colors, f"{mesh}, {least:,} points")
    bars.barh(
        [f"{row['sampler']}, {row['asked']:,}" for row in reversed(shown)],
        [row["rate"] for row in reversed(shown)],
        color=[colors[row["sampler"]] for row in reversed(shown)],
    )
    bars.set(xscale="log", xlabel="points / s")
    bars.tick_params(axis="y", labelsize=8)
    figure.tight_layout()
    figure.savefig(results.with_suffix(".png"), dpi=80)
    if plot:
        figure, axis = plt.subplots(figsize=(7, 3.6))
        plot_correlation(axis, correlated, colors, f"{mesh}, about {least:,} points")
        figure.tight_layout()
        figure.savefig(plot, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", type=Path, nargs="?", help="default: the teapot")
    parser.add_argument("--counts", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--limit", type=float, default=600.0, help="seconds a sampler may take")
    parser.add_argument("--peers-python", help="a Python that has the peers; otherwise one is made in build/peers")
    parser.add_argument("--only", nargs="+", choices=list(SCRIPTS), default=list(SCRIPTS))
    parser.add_argument("--plot", type=Path, help="also write the pair correlation alone, as PNG")
    parser.add_argument("-o", "--output", type=Path, default=Path("bench/results/points"))
    parser.add_argument("--draw", type=Path, metavar="JSON", help="only draw the results of an earlier run")
    options = parser.parse_args()
    if options.draw:
        return draw(options.draw, options.plot)

    from frazil.mesh_io import read_mesh

    if options.mesh is None:
        sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))
        from teapot import teapot

        mesh, title = teapot(16), "teapot"
    else:
        mesh, title = read_mesh(options.mesh), options.mesh.name
    rows = measure_all(mesh, options)
    write(rows, title, mesh.area, options)


def measure_all(mesh, options: argparse.Namespace) -> list[dict]:
    """A row for every sampler and count of the options."""
    vertices, faces = mesh.positions.astype(np.float64), mesh.triangles.copy()
    rows = []
    if find_library("usb-1.0") is None and os.geteuid() == 0:  # for Open3D
        subprocess.run(["apt-get", "install", "-qq", "-y", "libusb-1.0-0"], capture_output=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        np.savez(folder / "mesh.npz", V=vertices, F=faces)
        peers = options.peers_python or peers_python(PEERS_FOLDER)
        for count in options.counts:
            places, area = sample(vertices, faces, max(500_000, 2 * count))
            spacing = float(np.sqrt(0.71 * area / count))
            reference = None
            for name in options.only:
                python = sys.executable if name.startswith("frazil") else peers
                got = run(python, name, folder / "mesh.npz", count, spacing, options.threads, folder, options.limit)
                row = {"sampler": name, "asked": count}
                if isinstance(got, str):
                    rows.append(row | {"error": got})
                    print(name, count, got, flush=True)
                    continue
                number, seconds = len(got["P"]), float(got["seconds"])
                rate = number / seconds
                reference = reference or rate
                row |= {
                    "points": number,
                    "seconds": seconds,
                    "cpu": float(got["cpu"]),
                    "rate": rate,
                    "slower": reference / rate,
                }
                row |= {"bytes": float(got["peak"] - got["base"]) / number} | measure(got["P"], places, area)
                if "A" in got:
                    row["area_error"] = float(abs(got["A"].sum(dtype="f8") / area - 1))
                rows.append(row)
                print(f"{name} {count}: {rate:,.0f} points/s", flush=True)
    return rows


if __name__ == "__main__":
    main()
