from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, overload

import numpy
import numpy.typing
from numpy.typing import NDArray


class Cancelled(KeyboardInterrupt):
    pass

class Mesh:
    """
    A triangle mesh.

    Parameters
    ----------
    positions : (V, 3) float32, metres, finite.
    triangles : (F, 3) int32, counter-clockwise seen from outside.
    normals : (V, 3) or (3F, 3) float32, unit length, optional; without them the mesh is faceted.
    uvs : (V, 2) or (3F, 2) float32, optional.

    Raises
    ------
    ValueError
        For wrong shapes, NaN or infinite positions, indices out of range.

    The arrays are copied; the properties are views of the mesh's own memory.
    """

    def __init__(self, positions: numpy.typing.ArrayLike, triangles: numpy.typing.ArrayLike, normals: numpy.typing.ArrayLike | None = None, uvs: numpy.typing.ArrayLike | None = None) -> None: ...

    @property
    def positions(self) -> NDArray[numpy.float32]: ...

    @property
    def triangles(self) -> NDArray[numpy.int32]: ...

    def set_normals(self, values: numpy.typing.ArrayLike, interpolation: str | None = None) -> None:
        """
        Give normals; interpolation is constant, uniform (per triangle), vertex or corner, found from the length
        where it is not given.
        """

    def set_uvs(self, values: numpy.typing.ArrayLike, interpolation: str | None = None) -> None:
        """Give texture coordinates; see set_normals."""

    def set_colors(self, values: numpy.typing.ArrayLike, interpolation: str | None = None) -> None:
        """Give display colours, linear RGB; see set_normals."""

    def set_rest(self, values: numpy.typing.ArrayLike) -> None:
        """
        Give positions (V, 3) float32, metres, in a pose that does not move: points are placed there and stay on
        their triangles in every other pose.
        """

    def set_spacing(self, values: numpy.typing.ArrayLike) -> None:
        """
        Give the spacing (V,) float32 of the points that a render places on this mesh, metres in the world: it takes
        the place of the material's.
        """

    @property
    def spacing(self) -> numpy.ndarray | None:
        """View of the points' spacing, or None."""

    @property
    def rest(self) -> numpy.ndarray | None:
        """View of the rest positions, or None."""

    @property
    def normals(self) -> numpy.ndarray | None:
        """View of the normals, or None."""

    @property
    def uvs(self) -> numpy.ndarray | None:
        """View of the texture coordinates, or None."""

    @property
    def colors(self) -> numpy.ndarray | None:
        """View of the display colours, or None."""

    @property
    def normals_interpolation(self) -> str: ...

    @property
    def uvs_interpolation(self) -> str: ...

    @property
    def colors_interpolation(self) -> str: ...

    def submesh(self, triangles: numpy.typing.ArrayLike) -> Mesh:
        """
        Some of the triangles, by their indices (N,) int32, with the vertices that they use.
        """

    def transformed(self, matrix: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)]) -> Mesh:
        """
        Moved by a (4, 4) float64 matrix for row vectors; a mirroring one also flips the winding.
        """

    @property
    def area(self) -> float:
        """Surface area in square metres."""

    def __repr__(self) -> str: ...

class ControlMesh:
    """
    Polygons as USD gives them, right-handed.

    Parameters
    ----------
    points : (V, 3) float32, metres.
    face_vertex_counts, face_vertex_indices, hole_indices : int32.
    crease_indices, crease_lengths, crease_sharpnesses, corner_indices, corner_sharpnesses : as in USD.
    normals, uvs, colors : (array, interpolation) with 'constant', 'uniform', 'vertex' or 'corner'.
    is_boundary_smooth : interpolateBoundary is edgeOnly.
    """

    def __init__(self, points: numpy.typing.ArrayLike, face_vertex_counts: numpy.typing.ArrayLike, face_vertex_indices: numpy.typing.ArrayLike, *, hole_indices: numpy.typing.ArrayLike | None = None, crease_indices: numpy.typing.ArrayLike | None = None, crease_lengths: numpy.typing.ArrayLike | None = None, crease_sharpnesses: Sequence[float] = [], corner_indices: numpy.typing.ArrayLike | None = None, corner_sharpnesses: Sequence[float] = [], normals: tuple[numpy.typing.ArrayLike, str] | None = None, uvs: tuple[numpy.typing.ArrayLike, str] | None = None, colors: tuple[numpy.typing.ArrayLike, str] | None = None, is_boundary_smooth: bool = False) -> None: ...

def triangulate(cage: ControlMesh, path: str = 'ControlMesh') -> tuple[Mesh, NDArray[numpy.int32]]:
    """
    Flat polygons as triangles: (Mesh, the face of each triangle (F,) int32). ValueError, beginning with `path`,
    for indices or primvars that do not fit together.
    """

def subdivide(cage: ControlMesh, level: int, path: str = 'ControlMesh') -> tuple[Mesh, NDArray[numpy.int32]]:
    """
    The Catmull-Clark limit surface, `level` quads along each edge: (Mesh, the face of each triangle).
    """

def cut_long_edges(mesh: Mesh, edge_length: float, most_triangles: int = 4000000) -> tuple[Mesh, NDArray[numpy.int32], float]:
    """
    Halve edges until none is longer than edge_length: (Mesh, the triangle that each was cut from (F,) int32, the
    longest edge that is left). No more than most_triangles are made.
    """

def displaced(mesh: Mesh, offsets: numpy.typing.ArrayLike) -> Mesh:
    """
    Move the vertices by offsets (3F, 3) at the corners of the triangles, their mean at each vertex, and give the
    shape its normals. No cracks open.
    """

def self_intersections(mesh: Mesh) -> NDArray[numpy.int32]:
    """
    The triangles (N,) int32 that run through another of the mesh: what is inside is not well defined there, and light
    that goes through such a solid is lost or counted twice. Crossings of less than a thousandth of an edge do not
    count, nor do triangles that lie flat on each other.
    """

class PointSet:
    """
    Points on a mesh that stand for its surface. The arrays are views of the set's own memory.
    """

    def __init__(self) -> None:
        """No points."""

    @property
    def positions(self) -> NDArray[numpy.float32]:
        """(N, 3) float32, metres."""

    @property
    def normals(self) -> NDArray[numpy.float32]:
        """(N, 3) float32: the triangles' geometric normals, unit length."""

    @property
    def areas(self) -> NDArray[numpy.float32]:
        """
        (N,) float32, m²: the surface nearest to each point on its side; their sum is the mesh's area.
        """

    @property
    def triangles(self) -> NDArray[numpy.int32]:
        """(N,) int32: the triangle that each point lies on."""

    @property
    def barycentrics(self) -> NDArray[numpy.float32]:
        """
        (N, 2) float32 in [0, 1]: the weights of the triangle's second and third corner.
        """

    @property
    def spacing(self) -> float:
        """The distance asked for, metres; the largest where it varies."""

    def save(self, path: object) -> None:
        """
        Write a binary PLY file with all arrays. OSError where it cannot be written.
        """

    @staticmethod
    def load(path: object) -> PointSet:
        """Read a file that save() wrote. OSError where it cannot be read."""

    def on(self, mesh: Mesh, thin_walls: bool = True) -> PointSet:
        """
        The same points, with the same ids, on another pose of the mesh that they were made on: positions and
        normals follow their triangles, and each area is the pose's surface that is nearest to the point there.
        ValueError where the pose has fewer triangles.
        """

    def __len__(self) -> int: ...

    def __repr__(self) -> str: ...

def poisson_points_constant(mesh: Mesh, spacing: float, seed: int = 0, thin_walls: bool = True, max_points: int = 0, threads: int = 0, progress: Callable | None = None) -> PointSet: ...

def poisson_points_varying(mesh: Mesh, spacing: numpy.typing.ArrayLike, seed: int = 0, thin_walls: bool = True, max_points: int = 0, threads: int = 0, progress: Callable | None = None) -> PointSet: ...

def poisson_points_sampled(mesh: Mesh, spacing: Callable, seed: int = 0, thin_walls: bool = True, max_points: int = 0, threads: int = 0, progress: Callable | None = None) -> PointSet: ...

