"""Presets and overlays of ice: from Python, from USD, and their tables in the docs."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdShade
from test_usd_materials import COLOR, FLOAT, TOKEN, bind
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil import optics
from frazil.ice import ICE_PRESETS, presets_markdown
from frazil.usd.material_inputs import ICE_INPUTS, OVERLAY_INPUTS, find_input, inputs_markdown


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda", meters_per_unit=0.01)


def model_of(stage):
    scene = load(stage)
    return scene.materials[scene.objects[0].material].model, scene.warnings


def add_overlay(stage, ice, name, **inputs):
    shader = UsdShade.Shader.Define(stage, f"/Material/{name}")
    shader.CreateIdAttr("frazil:overlay")
    for key, (kind, value) in inputs.items():
        shader.CreateInput(key, kind).Set(value)
    output = shader.CreateOutput("out", TOKEN)
    ice.CreateInput(f"overlays:{name}", TOKEN).ConnectToSource(output)
    return shader


@pytest.mark.parametrize("name", list(ICE_PRESETS))
def test_presets_scale_lengths_and_coefficients(name):
    small, large = fz.ice_preset(name, age=0.2), fz.ice_preset(name, age=0.2, scale=10.0)
    np.testing.assert_allclose(small.medium.sigma_a, np.multiply(large.medium.sigma_a, 10), rtol=1e-5)
    assert small.age == pytest.approx(0.2)
    for a, b in zip(small.overlays, large.overlays, strict=True):
        assert b.size == pytest.approx(10 * a.size)
        assert b.width == pytest.approx(10 * a.width)
        assert b.opacity == a.opacity


@pytest.mark.parametrize(
    ("name", "impurities"),
    [
        ("fresh_breath", {}),
        ("arctic_blue", {}),
        ("old_glacier", {}),
        ("weathered_white", {}),
        ("sea_ice", {"dust": 1e-7, "algae": 2e-9}),
    ],
)
def test_presets_absorb_as_ice_does_per_metre(name, impurities):
    """Within 3 % of pure ice by Warren and Brandt with these impurities; `depth` multiplies that."""
    medium = optics.ice(0.0, 0.0, **impurities)
    np.testing.assert_allclose(fz.ice_preset(name).medium.sigma_a, medium.sigma_a, rtol=0.03)
    np.testing.assert_allclose(fz.ice_preset(name, depth=8.0).medium.sigma_a, 8 * np.array(medium.sigma_a), rtol=0.03)
    # As deep as it is large: real ice at any size.
    np.testing.assert_allclose(fz.ice_preset(name, scale=5, depth=5).medium.sigma_a, medium.sigma_a, rtol=0.03)


def test_unknown_presets_name_the_nearest():
    with pytest.raises(KeyError, match="Did you mean 'arctic_blue'"):
        fz.ice_preset("artic_blue")
    with pytest.raises(ValueError, match="scale must be > 0"):
        fz.ice_preset("sea_ice", scale=0.0)
    with pytest.raises(ValueError, match="depth must be >= 0, got -1"):
        fz.ice_preset("sea_ice", depth=-1.0)


def test_the_presets_are_those_of_the_shader():
    assert find_input(ICE_INPUTS, "preset").choices == ("none", *ICE_PRESETS)


def test_overlay_defaults_follow_the_table():
    overlay = fz.Overlay()
    for row in OVERLAY_INPUTS:
        value = getattr(overlay, row.name)
        assert value == (row.default if isinstance(row.default, str) else pytest.approx(row.default)), row.name


def test_overlays_of_a_stage_come_in_the_order_of_their_names_in_metres(stage):
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    add_overlay(stage, ice, "b_frost", pattern=(TOKEN, "frost"), opacity=(FLOAT, 0.25))
    add_overlay(stage, ice, "a_cracks", pattern=(TOKEN, "cells"), width=(FLOAT, 2.0), color=(COLOR, Gf.Vec3f(1, 0, 0)))
    model, warnings = model_of(stage)
    assert warnings == []
    assert [o.pattern for o in model.overlays] == ["cells", "frost"]
    assert model.overlays[0].width == pytest.approx(0.02)
    assert model.overlays[1].opacity == pytest.approx(0.25)


def test_a_preset_gives_what_is_not_authored(stage):
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    ice.CreateInput("preset", TOKEN).Set("old_glacier")
    ice.CreateInput("age", FLOAT).Set(0.75)
    ice.CreateInput("preset_depth", FLOAT).Set(3.0)
    ice.CreateInput("eta", FLOAT).Set(1.33)
    ice.CreateInput("sigma_a", COLOR).Set(Gf.Vec3f(0.01, 0.02, 0.03))
    add_overlay(stage, ice, "dust", pattern=(TOKEN, "snow"))
    model, warnings = model_of(stage)
    preset = ICE_PRESETS["old_glacier"]
    assert warnings == []
    assert model.roughness == pytest.approx(preset.inputs["roughness"])
    assert len(model.overlays) == len(preset.overlays) + 1
    np.testing.assert_allclose(model.medium.sigma_s_prime, preset.sigma_s_prime)
    np.testing.assert_allclose(model.medium.sigma_a, [1, 2, 3], rtol=1e-5)
    assert model.medium.eta == pytest.approx(1.33)


def test_overlays_out_of_range_are_named(stage):
    ice = bind(stage, add_quad(stage, "/Quad"), "frazil:ice")
    add_overlay(stage, ice, "cracks", opacity=(FLOAT, 2.0), age_begin=(FLOAT, 0.8), age_end=(FLOAT, 0.3))
    ice.CreateInput("overlays:none", Sdf.ValueTypeNames.Token)
    model, warnings = model_of(stage)
    assert model.overlays[0].opacity == 1.0
    assert any("/Material/cracks: opacity must be in 0..1, got 2. 1 is used." in w for w in warnings)
    assert any("/Material/cracks: age_end must be >= age_begin, 0.8, got 0.3" in w for w in warnings)
    assert any("overlays:none must be connected to a frazil:overlay" in w for w in warnings)


def test_the_tables_are_those_in_the_docs():
    docs = (Path(__file__).parents[2] / "docs" / "material.md").read_text(encoding="utf-8")
    assert inputs_markdown(OVERLAY_INPUTS) in docs, "regenerate with inputs_markdown(OVERLAY_INPUTS)"
    assert presets_markdown() in docs, "regenerate with presets_markdown()"
