from collections.abc import Callable
from typing import Annotated

import numpy
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

    def __init__(self, positions: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu', writable=False)], triangles: Annotated[NDArray[numpy.int32], dict(order='C', device='cpu', writable=False)], normals: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu', writable=False)] | None = None, uvs: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu', writable=False)] | None = None) -> None: ...

    @property
    def positions(self) -> NDArray[numpy.float32]: ...

    @property
    def triangles(self) -> NDArray[numpy.int32]: ...

    def set_normals(self, values: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu', writable=False)], interpolation: str | None = None) -> None:
        """
        Give normals; interpolation is constant, uniform (per triangle), vertex or corner, found from the length
        where it is not given.
        """

    def set_uvs(self, values: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu', writable=False)], interpolation: str | None = None) -> None:
        """Give texture coordinates; see set_normals."""

    def set_colors(self, values: Annotated[NDArray[numpy.float32], dict(order='C', device='cpu', writable=False)], interpolation: str | None = None) -> None:
        """Give display colours, linear RGB; see set_normals."""

    @property
    def area(self) -> float:
        """Surface area in square metres."""

    def __repr__(self) -> str: ...

class PointSet:
    """
    Points on a mesh that stand for its surface. The arrays are views of the set's own memory.
    """

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

    def __len__(self) -> int: ...

    def __repr__(self) -> str: ...

def poisson_points(mesh: Mesh, spacing: float, seed: int = 0, thin_walls: bool = True, max_points: int = 0, threads: int = 0, progress: Callable | None = None) -> PointSet: ...

def tessellated_points(mesh: Mesh, edge_length: float) -> PointSet: ...

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
    def from_albedo(albedo: object, mean_free_path: object, eta: float = 1.309999942779541) -> Medium:
        """
        The medium whose dipole has total reflectance `albedo` (0 <= albedo < 1) and transport mean free path
        `mean_free_path` = 1/(sigma_s_prime + sigma_a), in metres.
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

    def eval(self, r: object) -> object:
        """
        The factors at distances r (n,) in metres, (n, 3); preserve_energy is not in them.
        """

class Gathered:
    """What a gather returns."""

    @property
    def exitance(self) -> NDArray[numpy.float32]: ...

    @property
    def coverage(self) -> NDArray[numpy.float32]: ...

class PointTree:
    """
    The octree of points with their irradiance.

    Parameters
    ----------
    points : PointSet, or any object with positions (N, 3), normals (N, 3) and areas (N,).
    irradiance : (N, 3) or (N, G, 3), W/m²; rows with NaN are left out and counted.
    profile : Dipole.
    ramp : Ramp, optional.

    Safe to gather from by many threads at once.
    """

    def __init__(self, points: object, irradiance: object, profile: object, ramp: Ramp | None = None) -> None: ...

    def gather(self, positions: object, tolerance: float = 0.009999999776482582, estimator: str = 'noise_free') -> Gathered:
        """
        Exitance and coverage at M positions (M, 3), in any order.

        Returns an object with exitance (M, G, 3) and coverage (M, 3).
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

class RenderResult:
    """What a render gives: layers and statistics."""

    @property
    def layers(self) -> dict:
        """
        dict of AOV or layer name to (height, width, channels) float32; views of the film's own memory.
        """

    @property
    def stats(self) -> dict:
        """
        dict: points, nodes, rays, gathers, dropped samples, seconds per stage.
        """

def aov_table() -> list:
    """The AOV table: a list of dicts (name, channels, meaning, filter, ...)."""

def render(scene: "frazil::Scene", *, width: int = 960, height: int = 540, samples: int = 32, seed: int = 0, threads: int = 0, filter: str = 'blackman_harris', max_bounces: int = 4, spacing: float = 0.0, spacing_scale: float = 1.0, bake_samples: int = 64, tolerance: float = 0.009999999776482582, estimator: str = 'noise_free', progress: object | None = None) -> RenderResult:
    """
    Render a scene; see frazil.render. progress(stage, fraction) is called now and then from any thread;
    an exception that it raises stops the render.
    """
