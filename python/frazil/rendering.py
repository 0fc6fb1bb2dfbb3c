"""`render`: from a scene to a film, on all cores, stoppable.

Model: options are checked by the core; here they are named, sizes are predicted, and the work runs beside the main
thread, so that Ctrl-C is heard while the core computes and stops it at the next tile.
Units: metres; seconds in the stats, bytes for `peak_memory`.
Not: reading scenes and writing files.
"""

import json
import os
import re
import resource
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from datetime import datetime
from difflib import get_close_matches
from typing import Any

import numpy as np

from . import _frazil
from .aovs import chosen_aovs
from .baking import BAKE_FREE_OPTIONS, BAKE_OPTIONS, Bake, refresh_bake
from .checkpoint import Checkpoint
from .cryptomatte import scene_headers
from .denoise import check_denoiser, denoise_film
from .film import Film
from .mattes import resolve_mattes
from .stoppable import Progress, run_stoppable
from .tolerance import RENDER_TOLERANCE
from .version import version
from .warning import FrazilWarning

__all__ = ["ESTIMATORS", "render"]

ESTIMATORS = ("noise_free", "sum")


def render(
    scene: Any,
    *,
    resolution: tuple[int, int] = (960, 540),
    samples: int = 32,
    shading_samples: int = 0,
    noise: float = 0.0,
    min_samples: int = 16,
    seed: int = 0,
    threads: int = 0,
    max_bounces: int = 4,
    spacing: float = 0.0,
    spacing_scale: float = 1.0,
    spacing_pixels: float = 0.0,
    bake_samples: int = 0,
    bake_error: float = 0.0,
    translucent_shadows: bool = False,
    bake_bounces: int = 4,
    tolerance: float = RENDER_TOLERANCE,
    estimator: str = "noise_free",
    pixel_filter: str = "blackman_harris",
    aovs: Sequence[str] = (),
    lpes: Mapping[str, str] | None = None,
    mattes: Mapping[str, Sequence[str]] | None = None,
    bake: Bake | None = None,
    bake_cache: str | os.PathLike | None = None,
    denoise: bool = False,
    checkpoint: str | os.PathLike | None = None,
    checkpoint_minutes: float = 10.0,
    resume: bool = False,
    progress: Progress | None = None,
) -> Film:
    """Render a scene.

    Parameters
    ----------
    scene : Scene
        From `load_usd`, or made in Python.
    resolution : (int, int)
        Width and height in pixels, each from 1 to 65536.
    samples : int
        Of the camera per pixel, 1 or more; the most, where `noise` is given.
    shading_samples : int
        About how many of a pixel's samples are shaded, each for those that see alike (one object, like normals and
        places): the others tell what is seen. 0 shades all. The expected picture is the same; edges, depth, ids and
        mattes have all samples.
    noise : float
        Standard error at which a pixel gets no more samples, relative to its luminance plus a tenth of the picture's
        mean, averaged over 5x5 pixels; 0 gives every pixel all samples. The layer ``sample_count`` tells how many.
    min_samples : int
        Paths per pixel before `noise` is asked, 1 or more.
    seed : int
        Of all random numbers. The same seed gives the same bits, for any number of threads.
    threads : int
        0 = all cores.
    max_bounces : int
        Of diffuse and specular paths after the first hit, 0 or more.
    spacing : float
        Of the translucency points, metres; 0 = by material.
    spacing_scale : float
        Multiplies every spacing, > 0.
    spacing_pixels : float
        Points are no nearer to each other than so many pixels of the camera, so that far ice takes fewer; 0 = off.
    bake_samples : int
        Shadow rays per point and light, and as many that look for bounced light, twice as many for `occlusion`. 0 = 32
        where points are half a mean free path apart or more, and where they are closer as many to the same area, 8 at
        least: neighbours share what their rays tell.
    bake_error : float
        Relative error at each point to which the bake takes more samples, >= 0; 0 = none.
    translucent_shadows : bool
        Shadow rays of the bake go on through ice, dimmed: for thin clear ice. Off, light that enters ice counts as
        diffused there.
    bake_bounces : int
        Of light that reaches the points by way of ice and diffuse surfaces, 0 or more. With 3 or more all
        that is left after them is added as a geometric series.
    tolerance : float
        Relative error that clustering may make in a gather, > 0.
    estimator : str
        ``noise_free`` or ``sum``.
    pixel_filter : str
        ``blackman_harris`` or ``box``.
    aovs : sequence of str
        Layers of the AOV table to make beside those that are made anyway; see docs/aovs.md.
    lpes : mapping of str to str
        Light path expressions: a layer's name and what it keeps, as in ``{"ice_of_rim": "C<TD>.*<L.'rim'>"}``.
    mattes : mapping of str to sequence of str
        Sets of objects by name, as paths at or above them, beside those of the stage's collections: each gets a layer
        ``matte.NAME`` and one ``refracted_matte.NAME``.
    bake : Bake, optional
        Of this very scene (`frazil.bake`); without one the render bakes.
    bake_cache : path-like, optional
        A file that keeps the bake between renders: what in it still holds is taken over, the rest is baked anew and
        written. ``film.stats["bake_cache"]`` tells.
    denoise : bool
        Open Image Denoise on the ray-traced layers; translucency has no noise. The layers still sum to the beauty.
    checkpoint : path-like, optional
        A file that keeps the state of the render every `checkpoint_minutes` and when it is stopped. Delete it once the
        picture is written.
    checkpoint_minutes : float
        0 writes only when the render is stopped.
    resume : bool
        Go on from `checkpoint` to the bits of an unbroken render. ValueError where it is of another scene or options.
    progress : callable, optional
        Called as ``progress(stage, fraction)`` with fraction in [0, 1], from any thread. What it raises stops the
        render and is raised here.

    Returns
    -------
    Film
        Its layers are views of the renderer's memory.

    Raises
    ------
    ValueError
        For a scene or options out of range; the message begins with the object's path.
    MemoryError
        Where the picture would not fit into the memory that is free.
    KeyError
        For an unknown AOV or object of a matte; the message has the nearest.
    KeyboardInterrupt
        On Ctrl-C, at the next tile.

    Examples
    --------
    >>> import frazil as fz
    >>> film = fz.render(fz.load_usd("ice.usda"), resolution=(480, 270), samples=16)   # doctest: +SKIP
    >>> film.save("ice.exr")                                                           # doctest: +SKIP
    """
    options = {
        "width": resolution[0],
        "height": resolution[1],
        "samples": samples,
        "shading_samples": shading_samples,
        "noise": noise,
        "min_samples": min_samples,
        "seed": seed,
        "threads": threads,
        "max_bounces": max_bounces,
        "spacing": spacing,
        "spacing_scale": spacing_scale,
        "spacing_pixels": spacing_pixels,
        "bake_samples": bake_samples,
        "bake_error": bake_error,
        "translucent_shadows": translucent_shadows,
        "bake_bounces": bake_bounces,
        "tolerance": tolerance,
        "estimator": estimator,
        "filter": pixel_filter,
        "aovs": chosen_aovs(aovs),
        "lpes": list((lpes or {}).items()),
        "mattes": resolve_mattes(scene, mattes),
    }
    _refuse_what_cannot_fit(*resolution)
    _warn_of_unknown_labels(scene, lpes or {})
    if resume and checkpoint is None:
        raise ValueError("render: resume must come with a checkpoint, got none. Name its file.")
    if denoise:
        check_denoiser()
    job: dict[str, Any] = {}
    saved = None
    if checkpoint is not None:
        saved = Checkpoint(checkpoint, scene, options)
        job |= {"checkpoint": saved.save, "checkpoint_seconds": 60.0 * checkpoint_minutes}
    if resume and saved is not None:
        job["resume"] = saved.load()
    bake_stats: dict[str, Any] = {}
    if bake_cache is not None:
        bake, report = refresh_bake(
            scene, bake_cache, {k: options[k] for k in (*BAKE_OPTIONS, *BAKE_FREE_OPTIONS)}, progress
        )
        bake_stats = {**report.stats, "bake_cache": str(report)}
    if bake is not None:
        job["bake"] = bake

    core = _core_options(options)
    result = run_stoppable(lambda report: _frazil.render(scene, core, progress=report, **job), progress)
    stats = _both(bake_stats, result.stats)
    for message in result.stats["warnings"]:
        warnings.warn(message, FrazilWarning, stacklevel=2)
    paths = [item.path for item in scene.objects]
    names_of_mattes = {name: [paths[i] for i in members] for name, members in options["mattes"]} or None
    metadata = (
        _provenance(scene, options | {"lpes": dict(lpes or {}), "mattes": names_of_mattes}, stats)
        | _what_layers_hold(result)
        | scene_headers(scene, aovs)
    )
    film = Film(result.layers, metadata, stats)
    if denoise:
        start = time.perf_counter()
        denoise_film(film)
        stats["seconds"]["denoise"] = time.perf_counter() - start
    film.stats["peak_memory"] = peak_memory()
    return film