def poisson_points_by_count(mesh: Mesh, spacing: int, seed: int = 0, thin_walls: bool = True, max_points: int = 0, threads: int = 0, progress: Callable | None = None) -> PointSet: ...

class PointStatistics:
    """How good a point set is; distances in metres."""

    @property
    def count(self) -> int: ...

    @property
    def min_distance(self) -> float:
        """Of any two points on the same side."""

    @property
    def mean_distance(self) -> float:
        """From a point to its nearest."""

    @property
    def distance_spread(self) -> float:
        """Its standard deviation over its mean."""

    @property
    def gap(self) -> float:
        """The largest sampled distance from the surface to its nearest point."""

    @property
    def mean_area(self) -> float: ...

    @property
    def area_spread(self) -> float:
        """Standard deviation of the areas over their mean."""

    @property
    def area_sum(self) -> float: ...

    def __repr__(self) -> str: ...

def point_statistics(points: PointSet, mesh: Mesh, thin_walls: bool = True, samples: int = 0) -> PointStatistics:
    """
    Measure a point set: nearest pair, largest gap over `samples` places of the surface (0: ten a point, at least
    100,000), spread of nearest distances and of areas.
    """

def tessellated_points(mesh: Mesh, edge_length: float) -> PointSet:
    """
    The centres of a regular cut of every triangle into parts with edges of at most edge_length (metres), with
    their areas. ValueError where edge_length is not > 0 or would make too many points.
    """

def fresnel_dielectric(cos_theta: float, eta: float) -> float:
    """
    Reflected fraction of unpolarised light; eta = index it would enter / index it is in.
    """

def fresnel_average(eta: float) -> float:
    """2 ∫ F(cos) cos dcos: what comes from all around."""

class Medium:
    """
    What a translucent body is made of.

    Parameters
    ----------
    sigma_s_prime : (3,) or number, 1/m, >= 0. Reduced scattering coefficient.
    sigma_a : (3,) or number, 1/m, >= 0. Absorption coefficient.
    eta : index of refraction relative to the outside, 1 to 4; ice is 1.31.

    Raises
    ------
    ValueError
        For coefficients that are negative, NaN, or both zero.
    """

    def __init__(self, sigma_s_prime: object, sigma_a: object, eta: float = 1.309999942779541) -> None: ...

    @staticmethod
    def from_albedo(albedo: object, mean_free_path: object, eta: float = 1.309999942779541, profile: str = 'dipole') -> Medium:
        """
        The medium whose profile has total reflectance `albedo` (0 <= albedo < 1) and transport mean free path
        `mean_free_path` = 1/(sigma_s_prime + sigma_a), in metres.

        profile : dipole, better_dipole, normalized_diffusion, photon_beam or multiple_scattering; the last as renders
            use it, with light of one scattering: MultipleScattering(medium, single=1).
        """

    @property
    def sigma_s_prime(self) -> object: ...

    @property
    def sigma_a(self) -> object: ...

    @property
    def eta(self) -> float: ...

    @property
    def mean_free_path(self) -> object:
        """1/(sigma_s_prime + sigma_a), (3,), metres."""

    def __repr__(self) -> str: ...

class Dipole:
    """The standard dipole of Jensen et al. 2001."""

    def __init__(self, medium: Medium) -> None: ...

    def reflectance(self, r: object) -> object:
        """Rd(r) in 1/m², (n, 3), for distances r (n,) in metres."""

    def within(self, R: object) -> object:
        """
        F(R): the fraction that leaves within R metres of where it entered, (n, 3); inf gives the albedo.
        """

    @property
    def albedo(self) -> object:
        """Total diffuse reflectance Rd_total = F(inf), (3,)."""

    @property
    def medium(self) -> Medium: ...

class BetterDipole:
    """The better dipole of d'Eon 2012."""

    def __init__(self, medium: Medium) -> None: ...

    def reflectance(self, r: object) -> object:
        """Rd(r) in 1/m², (n, 3), for distances r (n,) in metres."""

    def within(self, R: object) -> object:
        """
        F(R): the fraction that leaves within R metres of where it entered, (n, 3); inf gives the albedo.
        """

    @property
    def albedo(self) -> object:
        """Total diffuse reflectance Rd_total = F(inf), (3,)."""

    @property
    def medium(self) -> Medium: ...

class NormalizedDiffusion:
    """The fit of Christensen and Burley 2015, single scattering included."""

    def __init__(self, medium: Medium) -> None: ...

    def reflectance(self, r: object) -> object:
        """Rd(r) in 1/m², (n, 3), for distances r (n,) in metres."""

    def within(self, R: object) -> object:
        """
        F(R): the fraction that leaves within R metres of where it entered, (n, 3); inf gives the albedo.
        """

    @property
    def albedo(self) -> object:
        """Total diffuse reflectance Rd_total = F(inf), (3,)."""

    @property
    def medium(self) -> Medium: ...

class PhotonBeamDiffusion:
    """Photon beam diffusion of Habel et al. 2013, multiple scattering alone."""

    def __init__(self, medium: Medium) -> None: ...

    def reflectance(self, r: object) -> object:
        """Rd(r) in 1/m², (n, 3), for distances r (n,) in metres."""

    def within(self, R: object) -> object:
        """
        F(R): the fraction that leaves within R metres of where it entered, (n, 3); inf gives the albedo.
        """

    @property
    def albedo(self) -> object:
        """Total diffuse reflectance Rd_total = F(inf), (3,)."""

    @property
    def medium(self) -> Medium: ...

class MultipleScattering:
    """
    The curve of photon beam diffusion, scaled to the exact albedo of light that is
    scattered more than once, and of `single` (0..1) of the light scattered once.
    """

    def __init__(self, medium: Medium, single: float = 0.0) -> None: ...

    def reflectance(self, r: object) -> object:
        """Rd(r) in 1/m², (n, 3), for distances r (n,) in metres."""

    def within(self, R: object) -> object:
        """
        F(R): the fraction that leaves within R metres of where it entered, (n, 3); inf gives the albedo.
        """

    @property
    def albedo(self) -> object:
        """Total diffuse reflectance Rd_total = F(inf), (3,)."""

    @property
    def medium(self) -> Medium: ...

def half_space_albedo(alpha: float, eta: float = 1.0) -> tuple[float, float]:
    """
    What leaves a half space lit from all around, over what enters: (by one scattering, by more), exactly.
    """

class Ramp:
    """
    A colour for every distance between where light enters and where it leaves.

    Parameters
    ----------
    distances : (K,) >= 0, increasing, metres; or mean free paths where mean_free_path is given.
    colors : (K, 3) >= 0, factors; linear between knots, constant outside.
    preserve_energy : scale each channel so that the total diffuse reflectance stays.
    mean_free_path : metres that one unit of distance stands for.
    """

    def __init__(self, distances: object, colors: object, preserve_energy: bool = False, mean_free_path: float = 1.0) -> None: ...

    def energy_scale(self, profile: object) -> object:
        """
        What preserve_energy multiplies each channel by, (3,); 1 where it is off.
        """

    def eval(self, r: object) -> object:
        """
        The factors at distances r (n,) in metres, (n, 3); preserve_energy is not in them.
        """

class Gathered:
    """What a gather returns."""

    @property
    def exitance(self) -> NDArray[numpy.float32]: ...

    @property
    def layers(self) -> NDArray[numpy.float32]: ...

    @property
    def coverage(self) -> NDArray[numpy.float32]: ...

