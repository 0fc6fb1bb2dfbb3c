"""`frazil render`: a USD stage in, a layered EXR and a PNG preview out, one per frame."""

import json
import math
import time
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer

from ..tolerance import RENDER_TOLERANCE
from ..warning import FrazilWarning
from .bake_options import BakeBounces, BakeError, BakeSamples, TranslucentShadows
from .checks import checked_resolution, misused, one_of, positive, refuse_unreadable, refuse_unwritable, within
from .frames import authored_resolution, fill_pattern, has_pattern, parse_frames
from .progress import PROGRESS_KINDS, make_progress

__all__ = ["render_command"]


def render_command(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.usd", help="The stage: usd, usda, usdc or usdz.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="OUT.exr", help="The EXR to write. For frames: out.####.exr, $F4, <F4> or %04d."
        ),
    ],
    camera: Annotated[
        str | None, typer.Option(metavar="PATH", help="Prim path of the camera. Default: the stage's own, else a view.")
    ] = None,
    materials: Annotated[
        Path | None,
        typer.Option(metavar="LOOKS.mtlx", help="A MaterialX file whose look replaces the stage's materials."),
    ] = None,
    look: Annotated[str | None, typer.Option(metavar="NAME", help="Of --materials; by default its first.")] = None,
    resolution: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Pixels. Default: the stage's render settings, else 960x540."),
    ] = None,
    samples: Annotated[int, typer.Option(metavar="N", help="Paths per pixel; the most, where --noise is given.")] = 32,
    noise: Annotated[
        float,
        typer.Option(metavar="ERROR", help="Relative standard error at which a pixel gets no more samples. 0 = off."),
    ] = 0.0,
    shading_samples: Annotated[
        int, typer.Option(metavar="N", help="Of a pixel's samples so many are shaded, each for those alike. 0 = all.")
    ] = 0,
    min_samples: Annotated[int, typer.Option(metavar="N", help="Paths per pixel before --noise is asked.")] = 16,
    denoise: Annotated[
        bool, typer.Option("--denoise", help="Open Image Denoise on the ray-traced layers, each by itself.")
    ] = False,
    bake_cache: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.bake", help="Keep points and light here; what in it still holds is not baked again."
        ),
    ] = None,
    checkpoint: Annotated[
        float | None,
        typer.Option(
            metavar="MINUTES", help="Write OUT.checkpoint this often and when stopped. 0 = only when stopped."
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from OUT.checkpoint, where there is one, to the same bits.")
    ] = False,
    frame: Annotated[
        float | None, typer.Option(metavar="F", help="Time code to render. Default: the stage's default values.")
    ] = None,
    frames: Annotated[
        str | None, typer.Option(metavar="A-B[xSTEP]", help="Several frames, as in 1-100x2 or 1,5,20-30.")
    ] = None,
    rest_frame: Annotated[
        float | None,
        typer.Option(metavar="F", help="Time code at which deforming meshes rest, so that points stay on them."),
    ] = None,
    threads: Annotated[int, typer.Option(metavar="N", help="0 = all cores; the picture is the same.")] = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of all random numbers.")] = 0,
    max_bounces: Annotated[int, typer.Option(metavar="N", help="Of diffuse and specular paths.")] = 4,
    spacing: Annotated[
        float, typer.Option(metavar="METRES", help="Between translucency points. 0 = by material.")
    ] = 0.0,
    spacing_scale: Annotated[float, typer.Option(metavar="FACTOR", help="Multiplies every spacing.")] = 1.0,
    spacing_pixels: Annotated[
        float, typer.Option(metavar="PIXELS", help="Points no nearer than so many pixels, so that far ice takes fewer.")
    ] = 0.0,
    bake_samples: BakeSamples = 0,
    bake_error: BakeError = 0.0,
    translucent_shadows: TranslucentShadows = False,
    bake_bounces: BakeBounces = 4,
    tolerance: Annotated[float, typer.Option(help="Relative error of a translucency gather.")] = RENDER_TOLERANCE,
    estimator: Annotated[str, typer.Option(metavar="NAME", help="noise_free or sum.")] = "noise_free",
    compression: Annotated[
        str, typer.Option(metavar="NAME", help="Of the EXR: none, rle, zip, zips, piz, pxr24, b44, b44a, dwaa, dwab.")
    ] = "zips",
    multipart: Annotated[
        bool, typer.Option("--multipart", help="Write every layer as a part of its own, which programs read singly.")
    ] = False,
    lpe: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=EXPRESSION", help="Write a layer of a light path expression, as in ice=C<TD>.*"),
    ] = None,
    matte: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=PATH,PATH",
            help="Write how much of each pixel shows these objects, directly and through ice: layers matte.NAME and "
            "refracted_matte.NAME; beside the stage's collections matte:NAME.",
        ),
    ] = None,
    aov: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LAYER",
            help="Write only these layers (repeat it, or comma between); 'all' stands for the usual ones, as in "
            "all,translucency_ramp. Default: the stage's render vars, else all.",
        ),
    ] = None,
    png: Annotated[
        Path | None, typer.Option("--png", metavar="OUT.png", help="The preview. Default: beside the EXR.")
    ] = None,
    no_png: Annotated[bool, typer.Option("--no-png", help="Write no preview.")] = False,
    stats: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write points, nodes, rays, seconds per stage, memory.")
    ] = None,
    progress: Annotated[
        str, typer.Option(metavar="KIND", help="bar, farm (ALF_PROGRESS lines on stdout) or none.")
    ] = "bar",
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only errors and warnings.")] = False,
) -> None:
    """Render a USD stage to a layered OpenEXR and a PNG preview."""
    # What can be refused without reading the scene is refused first.
    size = None if resolution is None else checked_resolution(resolution)
    from ..exr import COMPRESSIONS
    from ..rendering import ESTIMATORS

    one_of("--compression", compression, COMPRESSIONS)
    one_of("--estimator", estimator, ESTIMATORS)
    one_of("--progress", progress, PROGRESS_KINDS)
    positive("--tolerance", tolerance)
    positive("--bake-error", bake_error, may_be_zero=True)
    positive("--spacing-scale", spacing_scale)
    positive("--spacing", spacing, may_be_zero=True)
    positive("--spacing-pixels", spacing_pixels, may_be_zero=True)
    within("--samples", samples, 1, 2**24)
    within("--min-samples", min_samples, 1, 2**24)
    within("--shading-samples", shading_samples, 0, 2**24)
    positive("--noise", noise, may_be_zero=True)
    if checkpoint is not None:
        positive("--checkpoint", checkpoint, may_be_zero=True)
    within("--threads", threads, 0, 4096)
    within("--seed", seed, 0, 2**32 - 1)
    within("--max-bounces", max_bounces, 0, 1024)
    within("--bake-samples", bake_samples, 0, 2**20)
    within("--bake-bounces", bake_bounces, 0, 64)
    layers = _chosen_layers(aov)
    expressions = _named("--lpe", lpe, "EXPRESSION")
    mattes = {name: paths.split(",") for name, paths in _named("--matte", matte, "PATH,PATH").items()}
    jobs = _jobs(output, png, no_png, frame, frames)
    refuse_unreadable(scene)
    for _, exr, preview in jobs:
        refuse_unwritable(exr, preview)
        if checkpoint is not None or resume:
            refuse_unwritable(_checkpoint_of(exr))
    if stats is not None:
        refuse_unwritable(stats)
    if bake_cache is not None:
        refuse_unwritable(bake_cache)

    from ..aovs import layers_of
    from ..rendering import render as render_scene
    from ..usd import add_motion, load_usd

    options: dict[str, Any] = {
        "samples": samples,
        "noise": noise,
        "shading_samples": shading_samples,
        "min_samples": min_samples,
        "denoise": denoise,
        "bake_cache": bake_cache,
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
    }
    records = []
    with make_progress("none" if quiet and progress == "bar" else progress, len(jobs)) as reporter:
        for time_code, exr, preview in jobs:
            start = time.perf_counter()
            loaded = load_usd(
                scene, frame=time_code, camera=camera, rest_frame=rest_frame, materials=materials, look=look
            )
            seconds_load = time.perf_counter() - start
            reporter("load", 1.0)

            chosen = layers or _authored_layers(loaded)
            options["aovs"] = chosen or ()
            if chosen and "motion" in chosen:
                add_motion(loaded)
            options["lpes"] = expressions | _authored_lpes(loaded)
            options["mattes"] = mattes
            if checkpoint is not None or resume:
                saved = _checkpoint_of(exr)
                options |= {"checkpoint": saved, "resume": resume and saved.exists()}
                options["checkpoint_minutes"] = 10.0 if checkpoint is None else checkpoint
            film = render_scene(loaded, resolution=size or authored_resolution(loaded), progress=reporter, **options)

            start = time.perf_counter()
            film.save(
                exr,
                compression,
                layers=chosen and [*layers_of(chosen, film), *options["lpes"], *_mattes_of(film, chosen)],
                multipart=multipart,
            )
            if preview is not None:
                film.save_preview(preview)
            if checkpoint is not None or resume:
                _checkpoint_of(exr).unlink(missing_ok=True)
            if bake_cache is not None and not quiet:
                print(f"frazil: {bake_cache}: {film.stats['bake_cache']}", flush=True)
            records.append(_record(film, time_code, exr, seconds_load, time.perf_counter() - start))
            reporter.frame_done()
            if stats is not None:
                _write_stats(stats, scene, records)
            if not quiet:
                print(f"frazil: wrote {exr}" + (f" and {preview}" if preview is not None else ""), flush=True)


