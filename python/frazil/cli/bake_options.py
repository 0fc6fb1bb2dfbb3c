"""Options of the light at the points, which `frazil bake` and `frazil render` share."""

from typing import Annotated

import typer

__all__ = ["BakeBounces", "BakeError", "BakeSamples", "TranslucentShadows"]

BakeSamples = Annotated[
    int,
    typer.Option(
        metavar="N",
        help="Shadow rays per point and light, and as many that look for bounced light. 0 = 32, fewer where points "
        "are closer than half a mean free path.",
    ),
]
BakeError = Annotated[
    float,
    typer.Option(metavar="ERROR", help="Relative error of a point's light until which it gets more rays. 0 = off."),
]
TranslucentShadows = Annotated[
    bool, typer.Option("--translucent-shadows", help="Shadow rays of the bake go on through ice, dimmed.")
]
BakeBounces = Annotated[
    int,
    typer.Option(
        metavar="N",
        help="Of light that reaches ice by way of ice and diffuse surfaces. From 3 on, what is left is added.",
    ),
]
