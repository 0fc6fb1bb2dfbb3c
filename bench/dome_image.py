"""What a dome image costs to prepare: time and memory of its sampling tables, by size.

    python bench/dome_image.py [WIDTH ...]

An image of WIDTH x WIDTH/2 float pixels with a sun, in the form in which the USD reader hands it over; seconds of the
processor, and the process's largest memory in a process of its own.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time

import numpy as np


def measure(width: int) -> str:
    import frazil as fz

    image = np.full((width // 2, width, 3), 0.5, np.float32)
    image[width // 8, width // 3] = 1e5
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    start, wall = time.process_time(), time.perf_counter()
    dome = fz.DomeLight(image, "/sky")
    own, wall = time.process_time() - start, time.perf_counter() - wall
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    assert dome.has_image
    return f"{width:6} x {width // 2:5} {own:8.2f} {wall:8.2f} {before:10.0f} {after - before:10.0f}"


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(measure(int(sys.argv[2])))
        return
    print(f"{'pixels':>14} {'CPU s':>8} {'wall s':>8} {'image MiB':>10} {'more MiB':>10}")
    for width in map(int, sys.argv[1:] or ["2048", "8192", "16384"]):
        subprocess.run([sys.executable, __file__, "--one", str(width)], check=True)


if __name__ == "__main__":
    main()
