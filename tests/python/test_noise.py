"""Adaptive sampling ends where the noise is as asked; denoising keeps the sum."""

import numpy as np
import pytest
from small_scenes import ice_over_floor

import frazil as fz
from frazil.denoise import denoise_film

OPTIONS = {"spacing": 0.2, "bake_samples": 4, "resolution": (128, 72)}


def luminance(film):
    return film["beauty"][:, :, :3] @ np.array([0.2126, 0.7152, 0.0722], np.float32)


@pytest.fixture(scope="module")
def lit():
    """The scene, and what every render of it shall share: noise is then the camera paths' alone."""
    scene = ice_over_floor()
    return scene, fz.bake(scene, spacing=0.2, bake_samples=4)


def test_noise_is_as_asked_and_samples_go_where_it_is_hard(lit):
    scene, bake = lit
    truth = luminance(fz.render(scene, bake=bake, samples=2048, seed=9, resolution=(48, 27)))
    film = fz.render(scene, bake=bake, samples=2048, noise=0.03, resolution=(48, 27))
    counts = film["sample_count"][:, :, 0]
    assert 16 <= counts.min() < counts.max() <= 2048
    assert counts.mean() < 0.5 * 2048
    relative = (luminance(film) - truth) / (truth + 0.1 * truth.mean())
    rms = np.sqrt(np.mean(relative**2))
    assert 0.003 < rms < 0.03, rms


def test_variance_is_that_of_renders_with_other_seeds(lit):
    scene, bake = lit
    films = [fz.render(scene, bake=bake, samples=32, seed=seed, resolution=(48, 27)) for seed in range(12)]
    spread = np.var([luminance(film) for film in films], axis=0, ddof=1).mean()
    told = np.mean([film["variance"] for film in films])
    # All samples together are stratified better than their subsets: the estimate errs on the safe side.
    assert 0.7 * spread < told < 4.0 * spread


def test_denoised_layers_still_sum_to_the_beauty():
    pytest.importorskip("pyoidn", reason="Open Image Denoise is an extra")
    scene = ice_over_floor()
    noisy = fz.render(scene, samples=4, **OPTIONS)
    film = fz.render(scene, samples=4, denoise=True, **OPTIONS)
    truth = fz.render(scene, samples=512, **OPTIONS)
    additive = film.additive_layers()
    np.testing.assert_allclose(sum(film[n] for n in additive), film["beauty"][:, :, :3], rtol=1e-5, atol=1e-6)
    for name, groups in additive.items():
        np.testing.assert_allclose(sum(film[g] for g in groups), film[name], rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(film["translucency"], noisy["translucency"])
    for name in ("diffuse", "specular"):
        before, after = (np.sqrt(np.mean((f[name] - truth[name]) ** 2)) for f in (noisy, film))
        assert after < 0.7 * before, name


def test_denoising_gives_silhouettes_no_colour_of_its_own():
    pytest.importorskip("pyoidn", reason="Open Image Denoise is an extra")
    truth, film = (fz.render(ice_over_floor(), samples=n, seed=5, **OPTIONS) for n in (512, 4))
    alpha = truth["beauty"][:, :, 3]
    silhouette = (alpha > 0.02) & (alpha < 0.98)
    denoise_film(film)
    assert silhouette.sum() > 200
    for name in ("diffuse", "specular"):
        error = (film[name] - truth[name])[silhouette]
        colour = np.sqrt(np.mean((error - error.mean(axis=1, keepdims=True)) ** 2)) / truth[name][silhouette].mean()
        assert colour < 0.027, name


def test_negative_light_stays_negative():
    pytest.importorskip("pyoidn", reason="Open Image Denoise is an extra")
    film = fz.render(ice_over_floor(key=-10.0), samples=8, **OPTIONS)
    before = film["diffuse_key"].mean()
    assert before < 0.0
    denoise_film(film)
    assert film["diffuse_key"].mean() == pytest.approx(before, rel=0.05)


def test_what_the_core_lacks_in_a_pixel_is_seen_through_it_after_denoising_too():
    pytest.importorskip("pyoidn", reason="Open Image Denoise is an extra")
    film = fz.render(ice_over_floor(), samples=16, **OPTIONS)
    # Chips and cracks move light from one layer to the other, in single pixels that no guide shows.
    rng = np.random.default_rng(3)
    chips = (rng.random(film["N"].shape[:2]) < 0.02) & (film["object_id"][:, :, 0] == 1)
    for suffix in ("", "_sky", "_key"):
        moved = 0.8 * film["translucency" + suffix][chips]
        film["translucency" + suffix][chips] -= moved
        film["refraction" + suffix][chips] += moved
    before = luminance(film)
    denoise_film(film)
    left = luminance(film)[chips] / before[chips]
    print(chips.sum(), left.min(), left.mean(), left.std())
    assert chips.sum() > 30
    assert left.mean() > 0.97
    assert left.min() > 0.85


def test_shading_fewer_samples_keeps_the_picture_and_what_is_seen(lit):
    scene, bake = lit
    options = {"bake": bake, "resolution": (48, 27), "mattes": {"ball": ["/Ball"]}}
    whole = fz.render(scene, samples=64, **options)
    seeds = [fz.render(scene, samples=64, shading_samples=8, seed=seed, **options) for seed in range(16)]
    film = seeds[0]
    for name in ("Z", "P", "object_id", "matte.ball"):
        np.testing.assert_array_equal(film[name], whole[name], err_msg=name)
    additive = film.additive_layers()
    np.testing.assert_allclose(sum(film[n] for n in additive), film["beauty"][:, :, :3], rtol=1e-5, atol=1e-6)
    # The mean of many seeds is the truth's, layer by layer and, within the noise, pixel by pixel.
    truth = fz.render(scene, samples=1024, seed=99, **options)
    for name in ("diffuse", "specular", "translucency", "background", "albedo"):
        runs = np.array([f[name] for f in seeds])
        spread = runs.mean(axis=(1, 2, 3)).std(ddof=1) / np.sqrt(len(runs))
        assert abs(runs.mean() - truth[name].mean()) < 5 * spread + 2e-3 * truth[name].mean(), name
    cheap = np.mean([(luminance(f) - luminance(truth)) ** 2 for f in seeds])
    few = [fz.render(scene, samples=8, seed=seed, **options) for seed in range(16)]
    eighth = np.mean([(luminance(f) - luminance(truth)) ** 2 for f in few])
    assert cheap < 0.85 * eighth
    # The error told is that of the samples shaded.
    told, real = np.mean([f["variance"] for f in seeds]), np.var([luminance(f) for f in seeds], axis=0, ddof=1).mean()
    assert 0.5 * real < told < 6.0 * real


def test_shading_fewer_samples_has_the_same_bits_on_any_number_of_threads(lit):
    scene, bake = lit
    films = [
        fz.render(scene, bake=bake, samples=32, shading_samples=5, noise=0.05, threads=n, resolution=(40, 24))
        for n in (1, 3)
    ]
    for name in films[0]:
        np.testing.assert_array_equal(films[0][name], films[1][name], err_msg=name)


def test_shading_samples_below_zero_are_refused(lit):
    with pytest.raises(ValueError, match="shading_samples must be >= 0"):
        fz.render(lit[0], shading_samples=-1)
