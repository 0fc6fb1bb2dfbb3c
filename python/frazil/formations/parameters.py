"""What parameters a formation takes, read from its signature and docstring: for the command line and the docs.

Units: as the docstrings say.
"""

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Parameter:
    """One parameter: its type (int or float), default (None where it follows from others) and one line of meaning."""

    name: str
    type: type
    default: Any
    meaning: str


def parameters_of(function: Callable[..., Any]) -> list[Parameter]:
    """The parameters of a formation in order, without `progress`."""
    meanings = dict(re.findall(r"^    (\w+) : [^\n]*\n((?:        [^\n]*\n)+)", function.__doc__ or "", re.M))
    found = []
    for name, row in inspect.signature(function).parameters.items():
        if name != "progress":
            kind = int if row.annotation in (int, int | None) else float
            found.append(Parameter(name, kind, row.default, " ".join(meanings[name].split())))
    return found


def summary_of(function: Callable[..., Any]) -> str:
    """The first sentence of its docstring."""
    return (function.__doc__ or "").strip().splitlines()[0]


def formations_markdown(functions: dict[str, Callable[..., Any]]) -> str:
    """The table of docs/formations.md: parameters that all share, then each formation's own."""
    shared = ("scale", "age", "seed", "detail", "triangles")
    lines = ["| formation | scale, m | age | own parameters | what |", "|---|---|---|---|---|"]
    for name, function in functions.items():
        rows = {row.name: row for row in parameters_of(function)}
        own = "; ".join(f"`{r.name}` ({r.default:g}): {r.meaning}" for r in rows.values() if r.name not in shared)
        lines.append(
            f"| `{name}` | {rows['scale'].default:g} | {rows['age'].default:g} | {own} | {summary_of(function)} |"
        )
    return "\n".join(lines)
