"""Names of a light's attributes: what no schema knows is said, so that a typo is no silent default."""

from __future__ import annotations

import difflib

from pxr import Usd

from .context import ReadContext

LIGHT_GROUP = "frazil:lightGroup"
_MULTIPLIERS = tuple(f"frazil:{name}" for name in ("translucency", "refraction", "volume"))
_OURS = frozenset([LIGHT_GROUP, "frazil:translucencySet", *_MULTIPLIERS])
_KNOWN = _OURS | {f"inputs:{name}" for name in (*_MULTIPLIERS, LIGHT_GROUP)}
_APIS = {"inputs:shaping:": "ShapingAPI", "inputs:shadow:": "ShadowAPI"}


def warn_of_unknown_names(context: ReadContext, prim: Usd.Prim) -> None:
    """Warn of authored inputs of a light that mean nothing, with the nearest that do.

    Inputs in another renderer's namespace are its own.
    """
    schema = {name for name in prim.GetPrimDefinition().GetPropertyNames() if name.startswith("inputs:")}
    for attribute in prim.GetAuthoredAttributes():
        name = attribute.GetName()
        if name in schema or name in _KNOWN:
            continue
        space = next((space for space in _APIS if name.startswith(space)), None)
        if name.startswith(("inputs:frazil:", "frazil:")):
            _warn(context, prim, name, _KNOWN)
        elif space and not prim.HasAPI(_APIS[space]):
            context.warn(prim.GetPath(), f"{name} has no effect without {_APIS[space]}. Apply it to the light.")
        elif name.startswith("inputs:") and (space or name.count(":") == 1):
            _warn(context, prim, name, schema)


def _warn(context: ReadContext, prim: Usd.Prim, name: str, known: set[str] | frozenset[str]) -> None:
    nearest = difflib.get_close_matches(name, sorted(known), n=1, cutoff=0.0)[0]
    context.warn(
        prim.GetPath(), f"{prim.GetTypeName()} has no {name}, which is left out. The nearest name is {nearest}."
    )
