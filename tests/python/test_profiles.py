"""Every profile against quadrature, its limits, and random walks in a half space."""

from __future__ import annotations

import numpy as np
import pytest
from half_space_walk import walk
from scipy import integrate

import frazil as fz

MEDIUM = fz.Medium(sigma_s_prime=(30.0, 25.0, 40.0), sigma_a=(0.6, 0.15, 0.05), eta=1.31)
MATCHED = fz.Medium(sigma_s_prime=(30.0, 30.0, 30.0), sigma_a=(0.6, 15.0, 0.05), eta=1.0)
CLEAR = fz.Medium(sigma_s_prime=(1000.0, 800.0, 600.0), sigma_a=(0.0, 0.0, 0.0), eta=1.31)

ALL_ORDERS = [fz.Dipole, fz.BetterDipole, fz.NormalizedDiffusion]
MULTIPLE = [fz.PhotonBeamDiffusion, fz.MultipleScattering]


@pytest.mark.parametrize("kind", ALL_ORDERS + MULTIPLE)
@pytest.mark.parametrize("medium", [MEDIUM, MATCHED])
def test_profiles_integrate_to_their_albedo(medium, kind):
    profile = kind(medium)
    for c in range(3):

        def ring(x, c=c):
            return 2 * np.pi * np.exp(2 * x) * float(profile.reflectance(np.exp(x))[0, c])

        total = integrate.quad(ring, -14, 3, limit=400, epsrel=1e-6)[0]
        assert total == pytest.approx(profile.albedo[c], rel=1e-4)
        part = integrate.quad(ring, -14, np.log(0.1), limit=400, epsrel=1e-6)[0]
        assert part == pytest.approx(profile.within(0.1)[0, c], rel=1e-4)
    np.testing.assert_allclose(profile.within(np.inf)[0], profile.albedo, rtol=1e-6)
    np.testing.assert_allclose(profile.within(0.0)[0], 0.0, atol=1e-9)


@pytest.mark.parametrize("kind", ALL_ORDERS + MULTIPLE)
def test_limits(kind):
    """Falling in r; scale with the mean free path; black without scattering, bright without absorption."""
    profile = kind(MEDIUM)
    values = profile.reflectance(np.geomspace(1e-4, 1.0, 200))
    assert (np.diff(values, axis=0) <= 0).all()
    assert (values > 0).all()
    fine = kind(fz.Medium(MEDIUM.sigma_s_prime * 10, MEDIUM.sigma_a * 10, 1.31))
    np.testing.assert_allclose(fine.reflectance(0.002), 100 * profile.reflectance(0.02), rtol=1e-4)
    np.testing.assert_allclose(fine.albedo, profile.albedo, rtol=1e-5)
    np.testing.assert_allclose(kind(fz.Medium(0.0, 1.0)).albedo, 0.0, atol=1e-12)
    white = kind(CLEAR).albedo
    if kind in ALL_ORDERS:
        np.testing.assert_allclose(white, 1.0, rtol=1e-6)
    elif kind is fz.MultipleScattering:
        np.testing.assert_allclose(white, 1.0 - fz.half_space_albedo(1.0, 1.31)[0], rtol=1e-6)


@pytest.mark.parametrize("eta", [1.0, 1.31])
@pytest.mark.parametrize("alpha", [0.5, 0.9, 0.99, 0.9999])
def test_exact_albedo_equals_a_random_walk(alpha, eta):
    """Within three standard errors of the walk (its shares are of 0..1), and Chandrasekhar's closed form at eta = 1."""
    count = 40000 if alpha < 0.999 else 6000
    walks = walk(alpha, eta, "diffuse", count)
    single, multiple = fz.half_space_albedo(alpha, eta)
    for exact, walked in ((single, walks.single.sum()), (multiple, walks.multiple.sum())):
        assert abs(exact - walked) < 3 * np.sqrt(exact * (1 - exact) / count) + 1e-4
    if eta == 1.0:  # ∫ 2 mu 1/2 alpha (1 - mu ln(1 + 1/mu)) dmu
        by_hand = integrate.quad(lambda mu: alpha * mu * (1 - mu * np.log1p(1 / mu)), 0, 1)[0]
        assert single == pytest.approx(by_hand, rel=1e-6)


def test_white_half_space_returns_everything():
    for eta in (1.0, 1.31, 2.0):
        assert sum(fz.half_space_albedo(1.0, eta)) == pytest.approx(1.0, abs=2e-4)
    assert fz.half_space_albedo(0.0, 1.31) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("kind", "eta", "bound"),
    [
        (fz.MultipleScattering, 1.0, 0.04),
        (fz.MultipleScattering, 1.31, 0.03),
        (fz.PhotonBeamDiffusion, 1.0, 0.19),
        (fz.PhotonBeamDiffusion, 1.31, 0.17),
        (fz.NormalizedDiffusion, 1.0, 0.03),
        (fz.Dipole, 1.31, 0.35),
    ],
)
@pytest.mark.parametrize("alpha", [0.5, 0.9, 0.99])
def test_profiles_against_a_random_walk(alpha, kind, eta, bound):
    """F(R) over all R, of the orders that each holds; the bounds are what bench/profiles.py prints, rounded up."""
    walks = walk(alpha, eta, "diffuse", 60000)
    profile = kind(fz.Medium(alpha, 1.0 - alpha, eta=eta))
    true = walks.within("multiple") + (walks.within("single") if kind in ALL_ORDERS else 0.0)
    assert np.abs(profile.within(walks.edges[1:])[:, 0] - true).max() / true[-1] < bound


def test_bad_arguments():
    with pytest.raises(ValueError, match=r"half_space_albedo: alpha must be in \[0, 1\], got 1.5"):
        fz.half_space_albedo(1.5)
    with pytest.raises(ValueError, match=r"half_space_albedo: eta must be in \[1, 4\], got 0.5"):
        fz.half_space_albedo(0.5, 0.5)
    with pytest.raises(ValueError, match="reflectance: r must be >= 0"):
        fz.MultipleScattering(MEDIUM).reflectance(-1.0)