# ---- what is asked for -----------------------------------------------------------------------------------------------


def _chosen_layers(aov: list[str] | None) -> list[str] | None:
    """The AOVs of `--aov`, the beauty first; None for all that are made without being asked for."""
    if not aov:
        return None
    from ..aovs import ALL, aov_names

    known = (*aov_names(), ALL)
    names = [one_of("--aov", name.strip(), known) for part in aov for name in part.split(",")]
    for name in names:
        if names.count(name) > 1:
            raise misused("--aov", f"must name each layer once, got '{name}' twice.")
    return list(dict.fromkeys(["beauty", *_without_all(names)]))


def _named(option: str, texts: list[str] | None, what: str) -> dict[str, str]:
    """What `--lpe` and `--matte` give, by layer."""
    given: dict[str, str] = {}
    for text in texts or []:
        name, separator, value = text.partition("=")
        if not (name and separator and value):
            raise misused(option, f"must be NAME={what}, got '{text}'.")
        if name in given:
            raise misused(option, f"must name each layer once, got '{name}' twice.")
        given[name] = value
    return given


def _mattes_of(film: Any, chosen: list[str]) -> list[str]:
    """The layers of mattes: whoever names a set wants to see it."""
    kinds = [kind for kind in ("matte", "refracted_matte") if kind not in chosen]
    return [layer for layer in film if layer.partition(".")[0] in kinds]