class Cells:
    """
    The surface that each point of a mesh stands for: its moments, and places spread over it.

    Light that is known at the places, not at the points alone, makes the sum over a tenth of the points as smooth.

    Parameters
    ----------
    points : PointSet of poisson_points on this mesh.
    mesh : Mesh.
    places : how many a cell has at most, 1 to 4096.
    seed : of where in its piece of the cell each place lies.

    Raises
    ------
    ValueError
        Where the points leave a part of the mesh uncovered.

    Examples
    --------
    >>> import frazil as fz, numpy as np
    >>> square = fz.Mesh(np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.int32([[0, 1, 2], [0, 2, 3]]))
    >>> points = fz.poisson_points(square, 0.1)
    >>> cells = fz.Cells(points, square)
    >>> light = np.where(cells.positions[:, :1] > 0.5, [3.0, 2.0, 1.0], 0.0)  # a shadow's edge
    >>> tree = fz.PointTree(points, light, fz.Dipole(fz.Medium(10.0, 0.1)), cells=cells)
    """

    def __init__(self, points: object, mesh: Mesh, places: int = 64, seed: int = 0) -> None: ...

    def __len__(self) -> int: ...

    @property
    def areas(self) -> NDArray[numpy.float32]:
        """(N,) m²; they sum to the mesh's."""

    @property
    def centroids(self) -> NDArray[numpy.float32]:
        """(N, 3) metres."""

    @property
    def covariances(self) -> NDArray[numpy.float32]:
        """(N, 6) m²: xx, yy, zz, xy, xz, yz about the centroid."""

    @property
    def positions(self) -> object:
        """(M, 3) of the places, cell after cell; metres."""

    @property
    def normals(self) -> object:
        """(M, 3) of the places."""

    @property
    def weights(self) -> object:
        """(M,) m²: the area that each place stands for."""

    @property
    def owners(self) -> object:
        """(M,) uint32: the point of each place."""

class PointTree:
    """
    The octree of points with their irradiance.

    Parameters
    ----------
    points : PointSet, or any object with positions (N, 3), normals (N, 3) and areas (N,).
    irradiance : (N, 3) or (N, G, 3), W/m²; rows with NaN are left out and counted.
    profile : Dipole, BetterDipole, NormalizedDiffusion, PhotonBeamDiffusion or MultipleScattering.
    ramp : Ramp, optional.
    cells : Cells of the points, optional. Irradiance may then be that of their places, (M, 3) or (M, G, 3), which
        the estimator noise_free needs to be as smooth with a tenth of the points.

    Safe to gather from by many threads at once.
    """

    def __init__(self, points: object, irradiance: object, profile: object, ramp: Ramp | None = None, cells: Cells | None = None) -> None: ...

    def gather(self, positions: object, tolerance: float = 0.003000000026077032, estimator: str = 'noise_free', ramp_layers: bool = False) -> Gathered:
        """
        Exitance and coverage at M positions (M, 3), in any order.

        Returns an object with exitance (M, G, 3) and coverage (M, 3); with ramp_layers also layers (M, K, G, 3), the
        exitance per hat function of the ramp: colours times layers sum to the exitance (times Ramp.energy_scale).
        """

    def gather_exact(self, positions: object, estimator: str = 'noise_free') -> Gathered:
        """The same over every point in double precision: slow, to compare with."""

    @property
    def point_count(self) -> int: ...

    @property
    def node_count(self) -> int: ...

    @property
    def dropped_count(self) -> int:
        """Points left out for their non-finite irradiance."""

def area_compensation(coverage: object, profile: object, mode: str = 'ratio', limit: float = 8.0, strength: float = 1.0, by_luminance: bool = False) -> object:
    """
    Gain (M, 3) that the exitance is multiplied by, from coverage (M, 3). For mode 'fill' it is the amount to add
    per unit of irradiance at the shading point.
    """

class DomeLight:
    """
    Light from all around.

    Parameters
    ----------
    image : (height, width, 3) float32 lat-long radiance, row 0 = +y, centre = +z, or None for a
        uniform dome. Copied.
    portals : list of (4, 4) float64, openings that the light comes through: the unit square in x and y to
        the world, for row vectors; light goes along its -z. They guide sampling alone.
    """

    def __init__(self, image: Annotated[NDArray[numpy.float32], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)] | None = None, path: str = 'DomeLight', portals: Sequence[Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)]] = []) -> None: ...

    @property
    def portals(self) -> list: ...

    @property
    def has_image(self) -> bool: ...

    @property
    def image(self) -> object:
        """(height, width, 3) float32, or None."""

    def radiance(self, direction: Sequence[float]) -> list[float]:
        """
        Radiance from a unit direction in the light's own frame; 1 without an image.
        """

class DistantLight:
    """A sun along -z; `angle` is its full angle in degrees."""

    def __init__(self, angle: float = 0.5299999713897705) -> None: ...

    @property
    def angle(self) -> float: ...

    @angle.setter
    def angle(self, arg: float, /) -> None: ...

class RectLight:
    """
    A rectangle in x and y that shines along -z, in the light's units.

    Parameters
    ----------
    width, height : the sides.
    image : (height, width, 3) float32 that multiplies the radiance, upright (+y up) as seen from
        the side that shines, or None. Copied.
    """

    def __init__(self, width: float = 1.0, height: float = 1.0, image: Annotated[NDArray[numpy.float32], dict(shape=(None, None, 3), order='C', device='cpu', writable=False)] | None = None, path: str = 'RectLight') -> None: ...

    @property
    def has_image(self) -> bool: ...

    @property
    def image(self) -> object:
        """(height, width, 3) float32, or None."""

    @property
    def width(self) -> float: ...

    @width.setter
    def width(self, arg: float, /) -> None: ...

    @property
    def height(self) -> float: ...

    @height.setter
    def height(self, arg: float, /) -> None: ...

class DiskLight:
    """A disk in x and y that shines along -z, in the light's units."""

    def __init__(self, radius: float = 0.5) -> None: ...

    @property
    def radius(self) -> float: ...

    @radius.setter
    def radius(self, arg: float, /) -> None: ...

class SphereLight:
    """A sphere that shines outwards, in the light's units."""

    def __init__(self, radius: float = 0.5) -> None: ...

    @property
    def radius(self) -> float: ...

    @radius.setter
    def radius(self, arg: float, /) -> None: ...

class CylinderLight:
    """
    A tube about x without caps that shines outwards, in the light's units.
    """

    def __init__(self, length: float = 1.0, radius: float = 0.5) -> None: ...

    @property
    def length(self) -> float: ...

    @length.setter
    def length(self, arg: float, /) -> None: ...

    @property
    def radius(self) -> float: ...

    @radius.setter
    def radius(self, arg: float, /) -> None: ...

class MeshLight:
    """
    A mesh that shines along its normals.

    Parameters
    ----------
    mesh : Mesh, in the light's frame. Copied.
    object : index of the scene's object that shows this mesh at the light's matrix; None = none,
        then rays do not run into the light.
    triangle_factors : (F, 3) float32 that multiplies the radiance by triangle, or None.
    is_two_sided : shine from both sides.
    is_material : it stands for the emission of the object's material, which the camera sees itself.
    """

    def __init__(self, mesh: Mesh, object: int | None = None, triangle_factors: numpy.typing.ArrayLike | None = None, *, is_two_sided: bool = False, is_material: bool = False) -> None: ...

    @property
    def object(self) -> int | None: ...

    @property
    def mesh(self) -> Mesh:
        """A copy of the mesh."""

    @property
    def triangle_factors(self) -> object:
        """(F, 3) float32, or None."""

    @property
    def is_two_sided(self) -> bool: ...

    @property
    def is_material(self) -> bool: ...

class ObjectSet:
    """
    Objects of a scene by index, for light and shadow linking. Lights may share one.
    """

    def __init__(self, objects: Sequence[int]) -> None: ...

    @property
    def objects(self) -> list[int]: ...

    def __len__(self) -> int: ...

class IesProfile:
    """
    A luminaire's light by direction (IES LM-63, type C), bilinear in the angles; see read_ies.

    Parameters
    ----------
    vertical : (V,) degrees that rise within 0 (the light's -z) to 180; beyond them it gives nothing.
    horizontal : (H,) degrees, from 0 to 0, 90, 180 or 360, or from 90 to 270: less than a turn is mirrored.
    values : (H, V) intensities in candela, >= 0.
    path : name for messages.
    """

    def __init__(self, vertical: Sequence[float], horizontal: Sequence[float], values: Sequence[Sequence[float]], path: str = 'IesProfile') -> None: ...

    @property
    def vertical(self) -> list[float]: ...

    @property
    def horizontal(self) -> list[float]: ...

    @property
    def values(self) -> list[list[float]]: ...

    @property
    def mean(self) -> float:
        """Mean intensity over the sphere, or the hemisphere that it covers."""

    def intensity(self, direction: Sequence[float]) -> float:
        """
        Intensity towards a unit direction in the light's own frame; -z is vertical angle 0.
        """

