"""`frazil grade`: a rendered EXR and a recipe in, a new EXR or a PNG out."""

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["grade_command"]


def grade_command(
    picture: Annotated[Path, typer.Argument(metavar="IN.exr", help="A rendered, layered EXR.")],
    recipe: Annotated[
        Path, typer.Option("--recipe", "-r", metavar="RECIPE.toml", help="What to change: docs/grading.md.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT", help="The EXR to write, or a PNG for a preview of it.")
    ],
    keep_layers: Annotated[
        bool, typer.Option("--keep-layers", help="Write the additive layers too, graded, to grade them once more.")
    ] = False,
    compression: Annotated[
        str, typer.Option(metavar="NAME", help="Of the EXR: none, rle, zip, zips, piz, pxr24, b44, b44a, dwaa, dwab.")
    ] = "zips",
    multipart: Annotated[bool, typer.Option("--multipart", help="Every layer in a part of its own.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only errors and warnings.")] = False,
) -> None:
    """Change lights, components, ramp colours and colours of a rendered EXR, without a render."""
    from ..exr import COMPRESSIONS
    from ..replacing import check_writable

    if output.suffix.lower() not in (".exr", ".png"):
        raise typer.BadParameter(f"must be a file name that ends in .exr or .png, got '{output}'.", param_hint="-o")
    if compression not in COMPRESSIONS:
        message = f"must be one of {', '.join(COMPRESSIONS)}, got '{compression}'."
        raise typer.BadParameter(message, param_hint="--compression")
    check_writable(output)

    from ..film import Film
    from ..grade_recipe import read_recipe
    from ..grading import grade

    changes = read_recipe(recipe)
    film = grade(Film.load(picture, keep_half=True), changes, keep_layers=keep_layers)
    film.metadata["frazil:recipe"] = recipe.read_text(encoding="utf-8")
    if output.suffix.lower() == ".png":
        film.save_preview(output)
    else:
        film.save(output, compression, multipart=multipart)
    if not quiet:
        print(f"frazil: wrote {output}", flush=True)
