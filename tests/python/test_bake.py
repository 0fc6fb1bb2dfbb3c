"""Bakes: taken over to the bit where they hold, made anew where they do not, refused where they are not ours."""

import zipfile

import numpy as np
import pytest
from small_scenes import ice_over_floor, placed

import frazil as fz
from frazil.baking import refresh_bake

OPTIONS = {"spacing": 0.15, "bake_samples": 16, "bake_bounces": 2}


def light(bake: fz.Bake) -> np.ndarray:
    return np.array(bake.irradiance(0))


def refreshed(scene, path):
    bake, report = refresh_bake(scene, path, OPTIONS)
    return light(bake), report


def test_a_render_with_a_bake_has_the_bits_of_one_without():
    scene = ice_over_floor()
    options = {**OPTIONS, "samples": 4, "resolution": (32, 18)}
    plain = fz.render(scene, **options)
    baked = fz.render(scene, bake=fz.bake(scene, **OPTIONS), **options)
    for name in plain:
        np.testing.assert_array_equal(plain[name], baked[name], err_msg=name)


def test_points_that_are_closer_share_their_rays():
    """32 rays where points are half a mean free path apart, as many to the same area where they are closer."""
    scene = ice_over_floor()
    free_path = 2 * fz.bake(scene, bake_samples=1, bake_bounces=0).points(0).spacing
    for scale, rays in ((1.0, 32), (0.7, 16), (0.5, 8), (0.3, 8)):
        spacing = 0.5 * scale * free_path
        default = light(fz.bake(scene, spacing=spacing, bake_bounces=1))
        np.testing.assert_array_equal(
            default, light(fz.bake(scene, spacing=spacing, bake_bounces=1, bake_samples=rays))
        )


def test_a_file_gives_back_the_bits_and_serves_another_camera(tmp_path):
    path = tmp_path / "ice.bake"
    first, report = refreshed(ice_over_floor(), path)
    assert report.has_new_points
    assert report.new_groups == ["sky", "key"]
    again, report = refreshed(ice_over_floor(camera_x=1.0), path)
    assert not report.has_new_points
    assert report.new_groups == []
    assert report.stats["bake_rays"] == 0
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(light(fz.load_bake(path)), first)


def test_only_the_light_group_that_changed_is_baked_again(tmp_path):
    path = tmp_path / "ice.bake"
    before, _ = refreshed(ice_over_floor(key=40.0), path)
    changed, report = refreshed(ice_over_floor(key=10.0), path)
    assert not report.has_new_points
    assert report.new_groups == ["key"]
    assert "light groups baked: key" in str(report)
    np.testing.assert_array_equal(changed[:, 0], before[:, 0])
    fresh = light(fz.bake(ice_over_floor(key=10.0), **OPTIONS))
    np.testing.assert_array_equal(changed, fresh)


def test_ramp_and_compensation_leave_the_bake_as_it_is(tmp_path):
    path = tmp_path / "ice.bake"
    before, _ = refreshed(ice_over_floor(), path)
    scene = ice_over_floor(ramp_distances=[0.0, 0.5], ramp_colors=[(1, 1, 1), (0, 0.2, 1)], compensation="off")
    after, report = refreshed(scene, path)
    assert str(report) == "points and light taken over"
    np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(light(fz.bake(scene, **OPTIONS)), before)


@pytest.mark.parametrize("change", ["shape", "spacing", "samples"])
def test_what_the_light_depends_on_makes_it_anew(tmp_path, change):
    path = tmp_path / "ice.bake"
    refreshed(ice_over_floor(), path)
    options = dict(OPTIONS)
    scene = ice_over_floor(radius=0.9) if change == "shape" else ice_over_floor()
    if change == "spacing":
        options["spacing"] = 0.2
    if change == "samples":
        options["bake_samples"] = 8
    bake, report = refresh_bake(scene, path, options)
    assert report.new_groups == ["sky", "key"]
    assert report.has_new_points == (change != "samples")
    np.testing.assert_array_equal(light(bake), light(fz.bake(scene, **options)))


@pytest.mark.parametrize("harm", ["cut", "flip", "empty"])
def test_a_damaged_file_is_named_and_made_anew(tmp_path, harm):
    path = tmp_path / "ice.bake"
    first, _ = refreshed(ice_over_floor(), path)
    content = bytearray(path.read_bytes())
    if harm == "cut":
        content = content[: len(content) // 2]
    elif harm == "flip":
        content[len(content) // 2] ^= 0xFF
    else:
        content = b""
    path.write_bytes(content)
    with pytest.warns(fz.FrazilWarning, match="ice.bake: bake cache is damaged"):
        again, report = refreshed(ice_over_floor(), path)
    assert report.has_new_points
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(light(fz.load_bake(path)), first)


def test_a_foreign_file_is_left_alone(tmp_path):
    path = tmp_path / "letter.txt"
    path.write_text("dear reader")
    with pytest.raises(OSError, match="letter.txt: bake cache must be a file that Frazil wrote"):
        refreshed(ice_over_floor(), path)
    assert path.read_text() == "dear reader"
    with pytest.raises(OSError, match="damaged or foreign"):
        fz.load_bake(path)


def test_the_file_is_what_the_docs_say(tmp_path):
    path = tmp_path / "ice.bake"
    first, _ = refreshed(ice_over_floor(), path)
    with zipfile.ZipFile(path) as archive:
        assert set(archive.namelist()) == {"manifest.json", "0.points.ply", "0.light.npy", "0.moments.npy"}
        with archive.open("0.light.npy") as stream:
            np.testing.assert_array_equal(np.load(stream), first)


def test_a_bake_of_another_scene_is_refused():
    bake = fz.bake(ice_over_floor(), **OPTIONS)
    scene = ice_over_floor()
    scene.add_light(fz.Light(fz.DomeLight(), group="extra"))
    with pytest.raises(ValueError, match="light groups must be the scene's"):
        fz.render(scene, bake=bake, resolution=(8, 8), samples=1, **OPTIONS)


def test_points_too_far_apart_are_warned_of_once_for_all_bodies_alike():
    scene = ice_over_floor()
    ball = scene.objects[0]
    for i in range(3):
        scene.add_object(f"/Ball{i}", ball.mesh, ball.material, placed(3.0 + i))
    with pytest.warns(fz.FrazilWarning) as told:
        fz.bake(scene, spacing=0.8)
    assert len(told) == 1
    assert str(told[0].message).startswith("/Ball (and 3 more bodies): points are 0.8 m apart, 8.04 mean free paths")
