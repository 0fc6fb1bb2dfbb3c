"""Meshes of a stage: handedness, holes, primvars in every interpolation, subdivision, gprims."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt
from usd_stages import (
    COLORS,
    NORMALS,
    TEXCOORDS,
    add_mesh,
    add_quad,
    load,
    new_stage,
    set_primvar,
    triangle_normals,
    world_mesh,
)

CUBE_POINTS = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
CUBE_INDICES = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]


@pytest.fixture
def stage(tmp_path):
    return new_stage(tmp_path / "s.usda")


def read(stage):
    scene = load(stage)
    assert scene.warnings == []
    assert len(scene.objects) == 1
    return world_mesh(scene)


def volume(mesh):
    a, b, c = (mesh.positions[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def test_n_gons_and_holes(stage):
    points = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (1, 3, 0), (0, 2, 0), (4, 0, 0), (4, 2, 0)]
    mesh = add_mesh(stage, "/Mesh", points, [5, 4], [0, 1, 2, 3, 4, 1, 5, 6, 2])
    assert read(stage).area == pytest.approx(9.0)
    mesh.CreateHoleIndicesAttr([0])
    assert read(stage).area == pytest.approx(4.0)


@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_left_handed_meshes_face_the_other_way(stage, scheme):
    quad = add_quad(stage, "/Quad", scheme)
    set_primvar(quad, "st", TEXCOORDS, "faceVarying", [Gf.Vec2f(0, 0), Gf.Vec2f(1, 0), Gf.Vec2f(1, 1), Gf.Vec2f(0, 1)])
    assert (triangle_normals(read(stage))[:, 2] > 0).all()
    quad.CreateOrientationAttr("leftHanded")
    mesh = read(stage)
    assert (triangle_normals(mesh)[:, 2] < 0).all()
    # st stays with its corner
    np.testing.assert_allclose(mesh.uvs, mesh.positions[mesh.triangles.reshape(-1), :2], atol=1e-5)


def test_mirrored_transforms_keep_the_outside_outside(stage):
    mesh = add_mesh(stage, "/Cube", CUBE_POINTS, [4] * 6, CUBE_INDICES)
    assert volume(read(stage)) == pytest.approx(8.0)
    mesh.AddScaleOp().Set(Gf.Vec3f(-1, 1, 2))
    assert volume(read(stage)) == pytest.approx(16.0)


@pytest.mark.parametrize("indexed", [False, True])
@pytest.mark.parametrize(
    ("interpolation", "count", "core"),
    [
        ("constant", 1, "constant"),
        ("uniform", 2, "uniform"),
        ("varying", 6, "vertex"),
        ("vertex", 6, "vertex"),
        ("faceVarying", 8, "corner"),
    ],
)
def test_primvars_in_every_interpolation(stage, interpolation, count, core, indexed):
    points = [(x, y, 0) for y in range(2) for x in range(3)]
    counts, indices = [4, 4], [0, 1, 4, 3, 1, 2, 5, 4]
    mesh = add_mesh(stage, "/Mesh", points, counts, indices)
    colors = np.random.default_rng(7).random((count, 3)).astype(np.float32)
    if indexed:
        order = np.arange(count)[::-1]
        set_primvar(
            mesh,
            "displayColor",
            COLORS,
            interpolation,
            Vt.Vec3fArray.FromNumpy(colors[::-1].copy()),
            Vt.IntArray.FromNumpy(order.astype(np.int32)),
        )
    else:
        set_primvar(mesh, "displayColor", COLORS, interpolation, Vt.Vec3fArray.FromNumpy(colors))
    read_mesh = read(stage)
    assert read_mesh.colors_interpolation == core
    # What every triangle corner shows, by its position (corners of one face) and face.
    face_of_triangle = np.repeat([0, 1], 2)
    for triangle in range(4):
        for corner in range(3):
            vertex = read_mesh.triangles[triangle, corner]
            face = face_of_triangle[triangle]
            face_corner = 4 * face + indices[4 * face : 4 * face + 4].index(vertex)
            expected = {
                "constant": 0,
                "uniform": face,
                "varying": vertex,
                "vertex": vertex,
                "faceVarying": face_corner,
            }[interpolation]
            got = {"constant": 0, "uniform": triangle, "vertex": vertex, "corner": 3 * triangle + corner}[core]
            np.testing.assert_array_equal(read_mesh.colors[got], colors[expected])


def test_primvars_normals_win_over_the_normals_attribute(stage):
    quad = add_quad(stage, "/Quad")
    quad.CreateNormalsAttr([Gf.Vec3f(0, 1, 0)] * 4)
    np.testing.assert_allclose(read(stage).normals, [[0, 1, 0]] * 4)
    set_primvar(quad, "normals", NORMALS, "faceVarying", [Gf.Vec3f(0, 0, 2)] * 4)
    mesh = read(stage)
    assert mesh.normals_interpolation == "corner"
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 6)


def test_texture_coordinates_under_other_names(stage):
    quad = add_quad(stage, "/Quad")
    set_primvar(quad, "myCoords", TEXCOORDS, "vertex", [Gf.Vec2f(0.5, 0.25)] * 4)
    np.testing.assert_allclose(read(stage).uvs, [[0.5, 0.25]] * 4)


def test_inherited_primvars(stage):
    group = UsdGeom.Xform.Define(stage, "/Group")
    set_primvar(group, "displayColor", COLORS, "constant", [Gf.Vec3f(1, 0, 0)])
    add_quad(stage, "/Group/Quad")
    np.testing.assert_allclose(read(stage).colors, [[1, 0, 0]])


def catmull_clark(points, faces):
    """One step of Catmull-Clark subdivision of a closed mesh, straight from its definition."""
    points = np.asarray(points, np.float64)
    face_points = np.array([points[f].mean(0) for f in faces])
    edges = {}
    for number, face in enumerate(faces):
        for a, b in zip(face, face[1:] + face[:1], strict=True):
            edges.setdefault(frozenset((a, b)), []).append(number)
    edge_points = {e: (points[list(e)].sum(0) + face_points[f].sum(0)) / 4 for e, f in edges.items()}
    moved = np.empty_like(points)
    for v, p in enumerate(points):
        around = [i for i, f in enumerate(faces) if v in f]
        n = len(around)
        middles = np.mean([points[list(e)].mean(0) for e in edges if v in e], axis=0)
        moved[v] = (face_points[around].mean(0) + 2 * middles + (n - 3) * p) / n
    number_of_edge = {e: len(points) + len(faces) + i for i, e in enumerate(edges)}
    quads = []
    for number, face in enumerate(faces):
        for i, v in enumerate(face):
            after, before = frozenset((v, face[(i + 1) % len(face)])), frozenset((v, face[i - 1]))
            quads.append([v, number_of_edge[after], len(points) + number, number_of_edge[before]])
    return np.concatenate([moved, face_points, list(edge_points.values())]), quads


@pytest.mark.parametrize("shape", ["cube", "prism", "pyramid"])
def test_subdivision_agrees_with_the_definition(stage, shape):
    if shape == "cube":
        points, faces = CUBE_POINTS, np.reshape(CUBE_INDICES, (-1, 4)).tolist()
    elif shape == "prism":
        angle = np.arange(5) * 2 * np.pi / 5
        points = np.concatenate([np.c_[np.cos(angle), np.sin(angle), np.full(5, z)] for z in (-1, 1)])
        faces = [[4, 3, 2, 1, 0], [5, 6, 7, 8, 9]] + [[i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i] for i in range(5)]
    else:
        points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 2)]
        faces = [[3, 2, 1, 0], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    add_mesh(stage, "/Mesh", points, [len(f) for f in faces], sum(faces, []), "catmullClark")
    mesh = world_mesh(load(stage, subdivision_level=1))
    refined = (points, faces)
    for _ in range(5):
        refined = catmull_clark(*refined)
    # Every vertex lies where the definition goes to; the cage's own corners are the ones farthest from converged.
    dense = np.asarray(refined[0])
    distance = np.array([np.linalg.norm(dense - p, axis=1).min() for p in mesh.positions])
    assert distance.max() < 4e-3
    assert volume(mesh) > 0


def test_subdivision_levels_and_flat_schemes(stage):
    mesh = add_mesh(stage, "/Cube", CUBE_POINTS, [4] * 6, CUBE_INDICES, "catmullClark")
    assert len(world_mesh(load(stage)).triangles) == 6 * 16 * 2
    assert len(world_mesh(load(stage, subdivision_level=1)).triangles) == 6 * 4 * 2
    assert len(world_mesh(load(stage, subdivision_level=0)).triangles) == 12
    mesh.GetSubdivisionSchemeAttr().Set("bilinear")
    assert len(read(stage).triangles) == 12
    mesh.GetSubdivisionSchemeAttr().Set("loop")
    scene = load(stage)
    assert len(world_mesh(scene).triangles) == 12
    assert "/Cube: subdivisionScheme loop is not supported" in scene.warnings[0]
    with pytest.raises(ValueError, match="subdivision_level must be in 0..8"):
        load(stage, subdivision_level=9)


def test_a_silent_mesh_is_subdivided_unless_it_has_normals(stage):
    mesh = add_mesh(stage, "/Cube", CUBE_POINTS, [4] * 6, CUBE_INDICES, scheme=None)
    assert volume(read(stage)) < 4.0
    mesh.CreateNormalsAttr([Gf.Vec3f(0, 0, 1)] * 24)
    mesh.SetNormalsInterpolation("faceVarying")
    assert volume(read(stage)) == pytest.approx(8.0)


def test_unconnected_triangles_stay_where_they_are_under_catmull_clark(stage):
    points = np.random.default_rng(3).random((30, 3))
    add_mesh(stage, "/Soup", points, [3] * 10, np.arange(30), scheme=None)
    a, b, c = points[0::3], points[1::3], points[2::3]
    expected = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert read(stage).area == pytest.approx(expected, rel=1e-3)


GPRIMS = {
    "Sphere": ({"radius": 2.0}, 4 / 3 * np.pi * 8, 16 * np.pi),
    "Cube": ({"size": 3.0}, 27.0, 54.0),
    "Cone": ({"height": 3.0, "radius": 1.5}, np.pi * 2.25, np.pi * 1.5 * (1.5 + np.hypot(3, 1.5))),
    "Cylinder": ({"height": 3.0, "radius": 1.5}, np.pi * 2.25 * 3, 2 * np.pi * 1.5 * 4.5),
    "Capsule": ({"height": 2.0, "radius": 0.5}, np.pi * (0.25 * 2 + 4 / 3 * 0.125), np.pi * (2 + 1)),
}


@pytest.mark.parametrize("kind", GPRIMS)
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_gprims_have_the_volume_area_and_extent_of_the_shape(stage, kind, axis):
    sizes, true_volume, true_area = GPRIMS[kind]
    prim = stage.DefinePrim("/Shape", kind)
    for name, value in sizes.items():
        prim.GetAttribute(name).Set(value)
    if prim.HasAttribute("axis"):
        prim.GetAttribute("axis").Set(axis)
    mesh = read(stage)
    assert volume(mesh) == pytest.approx(true_volume, rel=2e-3)
    assert mesh.area == pytest.approx(true_area, rel=2e-3)
    assert mesh.uvs is not None
    low, high = mesh.positions.min(0), mesh.positions.max(0)
    extent = UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), 0)
    np.testing.assert_allclose([low, high], np.array(extent), atol=1e-3)
    # Normals are unit and on the side of their triangles.
    flat = triangle_normals(mesh)
    for corner in range(3):
        smooth = mesh.normals[mesh.triangles[:, corner]]
        np.testing.assert_allclose(np.linalg.norm(smooth, axis=1), 1, rtol=1e-5)
        assert (np.einsum("ij,ij->i", smooth, flat) > 0).all()


def test_cone_apex_is_at_the_positive_end(stage):
    cone = UsdGeom.Cone.Define(stage, "/Cone")
    cone.CreateAxisAttr("Y")
    mesh = read(stage)
    top = mesh.positions[mesh.positions[:, 1] > 0.999]
    np.testing.assert_allclose(top[:, [0, 2]], 0, atol=1e-6)


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_plane(stage, axis):
    plane = UsdGeom.Plane.Define(stage, "/Plane")
    plane.CreateWidthAttr(3)
    plane.CreateLengthAttr(5)
    plane.CreateAxisAttr(axis)
    mesh = read(stage)
    number = "XYZ".index(axis)
    assert mesh.area == pytest.approx(15)
    assert (triangle_normals(mesh)[:, number] > 0).all()
    extent = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(plane, 0))
    np.testing.assert_allclose([mesh.positions.min(0), mesh.positions.max(0)], extent, atol=1e-6)


finite = st.floats(-10, 10, width=32)
anything = st.floats(width=32)
quietly = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def exported(tmp_path, stage):
    """A stage in memory as a file that no other example of the same test has touched."""
    path = tmp_path / "any.usda"
    path.unlink(missing_ok=True)
    stage.GetRootLayer().Export(str(path))
    layer = Sdf.Layer.Find(str(path))
    if layer:
        layer.Reload(force=True)
    return path


def stage_in_memory():
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.Camera.Define(stage, "/Camera")
    UsdLux.DomeLight.Define(stage, "/Dome")
    return stage


@quietly
@given(
    points=st.lists(st.tuples(anything, anything, anything), max_size=8),
    counts=st.lists(st.integers(-2, 20), max_size=5),
    indices=st.lists(st.integers(-3, 9), max_size=20),
    scheme=st.sampled_from(["none", "catmullClark", "loop", "bilinear"]),
    holes=st.lists(st.integers(-2, 6), max_size=3),
    hand=st.sampled_from(["leftHanded", "rightHanded"]),
)
def test_any_arrays_are_read_or_named_never_a_crash(tmp_path, points, counts, indices, scheme, holes, hand):
    stage = stage_in_memory()
    mesh = add_mesh(stage, "/Any", points, counts, indices, scheme)
    mesh.CreateHoleIndicesAttr(holes)
    mesh.CreateOrientationAttr(hand)
    add_quad(stage, "/Good")
    scene = load(exported(tmp_path, stage))
    assert "/Good" in [o.path for o in scene.objects]
    if len(scene.objects) == 1:
        assert any(w.startswith("/Any: ") for w in scene.warnings)


@quietly
@given(
    points=st.lists(st.tuples(finite, finite, finite), min_size=4, max_size=9),
    faces=st.lists(st.lists(st.integers(0, 3), min_size=1, max_size=18), min_size=1, max_size=4),
    scheme=st.sampled_from(["none", "catmullClark"]),
)
def test_degenerate_polygons_give_finite_meshes(tmp_path, points, faces, scheme):
    stage = stage_in_memory()
    add_mesh(stage, "/Mesh", points, [len(f) for f in faces], sum(faces, []), scheme)
    for mesh in load(exported(tmp_path, stage)).meshes:
        assert np.isfinite(mesh.positions).all()
        assert mesh.normals is None or np.isfinite(mesh.normals).all()


@quietly
@given(
    values=st.lists(st.tuples(anything, anything), max_size=9),
    indices=st.none() | st.lists(st.integers(-2, 9), max_size=9),
    interpolation=st.sampled_from(["constant", "uniform", "varying", "vertex", "faceVarying"]),
)
def test_any_primvar_is_read_or_named(tmp_path, values, indices, interpolation):
    stage = stage_in_memory()
    quad = add_quad(stage, "/Quad")
    set_primvar(quad, "st", TEXCOORDS, interpolation, [Gf.Vec2f(*v) for v in values], indices)
    scene = load(exported(tmp_path, stage))
    assert len(scene.objects) == 1
    assert scene.mesh(0).uvs is None or np.isfinite(scene.mesh(0).uvs).all()
