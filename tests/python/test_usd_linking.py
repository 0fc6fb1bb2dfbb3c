"""Light and shadow linking: collections of every kind, resolved to the scene's objects; mesh lights."""

import itertools

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade
from usd_stages import add_mesh, add_quad, load

import frazil as fz


@pytest.fixture
def stage(tmp_path):
    """Four squares in two groups, and a light."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    UsdGeom.Camera.Define(stage, "/Camera")
    for group, name in itertools.product("AB", "xy"):
        add_quad(stage, f"/World/{group}/{name}")
    UsdLux.SphereLight.Define(stage, "/Light")
    return stage


def link_of(stage, name="light"):
    light = UsdLux.LightAPI(stage.GetPrimAtPath("/Light"))
    return light.GetLightLinkCollectionAPI() if name == "light" else light.GetShadowLinkCollectionAPI()


def members(scene, name="light"):
    """Paths of the objects that the light lights, or that cast its shadows."""
    found = scene.lights[0].lit if name == "light" else scene.lights[0].shadow.casters
    if found is None:
        return {item.path for item in scene.objects}
    return {scene.objects[i].path for i in found.objects}


ALL = {"/World/A/x", "/World/A/y", "/World/B/x", "/World/B/y"}


@pytest.mark.parametrize("name", ["light", "shadow"])
@pytest.mark.parametrize(
    ("root", "includes", "excludes", "rule", "expected"),
    [
        (True, [], [], "expandPrims", ALL),
        (False, [], [], "expandPrims", set()),
        (False, ["/World/A"], [], "expandPrims", {"/World/A/x", "/World/A/y"}),
        (True, [], ["/World/A/x"], "expandPrims", ALL - {"/World/A/x"}),
        (False, ["/World"], ["/World/B"], "expandPrims", {"/World/A/x", "/World/A/y"}),
        (False, ["/World", "/World/B/y"], ["/World/B"], "expandPrims", ALL - {"/World/B/x"}),
        (False, ["/World/A/x", "/World/B"], [], "explicitOnly", {"/World/A/x"}),
    ],
)
def test_includes_and_excludes(stage, name, root, includes, excludes, rule, expected):
    link = link_of(stage, name)
    link.CreateIncludeRootAttr(root)
    link.CreateExpansionRuleAttr(rule)
    link.CreateIncludesRel().SetTargets(includes)
    link.CreateExcludesRel().SetTargets(excludes)
    scene = load(stage)
    assert members(scene, name) == expected
    assert members(scene, "shadow" if name == "light" else "light") == ALL
    assert not scene.warnings


def test_collections_within_collections(stage):
    inner = Usd.CollectionAPI.Apply(stage.GetPrimAtPath("/World/A"), "some")
    inner.IncludePath("/World/A")
    inner.ExcludePath("/World/A/y")
    outer = Usd.CollectionAPI.Apply(stage.GetPrimAtPath("/World/B"), "more")
    outer.IncludePath(inner.GetCollectionPath())
    outer.IncludePath("/World/B/y")
    link = link_of(stage)
    link.CreateIncludeRootAttr(False)
    link.CreateIncludesRel().SetTargets([outer.GetCollectionPath()])
    assert members(load(stage)) == {"/World/A/x", "/World/B/y"}


def test_path_expressions(stage):
    link = link_of(stage)
    link.CreateIncludeRootAttr(False)
    link.CreateMembershipExpressionAttr(Sdf.PathExpression("/World//x"))
    assert members(load(stage)) == {"/World/A/x", "/World/B/x"}


def test_circular_collections_are_named_and_what_they_hold_counts(stage):
    one = Usd.CollectionAPI.Apply(stage.GetPrimAtPath("/World/A"), "one")
    two = Usd.CollectionAPI.Apply(stage.GetPrimAtPath("/World/B"), "two")
    one.IncludePath(two.GetCollectionPath())
    two.IncludePath(one.GetCollectionPath())
    two.IncludePath("/World/B/y")
    link = link_of(stage)
    link.CreateIncludeRootAttr(False)
    link.CreateIncludesRel().SetTargets([one.GetCollectionPath()])
    scene = load(stage)
    assert any(w.startswith("/Light: collection lightLink must be valid") and "circular" in w for w in scene.warnings)
    assert members(scene) == {"/World/B/y"}


def test_native_instances_are_linked_one_by_one(stage):
    for name in ("one", "two"):
        prim = stage.DefinePrim(f"/World/{name}")
        prim.GetReferences().AddInternalReference("/World/A")
        prim.SetInstanceable(True)
    link = link_of(stage)
    link.CreateIncludeRootAttr(False)
    link.CreateIncludesRel().SetTargets(["/World/one", "/World/two/y"])
    assert members(load(stage)) == {"/World/one/x", "/World/one/y", "/World/two/y"}


def test_point_instancers_are_linked_as_a_whole_or_by_prototype(stage):
    instancers = []
    for name in ("P", "Q"):
        instancer = UsdGeom.PointInstancer.Define(stage, f"/World/{name}")
        instancer.CreatePositionsAttr([Gf.Vec3f(0), Gf.Vec3f(3, 0, 0)])
        instancer.CreateProtoIndicesAttr([0, 1])
        instancer.CreatePrototypesRel().SetTargets(["/World/A/x", "/World/B/x"])
        instancers.append(instancer)
    link = link_of(stage)
    link.CreateIncludeRootAttr(False)
    link.CreateIncludesRel().SetTargets(["/World/P"])
    assert members(load(stage)) == {"/World/P[0]/x", "/World/P[1]/x"}
    link.CreateIncludesRel().SetTargets(["/World/B/x"])
    assert members(load(stage)) == {"/World/B/x", "/World/P[1]/x", "/World/Q[1]/x"}


def test_lights_share_their_sets(stage):
    other = UsdLux.SphereLight.Define(stage, "/Other")
    for light in (UsdLux.LightAPI(stage.GetPrimAtPath("/Light")), UsdLux.LightAPI(other)):
        link = light.GetLightLinkCollectionAPI()
        link.CreateIncludeRootAttr(False)
        link.CreateIncludesRel().SetTargets(["/World/A"])
    lights = load(stage).lights
    assert len(lights) == 2
    assert lights[0].lit.objects == lights[1].lit.objects == [0, 1]


def test_a_mesh_light_shines_from_its_object(stage):
    prim = stage.GetPrimAtPath("/World/B/y")
    api = UsdLux.MeshLightAPI.Apply(prim)
    UsdLux.LightAPI(api).CreateIntensityAttr(5)
    scene = load(stage)
    light = next(item for item in scene.lights if isinstance(item.shape, fz.MeshLight))
    assert scene.objects[light.shape.object].path == light.path == "/World/B/y"
    assert not light.shape.is_material
    np.testing.assert_allclose(light.radiance, 5)
    assert not scene.warnings


def test_mesh_lights_without_area_are_left_out(stage):
    mesh = add_mesh(stage, "/World/B/flat", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [3], [0, 1, 2])
    UsdLux.MeshLightAPI.Apply(mesh.GetPrim())
    scene = load(stage)
    assert not any(isinstance(item.shape, fz.MeshLight) for item in scene.lights)
    assert any(w.startswith("/World/B/flat: area must be > 0") for w in scene.warnings), scene.warnings


def test_emissive_materials_become_lights(stage):
    material = UsdShade.Material.Define(stage, "/Glow")
    shader = UsdShade.Shader.Define(stage, "/Glow/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set((1, 2, 3))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/World/A/x")).Bind(material)
    scene = load(stage)
    lights = [item for item in scene.lights if isinstance(item.shape, fz.MeshLight)]
    assert [light.path for light in lights] == ["/World/A/x"]
    assert lights[0].shape.is_material
    assert lights[0].shape.is_two_sided
    np.testing.assert_allclose(scene.triangle_emission(lights[0].shape.object), [(1, 2, 3)] * 2)


@pytest.mark.parametrize("name", ["light", "shadow"])
def test_links_to_what_does_not_exist_are_named(stage, name):
    link = link_of(stage, name)
    link.CreateIncludeRootAttr(False)
    link.CreateIncludesRel().SetTargets(["/World/A", "/World/B/z"])
    scene = load(stage)
    assert members(scene, name) == {"/World/A/x", "/World/A/y"}
    said = (
        f"/Light: collection {name}Link must hold prims of the stage, got /World/B/z. The nearest object is /World/B/"
    )
    assert [w[: len(said)] for w in scene.warnings] == [said]
