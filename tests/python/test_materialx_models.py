"""MaterialX: what becomes of standard_surface and open_pbr_surface."""

import numpy as np
import OpenImageIO as oiio
import pytest
from mtlx_documents import fed, image, model_of, refer, surface, value
from pxr import Gf
from test_usd_materials import COLOR, FLOAT, bind, write_image
from usd_stages import add_quad, load, new_stage

import frazil as fz
from frazil.usd.mtlx_library import library
from frazil.usd.surface_models import MODELS


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


@pytest.mark.parametrize(
    ("kind", "base", "metal", "rough", "ior", "coat"),
    [
        ("standard_surface", "base", "metalness", "specular_roughness", "specular_IOR", "coat"),
        ("open_pbr_surface", "base_weight", "base_metalness", "specular_roughness", "specular_ior", "coat_weight"),
    ],
)
def test_opaque_surfaces_become_standard_materials(stage, tmp_path, kind, base, metal, rough, ior, coat):
    inputs = (
        value(base, "float", "0.5")
        + value("base_color", "color3", "0.8, 0.4, 0.2")
        + value(metal, "float", "0.25")
        + value(rough, "float", "0.35")
        + value(ior, "float", "1.4")
        + value(coat, "float", "0.6")
        + value("coat_roughness", "float", "0.15")
    )
    model, said = refer(stage, tmp_path, surface(kind, inputs))
    assert said == []
    assert isinstance(model, fz.StandardMaterial)
    np.testing.assert_allclose(model.diffuse_color, [0.4, 0.2, 0.1], rtol=1e-5)
    found = [model.metallic, model.roughness, model.ior, model.clearcoat, model.clearcoat_roughness]
    np.testing.assert_allclose(found, [0.25, 0.35, 1.4, 0.6, 0.15], rtol=1e-5)
    np.testing.assert_allclose(model.emissive_color, 0)


def test_defaults_are_those_of_the_definition(stage, tmp_path):
    model, said = refer(stage, tmp_path, surface("standard_surface", ""))
    assert said == []
    np.testing.assert_allclose(model.diffuse_color, 0.8, rtol=1e-5)
    assert model.roughness == pytest.approx(0.2)
    model, _ = refer(stage, tmp_path, surface("open_pbr_surface", ""))
    assert model.roughness == pytest.approx(0.3)


def test_emission_opacity_and_a_tinted_reflection(stage, tmp_path):
    inputs = (
        value("emission", "float", "3")
        + value("emission_color", "color3", "1, 0.5, 0.25")
        + value("opacity", "color3", "0.5, 0.5, 0.5")
        + value("specular_color", "color3", "1, 0, 0")
        + value("specular", "float", "0.5")
    )
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert said == []
    np.testing.assert_allclose(model.emissive_color, [3, 1.5, 0.75], rtol=1e-5)
    assert model.opacity == pytest.approx(0.5)
    assert model.use_specular_workflow
    np.testing.assert_allclose(model.specular_color, [0.02, 0, 0], rtol=1e-5)  # half of 4 %, red


def test_subsurface_has_its_color_and_radius(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.1)
    inputs = (
        value("subsurface", "float", "1")
        + value("subsurface_color", "color3", "0.5, 0.7, 0.9")
        + value("subsurface_radius", "color3", "0.1, 0.2, 0.3")
        + value("subsurface_scale", "float", "2")
        + value("specular_IOR", "float", "1.31")
    )
    ice, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert said == []
    assert isinstance(ice, fz.IceMaterial)
    medium = ice.medium
    np.testing.assert_allclose(1 / (medium.sigma_s_prime + medium.sigma_a), [0.02, 0.04, 0.06], rtol=1e-4)
    np.testing.assert_allclose(fz.MultipleScattering(medium, single=1.0).albedo, [0.5, 0.7, 0.9], rtol=1e-3)
    assert (ice.translucency, ice.refraction, ice.overlays) == (1.0, 0.0, [])


