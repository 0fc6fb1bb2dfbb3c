"""`bake`: the points and the light of a scene's translucent bodies, and the file that keeps them between renders.

Model: a bake serves every camera and frame that shows the same shapes under the same lights. Its file remembers, by
content hash, what it was made of: points by shapes and spacing, each light group's light by the whole scene and that
group's lights. What still holds is taken over to the bit, the rest is baked anew.
Units: metres; irradiance in the lights' unit.
Valid: a file of another version of Frazil counts as changed.
Not: trees, which are made of the points in a moment.

The file is a zip archive without compression: ``manifest.json`` (format, version, hashes, light groups, object paths)
and, for each object that is ice, ``I.points.ply`` (`PointSet.save`), ``I.light.npy`` and,
with the estimator noise_free, ``I.moments.npy`` (each (N, G, 3) float32).
"""

import json
import os
import tempfile
import warnings
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import _frazil
from ._frazil import Bake
from .content import content_hash, scene_hash
from .replacing import DAMAGED_ARCHIVE, replacing
from .stoppable import Progress, run_stoppable
from .tolerance import RENDER_TOLERANCE
from .warning import FrazilWarning

__all__ = ["Bake", "bake", "load_bake", "refresh_bake", "save_bake"]

_FORMAT = "frazil bake"
_VERSION = 8
# What a bake depends on; other options of a render leave it as it is.
BAKE_OPTIONS = (
    "seed",
    "spacing",
    "spacing_scale",
    "spacing_pixels",
    "bake_samples",
    "bake_error",
    "bake_bounces",
    "translucent_shadows",
    "tolerance",
    "estimator",
)
# What else the core wants to know; bits depend on the picture's size by way of spacing_pixels alone.
BAKE_FREE_OPTIONS = ("threads", "width", "height")
# Properties of ice that change what is seen of it, not what bounces.
_ONLY_SEEN = ("ramp_", "compensation")


@dataclass
class BakeReport:
    """What became of a bake: which light groups were baked now, whether points were made, and the core's statistics."""

    has_new_points: bool
    new_groups: list[str]
    stats: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        if self.has_new_points:
            return "points and all light groups baked"
        if self.new_groups:
            return f"points taken over; light groups baked: {', '.join(g or 'default' for g in self.new_groups)}"
        return "points and light taken over"


def bake(
    scene: Any,
    *,
    seed: int = 0,
    threads: int = 0,
    spacing: float = 0.0,
    spacing_scale: float = 1.0,
    bake_samples: int = 0,
    bake_error: float = 0.0,
    translucent_shadows: bool = False,
    bake_bounces: int = 4,
    tolerance: float = RENDER_TOLERANCE,
    estimator: str = "noise_free",
    progress: Progress | None = None,
) -> Bake:
    """Make the points of every translucent body and bake the light that enters them.

    Parameters
    ----------
    scene : Scene
        From `load_usd`, or made in Python.
    seed, threads, spacing, spacing_scale, bake_samples, bake_bounces, tolerance, estimator, progress
        As for `render`; a render takes a bake only for the same scene.

    Returns
    -------
    Bake
        For ``render(scene, bake=...)`` and `save_bake`.

    Raises
    ------
    ValueError
        For a scene or options out of range; the message begins with the object's path.

    Examples
    --------
    >>> import frazil as fz
    >>> scene = fz.load_usd("ice.usda")                          # doctest: +SKIP
    >>> film = fz.render(scene, bake=fz.bake(scene))             # doctest: +SKIP
    """
    options = {
        "seed": seed,
        "threads": threads,
        "spacing": spacing,
        "spacing_scale": spacing_scale,
        "bake_samples": bake_samples,
        "bake_error": bake_error,
        "translucent_shadows": translucent_shadows,
        "bake_bounces": bake_bounces,
        "tolerance": tolerance,
        "estimator": estimator,
    }
    return _bake(scene, options, None, progress).bake


def refresh_bake(
    scene: Any, path: str | os.PathLike, options: dict[str, Any], progress: Progress | None = None
) -> tuple[Bake, BakeReport]:
    """The bake of a scene, from a file where that still holds; the file then is up to date.

    Parameters
    ----------
    scene : Scene
    path : path-like
        The cache. Where there is none it is made; where it is damaged or of another scene it is made anew.
    options : dict
        Of `bake`, by name; others are ignored.
    progress : callable, optional

    Returns
    -------
    (Bake, BakeReport)

    Raises
    ------
    OSError
        Where the file cannot be written, or is not a bake at all: nothing foreign is overwritten.
    """
    hashes = _hashes(scene, options)
    known, old = None, None
    if Path(path).exists():
        try:
            known, old = _read(path, hashes)
        except (*DAMAGED_ARCHIVE, OSError) as error:
            if not _is_ours(path):
                raise OSError(
                    f"{path}: bake cache must be a file that Frazil wrote, got another. Name another file."
                ) from error
            warnings.warn(f"{path}: bake cache is damaged ({error}); it is made anew.", FrazilWarning, stacklevel=2)
    result = _bake(scene, options, known, progress)
    has_new_points = known is None or len(known) == 0
    taken = set() if has_new_points else set(known.groups)
    report = BakeReport(has_new_points, [g for g in result.bake.groups if g not in taken], result.stats)
    if hashes != old:
        _write(result.bake, path, hashes, [item.path for item in scene.objects])
    return result.bake, report