def _authored_lpes(loaded: Any) -> dict[str, str]:
    """The light path expressions that the stage's render vars ask for, by layer."""
    settings = loaded.render_settings
    product_vars = settings.product.vars if settings else []
    return {var.layer: var.source_name for var in product_vars if var.source_type == "lpe"}


def _without_all(names: list[str]) -> list[str]:
    """The names, with `all` replaced by what it stands for."""
    from ..aovs import ALL, aov_table

    usual = [row["name"] for row in aov_table() if row["is_default"]]
    return [other for name in names for other in (usual if name == ALL else [name])]


def _jobs(
    output: Path, png: Path | None, no_png: bool, frame: float | None, frames: str | None
) -> list[tuple[float | None, Path, Path | None]]:
    """(time code, EXR, PNG) for every frame that is asked for."""
    if output.suffix.lower() != ".exr":
        raise misused("-o", f"must be a file name that ends in .exr, got '{output}'.")
    if png is not None and png.suffix.lower() != ".png":
        raise misused("--png", f"must be a file name that ends in .png, got '{png}'.")
    if png is not None and no_png:
        raise misused("--png", "must not be given together with --no-png.")
    if frame is not None and frames is not None:
        raise misused("--frame", "must not be given together with --frames.")
    if frame is not None and not math.isfinite(frame):
        raise misused("--frame", f"must be finite, got {frame}.")
    try:
        time_codes: list[float | None] = list(parse_frames(frames)) if frames is not None else [frame]
    except ValueError as error:
        raise misused("--frames", str(error)) from None
    if len(time_codes) > 1:
        for option, path in (("-o", output), ("--png", png)):
            if path is not None and not has_pattern(path):
                raise misused(option, f"must have a place for the frame's number, got '{path}'. As in out.####.exr.")
    preview = None if no_png else png or output.with_suffix(".png")
    try:
        return [(t, fill_pattern(output, t), preview and fill_pattern(preview, t)) for t in time_codes]
    except ValueError as error:
        raise misused("-o", str(error)) from None


def _checkpoint_of(exr: Path) -> Path:
    return exr.with_suffix(".checkpoint")


# Names that other renderers' render vars have for our layers.
_LAYER_OF_VAR = {
    "color": "beauty",
    "C": "beauty",
    "Ci": "beauty",
    "rgba": "beauty",
    "depth": "Z",
    "z": "Z",
    "normal": "N",
}


def _authored_layers(loaded: Any) -> list[str] | None:
    """The layers that the stage's render vars ask for, the beauty first; None for all, where there are no vars."""
    settings = loaded.render_settings
    if not settings or not settings.product.vars:
        return None
    from .._frazil import aov_table

    known = {row["name"] for row in aov_table()}
    layers = ["beauty"]
    for var in settings.product.vars:
        if var.source_type == "lpe":
            continue
        name = _LAYER_OF_VAR.get(var.source_name, var.source_name)
        if name in known:
            layers.append(name)
        else:
            message = f"{var.path}: sourceName '{var.source_name}' is no layer. There are {', '.join(sorted(known))}."
            warnings.warn(message, FrazilWarning, stacklevel=2)
    return list(dict.fromkeys(layers))


# ---- what is told ----------------------------------------------------------------------------------------------------


def _record(film: Any, time_code: float | None, exr: Path, seconds_load: float, seconds_save: float) -> dict[str, Any]:
    record = {key: value for key, value in film.stats.items() if key != "seconds"}
    seconds = {"load": seconds_load, **film.stats.get("seconds", {}), "save": seconds_save}
    size = {"width": film.width, "height": film.height}
    return {"frame": time_code, "output": str(exr), **size, **record, "seconds": seconds}


def _write_stats(path: Path, scene: Path, records: list[dict[str, Any]]) -> None:
    from ..replacing import replacing
    from ..version import version

    text = json.dumps({"version": version(), "scene": str(scene), "frames": records}, indent=2)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n")
