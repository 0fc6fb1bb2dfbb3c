"""Displacement from USD: true shape, points on it, refinement to the image, subsets, and what cannot be."""

import numpy as np
import OpenImageIO as oiio
import pytest
from pxr import Gf, Sdf, UsdGeom, UsdShade
from test_usd_materials import FLOAT, TOKEN, bind, connect_texture, write_image
from usd_stages import TEXCOORDS, add_mesh, add_quad, load, new_stage, set_primvar, world_mesh

import frazil as fz
from frazil.usd.material_inputs import DISPLACEMENT_INPUTS, inputs_markdown


def displacing(stage, prim, shader_id="frazil:displacement", surface="frazil:ice", path="/Material"):
    bind(stage, prim, surface, path)
    material = UsdShade.Material.Get(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Shape")
    shader.CreateIdAttr(shader_id)
    material.CreateDisplacementOutput().ConnectToSource(shader.ConnectableAPI(), "displacement")
    return shader


def with_st(quad, repeat=1):
    corners = ((0, 0), (repeat, 0), (repeat, repeat), (0, repeat))
    set_primvar(quad, "st", TEXCOORDS, "vertex", [Gf.Vec2f(*p) for p in corners])
    return quad


def connect_height(stage, shader, name, file, **inputs):
    texture = connect_texture(stage, shader, name, FLOAT, file, "r", **inputs)
    texture.GetInput("st").ClearSources()
    for wrap in ("wrapS", "wrapT"):
        texture.CreateInput(wrap, TOKEN).Set("repeat")
    return texture


@pytest.fixture
def wave(tmp_path):
    """A height image: one sine across."""
    levels = np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64)
    write_image(tmp_path / "wave.exr", np.tile(levels[None, :, None], (4, 1, 1)), oiio.FLOAT)
    return "./wave.exr"


def wave_length(height):
    s = (np.arange(20000) + 0.5) / 20000
    return np.sqrt(1 + (2 * np.pi * height * np.cos(2 * np.pi * s)) ** 2).mean()


def test_a_wave_has_its_area_and_its_points(tmp_path, wave):
    """In centimetres, under a scale: the shape, the sum of the points' areas, and their normals are the wave's."""
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.01)
    quad = with_st(add_quad(stage, "/Quad"))
    quad.AddScaleOp().Set(Gf.Vec3f(100, 100, 100))  # a metre
    shader = displacing(stage, quad)
    connect_height(stage, shader, "height", wave, scale=(Sdf.ValueTypeNames.Float4, Gf.Vec4f(5)))
    scene = load(stage)
    assert scene.warnings == []
    mesh = world_mesh(scene)
    assert mesh.positions[:, 2].max() == pytest.approx(0.05, rel=0.01)
    assert mesh.area == pytest.approx(wave_length(0.05), rel=2e-3)
    points = fz.poisson_points(mesh, 0.02)
    assert points.areas.sum() == pytest.approx(mesh.area, rel=1e-4)
    s = points.positions[:, 0]
    inside = (s > 0.05) & (s < 0.95)
    slope = 2 * np.pi * 0.05 * np.cos(2 * np.pi * s[inside])
    expected = np.stack([-slope, np.zeros_like(slope), np.ones_like(slope)], axis=1) / np.hypot(1, slope)[:, None]
    assert (np.sum(points.normals[inside] * expected, axis=1) > 0.998).all()


def test_edges_are_a_texel_long_or_as_asked(tmp_path, wave):
    stage = new_stage(tmp_path / "s.usda")
    shader = displacing(stage, with_st(add_quad(stage, "/Quad")))
    connect_height(stage, shader, "height", wave, scale=(Sdf.ValueTypeNames.Float4, Gf.Vec4f(1e-4)))

    def longest():
        mesh = load(stage).mesh(0)
        corners = mesh.positions[mesh.triangles]
        return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()

    assert 1 / 128 < longest() <= 1.01 / 64
    shader.CreateInput("edge_length", FLOAT).Set(0.1)
    assert 0.05 < longest() <= 0.101