def test_subsurface_of_both_models_is_frazil_ice_to_the_last_field(stage):
    from frazil.content import content_hash

    color, scale = Gf.Vec3f(0.78, 0.9, 0.95), Gf.Vec3f(0.3, 0.5, 0.7)
    words = {
        "frazil:ice": {"albedo": color, "mean_free_path": scale * 0.1, "refraction": 0.0, "roughness": 0.22},
        "ND_standard_surface_surfaceshader": {
            "subsurface": 1.0,
            "subsurface_color": color,
            "subsurface_radius": scale,
            "subsurface_scale": 0.1,
            "specular_IOR": 1.31,
            "specular_roughness": 0.22,
        },
        "ND_open_pbr_surface_surfaceshader": {
            "subsurface_weight": 1.0,
            "subsurface_color": color,
            "subsurface_radius": 0.1,
            "subsurface_radius_scale": scale,
            "specular_ior": 1.31,
            "specular_roughness": 0.22,
        },
    }
    for number, (kind, inputs) in enumerate(words.items()):
        shader = bind(stage, add_quad(stage, f"/Q{number}"), kind, f"/M{number}")
        for name, given in inputs.items():
            shader.CreateInput(name, FLOAT if isinstance(given, float) else COLOR).Set(given)
    scene = load(stage)
    assert scene.warnings == []
    models = [model_of(scene, i) for i in range(3)]
    for model in models[1:]:
        np.testing.assert_allclose(model.medium.sigma_a, models[0].medium.sigma_a, rtol=1e-4)
        model.medium = models[0].medium
        assert content_hash(model) == content_hash(models[0])


def test_open_pbr_subsurface_is_the_same_medium(stage, tmp_path):
    inputs = (
        value("subsurface_weight", "float", "1")
        + value("subsurface_color", "color3", "0.5, 0.7, 0.9")
        + value("subsurface_radius", "float", "0.2")
        + value("subsurface_radius_scale", "color3", "1, 0.5, 0.25")
    )
    ice, said = refer(stage, tmp_path, surface("open_pbr_surface", inputs))
    assert said == []
    medium = ice.medium
    np.testing.assert_allclose(1 / (medium.sigma_s_prime + medium.sigma_a), [0.2, 0.1, 0.05], rtol=1e-4)
    assert medium.eta == pytest.approx(1.5)


def test_transmission_absorbs_to_its_color_over_its_depth(tmp_path):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    inputs = (
        value("transmission", "float", "1")
        + value("transmission_color", "color3", "0.25, 0.5, 0.75")
        + value("transmission_depth", "float", "50")
        + value("specular_roughness", "float", "0.1")
        + value("transmission_extra_roughness", "float", "0.2")
    )
    ice, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert said == []
    np.testing.assert_allclose(np.exp(-0.5 * np.asarray(ice.medium.sigma_a)), [0.25, 0.5, 0.75], rtol=1e-5)
    assert (ice.refraction, ice.translucency) == (1.0, 0.0)
    assert ice.refraction_roughness == pytest.approx(0.3)


def test_transmission_without_a_depth_tints_the_boundary(stage, tmp_path):
    inputs = value("transmission", "float", "1") + value("transmission_color", "color3", "0.9, 0.6, 0.3")
    model, warned = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert warned == []
    assert model.refraction_tint == pytest.approx((0.9, 0.6, 0.3))
    assert model.medium.sigma_a == pytest.approx((0.0, 0.0, 0.0))


def test_transmission_that_scatters_has_a_core(stage, tmp_path):
    inputs = (
        value("transmission_weight", "float", "1")
        + value("transmission_color", "color3", "0.5, 0.5, 0.5")
        + value("transmission_depth", "float", "2")
        + value("transmission_scatter", "color3", "0.2, 0.2, 2.0")
        + value("transmission_scatter_anisotropy", "float", "0.5")
    )
    ice, _ = refer(stage, tmp_path, surface("open_pbr_surface", inputs))
    extinction = np.log(2) / 2
    np.testing.assert_allclose(ice.medium.sigma_s_prime, [0.05, 0.05, 0.5], rtol=1e-5)
    # Blue would be negative: all are raised until it is 0 [OpenPBR].
    raised = 1.0 - extinction
    np.testing.assert_allclose(ice.medium.sigma_a, [extinction - 0.1 + raised] * 2 + [0.0], rtol=1e-4, atol=1e-6)
    assert ice.translucency == 1.0


def test_what_is_not_let_through_lies_over_the_ice(stage, tmp_path):
    inputs = (
        value("transmission", "float", "0.75")
        + value("base_color", "color3", "1, 0.5, 0")
        + value("base", "float", "1")
        + value("transmission_depth", "float", "1")
    )
    ice, _ = refer(stage, tmp_path, surface("standard_surface", inputs))
    (overlay,) = ice.overlays
    assert overlay.opacity == pytest.approx(0.25)
    assert overlay.scattering == 1.0
    np.testing.assert_allclose(overlay.color, [1, 0.5, 0])


