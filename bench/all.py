"""Everything that is measured against others, in one run on one machine, as one table: `make bench`.

    python bench/all.py [--full] [-o bench/results/bench]

(a) points against pymeshlab, libigl, Open3D and trimesh; (b) gathers against the sum over every point; (c) seconds to a
picture of equal error against Mitsuba 3 and Cycles; (d) the most memory that each took; (e) growth with the number of
points and of threads. Writes OUT.md, OUT.json and OUT.png. Without --full sizes are such that it ends in about twenty
minutes on two idle cores; --full takes a million points for (a), 10^8 points for (e) and four times as many samples of
Mitsuba, whose mean is the truth, for (c).
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import frazil as fz

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "examples")]
import points as points_bench  # noqa: E402
import race  # noqa: E402
from teapot import teapot  # noqa: E402

# One size of a growing set in a process of its own: time and memory are its own.
GROWTH = """
import json, sys, time
sys.path.insert(0, sys.argv[1])
import numpy as np, frazil as fz
from teapot import teapot
def highest():  # of this process; ru_maxrss would begin with that of its parent
    return next(int(line.split()[1]) * 1024 for line in open('/proc/self/status') if line.startswith('VmHWM'))
count, threads = int(sys.argv[2]), int(sys.argv[3])
mesh = teapot(24)
spacing = float(np.sqrt(0.7 * mesh.area / count))
before = highest()
start = time.perf_counter(), time.process_time()
points = fz.poisson_points(mesh, spacing, threads=threads)
placed = time.perf_counter(), time.process_time()
light = np.ones((len(points), 3), np.float32)
tree = fz.PointTree(points, light, fz.Dipole(fz.Medium((8, 8, 8), (.05, .05, .05))))
planted = time.process_time()
places = points.positions[:: max(1, len(points) // 50_000)]
tree.gather(places, tolerance=0.01)
done = time.process_time()
print(json.dumps({'points': len(points), 'threads': threads, 'wall': placed[0] - start[0],
    'place_us': 1e6 * (placed[1] - start[1]) / len(points), 'tree_us': 1e6 * (planted - placed[1]) / len(points),
    'gather_us': 1e6 * (done - planted) / len(places),
    'bytes': (highest() - before) / len(points)}))
"""


def gather_rows(counts: list[int]) -> list[dict]:
    """Gathers by the tree and by the sum over every point, in processor time, at the same places."""
    mesh = teapot(16)
    profile = fz.Dipole(fz.Medium((8.0, 8.0, 8.0), (0.05, 0.05, 0.05)))
    rows = []
    for count in counts:
        points = fz.poisson_points(mesh, float(np.sqrt(0.7 * mesh.area / count)))
        light = np.maximum(points.normals @ np.float32([0.4, 0.8, 0.45]), 0)[:, None].repeat(3, axis=1)
        tree = fz.PointTree(points, np.ascontiguousarray(light), profile)
        places = points.positions[np.random.default_rng(1).choice(len(points), 50_000)]
        start = time.process_time()
        fast = tree.gather(places, tolerance=0.01, estimator="sum").exitance[:, 0]
        clustered = time.process_time() - start
        some = slice(0, 200)
        start = time.process_time()
        exact = tree.gather_exact(places[some], estimator="sum").exitance[:, 0]
        summed = (time.process_time() - start) / 200
        error = np.abs(fast[some] - exact) / exact.mean()
        rows.append(
            {
                "points": len(points),
                "gather_us": 1e6 * clustered / len(places),
                "sum_us": 1e6 * summed,
                "faster": summed / (clustered / len(places)),
                "RMS": float(np.sqrt(np.mean(error**2))),
                "worst": float(error.max()),
            }
        )
        print(f"gather, {count} points: {rows[-1]['faster']:.0f} x", flush=True)
    return rows


def growth_rows(counts: list[int]) -> list[dict]:
    rows = []
    for count in counts:
        for threads in (1, 2) if count == counts[0] else (2,):
            command = [sys.executable, "-c", GROWTH, str(HERE.parent / "examples"), str(count), str(threads)]
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                said = (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1][:160]
                rows.append({"points": count, "threads": threads, "error": said})
            else:
                rows.append(json.loads(done.stdout.splitlines()[-1]))
            print(f"growth: {rows[-1]}", flush=True)
    return rows


def write(results: dict, output: Path) -> None:
    output.parent.mkdir(parents=True, exist_ok=True)
    output.with_suffix(".json").write_text(json.dumps(results, indent=1))
    lines = [f"One run on {results['machine']}. Times are processor time over all threads unless they say wall.", ""]
    lines += ["## Points", "", *points_bench.table(results["points"], "teapot"), ""]
    lines += ["## Gathers against the sum over every point", ""]
    lines += ["| points | us a gather | us a sum | x faster | RMS error | worst |", "|---|---|---|---|---|---|"]
    for row in results["gather"]:
        lines.append(
            f"| {row['points']:,} | {row['gather_us']:.2f} | {row['sum_us']:,.0f} | {row['faster']:,.0f} "
            f"| {row['RMS']:.2%} | {row['worst']:.2%} |"
        )
    lines += ["", "## Seconds to a picture of equal error, and memory", "", *race.table(results["race"]), ""]
    lines += ["## Growth", ""]
    lines += ["| points | threads | wall s | us a point | us a point of the tree | us a gather | bytes a point |"]
    lines += ["|---|---|---|---|---|---|---|"]
    for row in results["growth"]:
        if "error" in row:
            lines.append(f"| {row['points']:,} | {row['threads']} | {row['error']} | | | | |")
            continue
        lines.append(
            f"| {row['points']:,} | {row['threads']} | {row['wall']:.2f} | {row['place_us']:.2f} "
            f"| {row['tree_us']:.2f} | {row['gather_us']:.2f} | {row['bytes']:.0f} |"
        )
    output.with_suffix(".md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    plot(results["race"], output.with_suffix(".png"))


def plot(rows: list[dict], path: Path) -> None:
    """Time against noise, with the line along which Monte Carlo renderers move, and the bias of each."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator

    shown = [row for row in rows if "error" not in row]
    media = list(dict.fromkeys(row["medium"] for row in shown))
    figure, axes = plt.subplots(1, len(media), figsize=(5.2 * len(media), 5.0), sharey=True, squeeze=False)
    colors = {name: f"C{i}" for i, name in enumerate(race.RENDERERS)}
    for axis, medium in zip(axes[0], media, strict=True):
        for row in (row for row in shown if row["medium"] == medium):
            name, size = row["renderer"], row["size"]
            marker = "o" if size == min(r["size"] for r in shown) else "s"
            label = f"{name}, {size}², bias {row['bias']:.1%}"
            axis.plot(row["seconds"], 100 * row["noise"], marker, color=colors[name], label=label)
            if not name.startswith("frazil"):
                noise = np.array([row["noise"], 0.01])
                axis.plot(row["seconds"] * (row["noise"] / noise) ** 2, 100 * noise, ":", color=colors[name], lw=1)
        axis.set(xscale="log", yscale="log", xlabel="processor s", title=f"{medium} ice")
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14)}
        axis.legend(fontsize=7, frameon=False, ncols=2, columnspacing=0.8, handletextpad=0.2, **below)
        axis.axhline(1.0, color="0.8", lw=1, zorder=0)
        for scale in (axis.xaxis, axis.yaxis):
            scale.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0)))
        axis.yaxis.set_minor_formatter("{x:g}")
    axes[0, 0].set_ylabel("noise, %")
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="large sizes: an hour or more")
    parser.add_argument("--peers-python", help="a Python that has the peers; otherwise one is made in build/peers")
    parser.add_argument("-o", "--output", type=Path, default=Path("bench/results/bench"))
    parser.add_argument("--sections", nargs="+", default=["points", "gather", "race", "growth"])
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    peers = options.peers_python or points_bench.peers_python(Path("build/peers"))
    record = options.output.with_suffix(".json")
    # Sections that are not asked for now stay as they were measured.
    results = json.loads(record.read_text()) if record.exists() else {}
    results |= {
        "machine": f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, {os.uname().sysname}"
    }
    jobs = {
        "points": lambda: points_bench.measure_all(
            teapot(16),
            argparse.Namespace(
                counts=[100_000, 1_000_000] if options.full else [30_000],
                threads=options.threads,
                limit=600.0,
                peers_python=peers,
                only=list(points_bench.SCRIPTS),
            ),
        ),
        "gather": lambda: gather_rows([100_000, 1_000_000] if options.full else [100_000]),
        "race": lambda: run_race(options, peers),
        "growth": lambda: growth_rows([10**5, 10**6, 10**7, 10**8] if options.full else [10**5, 10**6]),
    }
    for name in options.sections:
        results[name] = jobs[name]()
    for name in jobs:
        results.setdefault(name, [])
    write(results, options.output)


def run_race(options: argparse.Namespace, peers: str) -> list[dict]:
    parser = argparse.ArgumentParser()
    race.add_options(parser)
    chosen = parser.parse_args(["--sizes", "96", "256", "--samples", "8", "--cycles-spp", "64"])
    chosen.spp, chosen.threads = 1024 if options.full else 256, options.threads
    with tempfile.TemporaryDirectory() as temporary:
        return race.race(chosen, peers, Path(temporary))


if __name__ == "__main__":
    main()