class Shaping:
    """
    How the light depends on the angle from -z (UsdLuxShapingAPI).

    Parameters
    ----------
    cone_angle : degrees from the axis beyond which nothing shines, 0 to 180; 180 = no cone.
    cone_softness : >= 0; the part of the angle over which the light fades.
    focus : >= 0; exponent of the cosine. focus_tint : RGB that takes the place of what focus removes.
    ies : IesProfile that multiplies the light, None = none. ies_angle_scale : widens (> 1) or narrows (< 1) the
        profile about straight down, negative ones about straight up; 0 = neither.
    ies_normalize : divide the profile by its mean.
    """

    def __init__(self, *, cone_angle: float = 180.0, cone_softness: float = 0.0, focus: float = 0.0, focus_tint: Sequence[float] = [0.0, 0.0, 0.0], ies: IesProfile | None = None, ies_angle_scale: float = 0.0, ies_normalize: bool = False) -> None: ...

    @property
    def cone_angle(self) -> float: ...

    @property
    def cone_softness(self) -> float: ...

    @property
    def focus(self) -> float: ...

    @property
    def focus_tint(self) -> list[float]: ...

    @property
    def ies(self) -> IesProfile: ...

    @property
    def ies_angle_scale(self) -> float: ...

    @property
    def ies_normalize(self) -> bool: ...

class ShadowRules:
    """
    How a light's shadows depart from opaque ones (UsdLuxShadowAPI).

    Parameters
    ----------
    is_enabled : whether it casts shadows.
    color : RGB, what is left of the light in shadow.
    distance : metres from the shadowed place within which things cast shadows; < 0 = any.
    falloff : metres within `distance` over which the shadow fades; < 0 = none.
    falloff_gamma : exponent of the fade, > 0.
    casters : ObjectSet of the only objects that cast shadows, None = all.
    """

    def __init__(self, *, is_enabled: bool = True, color: Sequence[float] = [0.0, 0.0, 0.0], distance: float = -1.0, falloff: float = -1.0, falloff_gamma: float = 1.0, casters: ObjectSet | None = None) -> None: ...

    @property
    def is_enabled(self) -> bool: ...

    @property
    def color(self) -> list[float]: ...

    @property
    def distance(self) -> float: ...

    @property
    def falloff(self) -> float: ...

    @property
    def falloff_gamma(self) -> float: ...

    @property
    def casters(self) -> ObjectSet: ...

    def with_casters(self, casters: ObjectSet | None) -> ShadowRules:
        """The same rules with other casters."""

class Light:
    """
    A light of the scene.

    Parameters
    ----------
    shape : DomeLight, DistantLight, RectLight, DiskLight, SphereLight, CylinderLight or MeshLight.
    radiance : RGB, the product of intensity, exposure, colour and colour temperature.
    matrix : (4, 4) float64 light to world, for row vectors; None = identity.
    path : name for messages. group : light group, '' or 'default' = the default one.
    normalize : divide by the light's area in square metres.
    diffuse, specular, translucency, refraction, volume : multipliers of what the light does to each component.
    shaping : Shaping. shadow : ShadowRules.
    lit : ObjectSet of the only objects that it lights, None = all.
    """

    def __init__(self, shape: DomeLight | DistantLight | RectLight | DiskLight | SphereLight | CylinderLight | MeshLight, *, radiance: Sequence[float] = [1.0, 1.0, 1.0], matrix: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)] | None = None, path: str = 'Light', group: str = '', normalize: bool = False, diffuse: float = 1.0, specular: float = 1.0, translucency: float = 1.0, refraction: float = 1.0, volume: float = 1.0, shaping: Shaping = ..., shadow: ShadowRules = ..., lit: ObjectSet | None = None) -> None: ...

    @property
    def path(self) -> str: ...

    @path.setter
    def path(self, arg: str, /) -> None: ...

    @property
    def group(self) -> str: ...

    @group.setter
    def group(self, arg: str, /) -> None: ...

    @property
    def shape(self) -> DomeLight | DistantLight | RectLight | DiskLight | SphereLight | CylinderLight | MeshLight: ...

    @shape.setter
    def shape(self, arg: DomeLight | DistantLight | RectLight | DiskLight | SphereLight | CylinderLight | MeshLight, /) -> None: ...

    @property
    def radiance(self) -> list[float]: ...

    @radiance.setter
    def radiance(self, arg: Sequence[float], /) -> None: ...

    @property
    def normalize(self) -> bool: ...

    @normalize.setter
    def normalize(self, arg: bool, /) -> None: ...

    @property
    def shaping(self) -> Shaping: ...

    @shaping.setter
    def shaping(self, arg: Shaping, /) -> None: ...

    @property
    def shadow(self) -> ShadowRules: ...

    @shadow.setter
    def shadow(self, arg: ShadowRules, /) -> None: ...

    @property
    def lit(self) -> ObjectSet: ...

    @lit.setter
    def lit(self, lit: ObjectSet | None) -> None: ...

    @property
    def matrix(self) -> object: ...

    @matrix.setter
    def matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)], /) -> None: ...

    @property
    def diffuse(self) -> float: ...

    @property
    def specular(self) -> float: ...

    @property
    def translucency(self) -> float: ...

    @property
    def refraction(self) -> float: ...

    @property
    def volume(self) -> float: ...

    def check(self) -> None:
        """
        ValueError beginning with the light's path where a value of it cannot be used.
        """

    def __repr__(self) -> str: ...