def test_too_fine_an_edge_is_named_with_what_is_used(tmp_path, wave):
    stage = new_stage(tmp_path / "s.usda")
    shader = displacing(stage, with_st(add_quad(stage, "/Quad")))
    connect_height(stage, shader, "height", wave)
    shader.CreateInput("edge_length", FLOAT).Set(1e-5)
    scene = load(stage)
    assert len(scene.mesh(0).triangles) <= 2_000_000
    (said,) = scene.warnings
    assert said.startswith("/Quad: displacement wants edges of 1e-05 m, which would need more than 2000000 triangles")


@pytest.mark.parametrize("kind", ["preview", "mtlx", "mtlx_vector", "own_vector"])
def test_every_way_to_say_it_moves_the_surface_alike(tmp_path, kind):
    stage = new_stage(tmp_path / "s.usda", meters_per_unit=0.1)
    quad = with_st(add_quad(stage, "/Quad"))
    vector = Sdf.ValueTypeNames.Float3
    if kind == "preview":
        shader = bind(stage, quad, "UsdPreviewSurface")
        UsdShade.Material.Get(stage, "/Material").CreateDisplacementOutput().ConnectToSource(
            shader.ConnectableAPI(), "displacement"
        )
        shader.CreateInput("displacement", FLOAT).Set(0.25)
    elif kind == "mtlx":
        shader = displacing(stage, quad, "ND_displacement_float")
        shader.CreateInput("displacement", FLOAT).Set(0.5)
        shader.CreateInput("scale", FLOAT).Set(0.5)
    elif kind == "mtlx_vector":
        shader = displacing(stage, quad, "ND_displacement_vector3")
        shader.CreateInput("displacement", vector).Set(Gf.Vec3f(0, 0, 0.25))
    else:
        shader = displacing(stage, quad)
        shader.CreateInput("vector", vector).Set(Gf.Vec3f(0, 0, 0.25))
        shader.CreateInput("space", TOKEN).Set("object")
    scene = load(stage)
    assert scene.warnings == []
    np.testing.assert_allclose(scene.mesh(0).positions[:, 2], 0.25, rtol=1e-5)


