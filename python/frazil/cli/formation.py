"""The command `frazil formation NAME`: procedural ice, written as a USD scene that renders as it is."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .checks import one_of

__all__ = ["formation_commands"]


def _print_list(is_wanted: bool) -> None:
    if is_wanted:
        from ..formations import FORMATIONS
        from ..formations.parameters import summary_of

        for name, function in FORMATIONS.items():
            typer.echo(f"{name:<15} {summary_of(function)}")
        raise typer.Exit


def _root(
    context: typer.Context,
    is_listed: Annotated[
        bool, typer.Option("--list", help="List the formations.", callback=_print_list, is_eager=True)
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        raise typer.BadParameter("give the name of a formation; frazil formation --list has them")


class _Formations(TyperGroup):
    """One command for each formation, made when it is asked for: its options are the parameters of its function."""

    def list_commands(self, context: Any) -> list[str]:
        from ..formations import FORMATIONS

        return list(FORMATIONS)

    def get_command(self, context: Any, name: str) -> Any:
        from ..formations import FORMATIONS
        from ..formations.parameters import summary_of

        one_of("NAME", name, tuple(FORMATIONS))
        one = typer.Typer(add_completion=False, rich_markup_mode="rich")
        one.command(name, help=summary_of(FORMATIONS[name]))(_command(FORMATIONS[name]))
        return typer.main.get_command(one)


def formation_commands() -> typer.Typer:
    """The command `formation` with a command for each formation below it."""
    commands = typer.Typer(cls=_Formations, rich_markup_mode="rich", help="Make ice, as a USD scene to render.")
    commands.callback(invoke_without_command=True)(_root)
    return commands


def _command(function: Callable[..., Any]) -> Callable[..., None]:
    from ..formations.parameters import parameters_of

    def run(output: Path, quiet: bool, **parameters: Any) -> None:
        from ..formations import write_formation
        from ..formations.usd import check_suffix
        from ..replacing import check_writable

        check_suffix(output)
        check_writable(output)
        start = time.monotonic()
        with _Progress(quiet) as progress:
            made = function(**parameters, progress=progress)
            progress("write", 0.0)
            write_formation(made, output)
        if not quiet:
            typer.echo(f"{output}: {made.triangle_count} triangles in {time.monotonic() - start:.1f} s")

    rows = [
        inspect.Parameter(
            "output",
            inspect.Parameter.KEYWORD_ONLY,
            annotation=Annotated[
                Path,
                typer.Option("--output", "-o", metavar="OUT.usd", help="usd, usda or usdc; its sky goes beside."),
            ],
        )
    ]
    for row in parameters_of(function):
        kind = row.type if row.default is not None else row.type | None
        option = typer.Option(f"--{row.name}", metavar="N" if row.type is int else "X", help=row.meaning)
        rows.append(
            inspect.Parameter(
                row.name, inspect.Parameter.KEYWORD_ONLY, default=row.default, annotation=Annotated[kind, option]
            )
        )
    silent = Annotated[bool, typer.Option("--quiet", "-q", help="Only errors and warnings.")]
    rows.append(inspect.Parameter("quiet", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=silent))
    run.__signature__ = inspect.Signature(rows)  # type: ignore[attr-defined]
    run.__annotations__ = {row.name: row.annotation for row in rows}
    return run


class _Progress:
    """A bar of the stages on stderr."""

    def __init__(self, is_quiet: bool):
        from rich.console import Console
        from rich.progress import Progress

        self._bar = Progress(console=Console(stderr=True), transient=True, disable=is_quiet)
        self._task = None

    def __enter__(self) -> _Progress:
        self._bar.start()
        self._task = self._bar.add_task("solids", total=1.0)
        return self

    def __exit__(self, *_: Any) -> None:
        self._bar.stop()

    def __call__(self, stage: str, fraction: float) -> None:
        self._bar.update(self._task, description=stage, completed=fraction)