class RayScene:
    """
    Meshes that rays can hit.

    Parameters
    ----------
    meshes : list of Mesh, in world space, metres. Copied.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None: ...

    def are_occluded(self, origins: numpy.typing.ArrayLike, directions: numpy.typing.ArrayLike, t_max: float = float('inf')) -> object:
        """
        Whether anything lies on each ray: (M,) bool for origins and directions (M, 3).
        """

def light_groups(lights: Sequence[Light]) -> list[str]:
    """
    Names of the light groups in order of first appearance; '' is the default group. One default group where there
    is no light.
    """

def bake_irradiance(points: object, scene: RayScene, lights: Sequence[Light], *, eta: float = 1.31, roughness: float = 0.0, samples: int = 64, seed: int = 0, error: float = 0.0, max_rounds: int = 16, objects: Sequence[int] | None = None, return_error: bool = False) -> numpy.ndarray:
    """
    Irradiance that enters at points, with ray-traced shadows.

    Parameters
    ----------
    points : PointSet, or any object with positions and normals (N, 3) float32, metres.
    scene : RayScene that casts the shadows.
    lights : list of Light; the translucency multiplier of each is applied.
    eta : index of the body relative to the outside, 1 to 4; 1 lets all light in.
    roughness : of the boundary, 0 to 1.
    samples : shadow rays per point and light.
    seed : changes the noise, not the expectation.
    error : relative error (one standard deviation) at each point to which samples are added; 0 = none. Relative to what
        arrives, or to a tenth of what would arrive if nothing were in the way, whichever is larger.
    max_rounds : how many times `samples` a light may take at a point for that.
    objects : of the scene, that the points lie on, for light linking: one each, one for all, or None.
    return_error : return the estimated standard deviation of each point's luminance too.

    Returns
    -------
    (N, G, 3) float32, W/m²: one row per light group, see light_groups; with `return_error` a tuple of it and (N,).

    Raises
    ------
    ValueError
        For lights, points or options out of range, by name.
    """

def bake_occlusion(points: object, scene: RayScene, *, samples: int = 64, seed: int = 0, distance: float = float('inf')) -> tuple:
    """
    How much of the sky each point sees, by rays.

    Parameters
    ----------
    points : PointSet, or any object with positions and normals (N, 3) float32, metres.
    scene : RayScene that occludes. samples : rays per point. distance : metres within which things occlude.

    Returns
    -------
    openness (N,) from 0 to 1, weighed by the cosine, and bent normals (N, 3): the mean open directions.

    Raises
    ------
    ValueError
        For options out of range.
    """

def point_occlusion(points: PointSet, *, distance: float = float('inf'), tolerance: float = 0.20000000298023224) -> tuple:
    """
    The same as bake_occlusion from the points alone, without rays: each hides as a disk of its area.

    `tolerance` is the solid angle in steradian below which a cluster of points counts as one disk.
    """

def measure_bake(points: object, scene: RayScene, lights: Sequence[Light], samples: int, is_bare: bool) -> tuple[int, float]:
    """
    (rays, seconds of processor time) of a bake, or of tracing the very same rays one by one and nothing else. For bench/.
    """

class TextureTile:
    """
    One image of a Texture.

    Parameters
    ----------
    number : UDIM, 1001 and on; 0 = the image of all st.
    texels : (height, width, channels) float32, linear, 1 to 4 channels, row 0 on top.
    load : function without arguments that gives the same texels again. With it only copies of at most `kept` texels
        on a side are kept now, and finer ones when they are first seen; it may be called from any thread.
    is_half : keep them as half floats.
    """

    def __init__(self, number: int, texels: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], load: Callable | None = None, kept: int = 64, is_half: bool = False, content: str = '') -> None: ...

    @property
    def number(self) -> int: ...

    def memory(self) -> int:
        """Bytes that are kept now."""

class Texture:
    """
    An image on a surface.

    Parameters
    ----------
    texels : (height, width, channels) float32, linear, 1 to 4 channels, row 0 on top. Copied.
    wrap_s, wrap_t : 'repeat', 'clamp', 'mirror' or 'black'.
    """

    def __init__(self, texels: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], wrap_s: str = 'repeat', wrap_t: str = 'repeat') -> None: ...

    @staticmethod
    def from_tiles(tiles: Sequence[TextureTile], wrap_s: str = 'repeat', wrap_t: str = 'repeat', missing: Sequence[float] = [0.0, 0.0, 0.0, 1.0]) -> Texture:
        """
        A texture of TextureTiles by ascending number; `missing` is its value where there is none.
        """

    @property
    def texels(self) -> numpy.ndarray | None:
        """
        Of the first tile; None where it is read from its file as it is needed.
        """

    @property
    def tiles(self) -> list[int]: ...

    @property
    def content(self) -> str:
        """Tells the content of images that are read as they are needed."""

    def memory(self) -> int:
        """Bytes that are kept now."""

    @property
    def wrap_s(self) -> str: ...

    @property
    def wrap_t(self) -> str: ...

    def __repr__(self) -> str: ...

class TextureLookup:
    """
    How a material input reads a texture: texel * scale + bias, at
    st' = rotate(st * st_scale, st_rotation degrees) + st_translation.

    Parameters
    ----------
    texture : Texture, shared, not copied.
    first_channel : 0..3; a scalar input reads this channel, a colour three from it on.
    is_grey : a colour reads that one channel three times.
    is_triplanar : project along the axes of rest space even where there are texture
        coordinates; triplanar_size : metres of one repeat where it is projected.
    """

    def __init__(self, texture: Texture, first_channel: int = 0, scale: Sequence[float] = [1.0, 1.0, 1.0], bias: Sequence[float] = [0.0, 0.0, 0.0], st_scale: Sequence[float] = [1.0, 1.0], st_rotation: float = 0.0, st_translation: Sequence[float] = [0.0, 0.0], is_grey: bool = False, is_triplanar: bool = False, triplanar_size: float = 1.0) -> None: ...

    @property
    def texture(self) -> Texture: ...

    @property
    def first_channel(self) -> int: ...

    @property
    def scale(self) -> list[float]: ...

    @property
    def bias(self) -> list[float]: ...

    @property
    def st_scale(self) -> list[float]: ...

    @property
    def st_translation(self) -> list[float]: ...

    @property
    def st_rotation(self) -> float: ...

    @property
    def is_grey(self) -> bool: ...

    @property
    def is_triplanar(self) -> bool: ...

    @property
    def triplanar_size(self) -> float: ...

    def __repr__(self) -> str: ...

class StandardMaterial:
    """
    UsdPreviewSurface. Inputs take a constant or a TextureLookup; the names and
    defaults are the specification's, in snake_case. bump: height in metres, a
    TextureLookup.
    """

    def __init__(self, *, diffuse_color: TextureLookup | Sequence[float] = ..., uses_display_color: bool = False, emissive_color: TextureLookup | Sequence[float] = [0.0, 0.0, 0.0], use_specular_workflow: bool = False, specular_color: TextureLookup | Sequence[float] = [0.0, 0.0, 0.0], metallic: TextureLookup | float = 0.0, roughness: TextureLookup | float = 0.5, clearcoat: TextureLookup | float = 0.0, clearcoat_roughness: TextureLookup | float = 0.009999999776482582, opacity: TextureLookup | float = 1.0, opacity_threshold: float = 0.0, ior: float = 1.5, normal: TextureLookup | None = None, bump: TextureLookup | float = 0.0) -> None: ...

    @property
    def diffuse_color(self) -> TextureLookup | list[float]: ...

    @diffuse_color.setter
    def diffuse_color(self, arg: TextureLookup | Sequence[float], /) -> None: ...

    @property
    def emissive_color(self) -> TextureLookup | list[float]: ...

    @emissive_color.setter
    def emissive_color(self, arg: TextureLookup | Sequence[float], /) -> None: ...

    @property
    def specular_color(self) -> TextureLookup | list[float]: ...

    @specular_color.setter
    def specular_color(self, arg: TextureLookup | Sequence[float], /) -> None: ...

    @property
    def metallic(self) -> TextureLookup | float: ...

    @metallic.setter
    def metallic(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def roughness(self) -> TextureLookup | float: ...

    @roughness.setter
    def roughness(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def clearcoat(self) -> TextureLookup | float: ...

    @clearcoat.setter
    def clearcoat(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def clearcoat_roughness(self) -> TextureLookup | float: ...

    @clearcoat_roughness.setter
    def clearcoat_roughness(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def opacity(self) -> TextureLookup | float: ...

    @opacity.setter
    def opacity(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def bump(self) -> TextureLookup | float: ...

    @bump.setter
    def bump(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def normal(self) -> TextureLookup | None: ...

    @normal.setter
    def normal(self, value: TextureLookup | None) -> None: ...

    @property
    def uses_display_color(self) -> bool: ...

    @uses_display_color.setter
    def uses_display_color(self, arg: bool, /) -> None: ...

    @property
    def use_specular_workflow(self) -> bool: ...

    @use_specular_workflow.setter
    def use_specular_workflow(self, arg: bool, /) -> None: ...

    @property
    def opacity_threshold(self) -> float: ...

    @opacity_threshold.setter
    def opacity_threshold(self, arg: float, /) -> None: ...

    @property
    def ior(self) -> float: ...

    @ior.setter
    def ior(self, arg: float, /) -> None: ...

    def __repr__(self) -> str: ...

class Overlay:
    """
    A layer of cracks, frost, snow or dirt on ice. Lengths in metres, fractions in [0, 1].

    Parameters
    ----------
    pattern : 'solid', 'fracture', 'cells', 'frost', 'bubbles', 'snow' or 'bands'.
    color, opacity, roughness : of the layer where its mask is 1.
    scattering : part of the light that it reflects diffusely, so that it does not enter.
    bump : height where the mask is 1. internal : opacity of fracture planes seen inside the body.
    age_begin, age_end : opacity grows from nothing to all of it between these ages.
    size : of cells and features, distance of planes and bands. width : of lines, bubbles and bands.
    feather : over which edges fade. warp : bend of lines, of size. scales : of cells, octaves of frost.
    amount : how much there is. slope : -1..1, more where the surface faces `direction`. seed : another pattern.
    mask : multiplies the pattern; a constant or a TextureLookup. name : of its layers in a picture.

    Ranges are checked when the scene is rendered.
    """

    def __init__(self, pattern: str = 'solid', *, color: Sequence[float] = [0.8999999761581421, 0.949999988079071, 1.0], opacity: float = 1.0, roughness: float = 0.5, scattering: float = 0.699999988079071, bump: float = 0.0, internal: float = 0.0, age_begin: float = 0.0, age_end: float = 1.0, size: float = 0.30000001192092896, width: float = 0.004000000189989805, feather: float = 0.004000000189989805, warp: float = 0.20000000298023224, scales: int = 2, amount: float = 0.5, slope: float = 0.0, direction: Sequence[float] = [0.0, 1.0, 0.0], seed: int = 0, mask: TextureLookup | float = 1.0, name: str = '') -> None: ...

    @property
    def name(self) -> str: ...

    @name.setter
    def name(self, arg: str, /) -> None: ...

    @property
    def pattern(self) -> str: ...

    @property
    def color(self) -> list[float]: ...

    @color.setter
    def color(self, arg: Sequence[float], /) -> None: ...

    @property
    def opacity(self) -> float: ...

    @opacity.setter
    def opacity(self, arg: float, /) -> None: ...

    @property
    def roughness(self) -> float: ...

    @roughness.setter
    def roughness(self, arg: float, /) -> None: ...

    @property
    def scattering(self) -> float: ...

    @scattering.setter
    def scattering(self, arg: float, /) -> None: ...

    @property
    def bump(self) -> float: ...

    @bump.setter
    def bump(self, arg: float, /) -> None: ...

    @property
    def internal(self) -> float: ...

    @internal.setter
    def internal(self, arg: float, /) -> None: ...

    @property
    def age_begin(self) -> float: ...

    @age_begin.setter
    def age_begin(self, arg: float, /) -> None: ...

    @property
    def age_end(self) -> float: ...

    @age_end.setter
    def age_end(self, arg: float, /) -> None: ...

    @property
    def size(self) -> float: ...

    @size.setter
    def size(self, arg: float, /) -> None: ...

    @property
    def width(self) -> float: ...

    @width.setter
    def width(self, arg: float, /) -> None: ...

    @property
    def feather(self) -> float: ...

    @feather.setter
    def feather(self, arg: float, /) -> None: ...

    @property
    def warp(self) -> float: ...

    @warp.setter
    def warp(self, arg: float, /) -> None: ...

    @property
    def scales(self) -> int: ...

    @scales.setter
    def scales(self, arg: int, /) -> None: ...

    @property
    def amount(self) -> float: ...

    @amount.setter
    def amount(self, arg: float, /) -> None: ...

    @property
    def slope(self) -> float: ...

    @slope.setter
    def slope(self, arg: float, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    @property
    def direction(self) -> list[float]: ...

    @direction.setter
    def direction(self, arg: Sequence[float], /) -> None: ...

    @property
    def mask(self) -> TextureLookup | float: ...

    @mask.setter
    def mask(self, arg: TextureLookup | float, /) -> None: ...

    def eval(self, positions: numpy.typing.ArrayLike, normals: numpy.typing.ArrayLike, footprint: float = 0.0) -> list[float]:
        """
        The pattern's mask at positions (N, 3) with normals (N, 3), in metres of rest space, averaged over a
        footprint of this radius; the texture mask is left out. A list of N floats.
        """

    def __repr__(self) -> str: ...

class Density:
    """
    How much denser ice is than its medium from place to place: noise, or a grid.

    Parameters
    ----------
    values : (X, Y, Z) float32 >= 0, at least two a side, interpolated trilinearly; None = noise.
    matrix : (4, 4) float64 for row vectors: voxel (i, j, k) lies at (i, j, k) * matrix in the object's own frame.
    outside : density beyond the grid.
    contrast : standard deviation of the noise's logarithm, in [0, 4]; its mean is 1.
    size : of its widest features, metres. octaves : 1..8, each twice as fine and half as strong. seed.
    scale : of noise or grid, >= 0.
    absorption : how much of the density counts for sigma_a, in [0, 1]; 0 = for bubbles, which scatter alone.

    Ranges are checked when the scene is rendered.
    """

    def __init__(self, values: numpy.typing.ArrayLike | None = None, matrix: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)] | None = None, *, outside: float = 0.0, contrast: float = 0.0, size: float = 0.30000001192092896, octaves: int = 3, seed: int = 0, scale: float = 1.0, absorption: float = 1.0) -> None: ...

    @property
    def values(self) -> object: ...

    @property
    def matrix(self) -> object: ...

    @property
    def outside(self) -> float: ...

    @property
    def contrast(self) -> float: ...

    @contrast.setter
    def contrast(self, arg: float, /) -> None: ...

    @property
    def size(self) -> float: ...

    @size.setter
    def size(self, arg: float, /) -> None: ...

    @property
    def octaves(self) -> int: ...

    @octaves.setter
    def octaves(self, arg: int, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    @property
    def scale(self) -> float: ...

    @scale.setter
    def scale(self, arg: float, /) -> None: ...

    @property
    def absorption(self) -> float: ...

    @absorption.setter
    def absorption(self, arg: float, /) -> None: ...

    def eval(self, positions: numpy.typing.ArrayLike) -> list[float]:
        """
        The density at positions (N, 3) in the object's frame. A list of N floats.
        """

    def depth(self, origins: numpy.typing.ArrayLike, ends: numpy.typing.ArrayLike) -> list[float]:
        """
        The density's integral from origins (N, 3) straight to ends (N, 3) in the object's frame: metres of the
        medium. A list of N floats.
        """

    def __repr__(self) -> str: ...

class IceMaterial:
    """
    frazil:ice: a translucent core under a glossy dielectric boundary.

    Parameters
    ----------
    medium : Medium, in 1/m.
    roughness : float in [0, 1], or a TextureLookup.
    specular, translucency : weights in [0, 1] of the reflection and of the core.
    refraction : how much of what the medium leaves unscattered is seen through the boundary, in [0, 1].
    refraction_roughness : of light that goes through the boundary, in [0, 1]; None = as roughness.
    refraction_tint : RGB factor in [0, 1] on light each time that it goes through the boundary unscattered.
    volume : how much of the light scattered once inside is traced, in [0, 1].
    anisotropy : g of that light, in [-0.95, 0.95].
    density : Density, by which the medium is multiplied along refracted rays, from place to place.
    priority : where bodies overlap, the highest fills the place.
    overlays : list of Overlay, from below to the top; age : 0 = fresh .. 1 = old.
    tint : RGB factor on what leaves the core, or a TextureLookup.
    ramp_distances, ramp_colors : knots of the colour ramp over distance, metres and RGB.
    ramp_preserve_energy : keep the total reflectance whatever the ramp.
    profile : 'multiple_scattering', 'photon_beam', 'normalized_diffusion', 'better_dipole' or 'dipole'.
    compensation : 'off', 'ratio', 'conserve', 'depth', 'fill' or 'linear'; compensation_limit >= 1;
        compensation_strength in [0, 1].
    spacing : of the points, metres; 0 = from the mean free path. A TextureLookup is read at the mesh's vertices.
    normal : tangent-space normal map, a TextureLookup (usually scale 2, bias -1), or None.
    bump : height in metres, a TextureLookup.

    Ranges are checked when the scene is rendered.
    """

    def __init__(self, medium: Medium, *, profile: str = 'multiple_scattering', roughness: TextureLookup | float = 0.10000000149011612, specular: float = 1.0, translucency: float = 1.0, refraction: float = 1.0, refraction_roughness: float | None = None, refraction_tint: Sequence[float] = [1.0, 1.0, 1.0], volume: float = 0.0, anisotropy: float = 0.0, density: Density = ..., priority: int = 0, overlays: Sequence[Overlay] = [], age: float = 0.5, tint: TextureLookup | Sequence[float] = [1.0, 1.0, 1.0], ramp_distances: Sequence[float] = [], ramp_colors: Sequence[Sequence[float]] = [], ramp_preserve_energy: bool = False, compensation: str = 'depth', compensation_limit: float = 100.0, compensation_strength: float = 1.0, spacing: TextureLookup | float = 0.0, normal: TextureLookup | None = None, bump: TextureLookup | float = 0.0) -> None: ...

    @property
    def roughness(self) -> TextureLookup | float: ...

    @roughness.setter
    def roughness(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def tint(self) -> TextureLookup | list[float]: ...

    @tint.setter
    def tint(self, arg: TextureLookup | Sequence[float], /) -> None: ...

    @property
    def bump(self) -> TextureLookup | float: ...

    @bump.setter
    def bump(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def normal(self) -> TextureLookup | None: ...

    @normal.setter
    def normal(self, value: TextureLookup | None) -> None: ...

    @property
    def spacing(self) -> TextureLookup | float: ...

    @spacing.setter
    def spacing(self, arg: TextureLookup | float, /) -> None: ...

    @property
    def medium(self) -> Medium: ...

    @medium.setter
    def medium(self, arg: Medium, /) -> None: ...

    @property
    def specular(self) -> float: ...

    @specular.setter
    def specular(self, arg: float, /) -> None: ...

    @property
    def translucency(self) -> float: ...

    @translucency.setter
    def translucency(self, arg: float, /) -> None: ...

    @property
    def refraction(self) -> float: ...

    @refraction.setter
    def refraction(self, arg: float, /) -> None: ...

    @property
    def refraction_roughness(self) -> float | None: ...

    @refraction_roughness.setter
    def refraction_roughness(self, value: float | None) -> None: ...

    @property
    def refraction_tint(self) -> list[float]: ...

    @refraction_tint.setter
    def refraction_tint(self, arg: Sequence[float], /) -> None: ...

    @property
    def volume(self) -> float: ...

    @volume.setter
    def volume(self, arg: float, /) -> None: ...

    @property
    def anisotropy(self) -> float: ...

    @anisotropy.setter
    def anisotropy(self, arg: float, /) -> None: ...

    @property
    def density(self) -> Density: ...

    @density.setter
    def density(self, arg: Density, /) -> None: ...

    @property
    def priority(self) -> int: ...

    @priority.setter
    def priority(self, arg: int, /) -> None: ...

    @property
    def overlays(self) -> list[Overlay]: ...

    @overlays.setter
    def overlays(self, arg: Sequence[Overlay], /) -> None: ...

    @property
    def age(self) -> float: ...

    @age.setter
    def age(self, arg: float, /) -> None: ...

    @property
    def ramp_distances(self) -> list[float]: ...

    @property
    def ramp_colors(self) -> list[list[float]]: ...

    @property
    def ramp_preserve_energy(self) -> bool: ...

    @property
    def profile(self) -> str: ...

    @profile.setter
    def profile(self, arg: str, /) -> None: ...

    @property
    def compensation(self) -> str: ...

    @compensation.setter
    def compensation(self, arg: str, /) -> None: ...

    @property
    def compensation_limit(self) -> float: ...

    @compensation_limit.setter
    def compensation_limit(self, arg: float, /) -> None: ...

    @property
    def compensation_strength(self) -> float: ...

    @compensation_strength.setter
    def compensation_strength(self, arg: float, /) -> None: ...

    def __repr__(self) -> str: ...

class Displacement:
    """
    What moves a surface before points and rays meet it. Lengths in the mesh's own units.

    Parameters
    ----------
    height : along the normal; a constant or a TextureLookup.
    vector : takes the place of height; a TextureLookup or a constant, in `space` 'tangent' (along s, along t,
        normal) or 'object'.
    pattern : an Overlay, whose pattern (not its opacity or mask) multiplies either; metres.
    """

    def __init__(self, *, height: TextureLookup | float = 0.0, vector: TextureLookup | Sequence[float] | None = None, space: str = 'tangent', pattern: Overlay | None = None) -> None: ...

    @property
    def height(self) -> TextureLookup | float: ...

    @property
    def vector(self) -> TextureLookup | list[float] | None: ...

    @property
    def space(self) -> str: ...

    def eval(self, mesh: Mesh, metres_per_unit: float = 1.0) -> Annotated[NDArray[numpy.float32], dict(shape=(None, None))]:
        """Offsets (3F, 3) at the corners of a mesh, for displaced()."""

class Camera:
    """
    A camera that looks along -z of its frame, +y up.

    Parameters
    ----------
    matrix : (4, 4) float64 camera to world, for row vectors, metres; None = identity.
    focal_length, horizontal_aperture, vertical_aperture, horizontal_offset, vertical_offset :
        in one unit; only ratios count.
    is_orthographic, aperture_scale : metres per unit of aperture where it is orthographic.
    clipping : (near, far), metres.
    """

    def __init__(self, *, matrix: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)] | None = None, focal_length: float = 50.0, horizontal_aperture: float = 20.954999923706055, vertical_aperture: float = 15.290800094604492, horizontal_offset: float = 0.0, vertical_offset: float = 0.0, is_orthographic: bool = False, aperture_scale: float = 1.0, clipping: Sequence[float] = [9.999999747378752e-05, 999999995904.0], path: str = 'Camera') -> None: ...

    @property
    def path(self) -> str: ...

    @path.setter
    def path(self, arg: str, /) -> None: ...

    @property
    def matrix(self) -> object: ...

    @matrix.setter
    def matrix(self, arg: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)], /) -> None: ...

    @property
    def is_orthographic(self) -> bool: ...

    @is_orthographic.setter
    def is_orthographic(self, arg: bool, /) -> None: ...

    @property
    def focal_length(self) -> float: ...

    @focal_length.setter
    def focal_length(self, arg: float, /) -> None: ...

    @property
    def horizontal_aperture(self) -> float: ...

    @horizontal_aperture.setter
    def horizontal_aperture(self, arg: float, /) -> None: ...

    @property
    def vertical_aperture(self) -> float: ...

    @vertical_aperture.setter
    def vertical_aperture(self, arg: float, /) -> None: ...

    @property
    def horizontal_offset(self) -> float: ...

    @horizontal_offset.setter
    def horizontal_offset(self, arg: float, /) -> None: ...

    @property
    def vertical_offset(self) -> float: ...

    @vertical_offset.setter
    def vertical_offset(self, arg: float, /) -> None: ...

    @property
    def aperture_scale(self) -> float: ...

    @aperture_scale.setter
    def aperture_scale(self, arg: float, /) -> None: ...

    @property
    def clipping(self) -> list[float]: ...

    @clipping.setter
    def clipping(self, arg: Sequence[float], /) -> None: ...

    def __repr__(self) -> str: ...

class Material:
    """A named model of the scene."""

    @property
    def path(self) -> str: ...

    @property
    def model(self) -> StandardMaterial | IceMaterial: ...

    def __repr__(self) -> str: ...

class Object:
    """A mesh with a material, placed in the world."""

    @property
    def path(self) -> str: ...

    @property
    def mesh(self) -> int: ...

    @property
    def material(self) -> int: ...

    @property
    def asset(self) -> str: ...

    @property
    def translucency_set(self) -> str: ...

    @property
    def matrix(self) -> object: ...

    def __repr__(self) -> str: ...

class Scene:
    """
    All that is rendered, as plain data: one frame, metres, +y up.

    Meshes and materials are added once and placed by index; lists are views of the scene's parts.
    """

    def __init__(self) -> None: ...

    def add_mesh(self, mesh: Mesh, path: str) -> int:
        """
        Add a mesh (copied); its index. ValueError, beginning with `path`, if it is broken.
        """

    def add_material(self, path: str, model: StandardMaterial | IceMaterial) -> int:
        """Add a StandardMaterial or IceMaterial (copied); its index."""

    def add_object(self, path: str, mesh: int, material: int, matrix: Annotated[NDArray[numpy.float64], dict(shape=(4, 4), order='C', device='cpu', writable=False)] | None = None, asset: str = '', translucency_set: str = '') -> int:
        """
        Place a mesh by a (4, 4) float64 matrix for row vectors, None = identity; the object's index.
        `asset` is what it belongs to, for Cryptomatte; '' = itself. Ice of one `translucency_set` shares its light as
        one body; '' = by itself.
        """

    def add_light(self, light: Light) -> int:
        """Add a light (copied); its index."""

    def emissive_objects(self) -> list[int]:
        """Indices of the objects whose material emits light."""

    def triangle_emission(self, object: int) -> numpy.ndarray | None:
        """
        Mean radiance (F, 3) float32 that the material of an object emits, by triangle; None where it emits none.
        """

    @property
    def camera(self) -> Camera: ...

    @camera.setter
    def camera(self, arg: Camera, /) -> None: ...

    @property
    def meshes(self) -> list[Mesh]:
        """Copies of the meshes, in the order of their indices."""

    def mesh(self, index: int) -> Mesh:
        """A copy of one mesh."""

    @property
    def mesh_paths(self) -> list[str]: ...

    @property
    def materials(self) -> list[Material]: ...

    @property
    def objects(self) -> list[Object]: ...

    @property
    def lights(self) -> list[Light]: ...

    def set_motion(self, next: Scene) -> None:
        """
        Tell how the scene goes on, by the same scene a frame later: for the AOV motion. Objects are paired by path.
        """

    @property
    def motion(self) -> dict | None:
        """
        What set_motion told: (4, 4) matrices of the objects, (V, 3) positions of the meshes (empty where they stay)
        and the camera; None without.
        """

    def __repr__(self) -> str: ...

class RenderOptions:
    """What a render is asked for; see frazil.render for each."""

    def __init__(self) -> None: ...

    @property
    def width(self) -> int: ...

    @width.setter
    def width(self, arg: int, /) -> None: ...

    @property
    def height(self) -> int: ...

    @height.setter
    def height(self, arg: int, /) -> None: ...

    @property
    def samples(self) -> int: ...

    @samples.setter
    def samples(self, arg: int, /) -> None: ...

    @property
    def noise(self) -> float: ...

    @noise.setter
    def noise(self, arg: float, /) -> None: ...

    @property
    def shading_samples(self) -> int: ...

    @shading_samples.setter
    def shading_samples(self, arg: int, /) -> None: ...

    @property
    def min_samples(self) -> int: ...

    @min_samples.setter
    def min_samples(self, arg: int, /) -> None: ...

    @property
    def seed(self) -> int: ...

    @seed.setter
    def seed(self, arg: int, /) -> None: ...

    @property
    def threads(self) -> int: ...

    @threads.setter
    def threads(self, arg: int, /) -> None: ...

    @property
    def max_bounces(self) -> int: ...

    @max_bounces.setter
    def max_bounces(self, arg: int, /) -> None: ...

    @property
    def spacing(self) -> float: ...

    @spacing.setter
    def spacing(self, arg: float, /) -> None: ...

    @property
    def spacing_scale(self) -> float: ...

    @spacing_scale.setter
    def spacing_scale(self, arg: float, /) -> None: ...

    @property
    def spacing_pixels(self) -> float: ...

    @spacing_pixels.setter
    def spacing_pixels(self, arg: float, /) -> None: ...

    @property
    def bake_samples(self) -> int: ...

    @bake_samples.setter
    def bake_samples(self, arg: int, /) -> None: ...

    @property
    def bake_error(self) -> float: ...

    @bake_error.setter
    def bake_error(self, arg: float, /) -> None: ...

    @property
    def translucent_shadows(self) -> bool: ...

    @translucent_shadows.setter
    def translucent_shadows(self, arg: bool, /) -> None: ...

    @property
    def bake_bounces(self) -> int: ...

    @bake_bounces.setter
    def bake_bounces(self, arg: int, /) -> None: ...

    @property
    def aovs(self) -> list[str]: ...

    @aovs.setter
    def aovs(self, arg: Sequence[str], /) -> None: ...

    @property
    def lpes(self) -> list[tuple[str, str]]: ...

    @lpes.setter
    def lpes(self, arg: Sequence[tuple[str, str]], /) -> None: ...

    @property
    def mattes(self) -> list[tuple[str, list[int]]]: ...

    @mattes.setter
    def mattes(self, arg: Sequence[tuple[str, Sequence[int]]], /) -> None: ...

    @property
    def tolerance(self) -> float: ...

    @tolerance.setter
    def tolerance(self, arg: float, /) -> None: ...

    @property
    def estimator(self) -> str: ...

    @estimator.setter
    def estimator(self, arg: str, /) -> None: ...

    @property
    def filter(self) -> str: ...

    @filter.setter
    def filter(self, arg: str, /) -> None: ...

class Bake:
    """
    Points and light of every translucent body of a scene: what serves all cameras and frames that
    show the same shapes under the same lights.
    """

    @overload
    def __init__(self) -> None:
        """A bake of nothing."""

    @overload
    def __init__(self, groups: Sequence[str]) -> None:
        """A bake of these light groups, without objects yet."""

    @property
    def groups(self) -> list[str]:
        """The light groups."""

    def __len__(self) -> int:
        """Objects of the scene."""

    def points(self, index: int) -> PointSet:
        """
        A copy of the PointSet of an object, in the world; empty where it is not ice.
        """

    def irradiance(self, index: int) -> NDArray[numpy.float32]:
        """
        (N, G, 3) float32: light that enters an object's points, per light group.
        """

    def moments(self, index: int) -> object:
        """
        (N, G, 3) float32: covariance of the light, summed over channels, with the place in each point's cell;
        None where light was baked at the points alone.
        """

    def append(self, points: PointSet, irradiance: numpy.typing.ArrayLike, moments: numpy.typing.ArrayLike | None = None) -> None:
        """Add the next object (copied)."""

class RenderResult:
    """What a render gives: layers and statistics."""

    @property
    def layers(self) -> dict:
        """
        dict of AOV or layer name to (height, width, channels) float32; views of the film's own memory.
        """

    @property
    def light_groups(self) -> list[str]:
        """
        list of str: in the order of the layers; '' for lights without a group.
        """

    @property
    def ramp_knots(self) -> list:
        """
        list of dict, one per layer translucency_ramp<K>: material, distance (metres), color, share of energy, ...
        """

    @property
    def compensations(self) -> list:
        """list of dict, one per material of ice: material, mode, strength."""

    @property
    def overlays(self) -> list:
        """
        list of dict, one per overlay that has layers: name, material, opacity, age, age_begin, age_end.
        """

    @property
    def stats(self) -> dict:
        """
        dict: points, nodes, rays, gathers, dropped samples, seconds per stage.
        """

class BakeResult:
    """What a bake gives: itself and statistics."""

    @property
    def bake(self) -> Bake: ...

    @property
    def stats(self) -> dict:
        """As of a render."""

def aov_table() -> list:
    """The AOV table: a list of dicts (name, channels, meaning, filter, ...)."""

def render(scene: Scene, options: RenderOptions, *, progress: object | None = None, bake: Bake | None = None, checkpoint: object | None = None, checkpoint_seconds: float = 0.0, resume: Mapping[str, numpy.typing.ArrayLike] | None = None) -> RenderResult:
    """
    Render a scene; see frazil.render. progress(stage, fraction) is called now and then from any thread;
    an exception that it raises stops the render. checkpoint(state) gets a dict of float32 arrays every
    checkpoint_seconds (0: never) and when the render is stopped; `resume` takes such a dict.
    """

def bake(scene: Scene, options: RenderOptions, *, known: Bake | None = None, progress: object | None = None) -> BakeResult:
    """
    Points and light of a scene's translucent bodies; what is `known` (points of objects that have some, light
    of the groups that are named) is taken over.
    """

def cryptomatte_hash(name: str) -> int:
    """MurmurHash3_32 of a name, as Cryptomatte has it."""

def cryptomatte_id(name: str) -> float:
    """The float32 that stands for a name in a Cryptomatte."""

def mix_layers(layers: Sequence[Annotated[NDArray, dict(order='C', device='cpu', writable=False)]], weights: numpy.typing.ArrayLike, out: Annotated[NDArray[numpy.float32], dict(shape=(None, None, None), order='C', device='cpu')]) -> None:
    """
    Write the weighted sum of (H, W, 3) layers, float16 or float32, to the float32 array `out`.
    weights: (layers, 3), per channel.
    """
