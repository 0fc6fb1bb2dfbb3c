"""The commands, put together."""

import importlib.util
from collections.abc import Callable
from typing import Annotated, Any

import typer

__all__ = ["app"]


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        from ..version import version

        print(f"frazil {version()}")
        raise typer.Exit


def _frazil(
    is_version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Render glacier ice and other translucent matter from USD to layered OpenEXR.

    Exit status: 0 done, 1 failed, 2 misused, 130 stopped by Ctrl-C, 143 by SIGTERM.
    Errors and warnings are single lines on stderr.
    """


def app() -> Callable[..., Any]:
    """The command line as a callable that takes ``args``, ``prog_name`` and ``standalone_mode``."""
    from .bake import bake_command
    from .formation import formation_commands
    from .grade import grade_command
    from .info import info_command
    from .match import match_command
    from .render import render_command

    commands = typer.Typer(add_completion=False, no_args_is_help=False, rich_markup_mode="rich")
    commands.callback()(_frazil)
    commands.command("render")(render_command)
    if importlib.util.find_spec("frazil.cli.points") is not None:
        from .points import points_command

        commands.command("points")(points_command)
    commands.command("grade")(grade_command)
    commands.command("match")(match_command)
    commands.command("bake")(bake_command)
    commands.add_typer(formation_commands(), name="formation")
    commands.command("info")(info_command)
    return typer.main.get_command(commands).main
