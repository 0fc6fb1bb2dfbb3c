"""Writes the small OpenVDB file that tests read, with OpenVDB's own module.

    PYTHONPATH=<where openvdb is, e.g. bpy/5.0/python/lib/python3.11/site-packages> python tests/data/clouds.py FOLDER

clouds.vdb holds a grid `density` of 4 x 5 x 6 voxels from (-2, 3, 1) on under a turned frame, of values
(i + 10 j + 100 k + 1) / 1000, a level set `distance` and a grid `tiled` with a constant tile.
"""

import sys
from pathlib import Path

import numpy as np
import openvdb


def grid(name: str, values: np.ndarray, outside: float = 0.0):
    made = openvdb.FloatGrid(outside)
    made.name = name
    made.copyFromArray(values, ijk=(-2, 3, 1), tolerance=0.0)
    c, s = np.cos(0.5), np.sin(0.5)
    made.transform = openvdb.createLinearTransform(
        [[0.1 * c, 0.1 * s, 0, 0], [-0.2 * s, 0.2 * c, 0, 0], [0, 0, 0.05, 0], [1, 2, 3, 1]]
    )
    return made


def main() -> None:
    i, j, k = np.mgrid[:4, :5, :6]
    values = ((i + 10 * j + 100 * k + 1) / 1000).astype(np.float32)
    tiled = openvdb.FloatGrid(0.0)
    tiled.name = "tiled"
    tiled.fill((0, 0, 0), (15, 15, 15), 2.0, True)
    every = [grid("density", values), grid("distance", values - 0.2, 0.3), tiled]
    openvdb.write(str(Path(sys.argv[1]) / "clouds.vdb"), grids=every)


if __name__ == "__main__":
    main()
