"""Solids that ice is put together from: shards between sharp ridges, broken blocks, boulders.

Model: closed polyhedra of manifold3d, whose booleans keep them closed and keep every ridge exactly where it was. A
    shard is a polygon swept along a bent axis: its faces are hollow (melting hollows faces and keeps ridges), fluted,
    and step inwards where pieces have broken off.
Units: metres, y up.
Not: thin sheets; noise and melting (see weathering.py).
"""

from collections.abc import Iterable

import manifold3d
import numpy as np
from manifold3d import Manifold

kUp = np.array([0.0, 1.0, 0.0])


def solid_of(positions: np.ndarray, triangles: np.ndarray) -> Manifold:
    """The closed mesh (V, 3), (F, 3) as a solid; ValueError where it is not closed."""
    mesh = manifold3d.Mesh64(np.ascontiguousarray(positions, np.float64), np.ascontiguousarray(triangles, np.uint64))
    mesh.merge()
    solid = Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError:
        raise ValueError(f"solid: mesh must be closed, got {solid.status()}. Check its edges.")
    return solid


def arrays_of(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    """Positions (V, 3) float64 and triangles (F, 3) int64 of a solid."""
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, np.int64)


def union(solids: Iterable[Manifold]) -> Manifold:
    return Manifold.batch_boolean(list(solids), manifold3d.OpType.Add)


def shard(
    rng: np.random.Generator,
    base,
    tip,
    radius: float,
    step: float,
    *,
    faces: int | None = None,
    flat: float = 1.0,
    turn: float | None = None,
    hollow: tuple[float, float] = (0.05, 0.22),
    flute: float = 0.06,
    twist: float = 0.5,
    bend: float = 0.07,
    power: tuple[float, float] = (0.8, 1.15),
    breaks: int = 2,
    shaves: int = 2,
    belly: float = 0.0,
    is_broken: bool = False,
) -> Manifold:
    """A shard from `base` to `tip`, meshed in steps of about `step` metres.

    `flat` < 1 squeezes it to a blade, `turn` (radians) says which way its broad side faces; `breaks` are steps in its
    faces, `shaves` planes cut over its ridges; `belly` > 0 makes it widest there (0..1 of its height).
    """
    base, tip = np.asarray(base, np.float64), np.asarray(tip, np.float64)
    length = float(np.linalg.norm(tip - base))
    count = faces or int(rng.integers(4, 7))
    angles = (np.arange(count) + rng.uniform(-0.26, 0.26, count)) * 2 * np.pi / count
    depth = rng.uniform(*hollow, count)
    flutes = rng.choice([0.0, 0.5, 1.0], count) * flute
    waves = rng.integers(2, 5, count)
    spin = rng.uniform(0, 2 * np.pi) if turn is None else turn
    turned = rng.uniform(-twist, twist)
    exponent = rng.uniform(*power)
    bulge = rng.uniform(-bend, bend, 2) * length

    # Heights: even steps, and two close together wherever a face breaks.
    knots = np.sort(rng.uniform(0.15, 0.85, breaks * count).reshape(count, breaks), 1)
    drops = rng.uniform(0.08, 0.26, (count, breaks)) * (rng.random((count, breaks)) < 0.6)
    lean = rng.uniform(-0.18, 0.18, count)
    rows = np.linspace(0.0, 1.0, int(np.clip(length / step, 3, 4000)) + 1)[:-1]
    sharp = (knots[..., None] + np.array([0.0, 0.012])).ravel()
    s = np.unique(np.concatenate([rows, sharp[sharp < 0.97]]))
    offset = np.full((count, len(s)), 0.86) + rng.uniform(-0.14, 0.14, (count, 1)) + lean[:, None] * (s - 0.5)
    for k in range(breaks):
        fall = np.clip((s - knots[:, k : k + 1]) / 0.012, 0.0, 1.0)
        grow = np.clip((s - knots[:, k : k + 1]) / 0.35, 0.0, 1.0)
        offset -= drops[:, k : k + 1] * (fall - 0.7 * grow)
    offset = np.clip(offset, 0.3, 1.3)

    # Ridges, where the planes of neighbouring faces meet, then columns evenly between them.
    following = np.append(angles[1:], angles[0] + 2 * np.pi)
    after = np.roll(offset, -1, 0)
    a = offset * np.cos(following)[:, None] - after * np.cos(angles)[:, None]
    b = offset * np.sin(following)[:, None] - after * np.sin(angles)[:, None]
    middle = 0.5 * (angles + following)[:, None]
    ridge = np.arctan2(-a, b)
    ridge += np.pi * np.round((middle - ridge) / np.pi)
    gap = (following - angles)[:, None]
    ridge = np.clip(ridge, angles[:, None] + 0.12 * gap, following[:, None] - 0.12 * gap)
    begin = np.vstack([ridge[-1:] - 2 * np.pi, ridge[:-1]])
    across = int(np.clip(2.0 * np.pi * radius * np.sqrt(flat) / (count * step), 2, 400))
    u = np.linspace(0.0, 1.0, across, endpoint=False)
    theta = begin[:, None] + (ridge - begin)[:, None] * u[None, :, None]  # (face, column, row)
    rho = np.full(theta.shape, np.inf)
    for k in range(count):
        c = np.cos(theta - angles[k])
        rho = np.minimum(rho, np.where(c > 0.15, offset[k] / np.maximum(c, 0.15), np.inf))
    rho = np.minimum(rho, 1.9)
    v = 2.0 * u - 1.0
    rho *= 1.0 - depth[:, None, None] * (1.0 - v**2)[None, :, None]
    cusp = np.abs(np.sin(np.pi * waves[:, None] * u))
    rho *= 1.0 - (flutes[:, None] * cusp)[..., None] * (1.0 - s**4)
    theta, rho = theta.reshape(-1, len(s)), rho.reshape(-1, len(s))

    # Sweep: taper, twist, squeeze, bend.
    rest = np.maximum(1.0 - s, 0.0)
    width = radius * rest**exponent
    if belly > 0.0:
        width = width * (0.35 + 0.65 * np.clip(s / belly, 0.0, 1.0) ** 0.7)
    theta = theta + turned * s
    x, z = rho * np.cos(theta) * width, rho * np.sin(theta) * width * flat
    x, z = np.cos(spin) * x - np.sin(spin) * z, np.sin(spin) * x + np.cos(spin) * z
    axis = (tip - base) / length
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    arch = 4.0 * s * rest
    spine = base + s[:, None] * (tip - base) + arch[:, None] * (bulge[0] * side + bulge[1] * other)
    p = spine + x[..., None] * side - z[..., None] * other
    solid = swept(p, base, tip)

    # Planes where slivers have come off: across a ridge, steeply.
    for _ in range(shaves):
        turn_at = rng.uniform(0, 2 * np.pi)
        out = np.cos(turn_at) * side + np.sin(turn_at) * other
        at = rng.uniform(0.15, 0.7)
        normal = out + rng.uniform(-0.4, 0.6) * radius / length * axis
        normal /= np.linalg.norm(normal)
        through = base + at * (tip - base) + 4 * at * (1 - at) * (bulge[0] * side + bulge[1] * other)
        # How far a blade reaches in that direction: its broad side is `spin` around the axis.
        reach = np.hypot(np.cos(turn_at + spin), flat * np.sin(turn_at + spin))
        through = through + out * radius * (1 - at) ** exponent * reach * rng.uniform(0.5, 0.75)
        solid = solid.trim_by_plane(-normal, -float(normal @ through))
    # A plane may cut a bent shard twice: what hangs in the air goes.
    solid = max(solid.decompose(), key=lambda piece: piece.volume(), default=solid)
    if is_broken:
        turn_at = rng.uniform(0, 2 * np.pi)
        normal = axis * rng.uniform(0.6, 1.1) + np.cos(turn_at) * side + np.sin(turn_at) * other
        normal /= np.linalg.norm(normal)
        through = base + rng.uniform(0.45, 0.7) * (tip - base)
        solid = solid.trim_by_plane(-normal, -float(normal @ through))
    return solid