def _both(bake: dict[str, Any], render: dict[str, Any]) -> dict[str, Any]:
    """The statistics of a bake and of the render that took it: counts and seconds add up."""
    seconds = {
        name: bake.get("seconds", {}).get(name, 0.0) + render.get("seconds", {}).get(name, 0.0)
        for name in {**bake.get("seconds", {}), **render.get("seconds", {})}
    }
    both = {**render, "seconds": seconds}
    for name in ("bake_rays", "dropped_samples"):
        if name in bake:
            both[name] = bake[name] + render.get(name, 0)
    if "bake_cache" in bake:
        both["bake_cache"] = bake["bake_cache"]
    return both


def _core_options(options: dict[str, Any]) -> _frazil.RenderOptions:
    core = _frazil.RenderOptions()
    for name, value in options.items():
        setattr(core, name, value)
    return core


def peak_memory() -> int:
    """The most memory that this process has held so far, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _provenance(scene: Any, options: dict[str, Any], stats: dict[str, Any]) -> dict[str, Any]:
    """Where the picture comes from, for its file's header. A scene made in Python has no file and no frame."""
    frame = getattr(scene, "frame", None)
    origin = {
        "Software": f"Frazil {version()}",
        "DateTime": datetime.now().strftime("%Y:%m:%d %H:%M:%S"),
        "frazil:scene": getattr(scene, "file", None),
        "frazil:frame": "default" if frame is None else float(frame),
        "frazil:camera": scene.camera.path,
        "worldToCamera": np.linalg.inv(scene.camera.matrix),
        "frazil:objects": [item.path for item in scene.objects],
        "frazil:dropped_samples": int(stats.get("dropped_samples", 0)),
    }
    return origin | {f"frazil:{name}": value for name, value in options.items() if name not in ("width", "height")}


