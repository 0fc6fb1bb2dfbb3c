"""Displacement of a material, and the meshes that it moves: refined first, to show what image and pattern show."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pxr import UsdShade

from .._frazil import Displacement, Mesh, Overlay, cut_long_edges, displaced
from .context import ReadContext
from .expression import Expression
from .material_inputs import DISPLACEMENT_INPUTS, MaterialInput, find_input
from .material_values import ShaderValues, texcoord_name, to_value
from .mtlx_library import DISPLACEMENT_NODE
from .shading import ShaderReader

DISPLACEMENT_SHADERS = ("frazil:displacement", DISPLACEMENT_NODE)
_PREVIEW_SHADERS = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
_MTLX_SHADERS = ("ND_displacement_float", "ND_displacement_vector3")
_MOST_TRIANGLES = 2_000_000
_EDGES_PER_FEATURE = 8  # of a pattern's size, or 2 of its width


@dataclass(frozen=True)
class SurfaceDisplacement:
    """What a material does to the shape of its surface."""

    path: str
    displacement: Displacement
    texcoord_name: str | None = None
    edge_length: float = 0.0  # metres; 0 = from what is there to be seen
    texels: float = 0.0  # of its image, along one repeat of st
    triplanar_size: float | None = None  # metres, where the image is projected whatever the mesh has
    pattern_detail: float = 0.0  # metres


def read_displacement(
    reader: ShaderReader, material: UsdShade.Material, contexts: tuple[str, ...]
) -> SurfaceDisplacement | None:
    """The displacement of a material; None where it has none, or none that is supported (after a warning)."""
    context = reader.context
    for render_context in contexts:
        shader, _, _ = material.ComputeDisplacementSource(render_context)
        if shader:
            break
    else:
        return None
    kind, path = shader.GetShaderId() or "", str(shader.GetPath())
    if kind in DISPLACEMENT_SHADERS:
        return _read_own(reader, shader)
    if kind in _PREVIEW_SHADERS:
        return _plain(context, path, reader.read(shader, "displacement"), None)
    if kind in _MTLX_SHADERS:
        fed = reader.read(shader, "displacement")
        scale = reader.read(shader, "scale")
        if scale is not None and scale.image is not None:
            context.warn(path, "scale takes no texture. 1 is used.")
        elif scale is not None and fed is not None:
            fed = fed.affine(scale.bias, 0.0)
        return _plain(context, path, None, fed) if kind.endswith("vector3") else _plain(context, path, fed, None)
    context.warn(path, f"the displacement shader '{kind}' is not supported. The surface is rendered as it is.")
    return None


def _read_own(reader: ShaderReader, shader: UsdShade.Shader) -> SurfaceDisplacement:
    read = ShaderValues(reader, shader, DISPLACEMENT_INPUTS)
    values, expressions = read.values, read.expressions
    if "direction" not in read.authored:
        values["direction"] = (0.0, 0.0, 1.0) if reader.context.is_z_up else (0.0, 1.0, 0.0)
    pattern = {row.name: values[row.name] for row in DISPLACEMENT_INPUTS[4:]}
    detail = 0.0
    if pattern["pattern"] != "solid":
        thin = pattern["pattern"] in ("fracture", "cells", "bubbles", "bands")
        detail = float(pattern["size"]) / _EDGES_PER_FEATURE
        if thin:
            detail = min(detail, 0.5 * float(pattern["width"] + pattern["feather"]))
    image = expressions.get("vector" if "vector" in read.authored else "height")
    return _make(
        reader.context,
        str(shader.GetPath()),
        Displacement(
            height=values["height"],
            vector=values["vector"],
            space=values["space"],
            pattern=Overlay(**pattern) if pattern["pattern"] != "solid" else None,
        ),
        image,
        edge_length=float(values["edge_length"]),
        pattern_detail=detail,
    )


def _plain(
    context: ReadContext, path: str, height: Expression | None, vector: Expression | None
) -> SurfaceDisplacement | None:
    image = vector if vector is not None else height
    if image is None or (image.image is None and not image.bias.any()):
        return None
    made = Displacement(
        height=to_value(context, path, _row("height"), height) if height is not None else 0.0,
        vector=to_value(context, path, _row("vector"), vector.widened(3)) if vector is not None else None,
    )
    return _make(context, path, made, image)


def _row(name: str) -> MaterialInput:
    return find_input(DISPLACEMENT_INPUTS, name)


def _make(
    context: ReadContext, path: str, displacement: Displacement, image: Expression | None, **more: float
) -> SurfaceDisplacement:
    if image is None or image.image is None:
        return SurfaceDisplacement(path, displacement, **more)
    number = min(image.image.tiles)
    texels = max(image.image.pixels(number).shape[:2])
    (scale_s, scale_t), _, _ = image.placement.decomposed()
    return SurfaceDisplacement(
        path,
        displacement,
        texcoord_name(context, path, [image]),
        texels=texels * max(abs(scale_s), abs(scale_t)),
        triplanar_size=image.placement.triplanar_size if image.placement.is_triplanar else None,
        **more,
    )


def displace(
    context: ReadContext,
    path,
    mesh: Mesh,
    faces: np.ndarray,
    owner: np.ndarray,
    of_owner: dict[int, SurfaceDisplacement],
    metres_per_unit: float,
) -> tuple[Mesh, np.ndarray]:
    """The mesh refined and moved, and the cage face of each triangle.

    `owner` (faces of the cage) tells whose each face is, `of_owner` who moves it; other faces stay, but for what they
    share with those. `metres_per_unit` of the mesh's own frame.
    """
    wanted = min(_edge_length(mesh, d, metres_per_unit) for d in of_owner.values())
    if math.isfinite(wanted):
        mesh, parents, longest = cut_long_edges(mesh, wanted, _MOST_TRIANGLES)
        faces = faces[parents]
        if longest > 1.01 * wanted:
            context.warn(
                path,
                f"displacement wants edges of {wanted * metres_per_unit:.3g} m, which would need more than "
                f"{_MOST_TRIANGLES} triangles. Edges of up to {longest * metres_per_unit:.3g} m are used; set "
                "edge_length of its displacement, or a smaller image.",
            )
    offsets = np.zeros((3 * len(faces), 3), np.float32)
    corner_owner = np.repeat(owner[faces], 3)
    for number, surface in of_owner.items():
        chosen = corner_owner == number
        offsets[chosen] = surface.displacement.eval(mesh, metres_per_unit)[chosen]
    # Heights came in metres.
    return displaced(mesh, offsets / np.float32(metres_per_unit)), faces


def _edge_length(mesh: Mesh, surface: SurfaceDisplacement, metres_per_unit: float) -> float:
    """How long edges may be, in the mesh's units."""
    if surface.edge_length > 0.0:
        return surface.edge_length / metres_per_unit
    lengths = [surface.pattern_detail / metres_per_unit] if surface.pattern_detail > 0.0 else []
    if surface.texels > 0.0:
        if surface.triplanar_size is not None or mesh.uvs is None:
            lengths.append((surface.triplanar_size or 1.0) / surface.texels / metres_per_unit)
        else:
            lengths.append(_length_per_st(mesh) / surface.texels)
    return min(lengths, default=math.inf)


def _length_per_st(mesh: Mesh) -> float:
    """The length of one unit of st: the root of areas, over all of the mesh."""
    triangles, corners = mesh.triangles, np.arange(3 * len(mesh.triangles)).reshape(-1, 3)
    a, b, c = (mesh.positions[triangles[:, k]].astype(np.float64) for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    at = {"vertex": triangles, "corner": corners}.get(mesh.uvs_interpolation)
    if at is None:
        return math.inf
    s, t, u = (mesh.uvs[at[:, k]].astype(np.float64) for k in range(3))
    st_area = 0.5 * np.abs((t - s)[:, 0] * (u - s)[:, 1] - (t - s)[:, 1] * (u - s)[:, 0]).sum()
    return math.sqrt(area / st_area) if st_area > 0.0 else math.inf
