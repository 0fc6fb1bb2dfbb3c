"""Profiles, ramps, the gather and area compensation against closed forms and sums in double precision."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate
from surfaces import Points, cone, corner, plane, sphere

import frazil as fz

MEDIUM = fz.Medium(sigma_s_prime=(30.0, 25.0, 40.0), sigma_a=(0.6, 0.15, 0.05), eta=1.31)
MATCHED = fz.Medium(sigma_s_prime=(30.0, 30.0, 30.0), sigma_a=(0.6, 0.15, 0.05), eta=1.0)
CLEAR = fz.Medium(sigma_s_prime=(1000.0, 800.0, 600.0), sigma_a=(0.0, 0.0, 0.0), eta=1.31)
ESTIMATORS = ["noise_free", "sum"]


def dipole_numpy(medium: fz.Medium, r: np.ndarray) -> np.ndarray:
    """The standard dipole in double precision; its boundary's average reflection by scipy's quadrature."""
    eta = 1.0 / medium.eta

    def reflected(mu):
        s2 = (1 - mu * mu) / eta**2
        if s2 >= 1:
            return 1.0
        ct = np.sqrt(1 - s2)
        return 0.5 * (((eta * mu - ct) / (eta * mu + ct)) ** 2 + ((mu - eta * ct) / (mu + eta * ct)) ** 2)

    critical = np.sqrt(max(0.0, 1 - eta**2))
    fdr = 2 * integrate.quad(lambda m: reflected(m) * m, 0, 1, points=[critical], epsabs=1e-12)[0]
    boundary = (1 + fdr) / (1 - fdr)
    ss, sa = np.float64(medium.sigma_s_prime), np.float64(medium.sigma_a)
    st = ss + sa
    str_ = np.sqrt(3 * sa * st)
    out = 0.0
    for z in (1 / st, (1 + 4 * boundary / 3) / st):
        d = np.sqrt(np.asarray(r, float)[:, None] ** 2 + z**2)
        out = out + z * (1 + str_ * d) * np.exp(-str_ * d) / d**3
    return ss / st / (4 * np.pi) * out


def test_dipole_equals_its_formula():
    r = np.geomspace(1e-4, 2.0, 40)
    for medium in (MEDIUM, MATCHED):
        np.testing.assert_allclose(fz.Dipole(medium).reflectance(r), dipole_numpy(medium, np.float32(r)), rtol=2e-5)


def test_same_bits_alone_and_among_threads():
    """Two gathers of one set agree to the bit, whatever the threads do; a shuffled set may differ by the tolerance."""
    points = sphere(20000)
    rng = np.random.default_rng(6)
    irradiance = rng.uniform(0, 1, (20000, 3))
    trees = [fz.PointTree(points, irradiance, fz.Dipole(MEDIUM)) for _ in range(2)]
    where = rng.normal(size=(3000, 3))
    where /= np.linalg.norm(where, axis=1, keepdims=True)
    one, two = (tree.gather(where) for tree in trees)
    assert one.exitance.tobytes() == two.exitance.tobytes()
    assert one.coverage.tobytes() == two.coverage.tobytes()


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_white_furnace(estimator):
    """Nothing absorbed, light 1 from all around: 1 everywhere with `conserve`, on the tip of a spire too."""
    profile = fz.Dipole(fz.Medium(20.0, 0.0, eta=1.31))
    points = cone(0.15, 150, 1e-3, 3.0)
    tree = fz.PointTree(points, np.ones((len(points.areas), 3)), profile)
    where = np.concatenate([[[0, 0, 0]], points.positions[points.positions[:, 2] > -1][::37]])
    out = tree.gather(where, estimator=estimator)
    assert out.exitance[0].max() < 0.3
    gain = fz.area_compensation(out.coverage, profile, mode="conserve", limit=100.0)
    np.testing.assert_allclose(out.exitance[:, 0] * gain, 1.0, atol=0.02)


PROFILES = {
    "dipole": fz.Dipole,
    "better_dipole": fz.BetterDipole,
    "normalized_diffusion": fz.NormalizedDiffusion,
    "multiple_scattering": lambda medium: fz.MultipleScattering(medium, single=1.0),
}


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("eta", [1.0, 1.31, 1.5])
def test_albedo_inversion_round_trip(eta, profile):
    """Albedo and mean free path to a medium and back; and a medium to these and back."""
    albedo = np.array([0.05, 0.5, 0.9, 0.99, 0.9995, 0.0])
    for three in albedo.reshape(2, 3):
        mean_free_path = np.array([0.001, 0.02, 3.0])
        medium = fz.Medium.from_albedo(three, mean_free_path, eta=eta, profile=profile)
        np.testing.assert_allclose(PROFILES[profile](medium).albedo, three, rtol=1e-4)
        np.testing.assert_allclose(medium.mean_free_path, mean_free_path, rtol=1e-5)
    medium = fz.Medium((30.0, 25.0, 40.0), (0.6, 0.15, 5.0), eta)
    again = fz.Medium.from_albedo(PROFILES[profile](medium).albedo, medium.mean_free_path, eta, profile)
    np.testing.assert_allclose(again.sigma_s_prime, medium.sigma_s_prime, rtol=1e-4)
    np.testing.assert_allclose(again.sigma_a, medium.sigma_a, rtol=5e-4)


def test_an_albedo_beyond_the_profile_is_refused():
    with pytest.raises(ValueError, match="Medium: albedo must be < 0.[0-9]+ for the profile photon_beam, got 0.999"):
        fz.Medium.from_albedo(0.999, 0.01, profile="photon_beam")
    with pytest.raises(ValueError, match="Medium: profile must be dipole, better_dipole"):
        fz.Medium.from_albedo(0.9, 0.01, profile="gaussian")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(sigma_s_prime=(-1, 1, 1), sigma_a=0.1), "Medium: sigma_s_prime must be >= 0 and finite, got -1"),
        (dict(sigma_s_prime=1, sigma_a=-0.1), "Medium: sigma_a must be >= 0 and finite, got -0.1"),
        (dict(sigma_s_prime=float("inf"), sigma_a=0), "Medium: sigma_s_prime must be >= 0 and finite, got inf"),
        (dict(sigma_s_prime=1, sigma_a=0, eta=float("nan")), r"eta must be in \[1, 4\], got nan"),
        (dict(sigma_s_prime=1, sigma_a=float("nan")), "Medium: sigma_a must be >= 0 and finite, got nan"),
        (dict(sigma_s_prime=0, sigma_a=0), "must be > 0 in every channel"),
        (dict(sigma_s_prime=1, sigma_a=0, eta=0.9), r"eta must be in \[1, 4\], got 0.9"),
        (dict(sigma_s_prime=(1, 2), sigma_a=0), "one number or three"),
    ],
)
def test_bad_media(arguments, message):
    with pytest.raises(ValueError, match=message):
        fz.Medium(**arguments)


@pytest.mark.parametrize(
    ("albedo", "mean_free_path", "message"),
    [
        (1.0, 0.01, r"albedo must be in \[0, 1\), got 1"),
        (-0.1, 0.01, r"albedo must be in \[0, 1\), got -0.1"),
        (float("nan"), 0.01, r"albedo must be in \[0, 1\), got nan"),
        (0.5, 0.0, "mean_free_path must be > 0 and finite, got 0"),
        (0.5, float("inf"), "mean_free_path must be > 0 and finite, got inf"),
    ],
)
@pytest.mark.parametrize("profile", ["dipole", "multiple_scattering"])
def test_bad_albedo(albedo, mean_free_path, message, profile):
    with pytest.raises(ValueError, match=message):
        fz.Medium.from_albedo(albedo, mean_free_path, profile=profile)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize(("groups", "has_ramp", "fine"), [(1, False, 1e-3), (3, True, 2e-3)])
def test_gather_equals_the_sum_in_double(estimator, groups, has_ramp, fine):
    points = sphere(3000, 0.35)
    rng = np.random.default_rng(1)
    irradiance = rng.uniform(0, 1, (len(points.areas), groups, 3)) + (points.positions[:, :1, None] > 0)
    ramp = fz.Ramp([0.0, 0.05, 0.2], [[1, 0, 0], [0.2, 1, 0.5], [1, 1, 3]]) if has_ramp else None
    where = points.positions[::73] * 1.001
    tree = fz.PointTree(points, irradiance, fz.Dipole(MEDIUM), ramp)
    exact = tree.gather_exact(where, estimator)
    rms = {}
    for tolerance in (0.01, 0.0001):
        out = tree.gather(where, tolerance=tolerance, estimator=estimator)
        assert out.exitance.shape == (len(where), groups, 3)
        for name in ("exitance", "coverage"):
            error = getattr(out, name) / getattr(exact, name) - 1
            rms[name, tolerance] = np.sqrt((error**2).mean())
    assert rms["exitance", 0.01] < (0.01 if has_ramp else 0.005)
    assert rms["coverage", 0.01] < 0.005
    assert rms["exitance", 0.0001] < fine
    assert rms["coverage", 0.0001] < fine


def test_sum_equals_numpy():
    points = sphere(3000, 0.5)
    irradiance = np.random.default_rng(2).uniform(0, 2, (3000, 3))
    where = points.positions[:20]
    tree = fz.PointTree(points, irradiance, fz.Dipole(MEDIUM))
    r = np.linalg.norm(np.float32(points.positions)[None].astype(float) - np.float32(where)[:, None], axis=2)
    kernel = dipole_numpy(MEDIUM, r.ravel()).reshape(*r.shape, 3) * points.areas[None, :, None]
    exact = tree.gather_exact(where, "sum")
    np.testing.assert_allclose(exact.exitance[:, 0], (kernel * irradiance).sum(1), rtol=1e-5)
    np.testing.assert_allclose(exact.coverage, kernel.sum(1), rtol=1e-5)
    out = tree.gather(where, tolerance=1e-6, estimator="sum")
    np.testing.assert_allclose(out.exitance[:, 0], (kernel * irradiance).sum(1), rtol=3e-4)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_coverage_of_a_sphere(estimator):
    radius = 0.2
    profile = fz.Dipole(MEDIUM)
    tree = fz.PointTree(sphere(40000, radius), np.ones((40000, 3)), profile)
    where = sphere(500, radius).positions
    out = tree.gather(where, tolerance=0.001, estimator=estimator)
    expected = profile.within(2 * radius)[0]
    np.testing.assert_allclose(out.coverage, np.broadcast_to(expected, out.coverage.shape), rtol=0.01)
    np.testing.assert_allclose(out.coverage.mean(0), expected, rtol=2e-3)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("half_angle", [0.1, 0.4, 1.0, 0.5 * np.pi])
def test_coverage_of_a_cone_apex(estimator, half_angle):
    profile = fz.Dipole(MATCHED)
    points = cone(half_angle, 200, 5e-4, 20.0)
    tree = fz.PointTree(points, np.ones((len(points.areas), 3)), profile)
    out = tree.gather([[0.0, 0.0, 0.0]], tolerance=1e-4, estimator=estimator)
    np.testing.assert_allclose(out.coverage[0] / profile.albedo, np.sin(half_angle), rtol=5e-3)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_coverage_of_a_cube_vertex(estimator):
    profile = fz.Dipole(MATCHED)
    points = corner(200, 5e-4, 20.0)
    tree = fz.PointTree(points, np.ones((len(points.areas), 3)), profile)
    out = tree.gather([[0.0, 0.0, 0.0]], tolerance=1e-4, estimator=estimator)
    np.testing.assert_allclose(out.coverage[0] / profile.albedo, 0.75, rtol=5e-3)


@pytest.mark.parametrize("spacing", [0.25, 0.5, 1.0, 2.0])
def test_noise_free_coverage_of_a_plane(spacing):
    """Spacing in mean free paths, on a jittered grid."""
    medium = fz.Medium(100.0, 2.0, eta=1.31)
    profile = fz.Dipole(medium)
    mean_free_path = float(medium.mean_free_path[0])
    points = plane(spacing * mean_free_path, 20 * mean_free_path, seed=3)
    tree = fz.PointTree(points, np.ones((len(points.areas), 3)), profile)
    where = np.zeros((400, 3))
    where[:, :2] = np.random.default_rng(4).uniform(-3, 3, (400, 2)) * mean_free_path
    inside = profile.within(20 * mean_free_path)[0]
    error = {e: tree.gather(where, estimator=e, tolerance=0.003).coverage / inside - 1 for e in ESTIMATORS}
    rms = {e: np.sqrt((error[e] ** 2).mean()) for e in ESTIMATORS}
    assert rms["noise_free"] < 0.003 + 0.04 * spacing
    assert rms["noise_free"] < 0.8 * rms["sum"] + 0.002


def test_energy_preserving_ramp():
    profile = fz.Dipole(MEDIUM)
    mean_free_path = 1 / 30.6
    points = plane(0.5 * mean_free_path, 30 * mean_free_path)
    colors = [[1.0, 0.2, 0.0], [0.1, 1.0, 2.0], [0.5, 0.5, 1.0]]
    ramp = fz.Ramp([0.0, 3.0, 10.0], colors, preserve_energy=True, mean_free_path=mean_free_path)
    np.testing.assert_allclose(ramp.eval([0.0, 3 * mean_free_path, 1.0]), colors, rtol=1e-5, atol=1e-6)
    tree = fz.PointTree(points, np.ones((len(points.areas), 3)), profile, ramp)
    out = tree.gather([[0.0, 0.0, 0.0]], tolerance=1e-4)
    np.testing.assert_allclose(out.exitance[0, 0], out.coverage[0], rtol=0.02)


@pytest.mark.parametrize("knots", [[0.05, 0.1, 0.3, 0.9], [0.1], [0.1, 0.10000001], [0.0, 1e-7, 0.2]])
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_layers_of_a_ramp_take_any_colour(estimator, knots):
    """Knot colours times layers = a tree with that ramp, to half precision."""
    points = sphere(4000)
    rng = np.random.default_rng(5)
    irradiance = rng.uniform(0, 1, (4000, 2, 3))
    profile = fz.Dipole(fz.Medium(10.0, 0.1))
    where = points.positions[:200]
    layers = fz.PointTree(points, irradiance, profile, fz.Ramp(knots, np.ones((len(knots), 3)))).gather(
        where, estimator=estimator, ramp_layers=True
    )
    assert layers.layers.shape == (200, len(knots), 2, 3)
    np.testing.assert_allclose(layers.layers.sum(1), layers.exitance, rtol=1e-4)
    for preserve_energy in (False, True):
        ramp = fz.Ramp(knots, rng.uniform(0, 2, (len(knots), 3)), preserve_energy=preserve_energy)
        rendered = fz.PointTree(points, irradiance, profile, ramp).gather(where, estimator=estimator).exitance
        colors = ramp.eval(knots) * ramp.energy_scale(profile)
        total = (layers.layers * colors[None, :, None, :]).sum(1)
        np.testing.assert_allclose(total, rendered, rtol=2**-11)
    with pytest.raises(ValueError, match="ramp_layers must be off without a ramp"):
        fz.PointTree(points, irradiance, profile).gather(where, ramp_layers=True)


def test_compensation_modes():
    profile = fz.Dipole(MEDIUM)
    total = profile.albedo
    coverage = np.array([0.0 * total, 0.5 * total, total, 2.0 * total])

    def gain(mode, **options):
        return fz.area_compensation(coverage, profile, mode=mode, **options)[:, 0]

    np.testing.assert_allclose(gain("ratio"), [8, 2, 1, 1], rtol=1e-5)
    np.testing.assert_allclose(gain("ratio", limit=1.5), [1.5, 1.5, 1, 1], rtol=1e-5)
    np.testing.assert_allclose(gain("conserve"), [8, 2, 1, 0.5], rtol=1e-5)
    np.testing.assert_allclose(gain("linear"), [2, 1.5, 1, 1], rtol=1e-5)
    np.testing.assert_allclose(gain("off"), 1.0)
    np.testing.assert_allclose(gain("fill"), np.array([1, 0.5, 0, 0]) * total[0], atol=1e-6)
    np.testing.assert_allclose(gain("conserve", strength=0.5), [4.5, 1.5, 1, 0.75], rtol=1e-5)
    same = fz.area_compensation([total * [0.5, 1.0, 1.5]], profile, by_luminance=True)[0]
    assert same[0] == same[1] == same[2]


def test_bad_compensation():
    profile = fz.Dipole(MEDIUM)
    with pytest.raises(ValueError, match="mode must be off, ratio"):
        fz.area_compensation(np.ones((1, 3)), profile, mode="more")
    with pytest.raises(ValueError, match="limit must be >= 1"):
        fz.area_compensation(np.ones((1, 3)), profile, limit=0.5)
    with pytest.raises(ValueError, match=r"strength must be in \[0, 1\]"):
        fz.area_compensation(np.ones((1, 3)), profile, strength=2)


def test_bad_irradiance_and_points():
    points, profile = sphere(10), fz.Dipole(MEDIUM)
    with pytest.raises(ValueError, match=r"irradiance must have shape \(N, 3\) or \(N, G, 3\), got \(10, 4\)"):
        fz.PointTree(points, np.ones((10, 4)), profile)
    with pytest.raises(ValueError, match="one row per point"):
        fz.PointTree(points, np.ones((9, 3)), profile)
    with pytest.raises(ValueError, match="points must not be empty"):
        fz.PointTree(Points(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)), np.ones((0, 3)), profile)
    with pytest.raises(ValueError, match="points must be a PointSet"):
        fz.PointTree(7, np.ones((1, 3)), profile)


def test_nan_irradiance_is_left_out_and_counted():
    points, profile = sphere(1000), fz.Dipole(MEDIUM)
    irradiance = np.ones((1000, 3))
    irradiance[5, 1] = np.nan
    irradiance[6, 2] = np.inf
    tree = fz.PointTree(points, irradiance, profile)
    assert (tree.dropped_count, tree.point_count) == (2, 998)
    assert np.isfinite(tree.gather(points.positions).exitance).all()
    tree = fz.PointTree(points, irradiance * np.nan, profile)
    assert (tree.gather(points.positions).exitance == 0).all()


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("positions", np.nan, "PointTree: positions must be finite, got NaN or infinity at point 3"),
        ("positions", 1e30, "PointTree: positions must be within 1e[+]15 m of the origin, got 1e[+]30"),
        ("normals", np.nan, "PointTree: normals must be finite, got NaN or infinity at point 3"),
        ("areas", np.nan, "PointTree: areas must be >= 0 and finite, got nan at point 3"),
        ("areas", -1.0, "PointTree: areas must be >= 0 and finite, got -1 at point 3"),
    ],
)
def test_bad_points(field, value, message):
    points = sphere(10)
    getattr(points, field)[3] = value
    with pytest.raises(ValueError, match=message):
        fz.PointTree(points, np.ones((10, 3)), fz.Dipole(MEDIUM))


def test_arrays_that_are_none_are_named():
    points, profile = sphere(10), fz.Dipole(MEDIUM)
    with pytest.raises(ValueError, match="PointTree: irradiance must be an array of numbers, got <class 'str'>"):
        fz.PointTree(points, "light", profile)
    tree = fz.PointTree(points, np.ones((10, 3)), profile)
    for gather in (tree.gather, tree.gather_exact):
        with pytest.raises(ValueError, match="PointTree: positions must be an array of numbers"):
            gather("here")
    with pytest.raises(ValueError, match="Ramp: distances must be an array of numbers"):
        fz.Ramp("near", [[1, 1, 1]])
    with pytest.raises(ValueError, match="area_compensation: coverage must be an array of numbers"):
        fz.area_compensation("all", profile)
    points.areas = np.ones((5, 2))
    with pytest.raises(ValueError, match=r"PointTree: areas must have shape \(n,\), got 2 dimensions"):
        fz.PointTree(points, np.ones((10, 3)), profile)


@pytest.mark.parametrize("coverage", [np.nan, np.inf, -0.1])
def test_bad_coverage(coverage):
    with pytest.raises(ValueError, match="area_compensation: coverage must be >= 0 and finite"):
        fz.area_compensation([[0.5, coverage, 0.5]], fz.Dipole(MEDIUM))


def test_bad_boundaries():
    for eta in (0.0, -1.0, np.nan, np.inf, 1e300, 1e-300):
        with pytest.raises(ValueError, match="fresnel_average: eta must be > 0 and finite"):
            fz.fresnel_average(eta)
        with pytest.raises(ValueError, match="fresnel_dielectric: eta must be > 0 and finite"):
            fz.fresnel_dielectric(0.5, eta)
    for cos_theta in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match=r"fresnel_dielectric: cos_theta must be in \[0, 1\]"):
            fz.fresnel_dielectric(cos_theta, 1.31)


def test_nothing_leaves_infinitely_far_away():
    for kind in (fz.Dipole, fz.BetterDipole, fz.NormalizedDiffusion, fz.PhotonBeamDiffusion, fz.MultipleScattering):
        assert (kind(MEDIUM).reflectance(np.inf) == 0).all()


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_hostile_positions(estimator):
    points, profile = sphere(100), fz.Dipole(MEDIUM)
    points.positions[:] = points.positions[0]  # coincident
    tree = fz.PointTree(points, np.ones((100, 3)), profile)
    out = tree.gather([points.positions[0], [1e6, 0, 0], [1e20, 1e20, 0]], estimator=estimator)
    assert np.isfinite(out.exitance).all()
    assert (out.exitance[0] > 0).all()
    assert (out.exitance[1:] == 0).all()
    assert (out.coverage[1:] == 0).all()
    assert tree.gather(np.zeros((0, 3))).exitance.shape == (0, 1, 3)
    for gather in (tree.gather, tree.gather_exact):
        with pytest.raises(ValueError, match="PointTree: positions must be finite, got NaN or infinity at row 0"):
            gather([[np.nan, 0, 0]], estimator=estimator)
    for tolerance in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(ValueError, match="tolerance must be > 0"):
            tree.gather([[0, 0, 0]], tolerance=tolerance)
    with pytest.raises(ValueError, match="estimator must be"):
        tree.gather([[0, 0, 0]], estimator="best")


@pytest.mark.parametrize(
    ("distances", "colors", "message"),
    [
        ([0.2, 0.1], [[1, 1, 1], [1, 1, 1]], "distances must increase"),
        ([0.1, 0.1], [[1, 1, 1], [1, 1, 1]], "distances must increase"),
        ([-1], [[1, 1, 1]], "distances must be >= 0"),
        ([0.0], [[1, -1, 1]], "colors must be >= 0"),
        ([0.0], [[1, 3e38, 1]], r"colors must be at most 1e\+06, got 3e\+38 at knot 0"),
        ([0.0, 1.0], [[1, 1, 1]], "one row per distance"),
        ([], np.zeros((0, 3)), "at least one knot"),
    ],
)
def test_bad_ramps(distances, colors, message):
    with pytest.raises(ValueError, match=message):
        fz.Ramp(distances, colors)


@pytest.mark.parametrize("spacing", [0.04, 0.5, 2.0])
def test_coarse_points_keep_the_coverage_right_on_average_and_never_negative(spacing):
    """Spacing of 2 to 100 mean free paths: W is noisy, but its mean is Rd_total however shading points are grouped."""
    half = 8.0
    corners = np.array([[-half, 0, half], [half, 0, half], [half, 0, -half], [-half, 0, -half]])
    profile = fz.Dipole(fz.Medium.from_albedo((0.9, 0.93, 0.96), (0.02, 0.02, 0.02), 1.31))
    points = fz.poisson_points(fz.Mesh(corners, [[0, 1, 2], [0, 2, 3]]), spacing)
    tree = fz.PointTree(points, np.ones((len(points.positions), 3)), profile)
    places = np.zeros((2000, 3), np.float32)
    places[:, ::2] = np.random.default_rng(1).uniform(-0.5 * half, 0.5 * half, (2000, 2))
    together = tree.gather(places).coverage / profile.albedo
    alone = np.array([tree.gather(place[None]).coverage[0] for place in places[:300]]) / profile.albedo
    assert together.min() >= 0
    np.testing.assert_allclose(together.mean(axis=0), 1, atol=0.05)
    np.testing.assert_allclose(alone.mean(axis=0), together[:300].mean(axis=0), atol=0.03)
    assert alone.min() >= 0


def test_the_brightest_ramps_stay_finite():
    """Colours near the largest number overflowed to NaN."""
    points, ramp = sphere(200), fz.Ramp([0.0, 1e-9, 0.01], [[1e6, 0, 1e6], [0, 1e6, 1e-6], [1e6, 1e6, 0]])
    for kind in (fz.Dipole, fz.MultipleScattering):
        tree = fz.PointTree(points, np.ones((200, 3)), kind(MEDIUM), ramp)
        for estimator in ESTIMATORS:
            out = tree.gather(points.positions, estimator=estimator)
            assert np.isfinite(out.exitance).all()
            assert out.exitance.max() > 1e4


def test_a_profile_without_bound_holds_at_coarse_points():
    """1/r at r = 0: in the middle of a cell two free paths wide sums were wrong by half."""
    profile = fz.NormalizedDiffusion(fz.Medium(30.0, (0.6, 0.15, 0.05), eta=1.0))
    corners = np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]])
    points = fz.poisson_points(fz.Mesh(corners, [[0, 1, 2], [0, 2, 3]]), 0.0667)
    tree = fz.PointTree(points, np.ones((len(points), 3)), profile)
    places = points.positions[::16]
    out, exact = tree.gather(places), tree.gather_exact(places)
    np.testing.assert_allclose(out.coverage, exact.coverage, rtol=0.1)
    np.testing.assert_allclose(out.exitance[:, 0], exact.exitance[:, 0], rtol=0.1)


def test_coefficients_beyond_those_of_matter():
    """Free paths far shorter than light overflowed to NaN."""
    with pytest.raises(ValueError, match=r"Medium: sigma_s_prime [+] sigma_a must be at most 1e[+]08, got 1e[+]18"):
        fz.Medium(1e18, 1e-18)
    with pytest.raises(ValueError, match="Medium: mean_free_path must be at least 1e-08, got 1e-20"):
        fz.Medium.from_albedo(0.5, 1e-20)
    points = sphere(10)
    for profile in (fz.Dipole, fz.BetterDipole, fz.PhotonBeamDiffusion, fz.MultipleScattering):
        for medium in (fz.Medium(5e7, 5e7), fz.Medium(1e8, 0.0), fz.Medium(1e-30, 1e-30)):
            out = fz.PointTree(points, np.ones((10, 3)), profile(medium)).gather(points.positions)
            assert np.isfinite(out.exitance).all()
            assert (out.exitance >= 0).all()
