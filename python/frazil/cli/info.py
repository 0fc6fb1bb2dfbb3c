"""`frazil info`: what is in a USD stage, an EXR, or a file of points."""

import os
import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from ..warning import FrazilWarning

__all__ = ["info_command"]

_USD = (".usd", ".usda", ".usdc", ".usdz")


def info_command(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="A USD stage, an EXR, or points (PLY).", show_default=False)
    ] = None,
    media: Annotated[bool, typer.Option("--media", help="List the media of frazil.optics, with units.")] = False,
) -> None:
    """Say what is in a USD stage, an EXR, or a file of points; or list the media that are built in."""
    if media == (file is not None):
        raise typer.BadParameter("give a FILE, or --media without one.")
    if media:
        from ..optics import media_lines

        print("\n".join(media_lines()))
        return
    if not file.is_file():
        raise FileNotFoundError(f"{file}: file must exist. Check the path.")
    suffix = file.suffix.lower()
    if suffix in _USD:
        lines = _describe_usd(file)
    elif suffix == ".exr":
        lines = _describe_exr(file)
    elif suffix == ".ply":
        lines = _describe_ply(file)
    else:
        raise ValueError(f"{file}: must be usd, usda, usdc, usdz, exr or ply, got '{file.suffix}'.")
    for line in lines:
        print(line)


def _describe_usd(file: Path) -> Iterator[str]:
    from pxr import Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdUtils

    diagnostics = UsdUtils.CoalescingDiagnosticDelegate()  # else USD prints its own lines
    try:
        stage = Usd.Stage.Open(os.fspath(file))
    except Tf.ErrorException as error:
        reasons = [reason.commentary.strip() for reason in error.args if hasattr(reason, "commentary")]
        raise OSError(f"{file}: must be a USD stage: {'; '.join(reasons)}.") from None
    for diagnostic in diagnostics.TakeUncoalescedDiagnostics():
        warnings.warn(f"{file}: {diagnostic.commentary}", FrazilWarning, stacklevel=2)
    prims = list(stage.Traverse(Usd.TraverseInstanceProxies()))
    yield f"{file}: USD stage, {len(prims)} prims"
    yield f"  units      {UsdGeom.GetStageMetersPerUnit(stage):g} m, {UsdGeom.GetStageUpAxis(stage)} up"
    if stage.HasAuthoredTimeCodeRange():
        first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
        yield f"  frames     {first:g}-{last:g} at {stage.GetTimeCodesPerSecond():g} per second"
    box = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), [UsdGeom.Tokens.default_, UsdGeom.Tokens.render])
    bounds = box.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    if not bounds.IsEmpty():
        low, high = bounds.GetMin(), bounds.GetMax()
        yield f"  bounds     ({_numbers(low)}) to ({_numbers(high)}) in stage units"
    types = Counter(prim.GetTypeName() or "(no type)" for prim in prims)
    yield "  types      " + ", ".join(f"{count} {name}" for name, count in sorted(types.items()))
    for title, members in (
        ("cameras", [prim for prim in prims if prim.IsA(UsdGeom.Camera)]),
        ("lights", [prim for prim in prims if prim.HasAPI(UsdLux.LightAPI)]),
        ("materials", [prim for prim in prims if prim.IsA(UsdShade.Material)]),
    ):
        yield f"  {title:<10} {len(members) or 'none'}"
        for prim in members:
            yield f"    {prim.GetPath()} ({_kind(prim)})"


def _kind(prim) -> str:
    """The type of a prim; for a material that of its surface shader."""
    from pxr import UsdShade

    if prim.IsA(UsdShade.Material):
        shader = UsdShade.Material(prim).ComputeSurfaceSource("frazil")[0]
        return (shader.GetShaderId() or "no id") if shader else "no surface"
    return prim.GetTypeName()


def _describe_exr(file: Path) -> Iterator[str]:
    from ..exr import read_header

    width, height, layers, metadata = read_header(file)
    yield f"{file}: EXR, {width}x{height}, {metadata.pop('compression', 'none')}, {file.stat().st_size} bytes"
    yield "  layers"
    for name, channels in layers.items():
        yield f"    {name:<14} {' '.join(channels)} ({', '.join(sorted(set(channels.values())))})"
    yield "  metadata"
    for key in sorted(metadata):
        text = str(metadata[key])
        yield f"    {key:<24} {text if len(text) <= 200 else text[:200] + ' ...'}"


def _describe_ply(file: Path) -> Iterator[str]:
    with open(file, "rb") as stream:
        if stream.readline(16).strip() != b"ply":
            raise OSError(f"{file}: must be a PLY file, got one that does not begin with 'ply'.")
        header = []
        for _ in range(1000):
            line = stream.readline(4096).decode("ascii", "replace").split()
            if line == ["end_header"]:
                break
            header.append(line)
        else:
            raise OSError(f"{file}: must be a whole PLY file, got a header without end_header.")
    yield f"{file}: PLY, {file.stat().st_size} bytes"
    for line in header:
        if line[:1] == ["format"]:
            yield f"  format     {' '.join(line[1:])}"
        elif line[:1] == ["comment"]:
            yield f"  {line[1] if len(line) > 1 else '':<10} {' '.join(line[2:])}"
        elif line[:1] == ["element"] and len(line) == 3:
            yield f"  {line[1]:<10} {line[2]}"
        elif line[:1] == ["property"]:
            yield f"    {' '.join(line[1:])}"


def _numbers(values) -> str:
    return ", ".join(f"{value:g}" for value in values)
