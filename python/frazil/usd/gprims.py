"""Sphere, cube, cone, cylinder, capsule and plane as triangle meshes with smooth normals and st."""

from __future__ import annotations

import math

import numpy as np
from pxr import Usd

from .._frazil import Mesh
from .context import ReadContext
from .primvars import read_display_color

_SLICES = 128  # around an axis: area of a sphere 0.1 % below the true one
_STACKS = 64  # from pole to pole

# Row vectors: which way the axes of a shape along z turn for one along x or y. All keep the handedness.
_AXES = {
    "X": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]], np.float32),
    "Y": np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], np.float32),
    "Z": np.eye(3, dtype=np.float32),
}


def read_gprim(context: ReadContext, prim: Usd.Prim) -> Mesh:
    """The prim as a mesh in its own frame and units. ValueError, beginning with its path, where a size is not > 0."""
    kind = prim.GetTypeName()
    if kind == "Sphere":
        mesh = _surface_of_revolution(*_sphere_profile(_size(context, prim, "radius")), axis="Z")
    elif kind == "Cube":
        mesh = _cube(_size(context, prim, "size"))
    elif kind == "Plane":
        mesh = _plane(_size(context, prim, "width"), _size(context, prim, "length"), _axis(prim))
    elif kind == "Cone":
        profile = _cone_profile(_size(context, prim, "height"), _size(context, prim, "radius"), 0.0)
        mesh = _surface_of_revolution(*profile, axis=_axis(prim))
    elif kind == "Cylinder":
        radius = _size(context, prim, "radius")
        profile = _cone_profile(_size(context, prim, "height"), radius, radius)
        mesh = _surface_of_revolution(*profile, axis=_axis(prim))
    elif kind == "Cylinder_1":
        bottom = _size(context, prim, "radiusBottom", allows_zero=True)
        top = _size(context, prim, "radiusTop", allows_zero=True)
        if bottom == 0 and top == 0:
            raise ValueError(f"{prim.GetPath()}: radiusTop or radiusBottom must be > 0, got 0 for both.")
        profile = _cone_profile(_size(context, prim, "height"), bottom, top)
        mesh = _surface_of_revolution(*profile, axis=_axis(prim))
    else:  # Capsule, Capsule_1
        names = ("radius", "radius") if kind == "Capsule" else ("radiusBottom", "radiusTop")
        bottom, top = (_size(context, prim, name) for name in names)
        height = _size(context, prim, "height", allows_zero=True)
        mesh = _surface_of_revolution(*_capsule_profile(height, bottom, top), axis=_axis(prim))

    # displayColor of a shape is one value as far as its own topology goes, which differs between renderers.
    colors = read_display_color(context, prim, {"constant": 1, "uniform": -1, "vertex": -1, "corner": -1})
    if colors is not None:
        mesh.set_colors(colors[0], "constant")
    return mesh


def _size(context: ReadContext, prim: Usd.Prim, name: str, allows_zero: bool = False) -> float:
    value = context.get(prim.GetAttribute(name))
    if value is None or not math.isfinite(value) or value < 0 or (value == 0 and not allows_zero):
        rule = ">= 0" if allows_zero else "> 0"
        raise ValueError(f"{prim.GetPath()}: {name} must be {rule}, got {value}. Give the shape a size.")
    return float(value)


def _axis(prim: Usd.Prim) -> str:
    return str(prim.GetAttribute("axis").Get() or "Z")


def _sphere_profile(radius: float):
    angle = np.linspace(-math.pi / 2, math.pi / 2, _STACKS + 1)
    return _segments([(radius * np.cos(angle), radius * np.sin(angle), np.cos(angle), np.sin(angle))])


