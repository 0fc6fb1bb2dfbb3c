"""Opacity and age of overlays changed after the render: a new render where the layers are linear in them."""

import json

import numpy as np
import pytest
import test_grading as ice

import frazil as fz

ROUGHNESS = 0.3


def overlay(name, opacity, **changes):
    """Patches as rough as the ice, so that the surface's gloss stays."""
    values = {"pattern": "cells", "size": 0.15, "width": 0.04, "feather": 0.02, "roughness": ROUGHNESS, "age_end": 0.8}
    return fz.Overlay(**(values | changes), name=name, opacity=opacity)


def scene(opacity=0.5, age=0.4, refraction=0.0, other=None):
    """A block of ice on a floor, under two lights without extent."""
    made = fz.Scene()
    floor, cube = (made.add_mesh(fz.Mesh(*shape), path) for path, shape in (("/F", ice.grid()), ("/I", ice.block())))
    overlays = [overlay("cracks", opacity, scattering=0.6, color=(0.6, 0.8, 0.9))]
    if other is not None:
        overlays.append(overlay("dirt", other, scattering=0.3, color=(0.3, 0.2, 0.1), seed=7))
    model = fz.IceMaterial(
        fz.Medium(sigma_s_prime=(60.0, 60.0, 60.0), sigma_a=(4.0, 1.0, 0.4)),
        roughness=ROUGHNESS, spacing=0.02, overlays=overlays, age=age, refraction=refraction,
    )  # fmt: skip
    grey = made.add_material("/Looks/Floor", fz.StandardMaterial(diffuse_color=(0.4, 0.4, 0.4)))
    core = made.add_material("/Looks/Ice", model)
    made.add_object("/World/Floor", floor, grey)
    made.add_object("/World/Ice", cube, core)
    made.add_light(ice.light("Key", "key", fz.DistantLight(0.0), (3.0, 2.7, 2.3)))
    made.add_light(fz.Light(fz.DistantLight(0.0), path="/Lights/Rim", radiance=(0.5, 0.8, 1.5), group="rim"))
    camera = np.eye(4)
    camera[3, :3] = 0, 0.25, 1.5
    made.camera = fz.Camera(matrix=camera, focal_length=50, horizontal_aperture=30, vertical_aperture=24)
    return made


def render(*, bounces=0, max_bounces=0, samples=4, **changes):
    options = {"samples": samples, "bake_samples": 4, "bake_bounces": bounces, "max_bounces": max_bounces}
    return fz.render(scene(**changes), resolution=(40, 32), aovs=["overlay"], **options)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("overlay") / "in.exr"
    render().save(path, "zip")
    return fz.Film.load(path, keep_half=True)


def test_the_picture_is_the_same_with_and_without_the_layers():
    plain = fz.render(scene(), resolution=(40, 32), samples=4, bake_samples=4, bake_bounces=0, max_bounces=0)
    for name, layer in plain.layers.items():
        np.testing.assert_array_equal(render()[name], layer, err_msg=name)


@pytest.mark.parametrize("opacity", [0.0, 0.2, 1.0])
def test_another_opacity_is_a_new_render(film, opacity):
    expected = render(opacity=opacity)
    assert np.abs(expected["beauty"] - film["beauty"]).max() > 0.015
    graded = fz.grade(film, {"overlays": {"cracks": {"opacity": opacity / 0.5}}}, keep_layers=True)
    for name in ("translucency", "diffuse", "translucency_rim", "diffuse_key"):
        error = np.abs(graded[name] - expected[name])
        assert np.all(error <= 2.0**-9 * (np.abs(film[name]) + np.abs(expected[name])) + 1e-5), (name, error.max())
    assert np.abs(expected["diffuse"] - film["diffuse"]).max() > 0.01
    assert np.abs(expected["translucency"] - film["translucency"]).max() > 0.01
    np.testing.assert_allclose(graded["beauty"], expected["beauty"], atol=4e-3)


def test_another_age_is_a_new_render(film):
    for age in (0.1, 0.9):
        graded = fz.grade(film, {"overlays": {"age": age}})
        np.testing.assert_allclose(graded["beauty"], render(age=age)["beauty"], atol=4e-3)


def test_overlays_that_overlap_are_changed_to_first_order():
    rendered = render(other=0.5)
    graded = fz.grade(rendered, {"overlays": {"dirt": {"opacity": 0.5}}})
    np.testing.assert_allclose(graded["beauty"], render(other=0.25)["beauty"], atol=4e-3)
    both = {"cracks": {"opacity": 0.8}, "dirt": {"opacity": 0.8}}
    expected = render(opacity=0.4, other=0.4)["beauty"]
    graded = fz.grade(rendered, {"overlays": both}, keep_layers=True)
    error = np.abs(graded["beauty"] - expected)[:, :, :3]
    assert error.max() < 0.05 * np.abs(rendered["beauty"] - expected).max()
    np.testing.assert_allclose(graded["beauty"][:, :, :3], sum(graded[c] for c in ice.COMPONENTS), atol=1e-5)


def test_with_all_paths_the_change_agrees_in_the_mean():
    options = {"bounces": 2, "max_bounces": 4, "refraction": 1.0, "samples": 64}
    rendered, expected = render(**options), render(opacity=0.25, **options)
    graded = fz.grade(rendered, {"overlays": {"cracks": {"opacity": 0.5}}})
    shows = rendered["object_id"][:, :, 0] == 2
    change = (expected["beauty"] - rendered["beauty"])[shows].mean(axis=0)
    error = (graded["beauty"] - expected["beauty"])[shows].mean(axis=0)
    assert np.all(np.abs(error) < 0.15 * np.abs(change).max()), (error, change)


def test_what_cannot_be_served_is_refused(film):
    with pytest.raises(ValueError, match=r"overlays: must be one of cracks, got 'crack'\. Did you mean 'cracks'"):
        fz.grade(film, {"overlays": {"crack": {"opacity": 0.5}}})
    with pytest.raises(ValueError, match=r"overlays\.cracks\.opacity must be <= 4, got 5: it was rendered with"):
        fz.grade(film, {"overlays": {"cracks": {"opacity": 5}}})
    with pytest.raises(ValueError, match=r"overlays\.cracks\.opacty: key must be one of opacity.*Did you mean"):
        fz.grade(film, {"overlays": {"cracks": {"opacty": 5}}})
    with pytest.raises(ValueError, match=r"overlays\.age: must be in 0\.\.1, got 2"):
        fz.grade(film, {"overlays": {"age": 2}})
    with pytest.raises(ValueError, match=r"at the rendered age 0 it is not in the picture\. Render at a greater age"):
        fz.grade(render(age=0.0), {"overlays": {"age": 0.5}})
    bare = fz.Film({name: film[name] for name in ("beauty", *ice.COMPONENTS)}, {"frazil:light_groups": ["key"]})
    with pytest.raises(ValueError, match=r"layers overlay_\.\.\. must be in the picture.*--aov all,overlay"):
        fz.grade(bare, {"overlays": {"cracks": {"opacity": 0.5}}})
    with pytest.raises(ValueError, match=r"layer overlay_cracks_diffuse must be in the picture.*--aov all,overlay"):
        fz.grade(fz.Film({"beauty": film["beauty"]}, film.metadata), {"overlays": {"cracks": {"opacity": 0.5}}})


def test_a_film_names_the_overlays_that_it_has_layers_of(film):
    assert json.loads(film.metadata["frazil:overlays"])[0]["name"] == "cracks"
    assert {"overlay_cracks_diffuse", "overlay_cracks_translucency_rim"} <= set(film)
