"""Cryptomatte: what its layers are called, the header that names them, and mattes out of them by name.

Model: the published specification [Friedman2015]: ranks of (id, coverage) in RGBA layers ``<name>00``, ``01``, ``02``;
ids are MurmurHash3_32 of the name as float32; attributes ``cryptomatte/<key>/name, hash, conversion, manifest``.
Valid: reads any renderer's Cryptomatte with an embedded manifest, and ours.
Not: sidecar manifests; making the layers (the core does).
"""

import fnmatch
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .film import Film

__all__ = ["header_of", "manifest_of", "matte_of", "names_of"]

KINDS = ("object", "material", "asset")


def header_of(layer: str, names: Iterable[str]) -> dict[str, str]:
    """Header attributes of one Cryptomatte.

    Parameters
    ----------
    layer : str
        Such as ``crypto_object``.
    names : iterable of str
        All that may be in it.
    """
    from ._frazil import cryptomatte_hash

    ids = {name: f"{_bits_of(name):08x}" for name in dict.fromkeys(names)}
    key = f"cryptomatte/{cryptomatte_hash(layer):08x}"[: len("cryptomatte/") + 7]
    return {
        f"{key}/name": layer,
        f"{key}/hash": "MurmurHash3_32",
        f"{key}/conversion": "uint32_to_float32",
        f"{key}/manifest": json.dumps(ids, separators=(",", ":"), ensure_ascii=False),
    }


def manifest_of(film: Film, layer: str) -> dict[str, str]:
    """Name to eight hexadecimal digits, for one Cryptomatte of a film; ValueError where the header has none."""
    for attribute, value in film.metadata.items():
        match = re.fullmatch(r"cryptomatte/([0-9a-f]{7})/name", attribute)
        if match and value == layer:
            text = film.metadata.get(f"cryptomatte/{match[1]}/manifest")
            if text is None:
                break
            try:
                manifest = json.loads(text)
            except json.JSONDecodeError as error:
                raise ValueError(f"{layer}: manifest must be JSON: {error}.") from None
            if isinstance(manifest, Mapping):
                return {str(name): str(bits) for name, bits in manifest.items()}
            break
    raise ValueError(f"{layer}: manifest must be in the picture's header, is missing. Render with --aov {layer}.")


def names_of(film: Film, layer: str) -> list[str]:
    """The names that a Cryptomatte's manifest has."""
    return list(manifest_of(film, layer))


def matte_of(
    film: Film, kind: str, patterns: Sequence[str], *, refracted: bool = False
) -> tuple[np.ndarray, list[str]]:
    """The coverage of everything that is picked by name.

    Parameters
    ----------
    film : Film
        With the Cryptomatte's layers.
    kind : str
        object, material or asset.
    patterns : sequence of str
        Names, or shell patterns such as ``/World/Rocks*``.
    refracted : bool
        What is seen through ice.

    Returns
    -------
    coverage : (H, W) float32
        In 0..1.
    names : list of str
        Those that were picked.

    Raises
    ------
    ValueError
        Where the film lacks the layers or their manifest.
    """
    layer = ("crypto_refracted_" if refracted else "crypto_") + kind
    ranks = sorted(name for name in film if re.fullmatch(re.escape(layer) + r"\d\d", name))
    if not ranks:
        raise ValueError(f"grade: layer {layer}00 must be in the picture, is missing. Render with --aov all,{layer}.")
    manifest = manifest_of(film, layer)
    names = [name for name in manifest if any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)]
    picked = np.array([int(manifest[name], 16) for name in names], np.uint32)
    coverage = np.zeros((film.height, film.width), np.float32)
    for rank in ranks:
        array = np.ascontiguousarray(film[rank], dtype=np.float32)
        for channel in range(0, array.shape[2] - 1, 2):
            ids = np.ascontiguousarray(array[:, :, channel]).view(np.uint32)
            coverage += np.where(np.isin(ids, picked), array[:, :, channel + 1], 0.0)
    return coverage, names


def scene_headers(scene: Any, aovs: Iterable[str]) -> dict[str, str]:
    """Header attributes of the Cryptomattes among the AOVs, with the names of a scene."""
    wanted = [aov for aov in aovs if aov.startswith("crypto_")]
    if not wanted:
        return {}
    objects, materials = list(scene.objects), [material.path for material in scene.materials]
    names = {
        "object": [item.path for item in objects],
        "material": [materials[item.material] for item in objects],
        "asset": [item.asset or item.path for item in objects],
    }
    return {key: value for aov in wanted for key, value in header_of(aov, names[aov.split("_")[-1]]).items()}


def _bits_of(name: str) -> int:
    """The id's bits: the hash with an exponent that makes it a plain number."""
    from ._frazil import cryptomatte_hash

    bits = cryptomatte_hash(name)
    return bits ^ (1 << 23) if (bits >> 23) & 255 in (0, 255) else bits