def _what_layers_hold(result: Any) -> dict[str, Any]:
    """What a later change of the layers needs to know of them."""
    knots = list(result.ramp_knots)
    return {
        "frazil:light_groups": [name or "default" for name in result.light_groups],
        "frazil:additive": [row["name"] for row in _frazil.aov_table() if row["is_additive"]],
        "frazil:compensation": json.dumps(list(result.compensations)),
        "frazil:ramp_knots": json.dumps(knots) if knots else None,
        "frazil:overlays": json.dumps(list(result.overlays)) if result.overlays else None,
    }


def _warn_of_unknown_labels(scene: Any, lpes: Mapping[str, str]) -> None:
    """Labels of expressions that match nothing, such as a misspelt light group: their layers would be black."""
    if not lpes:
        return
    lobes = ("diffuse", "specular", "refraction", "translucency")
    groups = dict.fromkeys(light.group or "default" for light in scene.lights)
    paths = [item.path for item in (*scene.objects, *scene.lights)]
    known = {*groups, *paths, *lobes, ""}
    for name, expression in lpes.items():
        for label in dict.fromkeys(re.findall(r"'([^']*)'", expression)):
            if label in known:
                continue
            nearest = get_close_matches(label, sorted(known), n=1)
            hint = f" Did you mean {nearest[0]!r}?" if nearest else ""
            message = (
                f"lpe {name}: label must be a light group ({', '.join(groups)}), a lobe, or the path of an object or "
                f"light, got {label!r}. It matches nothing.{hint}"
            )
            warnings.warn(message, FrazilWarning, stacklevel=3)


def _refuse_what_cannot_fit(width: int, height: int) -> None:
    channels = sum(len(row["channels"]) for row in _frazil.aov_table())
    needed = 4 * width * height * channels
    free = _free_memory()
    if needed > free:
        raise MemoryError(
            f"resolution: picture must fit into {free / 2**30:.1f} GiB of free memory, got {width}x{height}, "
            f"which needs {needed / 2**30:.1f} GiB. Lower --resolution."
        )


def _free_memory() -> int:
    try:
        with open("/proc/meminfo") as lines:
            return next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return sys.maxsize
