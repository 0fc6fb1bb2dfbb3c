"""Primvars as arrays with an interpolation: indexed or not, inherited or not, checked against the mesh."""

from __future__ import annotations

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from .context import ReadContext

# USD's interpolation -> the core's, and the number of values that a mesh must give for it.
_INTERPOLATIONS = {
    "constant": "constant",
    "uniform": "uniform",
    "varying": "vertex",
    "vertex": "vertex",
    "faceVarying": "corner",
}

# Where textures are looked up when the material names no primvar, or one that the mesh lacks.
_TEXCOORD_NAMES = ("st", "UVMap", "uv", "map1", "st0", "st_0", "Texture_uv")

Primvar = tuple[np.ndarray, str]


def read_primvar(context: ReadContext, primvar: UsdGeom.Primvar, width: int, sizes: dict[str, int]) -> Primvar | None:
    """The primvar's values (N, width) float32, indices applied, and the core's interpolation.

    None (after a warning) where the values do not fit the mesh; `sizes` is what each interpolation needs.
    """
    prim = primvar.GetAttr().GetPrim()
    name = primvar.GetPrimvarName()
    values = primvar.Get(context.time)
    if values is None:
        return None
    indices = primvar.GetIndices(context.time) if primvar.IsIndexed() else None
    return fit_primvar(context, prim.GetPath(), name, values, indices, primvar.GetInterpolation(), width, sizes)


def fit_primvar(
    context: ReadContext,
    path: Sdf.Path,
    name: str,
    values,
    indices,
    usd_interpolation: str,
    width: int,
    sizes: dict[str, int],
) -> Primvar | None:
    """Check values (and indices) against the mesh and expand them: see read_primvar."""
    array = np.asarray(values, dtype=np.float32)
    if array.size == 0:
        return None
    if array.size % width:
        context.warn(path, f"{name} must have {width} numbers per value, got {array.shape}. It is left out.")
        return None
    array = array.reshape(-1, width)
    if indices is not None and len(indices):
        order = np.asarray(indices, dtype=np.int64)
        if order.min() < 0 or order.max() >= len(array):
            wrong = order[(order < 0) | (order >= len(array))][0]
            context.warn(path, f"indices of {name} must be in 0..{len(array) - 1}, got {wrong}. It is left out.")
            return None
        array = array[order]
    interpolation = _INTERPOLATIONS.get(usd_interpolation)
    if interpolation is None:
        context.warn(path, f"interpolation of {name} must be one that USD knows, got '{usd_interpolation}'.")
        return None
    if interpolation == "constant" and len(array) > 1:
        # Common in the wild: an array without its interpolation. Take it by its length where that is clear.
        fits = [key for key in ("vertex", "corner", "uniform") if sizes[key] == len(array)]
        if not fits:
            array = array[:1]
        else:
            interpolation = fits[0]
    if len(array) != sizes[interpolation]:
        context.warn(
            path,
            f"{name} ({usd_interpolation}) must have {sizes[interpolation]} values, got {len(array)}. It is left out.",
        )
        return None
    if not np.isfinite(array).all():
        context.warn(path, f"{name} must be finite, got NaN or infinity. It is left out.")
        return None
    return np.ascontiguousarray(array), interpolation


def read_texcoords(context: ReadContext, prim: Usd.Prim, name: str | None, sizes: dict[str, int]) -> Primvar | None:
    """The texture coordinates that the material asks for by `name`, else the usual ones."""
    primvars = UsdGeom.PrimvarsAPI(prim)
    for candidate in ([name] if name else []) + list(_TEXCOORD_NAMES):
        primvar = primvars.FindPrimvarWithInheritance(candidate)
        if not primvar or not primvar.HasAuthoredValue():
            continue
        if candidate != name and name not in (None, "st"):
            context.warn(prim.GetPath(), f"has no primvar '{name}', which its material reads. '{candidate}' is taken.")
        return read_primvar(context, primvar, 2, sizes)
    for primvar in primvars.GetPrimvarsWithValues():
        if primvar.GetTypeName() in (Sdf.ValueTypeNames.TexCoord2fArray, Sdf.ValueTypeNames.TexCoord2f):
            return read_primvar(context, primvar, 2, sizes)
    return None


def read_display_color(context: ReadContext, prim: Usd.Prim, sizes: dict[str, int]) -> Primvar | None:
    """displayColor, linear RGB."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
    if not primvar or not primvar.HasAuthoredValue():
        return None
    return read_primvar(context, primvar, 3, sizes)


def read_normals(context: ReadContext, mesh: UsdGeom.PointBased, sizes: dict[str, int]) -> Primvar | None:
    """Unit normals: primvars:normals where it is authored, else the normals attribute."""
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    if primvar and primvar.HasAuthoredValue():
        normals = read_primvar(context, primvar, 3, sizes)
    else:
        values = context.get(mesh.GetNormalsAttr())
        if values is None:
            return None
        normals = fit_primvar(
            context, mesh.GetPath(), "normals", values, None, mesh.GetNormalsInterpolation(), 3, sizes
        )
    if normals is None:
        return None
    lengths = np.linalg.norm(normals[0], axis=1, keepdims=True)
    if (lengths == 0).any():
        context.warn(mesh.GetPath(), "normals must have a length, got (0, 0, 0). They are left out.")
        return None
    return normals[0] / lengths, normals[1]


# Positions in a pose that does not move, as USD's houses call them.
_REST_NAMES = ("rest", "Pref", "pref", "__Pref")


def read_rest(context: ReadContext, mesh: UsdGeom.PointBased, count: int) -> np.ndarray | None:
    """Rest positions (V, 3) float32: a primvar of that name, else the points at the rest frame where they move."""
    primvars = UsdGeom.PrimvarsAPI(mesh)
    sizes = {"constant": 1, "uniform": -1, "vertex": count, "corner": -1}
    for name in _REST_NAMES:
        primvar = primvars.GetPrimvar(name)
        if not primvar or not primvar.HasAuthoredValue():
            continue
        found = read_primvar(context, primvar, 3, sizes)
        return None if found is None else found[0]
    points = mesh.GetPointsAttr()
    if context.rest_time is None or not points.ValueMightBeTimeVarying():
        return None
    rest = np.asarray(points.Get(context.rest_time), np.float32).reshape(-1, 3)
    if len(rest) != count:
        context.warn(
            mesh.GetPath(), f"must have {count} points at the rest frame, got {len(rest)}. It has no rest pose."
        )
        return None
    return rest


def read_spacing(context: ReadContext, prim: Usd.Prim, count: int) -> np.ndarray | None:
    """primvars:frazil:spacing in metres: (V,) float32, or (1,) where it is the same all over."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("frazil:spacing")
    if not primvar or not primvar.HasAuthoredValue():
        return None
    found = read_primvar(context, primvar, 1, {"constant": 1, "uniform": -1, "vertex": count, "corner": -1})
    if found is None:
        return None
    spacing = found[0][:, 0] * np.float32(context.meters_per_unit)
    if not (spacing > 0).all():
        wrong = spacing[~(spacing > 0)][0]
        context.warn(prim.GetPath(), f"frazil:spacing must be > 0, got {wrong:g} m. It is left out.")
        return None
    return spacing
