"""The command `frazil points`: Poisson points of a mesh file, written as PLY or USD."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from .checks import misused, positive

USD_SUFFIXES = {".usd", ".usda", ".usdc"}


def points_command(
    mesh: Annotated[Path, typer.Argument(help="USD, OBJ, PLY, STL or glTF file.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Binary PLY, or USD by its suffix.")],
    spacing: Annotated[float | None, typer.Option(help="Distance between points, in the mesh's unit (USD: m).")] = None,
    count: Annotated[int | None, typer.Option(help="Number of points, instead of a spacing.")] = None,
    seed: Annotated[int, typer.Option(help="Another seed gives other points.", min=0, max=2**32 - 1)] = 0,
    thin_walls: Annotated[bool, typer.Option(help="Give both sides of thin sheets their own points.")] = True,
    tessellated: Annotated[
        bool, typer.Option("--tessellated", help="Regular points instead, edges no longer than --spacing.")
    ] = False,
    texture: Annotated[
        Path | None,
        typer.Option(
            metavar="IMAGE", help="Spacing by texture: --spacing where it is black, --spacing-max where white."
        ),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(metavar="PATH", help="Spacing by this camera of a USD file: --pixels, but --spacing at least."),
    ] = None,
    pixels: Annotated[float, typer.Option(help="Between points, as the camera sees them.")] = 2.0,
    resolution: Annotated[str, typer.Option(metavar="WxH", help="Of the camera's picture.")] = "1920x1080",
    spacing_max: Annotated[float | None, typer.Option(help="Largest spacing, with --texture or --camera.")] = None,
    frame: Annotated[float | None, typer.Option(help="Time code of a USD file.")] = None,
    rest_frame: Annotated[
        float | None, typer.Option(help="Time code at which deforming meshes rest: their points are placed there.")
    ] = None,
    threads: Annotated[int, typer.Option(help="0 takes all cores.", min=0)] = 0,
    stats: Annotated[bool, typer.Option("--stats", help="Measure the points and print the result.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
) -> None:
    """Place Poisson-disk points on a mesh, with their areas."""
    from rich.console import Console
    from rich.progress import Progress

    import frazil as fz
    from frazil.mesh_io import read_mesh
    from frazil.points import spacing_from_texture

    from ..replacing import check_writable, replacing

    if (spacing is None) == (count is None):
        raise typer.BadParameter("give --spacing or --count, and not both")
    for name, value in (("--tessellated", tessellated), ("--texture", texture), ("--camera", camera)):
        if value and spacing is None:
            raise misused(name, "must come with --spacing, got --count.")
    if sum(map(bool, (tessellated, texture, camera))) > 1:
        raise misused("--texture", "must be alone: of --tessellated, --texture and --camera one at most.")
    if texture is not None and spacing_max is None:
        raise misused("--texture", "must come with --spacing-max, the spacing where it is white.")
    if spacing_max is not None:
        positive("--spacing-max", spacing_max)
        if texture is None and camera is None:
            raise misused("--spacing-max", "must come with --texture or --camera.")
    positive("--pixels", pixels)
    if camera is not None and mesh.suffix.lower() not in USD_SUFFIXES | {".usdz"}:
        raise misused("--camera", f"must come with a USD file, got '{mesh}'.")
    if output.suffix.lower() not in USD_SUFFIXES | {".ply"}:
        raise misused("-o", f"must end in .ply, .usd, .usda or .usdc, got '{output}'.")
    check_writable(output)
    surface = read_mesh(mesh, frame=frame, rest_frame=rest_frame)
    wanted = spacing
    if texture is not None:
        wanted = spacing_from_texture(texture, spacing, spacing_max)
    elif camera is not None:
        wanted = _spacing_by_camera(mesh, frame, camera, resolution, pixels, spacing, spacing_max)
    with Progress(console=Console(stderr=True), transient=True, disable=quiet) as bar:
        tasks = {}

        def report(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=1.0)
            bar.update(tasks[stage], completed=fraction)

        if tessellated:
            points = fz.tessellated_points(surface, spacing)
        else:
            points = fz.poisson_points(
                surface, wanted, seed, count=count, thin_walls=thin_walls, threads=threads, progress=report
            )
    if output.suffix.lower() in USD_SUFFIXES:
        save_usd(points, output)
    else:
        with replacing(output) as temporary:
            points.save(temporary)
    typer.echo(f"{len(points)} points, spacing {points.spacing:.6g}, area {points.areas.sum(dtype='f8'):.6g}: {output}")
    if stats:
        measured = fz.point_statistics(points, surface, thin_walls=thin_walls)
        typer.echo(
            f"nearest pair       {measured.min_distance:.6g} m, {measured.min_distance / points.spacing:.6f} x spacing"
        )
        typer.echo(f"largest gap        {measured.gap:.6g} m, {measured.gap / points.spacing:.6f} x spacing")
        typer.echo(f"mean distance      {measured.mean_distance:.6g} m to the nearest")
        typer.echo(f"distance spread    {measured.distance_spread:.4f} of the mean")
        typer.echo(f"mean area          {measured.mean_area:.6g} m2")
        typer.echo(f"area spread        {measured.area_spread:.4f} of the mean")


def _spacing_by_camera(
    stage: Path, frame: float | None, camera: str, resolution: str, pixels: float, least: float, most: float | None
):
    import frazil as fz
    from frazil.points import pixel_angle, spacing_from_camera

    from .frames import parse_resolution

    positive("--spacing", least)
    try:
        size = parse_resolution(resolution)
    except ValueError as error:
        raise misused("--resolution", str(error)) from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fz.FrazilWarning)  # the mesh's were given, and lights do not matter here
        seen_by = fz.load_usd(stage, frame=frame, camera=camera).camera
    angle = pixel_angle(seen_by, size)
    return spacing_from_camera(seen_by.matrix[3, :3], angle, pixels, least, float("inf") if most is None else most)


def save_usd(points, path: Path) -> None:
    """Write a UsdGeom.Points prim /Points in metres, with normals, widths and the rest as primvars."""
    from pxr import Sdf, Tf, Usd, UsdGeom, Vt

    from ..replacing import replacing

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    prim = UsdGeom.Points.Define(stage, "/Points")
    stage.SetDefaultPrim(prim.GetPrim())
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.positions))
    prim.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(points.normals))
    prim.CreateWidthsAttr(Vt.FloatArray([points.spacing]))
    prim.SetWidthsInterpolation(UsdGeom.Tokens.constant)
    if len(points):
        prim.CreateExtentAttr(UsdGeom.Points.ComputeExtent(prim.GetPointsAttr().Get(), Vt.FloatArray([points.spacing])))
    api = UsdGeom.PrimvarsAPI(prim)
    vertex = UsdGeom.Tokens.vertex
    types = Sdf.ValueTypeNames
    for name, kind, values in (
        ("frazil:area", types.FloatArray, Vt.FloatArray.FromNumpy(points.areas)),
        ("frazil:triangle", types.IntArray, Vt.IntArray.FromNumpy(points.triangles)),
        ("frazil:barycentrics", types.Float2Array, Vt.Vec2fArray.FromNumpy(points.barycentrics)),
    ):
        api.CreatePrimvar(name, kind, vertex).Set(values)
    # Ids name the same point in every pose and file of the set.
    prim.CreateIdsAttr(Vt.Int64Array.FromNumpy(np.arange(len(points), dtype=np.int64)))
    api.CreatePrimvar("frazil:spacing", types.Double, UsdGeom.Tokens.constant).Set(points.spacing)
    # USD tells its formats by suffix, so the file is made under its own name in a folder of its own.
    with replacing(path) as temporary, tempfile.TemporaryDirectory(dir=path.resolve().parent) as folder:
        whole = Path(folder) / path.name
        try:
            is_written = stage.GetRootLayer().Export(str(whole))
        except Tf.ErrorException as error:
            raise OSError(f"{path}: cannot be written: {error.args[0].commentary}") from None
        if not is_written:
            raise OSError(f"{path}: file must be writable, got an error while writing. Check the folder and disk.")
        whole.replace(temporary)
