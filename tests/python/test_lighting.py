"""Irradiance from Python: closed forms, groups, twins, refusals."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from frazil import _frazil as fz


def grid(count: int = 8) -> SimpleNamespace:
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, count), np.linspace(-0.4, 0.4, count))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1).astype(np.float32)
    return SimpleNamespace(positions=positions, normals=np.tile(np.float32([0, 0, 1]), (x.size, 1)))


def roof(height: float = 0.3, half: float = 0.2):
    corners = np.float32([[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]])
    return fz.RayScene([fz.Mesh(corners, np.int32([[0, 1, 2], [0, 2, 3]]))])


def above(z: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[3, 2] = z
    return matrix


def test_uniform_dome_gives_pi_and_eta_takes_the_reflected_share():
    empty = fz.RayScene([])
    dome = fz.Light(fz.DomeLight(), radiance=[1.0, 2.0, 0.0], path="/dome")
    full = fz.bake_irradiance(grid(), empty, [dome], eta=1.0, samples=256)
    assert full.shape == (64, 1, 3)
    assert full.dtype == np.float32
    np.testing.assert_allclose(full[:, 0], np.tile([np.pi, 2 * np.pi, 0.0], (64, 1)), rtol=1e-4)
    ice = fz.bake_irradiance(grid(), empty, [dome], eta=1.31, samples=256)
    np.testing.assert_allclose(ice[:, 0, 0], np.pi * (1 - fz.fresnel_average(1.31)), rtol=2e-3)


def test_groups_are_columns_in_order_and_sum_to_the_whole():
    lights = [
        fz.Light(fz.RectLight(1.0, 1.0), matrix=above(1.0), path="/key", group="key"),
        fz.Light(fz.SphereLight(0.2), matrix=above(2.0), path="/fill"),
        fz.Light(fz.DiskLight(0.5), matrix=above(1.5), path="/key2", group="key"),
    ]
    assert fz.light_groups(lights) == ["key", ""]
    baked = fz.bake_irradiance(grid(), roof(), lights)
    alone = [fz.bake_irradiance(grid(), roof(), [light])[:, 0] for light in lights]
    np.testing.assert_array_equal(baked[:, 1], alone[1])
    np.testing.assert_allclose(baked[:, 0], alone[0] + alone[2], rtol=1e-6)


def test_a_negative_twin_leaves_nothing():
    key = fz.Light(fz.RectLight(1.0, 1.0), matrix=above(1.0), radiance=[3.0] * 3, path="/key")
    twin = fz.Light(fz.RectLight(1.0, 1.0), matrix=above(1.0), radiance=[-3.0] * 3, path="/twin")
    assert not fz.bake_irradiance(grid(), roof(), [key, twin]).any()


def test_order_of_points_does_not_matter_beyond_their_index():
    points = grid()
    dome = fz.Light(fz.DomeLight(), path="/dome")
    baked = fz.bake_irradiance(points, roof(), [dome], samples=16)
    again = fz.bake_irradiance(points, roof(), [dome], samples=16)
    np.testing.assert_array_equal(baked, again)
    other = fz.bake_irradiance(points, roof(), [dome], samples=16, seed=1)
    assert (baked != other).any()
    np.testing.assert_allclose(baked.mean(), other.mean(), rtol=0.02)


def test_noise_falls_faster_than_random():
    light = fz.Light(fz.RectLight(1.0, 1.0), matrix=above(1.0), path="/key")
    truth = fz.bake_irradiance(grid(), roof(), [light], samples=16384, seed=9)
    errors = [
        np.sqrt(np.mean((fz.bake_irradiance(grid(), roof(), [light], samples=n) - truth) ** 2)) for n in (16, 256)
    ]
    assert errors[1] < errors[0] / 5  # random numbers: a quarter


def test_occlusion_of_single_rays():
    origins = np.float32([[0, 0, 0], [0.3, 0, 0], [0, 0, 0]])
    directions = np.float32([[0, 0, 1], [0, 0, 1], [0, 0, -1]])
    assert roof().are_occluded(origins, directions).tolist() == [True, False, False]
    assert roof().are_occluded(origins, directions, 0.2).tolist() == [False, False, False]


@pytest.mark.parametrize(
    ("light", "message"),
    [
        (dict(shape=fz.RectLight(0.0, 1.0)), "/bad: width must be > 0"),
        (dict(shape=fz.SphereLight(float("nan"))), "/bad: radius must be > 0"),
        (dict(shape=fz.DomeLight(), radiance=[float("inf"), 0, 0]), "/bad: radiance must be finite"),
        (dict(shape=fz.DiskLight(1.0), matrix=np.zeros((4, 4))), "/bad: transform must be invertible"),
    ],
)
def test_bad_lights_are_refused_by_path(light, message):
    with pytest.raises(ValueError, match=message.replace("(", r"\(")):
        fz.bake_irradiance(grid(), roof(), [fz.Light(path="/bad", **light)])


def test_bad_options_and_points_are_refused():
    dome = [fz.Light(fz.DomeLight(), path="/dome")]
    with pytest.raises(ValueError, match="samples must be in"):
        fz.bake_irradiance(grid(), roof(), dome, samples=0)
    with pytest.raises(ValueError, match="eta must be in"):
        fz.bake_irradiance(grid(), roof(), dome, eta=0.2)
    points = grid()
    points.normals = points.normals[:-1]
    with pytest.raises(ValueError, match="normals must be one per point"):
        fz.bake_irradiance(points, roof(), dome)
    points.normals = points.normals[:, :2].copy()
    with pytest.raises(ValueError, match=r"points: normals must have shape \(N, 3\)"):
        fz.bake_irradiance(points, roof(), dome)
    with pytest.raises(ValueError, match="/sky: pixels must be finite"):
        fz.DomeLight(np.full((2, 4, 3), np.nan, np.float32), "/sky")


@settings(max_examples=60, deadline=None)
@given(
    size=st.tuples(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6)),
    offset=st.tuples(*[st.floats(-1e4, 1e4)] * 3),
    kind=st.sampled_from([fz.RectLight, fz.SphereLight, fz.DiskLight, fz.CylinderLight]),
)
def test_any_light_gives_finite_irradiance_of_at_most_pi(size, offset, kind):
    matrix = np.eye(4)
    matrix[3, :3] = offset
    shape = kind(*size) if kind in (fz.RectLight, fz.CylinderLight) else kind(size[0])
    baked = fz.bake_irradiance(grid(2), fz.RayScene([]), [fz.Light(shape, matrix=matrix, path="/l")], eta=1.0)
    assert np.isfinite(baked).all()
    assert (baked >= 0).all()
    # A single estimate of few samples may overshoot where a sampler goes by area; by solid angle it cannot.
    if kind in (fz.RectLight, fz.SphereLight):
        assert (baked <= np.pi * 2.001).all()


def test_errors_come_with_the_bake_and_fall_with_the_target():
    light = fz.Light(fz.RectLight(1.0, 1.0), matrix=above(1.0), path="/key")
    plain, errors = fz.bake_irradiance(grid(), roof(), [light], samples=16, return_error=True)
    assert plain.shape == (64, 1, 3)
    assert errors.shape == (64,)
    _, adapted = fz.bake_irradiance(grid(), roof(), [light], samples=16, error=0.01, max_rounds=64, return_error=True)
    assert adapted.mean() < errors.mean()
    with pytest.raises(ValueError, match="error must be >= 0"):
        fz.bake_irradiance(grid(), roof(), [light], error=-1.0)


def test_linked_lights_reach_only_their_objects():
    light = fz.Light(fz.DomeLight(), path="/dome", lit=fz.ObjectSet([3]))
    assert fz.bake_irradiance(grid(), fz.RayScene([]), [light], objects=[3]).any()
    assert not fz.bake_irradiance(grid(), fz.RayScene([]), [light], objects=[2]).any()
