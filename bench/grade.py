"""Time and memory of `fz.grade` on a 1080p picture with 40 layers of half floats.

    python bench/grade.py [--width 1920 --height 1080 --layers 40]

Prints seconds for recipes of growing size, once the picture is loaded, and the peak memory against the file's size.
"""

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

import frazil as fz

COMPONENTS = ("translucency", "diffuse", "specular", "refraction", "volume", "emission", "background")


def make_picture(path: Path, width: int, height: int, layers: int) -> None:
    """Noise as the light of `layers` layers: the worst that compression can meet."""
    random = np.random.default_rng(1)
    groups = [f"light{k}" for k in range(max(2, (layers - len(COMPONENTS)) // len(COMPONENTS)))]
    film = {}
    total = np.zeros((height, width, 3), np.float32)
    for component in COMPONENTS:
        own = np.zeros((height, width, 3), np.float32)
        for group in groups:
            part = random.random((height, width, 3), np.float32) * np.float32(0.1)
            film[f"{component}_{group}"] = part.astype(np.float16)
            own += part
        film[component] = own.astype(np.float16)
        total += own
    film["beauty"] = np.concatenate([total, np.ones((height, width, 1), np.float32)], axis=2).astype(np.float16)
    film["N"] = random.random((height, width, 3), np.float32).astype(np.float16)
    metadata = {"frazil:light_groups": groups, "frazil:additive": list(COMPONENTS)}
    fz.Film(film, metadata).save(path, "zip")
    print(f"{len(film)} layers, {width}x{height}, {path.stat().st_size / 2**20:.0f} MiB on disk")


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measure(path: Path) -> None:
    """Grade in a process of its own, so that the peak is that of loading and grading."""
    start_memory = peak()
    start = time.perf_counter()
    film = fz.Film.load(path, keep_half=True)
    size = path.stat().st_size / 2**20
    print(f"load {time.perf_counter() - start:.2f} s, peak {peak() - start_memory:.0f} MiB")
    groups = [name.removeprefix("diffuse_") for name in film if name.startswith("diffuse_")]
    mix = {"lights": {group: {"intensity": 0.5 + 0.1 * k} for k, group in enumerate(groups)}}
    recipes = {
        "one component": {"components": {"specular": {"intensity": 0.5}}},
        "all lights": mix,
        "all lights and saturation": mix | {"color": {"saturation": 1.2, "exposure": 0.5, "temperature": 5000}},
        "all lights, saturation, gamma": mix | {"color": {"saturation": 1.2, "gamma": 1.1}},
    }
    for name, recipe in recipes.items():
        seconds, cpu = [], []
        for _ in range(5):
            start, start_cpu = time.perf_counter(), time.process_time()
            fz.grade(film, recipe)
            seconds.append(time.perf_counter() - start)
            cpu.append(time.process_time() - start_cpu)
        print(f"{name:32} best {min(seconds):.3f} s, median {sorted(seconds)[2]:.3f} s, {sorted(cpu)[2]:.3f} CPU s")
    used = peak() - start_memory
    print(f"peak memory beyond the interpreter {used:.0f} MiB = {used / size:.2f} x the file")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=1920)
    parser.add_argument("--height", type=int, default=1080)
    parser.add_argument("--layers", type=int, default=40)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "in.exr"
        child = os.fork()
        if child == 0:
            make_picture(path, options.width, options.height, options.layers)
            os._exit(0)
        os.waitpid(child, 0)
        measure(path)


if __name__ == "__main__":
    main()
