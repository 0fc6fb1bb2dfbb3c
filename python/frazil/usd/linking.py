"""Light and shadow linking: UsdLux collections resolved to the scene's objects."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

from pxr import Sdf, Usd, UsdLux

from .._frazil import ObjectSet
from .context import ReadContext

_ROOT = Sdf.Path.absoluteRootPath


class LinkReader:
    """Knows every object of the scene by the prims that it came from, and answers what a collection holds of them."""

    def __init__(self, context: ReadContext) -> None:
        self._context = context
        # The candidates of each object, the nearest first: its subset, its prim, the PointInstancers that place it.
        self._objects: list[tuple[Sdf.Path, ...]] = []
        self._known: dict[frozenset, ObjectSet | None] = {}

    def add_object(self, candidates: Sequence[Sdf.Path]) -> None:
        """The next object of the scene: the paths by which a collection may name it, the nearest first."""
        self._objects.append(tuple(candidates))

    def lit_by(self, prim: Usd.Prim) -> ObjectSet | None:
        """The objects that a light lights; None for all."""
        return self._members(prim, UsdLux.LightAPI(prim).GetLightLinkCollectionAPI(), "lightLink")

    def casters_of(self, prim: Usd.Prim) -> ObjectSet | None:
        """The objects that cast shadows in a light; None for all."""
        return self._members(prim, UsdLux.LightAPI(prim).GetShadowLinkCollectionAPI(), "shadowLink")

    def mattes(self) -> dict[str, list[int]]:
        """The objects of the stage's collections ``matte:NAME``, on whichever prim, by NAME."""
        found: dict[str, list[int]] = {}
        for prim in self._context.stage.TraverseAll():
            for schema in prim.GetAppliedSchemas():
                kind, _, name = schema.partition(":")
                if kind != "CollectionAPI" or not name.startswith("matte:"):
                    continue
                matte = name.removeprefix("matte:")
                if not re.fullmatch(r"[A-Za-z0-9_]+", matte):
                    self._context.warn(
                        prim.GetPath(), f"collection {name} must end in letters, digits and _. It is left out."
                    )
                    continue
                members = self._members(prim, Usd.CollectionAPI(prim, name), name)
                own = range(len(self._objects)) if members is None else members.objects
                found[matte] = sorted({*found.get(matte, ()), *own})
        return found

    def _members(self, prim: Usd.Prim, collection: Usd.CollectionAPI, name: str) -> ObjectSet | None:
        if not collection:
            return None
        is_valid, reason = collection.Validate()
        if not is_valid:
            said = " ".join(reason.split())
            self._context.warn(
                prim.GetPath(), f"collection {name} must be valid, got: {said} What it does hold counts."
            )
        self._warn_of_missing(prim, collection, name)
        query = collection.ComputeMembershipQuery()
        rules = query.GetAsPathExpansionRuleMap()
        if not rules:
            return self._by_expression(collection, query)
        if set(rules) == {_ROOT} and rules[_ROOT] == Usd.Tokens.expandPrims:
            return None
        key = frozenset((str(path), str(rule)) for path, rule in rules.items())
        if key not in self._known:
            named = [path for path in rules if path != _ROOT]
            holds = {
                candidates: query.IsPathIncluded(_deciding(candidates, named)) for candidates in set(self._objects)
            }
            self._known[key] = self._set_of(holds)
        return self._known[key]

    def _warn_of_missing(self, prim: Usd.Prim, collection: Usd.CollectionAPI, name: str) -> None:
        for relationship in (collection.GetIncludesRel(), collection.GetExcludesRel()):
            for path in relationship.GetTargets() if relationship else ():
                if not self._context.stage.GetObjectAtPath(path):
                    known = [str(own) for candidates in self._objects for own in candidates]
                    nearest = difflib.get_close_matches(str(path), known, n=1, cutoff=0.0)
                    hint = f" The nearest object is {nearest[0]}." if nearest else ""
                    self._context.warn(
                        prim.GetPath(), f"collection {name} must hold prims of the stage, got {path}.{hint}"
                    )

    def _by_expression(self, collection: Usd.CollectionAPI, query) -> ObjectSet | None:
        """A collection without rules: a path expression, or nothing at all."""
        expression = str(collection.ResolveCompleteMembershipExpression().GetText())
        key = frozenset([expression])
        if key not in self._known:
            holds = {
                candidates: any(query.IsPathIncluded(path) for path in candidates) for candidates in set(self._objects)
            }
            self._known[key] = self._set_of(holds)
        return self._known[key]

    def _set_of(self, holds: dict[tuple[Sdf.Path, ...], bool]) -> ObjectSet | None:
        members = [index for index, candidates in enumerate(self._objects) if holds[candidates]]
        return None if len(members) == len(self._objects) else ObjectSet(members)


def _deciding(candidates: tuple[Sdf.Path, ...], named: list[Sdf.Path]) -> Sdf.Path:
    """The nearest candidate that the collection speaks of, by its own name or an ancestor's; else the first."""
    for path in candidates:
        if any(path.HasPrefix(name) for name in named):
            return path
    return candidates[0]
