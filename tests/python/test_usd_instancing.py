"""Native instances and PointInstancers: shared meshes, nesting, masks, prototypes that draw nothing of their own."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade
from usd_stages import add_quad, load, new_stage, world_positions


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


def origin(scene, number):
    return scene.objects[number].matrix[3, :3]


def by_path(scene):
    return {o.path: o for o in scene.objects}


def test_native_instances_share_a_mesh(stage):
    stage.CreateClassPrim("/_Model")
    add_quad(stage, "/_Model/Quad").AddTranslateOp().Set(Gf.Vec3d(0, 1, 0))
    for number in range(3):
        prim = UsdGeom.Xform.Define(stage, f"/I{number}")
        prim.AddTranslateOp().Set(Gf.Vec3d(number, 0, 0))
        prim.GetPrim().GetReferences().AddInternalReference("/_Model")
        prim.GetPrim().SetInstanceable(True)
    scene = load(stage)
    assert [o.path for o in scene.objects] == ["/I0/Quad", "/I1/Quad", "/I2/Quad"]
    assert len(scene.mesh_paths) == 1
    for number in range(3):
        np.testing.assert_allclose(origin(scene, number), [number, 1, 0])


def test_nested_native_instances_share_a_mesh(stage):
    stage.CreateClassPrim("/_Leaf")
    add_quad(stage, "/_Leaf/Quad")
    stage.CreateClassPrim("/_Tree")
    for number in range(2):
        leaf = UsdGeom.Xform.Define(stage, f"/_Tree/L{number}")
        leaf.AddTranslateOp().Set(Gf.Vec3d(0, number, 0))
        leaf.GetPrim().GetReferences().AddInternalReference("/_Leaf")
        leaf.GetPrim().SetInstanceable(True)
    for number in range(2):
        tree = UsdGeom.Xform.Define(stage, f"/T{number}")
        tree.AddTranslateOp().Set(Gf.Vec3d(10 * number, 0, 0))
        tree.GetPrim().GetReferences().AddInternalReference("/_Tree")
        tree.GetPrim().SetInstanceable(True)
    scene = load(stage)
    assert len(scene.objects) == 4
    assert len(scene.mesh_paths) == 1
    np.testing.assert_allclose(by_path(scene)["/T1/L1/Quad"].matrix[3, :3], [10, 1, 0])


def test_instances_keep_their_own_materials(stage):
    stage.CreateClassPrim("/_Model")
    add_quad(stage, "/_Model/Quad")
    for number in range(2):
        material = UsdShade.Material.Define(stage, f"/M{number}")
        shader = UsdShade.Shader.Define(stage, f"/M{number}/S")
        shader.CreateIdAttr("UsdPreviewSurface")
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        prim = UsdGeom.Xform.Define(stage, f"/I{number}").GetPrim()
        prim.GetReferences().AddInternalReference("/_Model")
        prim.SetInstanceable(True)
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)
    scene = load(stage)
    assert len(scene.mesh_paths) == 1
    assert [scene.materials[o.material].path for o in scene.objects] == ["/M0", "/M1"]


def define_instancer(stage, path="/Points", positions=((0, 0, 0), (5, 0, 0), (0, 5, 0)), prototypes=(0, 0, 0)):
    instancer = UsdGeom.PointInstancer.Define(stage, path)
    instancer.CreatePositionsAttr([Gf.Vec3f(*p) for p in positions])
    instancer.CreateProtoIndicesAttr(list(prototypes))
    return instancer


def test_point_instancer(stage):
    instancer = define_instancer(stage, prototypes=(0, 1, 0))
    instancer.AddTranslateOp().Set(Gf.Vec3d(0, 0, 7))
    first = UsdGeom.Xform.Define(stage, "/Points/First")
    first.AddTranslateOp().Set(Gf.Vec3d(0, 0, 1))
    add_quad(stage, "/Points/First/Quad").AddScaleOp().Set(Gf.Vec3f(2))
    add_quad(stage, "/Points/Second")
    instancer.CreatePrototypesRel().SetTargets(["/Points/First", "/Points/Second"])
    instancer.CreateScalesAttr([Gf.Vec3f(1), Gf.Vec3f(3), Gf.Vec3f(1)])
    turn = Gf.Rotation(Gf.Vec3d(0, 0, 1), 90).GetQuat()
    instancer.CreateOrientationsAttr([Gf.Quath(1), Gf.Quath(turn), Gf.Quath(1)])
    scene = load(stage)
    assert scene.warnings == []
    objects = by_path(scene)
    assert sorted(objects) == ["/Points[0]/First/Quad", "/Points[1]/Second", "/Points[2]/First/Quad"]
    assert len(scene.mesh_paths) == 2
    np.testing.assert_allclose(objects["/Points[2]/First/Quad"].matrix[3, :3], [0, 5, 8])
    np.testing.assert_allclose(objects["/Points[2]/First/Quad"].matrix[0, :3], [2, 0, 0], atol=1e-6)
    # x of the prototype: three times as long, turned to y
    np.testing.assert_allclose(objects["/Points[1]/Second"].matrix[0, :3], [0, 3, 0], atol=2e-3)
    np.testing.assert_allclose(objects["/Points[1]/Second"].matrix[3, :3], [5, 0, 7])


def test_masked_instances(stage):
    instancer = define_instancer(stage)
    add_quad(stage, "/Points/Quad")
    instancer.CreatePrototypesRel().SetTargets(["/Points/Quad"])
    instancer.CreateIdsAttr([10, 11, 12])
    instancer.CreateInvisibleIdsAttr([11])
    assert [o.path for o in load(stage).objects] == ["/Points[0]/Quad", "/Points[2]/Quad"]
    instancer.DeactivateId(12)
    assert [o.path for o in load(stage).objects] == ["/Points[0]/Quad"]


def test_prototypes_may_be_overs_elsewhere(stage):
    instancer = define_instancer(stage)
    add_quad(stage, "/Prototypes/Quad")
    stage.GetPrimAtPath("/Prototypes").SetSpecifier(Sdf.SpecifierOver)
    instancer.CreatePrototypesRel().SetTargets(["/Prototypes/Quad"])
    scene = load(stage)
    assert len(scene.objects) == 3


def test_nested_point_instancers_inside_native_instances(stage):
    stage.CreateClassPrim("/_Model")
    outer = define_instancer(stage, "/_Model/Outer", [(0, 0, 0), (100, 0, 0)], [0, 0])
    inner = define_instancer(stage, "/_Model/Outer/Inner", [(0, 0, 0), (10, 0, 0), (20, 0, 0)], [0, 0, 0])
    add_quad(stage, "/_Model/Outer/Inner/Quad")
    inner.CreatePrototypesRel().SetTargets(["/_Model/Outer/Inner/Quad"])
    outer.CreatePrototypesRel().SetTargets(["/_Model/Outer/Inner"])
    for number in range(2):
        prim = UsdGeom.Xform.Define(stage, f"/I{number}")
        prim.AddTranslateOp().Set(Gf.Vec3d(1000 * number, 0, 0))
        prim.GetPrim().GetReferences().AddInternalReference("/_Model")
        prim.GetPrim().SetInstanceable(True)
    scene = load(stage)
    assert len(scene.mesh_paths) == 1
    x = sorted(round(o.matrix[3, 0]) for o in scene.objects)
    assert x == sorted(1000 * a + 100 * b + 10 * c for a in range(2) for b in range(2) for c in range(3))
    assert "/I1/Outer[1]/Inner[2]/Quad" in by_path(scene)


def test_native_instances_as_prototypes(stage):
    stage.CreateClassPrim("/_Model")
    add_quad(stage, "/_Model/Quad")
    instancer = define_instancer(stage)
    prim = stage.DefinePrim("/Points/Proto", "Xform")
    prim.GetReferences().AddInternalReference("/_Model")
    prim.SetInstanceable(True)
    instancer.CreatePrototypesRel().SetTargets(["/Points/Proto"])
    scene = load(stage)
    assert len(scene.objects) == 3
    assert len(scene.mesh_paths) == 1


def test_broken_instancers_are_named(stage):
    add_quad(stage, "/Good")
    instancer = define_instancer(stage, prototypes=(0, 7, -1))
    add_quad(stage, "/Points/Quad")
    instancer.CreatePrototypesRel().SetTargets(["/Points/Quad", "/Nowhere"])
    scene = load(stage)
    assert len(scene.objects) == 2
    assert any("protoIndices must be in 0..1, got 7" in w for w in scene.warnings)
    assert any("/Nowhere" in w for w in scene.warnings)
    instancer.GetPositionsAttr().Set([Gf.Vec3f(0)])
    scene = load(stage)
    assert len(scene.objects) == 1
    assert any(w.startswith("/Points: positions must have 3 values") for w in scene.warnings)


def test_an_instancer_that_instances_itself_ends(stage):
    add_quad(stage, "/Good")
    instancer = define_instancer(stage)
    instancer.CreatePrototypesRel().SetTargets(["/Points"])
    scene = load(stage)
    assert len(scene.objects) == 1
    assert any("holds the instancer itself" in w for w in scene.warnings)
    # and through another one
    other = define_instancer(stage, "/Other")
    other.CreatePrototypesRel().SetTargets(["/Points"])
    instancer.GetPrototypesRel().SetTargets(["/Other"])
    scene = load(stage)
    assert len(scene.objects) == 1
    assert any("instances itself" in w for w in scene.warnings)


def test_more_instances_than_memory_holds_are_refused(stage, monkeypatch):
    from frazil.usd import instancing

    monkeypatch.setattr(instancing, "_MOST_INSTANCES", 2)
    add_quad(stage, "/Good")
    instancer = define_instancer(stage)
    add_quad(stage, "/Points/Quad")
    instancer.CreatePrototypesRel().SetTargets(["/Points/Quad"])
    scene = load(stage)
    assert [o.path for o in scene.objects] == ["/Good"]
    assert any("/Points: must have at most 2 instances in all, got 3" in w for w in scene.warnings)


def test_scale_of_zero_leaves_out_that_instance_only(stage):
    instancer = define_instancer(stage)
    add_quad(stage, "/Points/Quad")
    instancer.CreatePrototypesRel().SetTargets(["/Points/Quad"])
    instancer.CreateScalesAttr([Gf.Vec3f(1), Gf.Vec3f(0), Gf.Vec3f(1)])
    scene = load(stage)
    assert len(scene.objects) == 2
    assert any(w.startswith("/Points[1]/Quad: its transform cannot be inverted") for w in scene.warnings)


def test_many_instances(stage):
    count = 20000
    instancer = UsdGeom.PointInstancer.Define(stage, "/Points")
    positions = np.random.default_rng(1).random((count, 3)).astype(np.float32)
    from pxr import Vt

    instancer.CreatePositionsAttr(Vt.Vec3fArray.FromNumpy(positions))
    instancer.CreateProtoIndicesAttr(Vt.IntArray(count, 0))
    add_quad(stage, "/Points/Quad")
    instancer.CreatePrototypesRel().SetTargets(["/Points/Quad"])
    scene = load(stage)
    assert len(scene.objects) == count
    assert len(scene.mesh_paths) == 1
    np.testing.assert_allclose(origin(scene, 1234), positions[1234], rtol=1e-6)


def test_payload_asset_instanced_twice_reads_its_mesh_once(tmp_path):
    model = Usd.Stage.CreateNew(str(tmp_path / "model.usda"))
    UsdGeom.Xform.Define(model, "/Model")
    add_quad(model, "/Model/Quad")
    model.SetDefaultPrim(model.GetPrimAtPath("/Model"))
    model.Save()
    stage = new_stage(tmp_path / "s.usda")
    for number in range(2):
        prim = stage.DefinePrim(f"/I{number}", "Xform")
        prim.GetPayloads().AddPayload(Sdf.Payload("./model.usda"))
        prim.SetInstanceable(True)
    scene = load(stage)
    assert len(scene.objects) == 2
    assert len(scene.mesh_paths) == 1
    assert world_positions(scene).shape == (4, 3)