def save_bake(bake: Bake, path: str | os.PathLike, scene: Any, **options: Any) -> None:
    """Write a bake, whole or not at all. `options` are those that it was made with (`bake`)."""
    _write(bake, path, _hashes(scene, options), [item.path for item in scene.objects])


def load_bake(path: str | os.PathLike) -> Bake:
    """Read a bake, whatever scene it is of.

    Raises
    ------
    OSError
        For a file that is missing, damaged or no bake.
    """
    try:
        return _read(path, None)[0]
    except DAMAGED_ARCHIVE as error:
        raise OSError(
            f"{path}: bake must be a whole file of Frazil's, got a damaged or foreign one ({error})."
        ) from error


def _bake(scene: Any, options: dict[str, Any], known: Bake | None, progress: Progress | None) -> Any:
    core = _frazil.RenderOptions()
    for name in (*BAKE_OPTIONS, *BAKE_FREE_OPTIONS):
        if name in options:
            setattr(core, name, options[name])
    result = run_stoppable(lambda report: _frazil.bake(scene, core, known=known, progress=report), progress)
    for message in result.stats["warnings"]:
        warnings.warn(message, FrazilWarning, stacklevel=3)
    return result


def _hashes(scene: Any, options: dict[str, Any]) -> dict[str, Any]:
    """What the parts of a bake were made of: one text for the points, one per light group."""
    defaults = _frazil.RenderOptions()
    chosen = {name: options.get(name, getattr(defaults, name)) for name in BAKE_OPTIONS}
    shapes = scene_hash(scene, _ONLY_SEEN)
    if chosen["spacing_pixels"] > 0:
        size = [options.get(name, getattr(defaults, name)) for name in ("width", "height")]
        shapes = content_hash(shapes, scene.camera, size)
    groups = {
        group: content_hash(shapes, chosen, [light for light in scene.lights if light.group == group])
        for group in _frazil.light_groups(scene.lights)
    }
    placing = {name: chosen[name] for name in ("seed", "spacing", "spacing_scale", "spacing_pixels")}
    return {"points": content_hash(shapes, placing), "groups": groups}


def _write(bake: Bake, path: str | os.PathLike, hashes: dict[str, Any], objects: list[str]) -> None:
    manifest = {"format": _FORMAT, "version": _VERSION, **hashes, "group_order": bake.groups, "objects": objects}
    with (
        replacing(path) as temporary,
        tempfile.TemporaryDirectory(dir=temporary.parent) as folder,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_STORED, allowZip64=True) as archive,
    ):
        archive.writestr("manifest.json", json.dumps(manifest, indent=1))
        for i in range(len(bake)):
            points = bake.points(i)
            if len(points) == 0:
                continue
            ply = Path(folder) / "points.ply"
            points.save(ply)
            archive.write(ply, f"{i}.points.ply")
            with archive.open(f"{i}.light.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, bake.irradiance(i))
            moments = bake.moments(i)
            if moments is not None:
                with archive.open(f"{i}.moments.npy", "w", force_zip64=True) as stream:
                    np.lib.format.write_array(stream, moments)


def _read(path: str | os.PathLike, hashes: dict[str, Any] | None) -> tuple[Bake, dict[str, Any]]:
    """What of a file holds for these hashes (all of it for None), and the file's own hashes."""
    with zipfile.ZipFile(path) as archive, tempfile.TemporaryDirectory() as folder:
        manifest = json.loads(archive.read("manifest.json"))
        if manifest.get("format") != _FORMAT or manifest.get("version") != _VERSION:
            raise ValueError(f"format {manifest.get('format')!r}, version {manifest.get('version')!r}")
        own = {"points": manifest["points"], "groups": manifest["groups"]}
        if hashes is not None and own["points"] != hashes["points"]:
            return Bake(), own
        order = manifest["group_order"]
        kept = [
            g for g, name in enumerate(order) if hashes is None or hashes["groups"].get(name) == own["groups"][name]
        ]
        bake = Bake([order[g] for g in kept])
        names = set(archive.namelist())
        for i in range(len(manifest["objects"])):
            if f"{i}.points.ply" not in names:
                bake.append(_frazil.PointSet(), np.zeros((0, len(kept), 3), np.float32))
                continue
            points = _frazil.PointSet.load(archive.extract(f"{i}.points.ply", folder))
            arrays = []
            for name in (f"{i}.light.npy", f"{i}.moments.npy"):
                if name not in names:
                    continue
                with archive.open(name) as stream:
                    array = np.lib.format.read_array(stream, allow_pickle=False)
                arrays.append(np.ascontiguousarray(array[:, kept]))
            bake.append(points, *arrays)
        return bake, own


def _is_ours(path: str | os.PathLike) -> bool:
    """Whether a file may be overwritten as a bake: empty, named as one, or a zip archive that may have been one."""
    target = Path(path)
    if target.suffix == ".baking" or target.stat().st_size == 0:
        return True
    with target.open("rb") as stream:
        head = stream.read(4096)
    return head.startswith(b"PK") and b"manifest.json" in head