def block(rng: np.random.Generator, center, half, cuts: int = 8, lean: float = 0.2) -> Manifold:
    """A broken block: a box of half axes `half` (3,), turned a little, its edges and corners cut by planes."""
    half = np.asarray(half, np.float64)
    solid = Manifold.cube(tuple(2 * half), True)
    for _ in range(cuts):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        reach = np.abs(normal * half).sum() * rng.uniform(0.62, 0.9)
        solid = solid.trim_by_plane(-normal, -float(reach))
    spin = np.degrees(rng.uniform(-lean, lean, 3))
    return solid.rotate((spin[0], np.degrees(rng.uniform(0, 2 * np.pi)), spin[2])).translate(tuple(center))


def boulder(rng: np.random.Generator, center, size) -> Manifold:
    """An angular boulder of half axes `size` (3,): the hull of points on an ellipsoid, with planes broken off."""
    points = rng.normal(size=(26, 3))
    points *= rng.uniform(0.82, 1.0, (26, 1)) / np.linalg.norm(points, axis=1, keepdims=True)
    solid = Manifold.hull_points(points)
    for _ in range(7):
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        solid = solid.trim_by_plane(-normal, -float(rng.uniform(0.55, 0.8)))
    return solid.scale(tuple(size)).rotate(tuple(rng.uniform(-40, 40, 3))).translate(tuple(center))


def swept(p: np.ndarray, base: np.ndarray, tip: np.ndarray) -> Manifold:
    """The solid between columns (C, S, 3) of points around an axis, closed by a fan at the base and one at the tip."""
    columns, rows, _ = p.shape
    index = np.arange(columns * rows).reshape(columns, rows)
    a, b = index, np.roll(index, -1, 0)
    quads = np.stack([a[:, :-1], b[:, :-1], b[:, 1:], a[:, 1:]], -1).reshape(-1, 4)
    foot, top = columns * rows, columns * rows + 1
    bottom = np.stack([np.full(columns, foot), b[:, 0], a[:, 0]], 1)
    crown = np.stack([np.full(columns, top), a[:, -1], b[:, -1]], 1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]], bottom, crown])
    positions = np.concatenate([p.reshape(-1, 3), p[:, 0].mean(0)[None], tip[None]])
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    if np.einsum("ij,ij->", a - base, np.cross(b - base, c - base)) < 0:
        triangles = triangles[:, ::-1]
    return solid_of(positions, triangles)