def test_what_is_not_carried_over_is_named_once_and_only_where_it_matters(stage, tmp_path):
    inputs = (
        value("sheen", "float", "0.5")
        + value("thin_walled", "boolean", "true")
        + value("coat_IOR", "float", "1.5")  # its default
        + value("thin_film_thickness", "float", "300")
    )
    _, said = refer(stage, tmp_path, surface("standard_surface", inputs))
    assert len(said) == 1
    assert "/Looks/Mine/shader: sheen, thin_film_thickness, thin_walled: not carried over" in said[0]


def test_what_has_no_weight_is_not_named(stage, tmp_path):
    inputs = (
        value("coat_color", "color3", "1, 0, 0")
        + value("sheen_color", "color3", "1, 0, 0")
        + value("thin_film_IOR", "float", "2")
        + value("transmission_dispersion", "float", "20")
    )
    assert refer(stage, tmp_path, surface("standard_surface", inputs))[1] == []
    _, said = refer(stage, tmp_path, surface("standard_surface", inputs + value("coat", "float", "0.1")))
    assert said == ["/Looks/Mine/shader: coat_color: not carried over (docs/material.md)."]


@pytest.mark.parametrize(("kind", "prefix"), [("standard_surface", ""), ("open_pbr_surface", "geometry_")])
def test_a_coat_with_another_normal_than_the_base_is_named(stage, tmp_path, kind, prefix):
    write_image(tmp_path / "n.exr", np.full((2, 2, 3), (0.5, 0.5, 1.0)), oiio.FLOAT)
    graph = image("pic", "n.exr", "vector3")
    graph += f'<normalmap name="n" type="vector3">{fed("in", "vector3", "pic")}</normalmap>'
    coat = value("coat" if kind == "standard_surface" else "coat_weight", "float", "0.5")
    base, own = (fed(f"{prefix}{n}", "vector3", "n") for n in ("normal", "coat_normal"))
    for inputs, is_named in ((base + own + coat, False), (base + coat, True), (own + coat, True), (base, False)):
        _, said = refer(stage, tmp_path, surface(kind, inputs, graph))
        expected = [f"/Looks/Mine/shader: {prefix}coat_normal: not carried over (docs/material.md)."]
        assert said == (expected if is_named else []), inputs


def test_an_opacity_with_a_color_is_its_mean_and_named(stage, tmp_path):
    model, said = refer(stage, tmp_path, surface("standard_surface", value("opacity", "color3", "1, 0.5, 0")))
    assert model.opacity == pytest.approx(0.5)
    assert said == ["/Looks/Mine/shader: opacity has a color, which is not supported. Its mean is used."]
    write_image(tmp_path / "o.exr", np.full((2, 2, 3), (0.9, 0.6, 0.3)), oiio.FLOAT)
    inputs = fed("opacity", "color3", "pic")
    model, said = refer(stage, tmp_path, surface("standard_surface", inputs, image("pic", "o.exr")))
    np.testing.assert_allclose(model.opacity.texture.texels, 0.6, rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "text", "rule", "used"),
    [
        ("specular_IOR", "0.5", ">= 1", "1"),
        ("specular_IOR", "nan", "finite", "1.5"),
        ("coat", "1.5", "in 0..1", "1"),
        ("subsurface_scale", "-1", ">= 0", "0"),
        ("transmission_scatter_anisotropy", "-2", "in -1..1", "-1"),
    ],
)
def test_values_out_of_the_definitions_range_are_named(stage, name, text, rule, used):
    shader = bind(stage, add_quad(stage, "/Quad"), "ND_standard_surface_surfaceshader", context="mtlx")
    shader.CreateInput("transmission", FLOAT).Set(0.1)
    shader.CreateInput("subsurface", FLOAT).Set(0.9)
    shader.CreateInput("transmission_depth", FLOAT).Set(1.0)
    shader.CreateInput(name, FLOAT).Set(float(text))
    scene = load(stage)
    expected = f"/Material/Surface: {name} must be {rule}, got {text}. {used} is used."
    if name.startswith("transmission"):  # read where there is more of it than of subsurface
        shader.GetInput("subsurface").Set(0.0)
        scene = load(stage)
    assert expected in scene.warnings


def test_every_input_of_the_models_is_carried_or_listed():
    for model in MODELS.values():
        listed = {n.strip() for names, _, _ in model.not_carried for n in names.split(",")}
        every = {i.getName() for i in library().getNodeDef(model.node).getActiveInputs()}
        assert every == listed | model.carried, model.node


def test_the_lists_are_those_in_the_docs():
    from pathlib import Path

    from frazil.usd.surface_models import not_carried_markdown

    docs = (Path(__file__).parents[2] / "docs" / "material.md").read_text(encoding="utf-8")
    assert not_carried_markdown() in docs, "regenerate with not_carried_markdown()"