def _cone_profile(height: float, bottom: float, top: float):
    """Bottom cap, side, top cap, from below to above; each keeps its own normals."""
    half = height / 2
    slope = np.hypot(height, bottom - top)
    side = [(height / slope, (bottom - top) / slope)] * 2
    pieces = []
    if bottom > 0:
        pieces.append(([0, bottom], [-half, -half], [0, 0], [-1, -1]))
    steps = np.linspace(0, 1, 2 if bottom == top else _STACKS // 2 + 1)
    pieces.append(
        (bottom + (top - bottom) * steps, -half + height * steps, [side[0][0]] * len(steps), [side[0][1]] * len(steps))
    )
    if top > 0:
        pieces.append(([top, 0], [half, half], [0, 0], [1, 1]))
    return _segments(pieces)


def _capsule_profile(height: float, bottom: float, top: float):
    low = np.linspace(-math.pi / 2, 0, _STACKS // 2 + 1)
    high = np.linspace(0, math.pi / 2, _STACKS // 2 + 1)
    half = height / 2
    slope = np.hypot(height, bottom - top) or 1.0
    side = (height / slope if height else 1.0, (bottom - top) / slope)
    pieces = [(bottom * np.cos(low), -half + bottom * np.sin(low), np.cos(low), np.sin(low))]
    if height > 0:
        pieces.append(([bottom, top], [-half, half], [side[0]] * 2, [side[1]] * 2))
    pieces.append((top * np.cos(high), half + top * np.sin(high), np.cos(high), np.sin(high)))
    return _segments(pieces)


def _segments(pieces):
    """Radius, height, normal (outwards, upwards) along the profile, and whether a row joins the next one."""
    rows = [np.array([np.asarray(column, np.float64) for column in piece]).T for piece in pieces]
    joins = np.concatenate([np.r_[np.ones(len(row) - 1, bool), False] for row in rows])
    return np.concatenate(rows), joins


def _surface_of_revolution(rows: np.ndarray, joins: np.ndarray, axis: str) -> Mesh:
    around = np.linspace(0, 2 * math.pi, _SLICES + 1)
    cos, sin = np.cos(around), np.sin(around)
    cos[-1], sin[-1] = cos[0], sin[0]
    radius, height, outwards, upwards = (rows[:, i : i + 1] for i in range(4))

    def ring(r, z):
        return np.stack(np.broadcast_arrays(r * cos, r * sin, z), axis=-1).reshape(-1, 3)

    positions, normals = ring(radius, height), ring(outwards, upwards)
    # st: around and along the profile's length.
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(rows[:, :2], axis=0), axis=1))]
    uvs = np.stack(np.broadcast_arrays(around / (2 * math.pi), (length / length[-1])[:, None]), axis=-1).reshape(-1, 2)

    # Two triangles per cell, but one where a ring is a point.
    row = np.flatnonzero(joins)[:, None]
    column = np.arange(_SLICES)[None, :]
    a = row * (_SLICES + 1) + column
    b, c, d = a + 1, a + _SLICES + 2, a + _SLICES + 1
    scale = np.abs(rows[:, :2]).max()
    has_lower = np.broadcast_to(rows[row, 0] > 1e-9 * scale, a.shape)
    has_upper = np.broadcast_to(rows[row + 1, 0] > 1e-9 * scale, a.shape)
    triangles = np.concatenate([np.stack([a, b, c], -1)[has_lower], np.stack([a, c, d], -1)[has_upper]])
    return _mesh(positions, triangles, normals, uvs, axis)


def _cube(size: float) -> Mesh:
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)
    positions, normals = [], []
    for axis in range(3):
        for sign in (1, -1):
            face = np.zeros((4, 3))
            face[:, axis] = sign
            face[:, (axis + 1) % 3] = corners[:, 0] * sign
            face[:, (axis + 2) % 3] = corners[:, 1]
            positions.append(face * size / 2)
            normals.append(np.eye(3)[axis] * sign + np.zeros((4, 3)))
    triangles = np.array([[0, 1, 2], [0, 2, 3]])[None] + 4 * np.arange(6)[:, None, None]
    uvs = np.tile((corners + 1) / 2, (6, 1))
    return _mesh(np.concatenate(positions), triangles.reshape(-1, 3), np.concatenate(normals), uvs, "Z")


def _plane(width: float, length: float, axis: str) -> Mesh:
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    # UsdGeomPlane: width runs along x (z for axis X), length along y (z for axis Y).
    along = {"Z": (0, 1), "X": (2, 1), "Y": (0, 2)}[axis]
    positions = np.zeros((4, 3))
    positions[:, along[0]] = corners[:, 0] * width
    positions[:, along[1]] = corners[:, 1] * length
    normal = np.eye(3)["XYZ".index(axis)]
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    cross = np.cross(positions[1] - positions[0], positions[2] - positions[0])
    if cross @ normal < 0:
        triangles = triangles[:, ::-1]
    return _mesh(positions, triangles, np.tile(normal, (4, 1)), corners + 0.5, "Z")


def _mesh(positions, triangles, normals, uvs, axis: str) -> Mesh:
    turn = _AXES[axis]
    return Mesh(
        np.ascontiguousarray(positions.astype(np.float32) @ turn),
        np.ascontiguousarray(triangles, dtype=np.int32),
        np.ascontiguousarray(normals.astype(np.float32) @ turn),
        np.ascontiguousarray(uvs, dtype=np.float32),
    )
