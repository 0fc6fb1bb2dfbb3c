"""Meshes of a stage: polygons, holes, handedness, subdivision, primvars and GeomSubsets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Usd, UsdGeom

from .._frazil import ControlMesh, Mesh, subdivide, triangulate
from .context import ReadContext
from .displacement import SurfaceDisplacement, displace
from .primvars import Primvar, read_display_color, read_normals, read_rest, read_spacing, read_texcoords

# Above this many triangles a cage is refined less, so that dense scans stay what they are.
_MAX_REFINED_TRIANGLES = 4_000_000


@dataclass
class MeshPart:
    """Some faces of a mesh that share a material: all of them, or those of one GeomSubset."""

    mesh: Mesh
    subset: str = ""


def read_mesh(
    context: ReadContext,
    prim: Usd.Prim,
    texcoord_name: str | None,
    displacements: dict[str, SurfaceDisplacement] | None = None,
    metres_per_unit: float = 1.0,
) -> list[MeshPart]:
    """The prim's mesh at the frame, in its own frame and units, cut by material subsets.

    `displacements` are those of the prim's own material ('') and of its subsets; `metres_per_unit` is of its frame.

    ValueError, beginning with the prim's path, where it is broken; an empty list (after a warning) where it has no
    faces.
    """
    path = prim.GetPath()
    schema = UsdGeom.Mesh(prim)
    points = _array(context, schema.GetPointsAttr(), np.float32).reshape(-1, 3)
    counts = _array(context, schema.GetFaceVertexCountsAttr(), np.int32)
    indices = _array(context, schema.GetFaceVertexIndicesAttr(), np.int32)
    if len(points) == 0 or len(counts) == 0:
        context.warn(path, f"is a mesh without {'points' if len(points) == 0 else 'faces'}. It is left out.")
        return []
    if (counts < 3).any():
        context.warn(path, f"has {int((counts < 3).sum())} faces of fewer than 3 corners. They are left out.")

    sizes = {"constant": 1, "uniform": len(counts), "vertex": len(points), "corner": len(indices)}
    normals = read_normals(context, schema, sizes)
    uvs = read_texcoords(context, prim, texcoord_name, sizes)
    colors = read_display_color(context, prim, sizes)
    if schema.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded and counts.sum() == len(indices):
        order = _reversed_winding(counts)
        indices = indices[order]
        normals, uvs, colors = (_reorder_corners(primvar, order) for primvar in (normals, uvs, colors))

    level = _subdivision_steps(context, schema, counts, normals is not None)

    def cage_of(positions: np.ndarray, **primvars) -> ControlMesh:
        creases = {} if level is None else _creases(context, schema)
        holes = _array(context, schema.GetHoleIndicesAttr(), np.int32)
        return ControlMesh(positions, counts, indices, hole_indices=holes, **primvars, **creases)

    cage = cage_of(points, normals=normals if level is None else None, uvs=uvs, colors=colors)
    mesh, faces = _refined(cage, level, str(path))
    if len(faces) == 0:
        context.warn(path, "has no faces that can be seen. It is left out.")
        return []
    _set_point_data(context, schema, mesh, len(points), lambda values: _refined_like(values, cage_of, level, mesh))
    subsets = material_subsets(prim)
    owner = _owners(context, subsets, len(counts))
    names = ["", *(subset.GetPrim().GetName() for subset in subsets)]
    if displacements:
        numbered = {names.index(name) - 1: surface for name, surface in displacements.items() if name in names}
        mesh, faces = displace(context, path, mesh, faces, owner, numbered, metres_per_unit)
    return _split_by_owner(mesh, owner[faces], names)


def _refined(cage: ControlMesh, level: int | None, path: str) -> tuple[Mesh, np.ndarray]:
    return triangulate(cage, path) if level is None else subdivide(cage, 2**level, path)


def _refined_like(values: np.ndarray, cage_of, level: int | None, mesh: Mesh) -> np.ndarray | None:
    """The vertices (V, 3) of another pose of a cage, refined as `mesh` was; None where that gave other vertices."""
    positions = values if level is None else _refined(cage_of(values), level, "rest")[0].positions
    return positions if len(positions) == len(mesh.positions) else None


def _set_point_data(context: ReadContext, schema: UsdGeom.Mesh, mesh: Mesh, count: int, refine) -> None:
    """Give the mesh what points ask for: its rest pose, and their spacing where that is a primvar.

    `refine` takes (V, 3) values of the cage to the mesh's vertices.
    """
    rest = read_rest(context, schema, count)
    if rest is not None:
        refined = refine(rest)
        if refined is None:
            context.warn(schema.GetPath(), "its rest pose is not subdivided like the mesh. It has none.")
        else:
            mesh.set_rest(refined)
    spacing = read_spacing(context, schema.GetPrim(), count)
    if spacing is not None:
        if len(spacing) == count and count > 1:
            refined = refine(np.repeat(spacing[:, None], 3, axis=1))
            if refined is None:
                return
            # A limit surface may leave the range of its cage.
            values = np.clip(refined[:, 0], spacing.min(), spacing.max())
        else:
            values = np.full(len(mesh.positions), spacing[0], np.float32)
        mesh.set_spacing(np.ascontiguousarray(values))


def material_subsets(prim: Usd.Prim) -> list[UsdGeom.Subset]:
    """The GeomSubsets of the materialBind family."""
    return UsdGeom.Subset.GetGeomSubsets(UsdGeom.Imageable(prim), UsdGeom.Tokens.face, "materialBind")


def _array(context: ReadContext, attribute: Usd.Attribute, dtype) -> np.ndarray:
    value = context.get(attribute)
    return np.zeros(0, dtype) if value is None else np.ascontiguousarray(value, dtype=dtype)


def _reversed_winding(counts: np.ndarray) -> np.ndarray:
    """Corner numbers that walk every face backwards from its first corner."""
    starts = np.repeat(np.cumsum(counts) - counts, counts)
    lengths = np.repeat(counts, counts)
    step = np.arange(len(starts)) - starts
    return starts + (lengths - step) % lengths


def _reorder_corners(primvar: Primvar | None, order: np.ndarray) -> Primvar | None:
    if primvar is None or primvar[1] != "corner":
        return primvar
    return np.ascontiguousarray(primvar[0][order]), primvar[1]


def _subdivision_steps(context: ReadContext, schema: UsdGeom.Mesh, counts: np.ndarray, has_normals: bool) -> int | None:
    """How often each edge is halved (0 = the cage itself, on the limit surface); None = flat polygons."""
    attribute = schema.GetSubdivisionSchemeAttr()
    scheme = attribute.Get()
    if scheme == UsdGeom.Tokens.loop:
        context.warn(schema.GetPath(), "subdivisionScheme loop is not supported. Its polygons are rendered flat.")
        return None
    if scheme != UsdGeom.Tokens.catmullClark:
        return None
    # Catmull-Clark is USD's default, so that many exporters of plain polygons get it by saying nothing. Normals of
    # their own give those away: a subdivision surface has none.
    if has_normals and not attribute.HasAuthoredValue():
        return None
    steps = context.subdivision_level
    while steps > 0 and counts.sum() // 2 * 4**steps > _MAX_REFINED_TRIANGLES:
        steps -= 1
    return steps


def _creases(context: ReadContext, schema: UsdGeom.Mesh) -> dict:
    boundary = schema.GetInterpolateBoundaryAttr().Get()
    return {
        "crease_indices": _array(context, schema.GetCreaseIndicesAttr(), np.int32),
        "crease_lengths": _array(context, schema.GetCreaseLengthsAttr(), np.int32),
        "crease_sharpnesses": _array(context, schema.GetCreaseSharpnessesAttr(), np.float32).tolist(),
        "corner_indices": _array(context, schema.GetCornerIndicesAttr(), np.int32),
        "corner_sharpnesses": _array(context, schema.GetCornerSharpnessesAttr(), np.float32).tolist(),
        "is_boundary_smooth": boundary == UsdGeom.Tokens.edgeOnly,
    }


def _owners(context: ReadContext, subsets: list[UsdGeom.Subset], face_count: int) -> np.ndarray:
    """The number of the subset that each face belongs to; -1 for none."""
    owner = np.full(face_count, -1, dtype=np.int32)
    for number, subset in enumerate(subsets):
        indices = _array(context, subset.GetIndicesAttr(), np.int64)
        is_valid = (indices >= 0) & (indices < face_count)
        if not is_valid.all():
            wrong = indices[~is_valid][0]
            context.warn(
                subset.GetPath(), f"indices must be in 0..{face_count - 1}, got {wrong}. Those entries are left out."
            )
            indices = indices[is_valid]
        owner[indices] = number
    return owner


def _split_by_owner(mesh: Mesh, owner: np.ndarray, names: list[str]) -> list[MeshPart]:
    parts = []
    for number, name in enumerate(names, -1):
        triangles = np.flatnonzero(owner == number).astype(np.int32)
        if len(triangles) == len(owner):
            return [MeshPart(mesh, name)]
        if len(triangles):
            parts.append(MeshPart(mesh.submesh(triangles), name))
    return parts
