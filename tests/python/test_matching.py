"""A reference that a known recipe has made is found again, to 2 %."""

import numpy as np
import pytest
import test_grading as ice

import frazil as fz
from frazil.difference import flip_difference
from frazil.grade_recipe import read_recipe, recipe_text
from frazil.image import read_picture, write_png

LIGHTS = {
    "key": {"intensity": 0.5, "color": [1.0, 0.8, 0.5]},
    "rim": {"intensity": 1.5, "color": [0.2, 1.0, 0.6]},
    "sky": {"intensity": 3.0, "color": [1.0, 1.0, 1.0]},
    "fill": {"intensity": 0.0},
    "default": {"intensity": 0.5},
}


@pytest.fixture(scope="module")
def film():
    return ice.render(aovs=["translucency_ramp"], samples=8)


def factors(recipe):
    return {group: mix.factor for group, mix in read_recipe(recipe).lights.items()}


def assert_factors(found, expected, tolerance=0.02, faint=0.02):
    """Within `tolerance`; the faint negative light may be off by `faint`."""
    for group, factor in factors({"lights": expected}).items():
        np.testing.assert_allclose(
            factors(found)[group],
            factor,
            atol=(faint if group == "fill" else tolerance) * max(1.0, np.abs(factor).max()),
            err_msg=group,
        )


def test_a_light_mix_is_found_again(film):
    target = fz.grade(film, {"lights": LIGHTS})["beauty"][:, :, :3]
    found = fz.match(film, target)
    assert_factors(found.recipe, LIGHTS)
    assert found.rms_after < 1e-3 * found.rms_before
    assert found.flip_after < 0.01 < found.flip_before


def test_a_painting_of_eight_bits_is_enough(film, tmp_path):
    target = fz.grade(film, {"lights": LIGHTS, "color": {"exposure": -1.0}})["beauty"][:, :, :3]
    write_png(tmp_path / "art.png", target)
    found = fz.match(film, tmp_path / "art.png")
    halved = {group: mix | {"intensity": 0.5 * mix["intensity"]} for group, mix in LIGHTS.items()}
    # Eight bits do not show more of it: by seeds 0 to 4, at 8 and 32 samples, it comes back as 0 to 0.09 of a light.
    assert_factors(found.recipe, halved, tolerance=0.03, faint=0.1)


def test_ramp_colours_are_found_again(film):
    target = fz.grade(film, {"ramp": {"colors": ice.NEW_COLORS}})["beauty"][:, :, :3]
    found = fz.match(film, target, what=["ramp"])
    np.testing.assert_allclose(found.recipe["ramp"]["/Looks/Ice"]["colors"], ice.NEW_COLORS, atol=0.02)
    assert found.rms_after < 1e-3 * found.rms_before


def test_lights_and_ramp_together_come_close(film):
    recipe = {"lights": {"key": {"intensity": 0.5}}, "ramp": {"colors": ice.NEW_COLORS}}
    found = fz.match(film, fz.grade(film, recipe)["beauty"], what=["lights", "ramp"])
    assert found.rms_after < 0.02 * found.rms_before


def test_a_gain_is_found_again_in_the_mask_alone(film):
    target = fz.grade(film, {"color": {"gain": [0.5, 1.0, 2.0]}})["beauty"][:, :, :3].copy()
    mask = np.zeros(target.shape[:2], np.float32)
    mask[10:30] = 1.0
    target[:10] = 7.0  # painted over, but not in the mask
    found = fz.match(film, target, what=["gain"], mask=mask)
    np.testing.assert_allclose(found.recipe["color"]["gain"], [0.5, 1.0, 2.0], rtol=0.02)
    assert found.flip_after < 0.01


def test_lights_are_negative_only_where_that_is_allowed(film):
    target = fz.grade(film, {"lights": {"rim": {"sign": -1}}})["beauty"][:, :, :3]
    free = factors(fz.match(film, target, allow_negative=True).recipe)
    np.testing.assert_allclose(free["rim"], -1.0, atol=0.02)
    held = factors(fz.match(film, target).recipe)
    assert all(np.all(factor >= 0.0) for factor in held.values())
    assert np.all(held["rim"] == 0.0)


def test_grey_gives_intensities(film):
    target = fz.grade(film, {"lights": {"key": {"intensity": 0.25}}})["beauty"][:, :, :3]
    found = factors(fz.match(film, target, per_channel=False).recipe)
    np.testing.assert_allclose(found["key"], 0.25, atol=0.01)
    np.testing.assert_allclose(found["sky"], 1.0, atol=0.02)


def test_flip_is_zero_for_the_same_and_one_for_black_and_white():
    black, white = np.zeros((32, 32, 3), np.float32), np.ones((32, 32, 3), np.float32)
    assert flip_difference(white, white) == pytest.approx(0.0, abs=1e-5)
    assert flip_difference(white, black) == pytest.approx(1.0, abs=0.05)


def test_what_cannot_be_matched_is_refused(film, tmp_path):
    target = film["beauty"][:, :, :3]
    with pytest.raises(ValueError, match="reference must be 40x32 like the render, got 20x16"):
        fz.match(film, target[::2, ::2])
    with pytest.raises(ValueError, match="mask must be 40x32"):
        fz.match(film, target, mask=np.ones((2, 2)))
    with pytest.raises(ValueError, match="mask must leave some pixels"):
        fz.match(film, target, mask=np.zeros((32, 40)))
    with pytest.raises(ValueError, match="what must be of lights, ramp, gain, got 'shape'"):
        fz.match(film, target, what=["shape"])
    bare = fz.Film(film.layers, {k: v for k, v in film.metadata.items() if k != "frazil:ramp_knots"})
    with pytest.raises(ValueError, match="Render ice that has a ramp with --aov all,translucency_ramp"):
        fz.match(bare, target, what=["ramp"])
    (tmp_path / "art.png").write_bytes(b"no image")
    with pytest.raises(OSError, match=r"art\.png: must be an image"):
        fz.match(film, tmp_path / "art.png")


def test_the_command_writes_a_recipe_that_grade_takes(tmp_path, film, capsys):
    from frazil.cli import main

    film.save(tmp_path / "in.exr", "zip")
    write_png(tmp_path / "art.png", fz.grade(film, {"lights": {"key": {"intensity": 0.5}}})["beauty"][:, :, :3])
    recipe, graded = tmp_path / "r.toml", tmp_path / "out.png"
    assert main(["match", str(tmp_path / "in.exr"), str(tmp_path / "art.png"), "-o", str(recipe)]) == 0
    assert "FLIP" in capsys.readouterr().out
    assert main(["grade", str(tmp_path / "in.exr"), "-r", str(recipe), "-o", str(graded)]) == 0
    np.testing.assert_allclose(read_picture(graded), read_picture(tmp_path / "art.png"), atol=0.02)
    assert main(["match", str(tmp_path / "in.exr"), str(tmp_path / "art.png"), "-o", "r.txt"]) == 2


def test_recipes_survive_being_written():
    recipe = {"lights": LIGHTS, "ramp": {"/Looks/A b": {"colors": [[0.1, 0.2, 0.3]], "preserve_energy": False}}}
    import tomllib

    assert tomllib.loads(recipe_text(recipe)) == recipe
    assert read_recipe(tomllib.loads(recipe_text(recipe))) == read_recipe(recipe)
