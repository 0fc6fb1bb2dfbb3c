"""Small stages that the USD tests build, and a loader that keeps their warnings."""

import warnings

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

import frazil as fz


def new_stage(path, up="Y", meters_per_unit=1.0):
    """A stage on disk with a camera and a light, so that nothing is warned of."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, up)
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    UsdGeom.Camera.Define(stage, "/Camera")
    UsdLux.DomeLight.Define(stage, "/Dome")
    return stage


def add_mesh(stage, path, points, counts, indices, scheme="none"):
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in points])
    mesh.CreateFaceVertexCountsAttr([int(c) for c in counts])
    mesh.CreateFaceVertexIndicesAttr([int(i) for i in indices])
    if scheme:
        mesh.CreateSubdivisionSchemeAttr(scheme)
    return mesh


def add_quad(stage, path, scheme="none"):
    """A unit square in xy that faces +z."""
    return add_mesh(stage, path, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [4], [0, 1, 2, 3], scheme)


def load(stage_or_path, **options):
    """The scene; a stage is saved first. No warning reaches the test; they are in scene.warnings."""
    path = stage_or_path
    if isinstance(stage_or_path, Usd.Stage):
        stage_or_path.Save()
        path = stage_or_path.GetRootLayer().realPath
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fz.FrazilWarning)
        return fz.load_usd(path, **options)


def world_positions(scene, number=0):
    item = scene.objects[number]
    positions = scene.mesh(item.mesh).positions
    return positions @ item.matrix[:3, :3] + item.matrix[3, :3]


def world_mesh(scene, number=0):
    item = scene.objects[number]
    return scene.mesh(item.mesh).transformed(item.matrix)


def triangle_normals(mesh):
    a, b, c = (mesh.positions[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
    return np.cross(b - a, c - a)


def set_primvar(prim, name, type_name, interpolation, values, indices=None):
    primvar = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(name, type_name, interpolation)
    primvar.Set(values)
    if indices is not None:
        primvar.SetIndices(indices)
    return primvar


TEXCOORDS = Sdf.ValueTypeNames.TexCoord2fArray
COLORS = Sdf.ValueTypeNames.Color3fArray
NORMALS = Sdf.ValueTypeNames.Normal3fArray
