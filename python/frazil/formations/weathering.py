"""From a solid to a surface of ice: evenly fine triangles, edges rounded by age, bowls and grooves of melting.

Model: the solid is refined, rounded (umbrella smoothing, a diffusion of the surface by the square of the radius) and
    displaced along its normals at a middle resolution, then refined to the wanted number of triangles and displaced by
    the finer features. Refining and displacing keep every edge with its two triangles, so closed solids stay closed;
    where a surface would run through itself, in thin tips and along sharp edges, it is moved less.
Units: metres.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold
from scipy.sparse import coo_matrix

from .._frazil import Mesh, self_intersections
from .contour import Surface
from .noise import Noise
from .solids import arrays_of, solid_of

Progress = Callable[[str, float], None]  # (stage, fraction of it in 0..1)
Displacement = Callable[[np.ndarray, np.ndarray, float], np.ndarray]  # (points, normals, step) -> metres, outwards

kCoarse = 160_000  # triangles at which a surface is rounded and takes its large features
kMostPasses = 60
kWithdrawals = (0.5, 0.75, 1.0, 1.0, 1.0)  # how much less a crossing surface is moved, try after try


def grow(
    solid: Manifold,
    triangles: int,
    *,
    rounding: float = 0.0,
    large: Displacement | None = None,
    fine: Displacement | None = None,
    keep: Callable[[np.ndarray], np.ndarray] | None = None,
    progress: Progress | None = None,
) -> Surface:
    """The surface of `solid` with about that many triangles.

    `rounding` is the radius (m) over which edges are worn; `keep` (N,) in 0..1 of points says how much of rounding and
    displacement a place takes (tips take little). `fine` gets the step of the mesh, to leave out what it cannot show.
    """
    report = progress or (lambda stage, fraction: None)
    report("surface", 0.0)
    coarse = refine(solid, min(triangles, kCoarse))
    surface = Surface(*arrays_of(coarse))
    step = _step(surface)
    share = np.ones(len(surface.positions)) if keep is None else keep(surface.positions)
    if rounding > 0.0:
        _move(surface, _rounded(surface, rounding, step, share))
    if large is not None:
        _move(surface, _displaced(surface, large, step, share))
    report("surface", 0.3)
    if triangles > 1.3 * kCoarse:
        surface = Surface(*arrays_of(refine(solid_of(surface.positions, surface.triangles), triangles)))
        step = _step(surface)
        share = np.ones(len(surface.positions)) if keep is None else keep(surface.positions)
    report("surface", 0.6)
    if fine is not None:
        _move(surface, _displaced(surface, fine, step, share))
    report("surface", 1.0)
    return surface


def refine(solid: Manifold, triangles: int) -> Manifold:
    """The solid with long edges split, or small ones merged, until it has about that many triangles."""
    step = np.sqrt(solid.surface_area() * 4.0 / np.sqrt(3.0) / triangles)
    # Where solids met, edges of different origin would be kept.
    solid = solid.as_original()
    tolerance = 0.02 * step
    while solid.num_tri() > 0.7 * triangles and tolerance < 8.0 * step:
        solid = solid.simplify(tolerance)
        tolerance *= 1.7
    best = solid
    for _ in range(6):
        if solid.num_tri() > triangles:
            break
        best = solid.refine_to_length(float(step))
        ratio = best.num_tri() / triangles
        if 0.85 < ratio < 1.15 or (triangles > 2_000_000 and 0.75 < ratio < 1.35):
            break
        step *= ratio**0.6
    return best


@dataclass
class Melt:
    """Scallops, ripples and layers on a surface: depths in metres at `size` metres, `amount` 0..1 of them.

    Bowls are `stretch` times as high as wide; `layers` is the thickness (m) of the years' bands, which stand out by
    `band`; `grain` the height of the finest noise, `dent` that of the broadest in units of `depth`. `cracks` planes are
    opened to grooves, on one side of which the ice has slipped a little.
    """

    noise: Noise
    box: tuple[np.ndarray, np.ndarray]
    size: float
    depth: float
    amount: float = 1.0
    stretch: float = 1.5
    layers: float = 0.0
    band: float = 0.0
    grain: float = 0.0
    dip: tuple[float, float, float] = (0.2, 0.96, -0.15)
    cracks: int = 0
    dent: float = 0.4

    def __post_init__(self):
        rng = np.random.default_rng((self.noise.seed, 9001))
        normals = rng.normal(size=(self.cracks, 3)) * [1.0, 0.6, 1.0]
        self._planes = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
        low, high = np.asarray(self.box[0]), np.asarray(self.box[1])
        self._through = 0.5 * (low + high) + 0.3 * (high - low) * rng.uniform(-1, 1, (self.cracks, 3))

    def large(self, p: np.ndarray, n: np.ndarray, step: float) -> np.ndarray:
        """Broad dents, and bowls of `size` that meet in cusps."""
        size = self.size
        out = self.dent * self.depth * self.noise(p, 3.1 * size, 3)
        if step < 0.4 * size:
            out = out - self._bowls(p, size, 1) * self.depth * self.amount
        return out

    def fine(self, p: np.ndarray, n: np.ndarray, step: float) -> np.ndarray:
        """Bowls within the bowls, bands of the years, grain."""
        out = np.zeros(len(p))
        size = 0.38 * self.size
        if step < 0.4 * size:
            out -= self._bowls(p, size, 2) * 0.30 * self.depth * self.amount
        if self.band > 0.0:
            height = p @ np.asarray(self.dip) + 0.25 * self.layers * self.noise(p, 6.0 * self.layers, 8)
            line = 0.7 * self.noise.line(height, self.layers, 52) + 0.4 * self.noise.line(height, 0.4 * self.layers, 53)
            out += self.band * np.clip(line, -0.6, 1.0)
        if self.cracks:
            out -= self._grooves(p, step)
        octaves = int(np.clip(np.log2(max(0.25 * self.size / (2.0 * step), 1.0)) + 1, 0, 5))
        if self.grain > 0.0 and octaves:
            out += self.grain * self.noise.fractal(p, 0.25 * self.size, octaves, 20, 0.55)
        return out

    def _grooves(self, p: np.ndarray, step: float) -> np.ndarray:
        bent = p + 0.25 * self.size * self.noise.vector(p, 2.3 * self.size, 60)
        bent += 0.05 * self.size * self.noise.vector(p, 0.5 * self.size, 64)
        width = max(0.05 * self.size, 1.2 * step)
        depth = np.zeros(len(p))
        for k, (normal, through) in enumerate(zip(self._planes, self._through, strict=True)):
            side = (bent - through) @ normal
            open_here = np.clip(0.5 + 1.3 * self.noise(p, 5.0 * self.size, 70 + k % 5), 0.0, 1.0)
            groove = np.exp(-np.abs(side) / width)
            slip = np.where(side > 0.0, np.exp(-np.maximum(side, 0.0) / (1.6 * self.size)), 0.0)
            depth += open_here * (0.5 * groove + 0.5 * slip)
        return self.depth * depth

    def _bowls(self, p: np.ndarray, size: float, stream: int) -> np.ndarray:
        wavy = p + 0.18 * size * self.noise.vector(p, 1.7 * size, 30 + 3 * stream)
        where = np.clip(0.55 + 0.9 * self.noise(p, 4.3 * size, 40 + stream), 0.0, 1.0)
        bowls = self.noise.scallops(wavy, (size, self.stretch * size, size), self.box, stream)
        return bowls * where


def _move(surface: Surface, moved: np.ndarray) -> None:
    """Move the vertices there, less or not at all where the surface would then run through itself."""
    base, share = surface.positions, np.ones(len(moved))
    triangles = surface.triangles
    for withdrawal in kWithdrawals:
        surface.positions = base + share[:, None] * (moved - base)
        crossing = self_intersections(Mesh(np.float32(surface.positions), np.int32(triangles)))
        if not len(crossing):
            return
        reach = np.zeros(len(moved))
        reach[triangles[crossing]] = 1.0
        for part in (0.5, 0.25):  # the vertices around follow half of the way, those around these a quarter
            around = triangles[(reach[triangles] > 0.0).any(axis=1)]
            reach[around] = np.maximum(reach[around], part)
        share *= 1.0 - withdrawal * reach
    surface.positions = base + share[:, None] * (moved - base)


def _rounded(surface: Surface, radius: float, step: float, share: np.ndarray) -> np.ndarray:
    passes = int(np.clip(np.ceil(2.0 * (radius / step) ** 2), 1, kMostPasses))
    strength = min(1.0, 2.0 * (radius / step) ** 2 / passes) * 0.5
    neighbours = _neighbours(surface)
    p = surface.positions
    for _ in range(passes):
        p = p + (strength * share)[:, None] * (neighbours @ p - p)
    return p


def _neighbours(surface: Surface):
    # Rows that average the vertices around each vertex.
    t = surface.triangles
    start = np.concatenate([t[:, 0], t[:, 1], t[:, 2]])
    end = np.concatenate([t[:, 1], t[:, 2], t[:, 0]])
    count = len(surface.positions)
    matrix = coo_matrix((np.ones(len(start)), (start, end)), (count, count)).tocsr()
    degree = np.asarray(matrix.sum(1)).ravel()
    matrix.data /= np.repeat(np.maximum(degree, 1.0), np.diff(matrix.indptr))
    return matrix


def _displaced(surface: Surface, field: Displacement, step: float, share: np.ndarray) -> np.ndarray:
    normals = surface.vertex_normals()
    share = share * _flatness(surface, normals)
    moved = surface.positions.copy()
    for begin in range(0, len(normals), 1 << 18):
        part = slice(begin, begin + (1 << 18))
        height = field(surface.positions[part], normals[part], step) * share[part]
        moved[part] += height[:, None] * normals[part]
    return moved


def _flatness(surface: Surface, normals: np.ndarray) -> np.ndarray:
    # 1 where faces agree, 0 on sharp ridges, which displacement along a mean normal would fray.
    t = surface.triangles
    a, b, c = (surface.positions[t[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    area = np.linalg.norm(n, axis=1)
    count = len(normals)
    total, along = np.zeros(count), np.zeros(count)
    for k in range(3):
        total += np.bincount(t[:, k], area, count)
        along += np.bincount(t[:, k], np.einsum("ij,ij->i", n, normals[t[:, k]]), count)
    return np.clip((along / np.maximum(total, 1e-300) - 0.80) / 0.17, 0.05, 1.0)


def _step(surface: Surface) -> float:
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return float(np.sqrt(area * 4.0 / np.sqrt(3.0) / max(len(surface.triangles), 1)))
