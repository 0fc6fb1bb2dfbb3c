"""Mattes by paths, collections of a stage and the command line; sets of ice that share their light."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil.cli import main


@pytest.fixture
def stage(tmp_path):
    """Four squares in two groups; the collection `matte:left` of them all but one."""
    stage = new_stage(tmp_path / "scene.usda")
    for number, path in enumerate(("/World/A/x", "/World/A/y", "/World/B/x", "/World/B/y")):
        quad = add_quad(stage, path)
        UsdGeom.Xformable(quad).AddTranslateOp().Set((number % 2 - 1.0, number // 2 - 1.0, -3.0))
    left = Usd.CollectionAPI.Apply(stage.GetPrimAtPath("/World"), "matte:left")
    left.CreateIncludesRel().SetTargets(["/World/A", "/World/B/x"])
    return stage


def test_collections_and_paths_name_sets_which_may_overlap(stage):
    scene = load(stage)
    assert scene.mattes == {"left": [0, 1, 2]}
    film = fz.render(scene, resolution=(16, 16), samples=4, mattes={"all": ["/World"], "b": ["/World/B/x", "/World/B"]})
    mattes = {name: film[f"matte.{name}"][..., 0] for name in ("left", "all", "b")}
    assert np.allclose(mattes["all"], film["beauty"][..., 3], atol=1e-6)
    assert mattes["left"].sum() > 1
    assert mattes["b"].sum() > 1
    assert (mattes["left"] + mattes["b"]).max() == pytest.approx(2.0)  # the square that both have
    assert not film["refracted_matte.all"].any()
    assert film.metadata["frazil:mattes"]["b"] == ["/World/B/x", "/World/B/y"]


def test_unknown_paths_offer_the_nearest(stage):
    scene = load(stage)
    with pytest.raises(KeyError, match=r"matte rock: path must be at or above an object, got '/World/C'. Did you mean"):
        fz.render(scene, mattes={"rock": ["/World/C"]})
    with pytest.raises(ValueError, match=r"matte: name must be of letters, digits and _, got 'a.b'"):
        fz.render(scene, mattes={"a.b": ["/World"]}, resolution=(4, 4))


def test_command_line_writes_them(stage, tmp_path):
    load(stage)
    out = tmp_path / "out.exr"
    command = ["render", str(tmp_path / "scene.usda"), "-o", str(out), "--resolution", "8x8", "--samples", "1"]
    assert main([*command, "--no-png", "--quiet", "--matte", "b=/World/B", "--aov", "beauty"]) == 0
    film = fz.Film.load(out)
    assert set(film) == {"beauty", "matte.left", "refracted_matte.left", "matte.b", "refracted_matte.b"}
    assert main([*command, "--no-png", "--quiet", "--matte", "b"]) == 2


def test_translucency_sets_are_inherited(stage):
    stage.GetPrimAtPath("/World/A").CreateAttribute("frazil:translucencySet", Sdf.ValueTypeNames.Token).Set("berg")
    scene = load(stage)
    assert [item.translucency_set for item in scene.objects] == ["berg", "berg", "", ""]
