"""`frazil bake`: points and light of a USD stage into a file that renders take them from."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ..tolerance import RENDER_TOLERANCE
from .bake_options import BakeBounces, BakeError, BakeSamples, TranslucentShadows
from .checks import checked_resolution, misused, one_of, positive, refuse_unreadable, refuse_unwritable, within
from .frames import authored_resolution
from .progress import PROGRESS_KINDS, make_progress

__all__ = ["bake_command"]


def bake_command(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.usd", help="The stage: usd, usda, usdc or usdz.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE.bake", help="The file; what in it still holds is kept.")
    ],
    camera: Annotated[
        str | None, typer.Option(metavar="PATH", help="Prim path of the camera that --spacing-pixels is for.")
    ] = None,
    resolution: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Pixels of --spacing-pixels. Default: the stage's, else 960x540."),
    ] = None,
    frame: Annotated[
        float | None, typer.Option(metavar="F", help="Time code to bake. Default: the stage's default values.")
    ] = None,
    rest_frame: Annotated[
        float | None,
        typer.Option(metavar="F", help="Time code at which deforming meshes rest, so that points stay on them."),
    ] = None,
    threads: Annotated[int, typer.Option(metavar="N", help="0 = all cores; the bake is the same.")] = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of all random numbers.")] = 0,
    spacing: Annotated[
        float, typer.Option(metavar="METRES", help="Between translucency points. 0 = by material.")
    ] = 0.0,
    spacing_scale: Annotated[float, typer.Option(metavar="FACTOR", help="Multiplies every spacing.")] = 1.0,
    spacing_pixels: Annotated[
        float, typer.Option(metavar="PIXELS", help="Points no nearer than so many pixels of the camera.")
    ] = 0.0,
    bake_samples: BakeSamples = 0,
    bake_error: BakeError = 0.0,
    translucent_shadows: TranslucentShadows = False,
    bake_bounces: BakeBounces = 4,
    tolerance: Annotated[float, typer.Option(help="Relative error of a translucency gather.")] = RENDER_TOLERANCE,
    estimator: Annotated[str, typer.Option(metavar="NAME", help="noise_free or sum.")] = "noise_free",
    progress: Annotated[
        str, typer.Option(metavar="KIND", help="bar, farm (ALF_PROGRESS lines on stdout) or none.")
    ] = "bar",
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only errors and warnings.")] = False,
) -> None:
    """Bake points and light of a USD stage for `frazil render --bake-cache FILE.bake` with the same options."""
    from ..rendering import ESTIMATORS

    one_of("--estimator", estimator, ESTIMATORS)
    one_of("--progress", progress, PROGRESS_KINDS)
    positive("--tolerance", tolerance)
    positive("--bake-error", bake_error, may_be_zero=True)
    positive("--spacing-scale", spacing_scale)
    positive("--spacing", spacing, may_be_zero=True)
    positive("--spacing-pixels", spacing_pixels, may_be_zero=True)
    size = None if resolution is None else checked_resolution(resolution)
    within("--threads", threads, 0, 4096)
    within("--seed", seed, 0, 2**32 - 1)
    within("--bake-samples", bake_samples, 0, 2**20)
    within("--bake-bounces", bake_bounces, 0, 64)
    if output.suffix.lower() in (".exr", ".png"):
        raise misused("-o", f"must not be a picture's name, got '{output}'. As in ice.bake.")
    refuse_unreadable(scene)
    refuse_unwritable(output)

    from ..baking import refresh_bake
    from ..usd import load_usd

    options: dict[str, Any] = {
        "seed": seed,
        "threads": threads,
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
    with make_progress("none" if quiet and progress == "bar" else progress, 1) as reporter:
        loaded = load_usd(scene, frame=frame, camera=camera, rest_frame=rest_frame)
        reporter("load", 1.0)
        options["width"], options["height"] = size or authored_resolution(loaded)
        bake, report = refresh_bake(loaded, output, options, reporter)
    if not quiet:
        count = sum(len(bake.points(i)) for i in range(len(bake)))
        print(f"frazil: {output}: {count} points, {len(bake.groups)} light groups; {report}", flush=True)
