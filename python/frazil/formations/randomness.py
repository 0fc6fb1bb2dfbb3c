"""Random numbers that depend on nothing but a name and a seed."""

import zlib

import numpy as np


def generator(name: str, seed: int) -> np.random.Generator:
    """The generator of the formation `name` for `seed`."""
    return np.random.default_rng((zlib.crc32(name.encode()), int(seed)))