def test_patterns_displace(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    shader = displacing(stage, add_quad(stage, "/Quad"))
    shader.CreateInput("height", FLOAT).Set(-0.02)
    shader.CreateInput("pattern", TOKEN).Set("cells")
    shader.CreateInput("size", FLOAT).Set(0.3)
    shader.CreateInput("width", FLOAT).Set(0.03)
    shader.CreateInput("feather", FLOAT).Set(0.02)
    scene = load(stage)
    assert scene.warnings == []
    height = scene.mesh(0).positions[:, 2]
    assert height.min() < -0.015
    assert height.max() == pytest.approx(0, abs=1e-6)
    assert 0.02 < (height < -0.01).mean() < 0.5  # lines, not all of it


def test_subsets_are_displaced_apart_and_stay_joined(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    points = [(x, y, 0) for y in range(2) for x in range(3)]
    mesh = add_mesh(stage, "/Strip", points, [4, 4], [0, 1, 4, 3, 1, 2, 5, 4])
    left = UsdGeom.Subset.CreateGeomSubset(mesh, "left", "face", [0], "materialBind", "nonOverlapping")
    shader = displacing(stage, left)
    shader.CreateInput("height", FLOAT).Set(0.1)
    shader.CreateInput("edge_length", FLOAT).Set(0.25)
    scene = load(stage)
    by_path = {o.path: scene.mesh(o.mesh) for o in scene.objects}
    rest, moved = by_path["/Strip"], by_path["/Strip/left"]
    assert moved.positions[moved.positions[:, 0] < 0.9][:, 2].min() == pytest.approx(0.1)
    assert rest.positions[rest.positions[:, 0] > 1.1][:, 2].max() == 0.0

    def seam(m):
        return sorted(map(tuple, np.round(m.positions[np.isclose(m.positions[:, 0], 1)], 5)))

    assert seam(rest) == seam(moved)


def test_subdivision_surfaces_and_spheres_are_displaced(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    sphere = UsdGeom.Sphere.Define(stage, "/Sphere")
    shader = displacing(stage, sphere)
    shader.CreateInput("height", FLOAT).Set(0.5)
    scene = load(stage)
    used = np.unique(scene.mesh(0).triangles)
    np.testing.assert_allclose(np.linalg.norm(scene.mesh(0).positions[used], axis=1), 1.5, rtol=1e-3)


def test_ice_on_a_displaced_body_renders_the_same_with_one_and_two_threads(tmp_path, wave):
    stage = new_stage(tmp_path / "s.usda")
    shader = displacing(stage, UsdGeom.Sphere.Define(stage, "/Sphere"))
    connect_height(stage, shader, "height", wave, scale=(Sdf.ValueTypeNames.Float4, Gf.Vec4f(0.05)))
    scene = load(stage)
    films = [fz.render(scene, resolution=(16, 16), samples=2, threads=t, spacing=0.2) for t in (1, 2)]
    np.testing.assert_array_equal(films[0].layers["beauty"], films[1].layers["beauty"])


def test_displacement_that_nobody_knows_is_named(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    displacing(stage, add_quad(stage, "/Quad"), "acme:wobble")
    scene = load(stage)
    assert scene.warnings == [
        "/Material/Shape: the displacement shader 'acme:wobble' is not supported. The surface is rendered as it is."
    ]


def test_values_out_of_range_are_named(tmp_path):
    stage = new_stage(tmp_path / "s.usda")
    shader = displacing(stage, add_quad(stage, "/Quad"))
    shader.CreateInput("height", FLOAT).Set(float("nan"))
    shader.CreateInput("edge_length", FLOAT).Set(-1.0)
    shader.CreateInput("heigth", FLOAT).Set(1.0)
    said = load(stage).warnings
    assert any("/Material/Shape: height must be finite" in w for w in said)
    assert any("/Material/Shape: edge_length must be >= 0 m, got -1. 0 is used." in w for w in said)
    assert any("has no input 'heigth'. The nearest is 'height'" in w for w in said)


def test_a_deforming_mesh_keeps_its_triangles_and_its_rest_pose():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    rest = fz.Mesh(square, triangles)
    pose = fz.Mesh(square * [3, 1, 1], triangles)
    pose.set_rest(square)
    of_rest, of_pose = (fz._frazil.cut_long_edges(mesh, 0.2)[0] for mesh in (rest, pose))
    np.testing.assert_array_equal(of_rest.triangles, of_pose.triangles)
    np.testing.assert_allclose(of_pose.positions, of_rest.positions * [3, 1, 1], atol=1e-6)
    np.testing.assert_allclose(of_pose.rest, of_rest.positions, atol=1e-6)


def test_python_arguments_are_checked():
    mesh = fz.Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    with pytest.raises(ValueError, match="offsets must be 3 per triangle, 3, got 2"):
        fz._frazil.displaced(mesh, np.zeros((2, 3), np.float32))
    with pytest.raises(ValueError, match="edge_length must be > 0"):
        fz._frazil.cut_long_edges(mesh, 0.0)
    with pytest.raises(ValueError, match="space must be one of tangent, object"):
        fz._frazil.Displacement(space="world")


def test_the_table_is_the_one_in_the_docs():
    from pathlib import Path

    docs = (Path(__file__).parents[2] / "docs" / "material.md").read_text(encoding="utf-8")
    assert inputs_markdown(DISPLACEMENT_INPUTS) in docs, "regenerate with inputs_markdown(DISPLACEMENT_INPUTS)"
