"""`frazil match`: a rendered EXR and a painted picture in, the recipe that brings the one nearest to the other out."""

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["match_command"]


def match_command(
    picture: Annotated[Path, typer.Argument(metavar="IN.exr", help="A rendered, layered EXR.")],
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="PNG, JPEG, TIFF or EXR of the same size.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="RECIPE.toml", help="The recipe to write.")],
    what: Annotated[
        str, typer.Option(metavar="NAMES", help="What to change, comma between: lights, ramp, gain.")
    ] = "lights",
    mask: Annotated[
        Path | None, typer.Option(metavar="MASK", help="An image that is bright where pixels count.")
    ] = None,
    allow_negative: Annotated[
        bool, typer.Option("--allow-negative", help="Lights and gains may come out negative.")
    ] = False,
    grey: Annotated[bool, typer.Option("--grey", help="Intensities and one gain only, no colours.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only errors and warnings.")] = False,
) -> None:
    """Find the light mix, ramp colours or gain that bring a render nearest to painted art."""
    from ..replacing import check_writable, replacing

    if output.suffix.lower() != ".toml":
        raise typer.BadParameter(f"must be a file name that ends in .toml, got '{output}'.", param_hint="-o")
    check_writable(output)

    from ..grade_recipe import recipe_text
    from ..matching import match

    found = match(
        picture,
        reference,
        what=[name.strip() for name in what.split(",")],
        mask=mask,
        allow_negative=allow_negative,
        per_channel=not grey,
    )
    with replacing(output) as temporary:
        temporary.write_text(recipe_text(found.recipe), encoding="utf-8")
    if not quiet:
        print(f"frazil: FLIP {found.flip_before:.4f} before, {found.flip_after:.4f} after", flush=True)
        print(f"frazil: RMS {found.rms_before:.4g} before, {found.rms_after:.4g} after", flush=True)
        print(f"frazil: wrote {output}", flush=True)
