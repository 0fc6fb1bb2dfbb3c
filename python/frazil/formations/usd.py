"""Formations as USD: meshes with rest positions, materials, collections, lights, a camera, and the sky beside it.

Model: UsdGeom, UsdShade (frazil:ice, UsdPreviewSurface), UsdLux, UsdCollectionAPI on the formation's root prim.
Units: metres, y up.
Not: reading; see frazil.usd.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from ..replacing import replacing
from .formation import CameraRow, Formation, LightRow, MaterialRow, Part
from .sky import write_image

kSuffixes = (".usd", ".usda", ".usdc")
_FILM_MM = (36.0, 20.25)


def write_formation(formation: Formation, path: str | Path) -> None:
    """Write the formation to a .usd, .usda or .usdc file, its sky to NAME_sky.exr beside it.

    Raises
    ------
    ValueError
        For another suffix.
    OSError
        Where a file cannot be written; what was there before is then left.
    """
    path = Path(path)
    check_suffix(path)
    write_stage(path, lambda stage, sky: add_formation(stage, formation, sky), formation.sky)


def write_stage(path: Path, fill: Callable[[Usd.Stage, str], object], sky: np.ndarray | None) -> None:
    """Write what `fill` puts into an empty stage, told where the sky lies, and the sky beside it."""
    sky_path = path.with_name(f"{path.stem}_sky.exr")
    if sky is not None:
        with replacing(sky_path) as temporary, tempfile.TemporaryDirectory(dir=path.resolve().parent) as folder:
            whole = Path(folder) / sky_path.name
            write_image(whole, sky)
            whole.replace(temporary)
    stage = Usd.Stage.CreateInMemory()
    fill(stage, f"./{sky_path.name}")
    export(stage, path)


def check_suffix(path: Path) -> None:
    """ValueError unless the file is named as USD is."""
    if path.suffix.lower() not in kSuffixes:
        raise ValueError(f"{path}: file must end in {', '.join(kSuffixes)}, got {path.suffix!r}. Rename it.")


def export(stage: Usd.Stage, path: Path) -> None:
    """Write a stage whole or not at all; OSError where it fails."""
    # USD tells its formats by suffix, so the file is made under its own name in a folder of its own.
    with replacing(path) as temporary, tempfile.TemporaryDirectory(dir=path.resolve().parent) as folder:
        whole = Path(folder) / path.name
        try:
            is_written = stage.GetRootLayer().Export(str(whole))
        except Tf.ErrorException as error:
            raise OSError(f"{path}: cannot be written: {error.args[0].commentary}") from None
        if not is_written:
            raise OSError(f"{path}: file must be writable, got an error while writing. Check the folder and disk.")
        whole.replace(temporary)


def add_formation(stage: Usd.Stage, formation: Formation, sky: str) -> Usd.Prim:
    """Fill an empty stage: meshes under /World/NAME, materials, lights and camera beside it."""
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    world = UsdGeom.Xform.Define(stage, "/World")
    stage.SetDefaultPrim(world.GetPrim())
    root = add_geometry(stage, formation, f"/World/{formation.name}")
    for row in formation.lights:
        _add_light(stage, row, sky)
    _add_camera(stage, formation.camera)
    return root


def add_geometry(stage: Usd.Stage, formation: Formation, path: str) -> Usd.Prim:
    """The formation's meshes, materials and collections under one prim, which can be instanced."""
    root = UsdGeom.Xform.Define(stage, path).GetPrim()
    Usd.ModelAPI(root).SetKind("component")
    root.SetCustomDataByKey("frazil:formation", formation.name)
    for key, value in formation.parameters.items():
        if value is not None:
            root.SetCustomDataByKey(f"frazil:parameters:{key}", value)
    materials = {
        name: _add_material(stage, f"{path}/Materials/{name}", row) for name, row in formation.materials.items()
    }
    for part in formation.parts:
        mesh = _add_mesh(stage, f"{path}/{part.name}", part)
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(materials[part.material])
    for name, members in formation.collections.items():
        collection = Usd.CollectionAPI.Apply(root, name)
        for member in members:
            collection.IncludePath(f"{path}/{member}")
    return root


def _add_mesh(stage: Usd.Stage, path: str, part: Part) -> UsdGeom.Mesh:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(part.positions))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(part.triangles), 3, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(part.triangles.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr([Gf.Vec3f(*map(float, p)) for p in (part.positions.min(0), part.positions.max(0))])
    if part.is_sheet:
        mesh.CreateDoubleSidedAttr(True)
    primvars = UsdGeom.PrimvarsAPI(mesh)
    types = Sdf.ValueTypeNames
    rows = [
        ("normals", types.Normal3fArray, UsdGeom.Tokens.faceVarying, part.normals),
        ("rest", types.Point3fArray, UsdGeom.Tokens.vertex, part.positions),
    ]
    if part.colors is not None:
        rows.append(("displayColor", types.Color3fArray, UsdGeom.Tokens.vertex, part.colors))
    for name, kind, interpolation, values in rows:
        array = np.ascontiguousarray(values, np.float32).reshape(-1, 3)
        primvars.CreatePrimvar(name, kind, interpolation).Set(Vt.Vec3fArray.FromNumpy(array))
    return mesh


def _add_material(stage: Usd.Stage, path: str, row: MaterialRow) -> UsdShade.Material:
    material = UsdShade.Material.Define(stage, path)
    shader = UsdShade.Shader.Define(stage, f"{path}/Surface")
    shader.CreateIdAttr(row.shader)
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput("frazil" if row.shader == "frazil:ice" else "").ConnectToSource(output)
    for name, value in row.inputs.items():
        if name == "overlays":
            for key, overlay in value.items():
                child = UsdShade.Shader.Define(stage, f"{path}/{key}")
                child.CreateIdAttr("frazil:overlay")
                _set_inputs(child, overlay)
                source = child.CreateOutput("overlay", Sdf.ValueTypeNames.Token)
                shader.CreateInput(f"overlays:{key}", Sdf.ValueTypeNames.Token).ConnectToSource(source)
        else:
            _set_inputs(shader, {name: value})
    if row.uses_colors:
        reader = UsdShade.Shader.Define(stage, f"{path}/Color")
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        color = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(color)
    return material


def _set_inputs(shader: UsdShade.Shader, values: dict[str, Any]) -> None:
    types = Sdf.ValueTypeNames
    kinds = {float: types.Float, int: types.Int, bool: types.Bool, str: types.Token, tuple: types.Color3f}
    for name, value in values.items():
        kind = types.Vector3f if name == "direction" else kinds[type(value)]
        shader.CreateInput(name, kind).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)


def _add_light(stage: Usd.Stage, row: LightRow, sky: str) -> None:
    path = f"/World/Lights/{row.name}"
    toward = np.asarray(row.toward, np.float64)
    if row.kind == "dome":
        light = UsdLux.DomeLight.Define(stage, path)
        light.CreateTextureFileAttr(sky)
        light.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
    elif row.kind == "distant":
        light = UsdLux.DistantLight.Define(stage, path)
        light.CreateAngleAttr(row.size)
        light.CreateNormalizeAttr(True)
        light.AddTransformOp().Set(frame(toward, np.zeros(3)))
    elif row.kind == "rect":
        light = UsdLux.RectLight.Define(stage, path)
        light.CreateWidthAttr(row.size)
        light.CreateHeightAttr(row.size)
        light.AddTransformOp().Set(frame(np.subtract(row.at, row.to), np.asarray(row.at)))
    else:
        light = UsdLux.SphereLight.Define(stage, path)
        light.CreateRadiusAttr(row.size)
        light.AddTranslateOp().Set(Gf.Vec3d(*row.at))
    light.CreateIntensityAttr(row.intensity)
    light.CreateColorAttr(Gf.Vec3f(*row.color))
    light.GetPrim().CreateAttribute("frazil:lightGroup", Sdf.ValueTypeNames.String).Set(row.name.lower())


def _add_camera(stage: Usd.Stage, row: CameraRow) -> None:
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(row.focal_mm)
    camera.CreateHorizontalApertureAttr(_FILM_MM[0])
    camera.CreateVerticalApertureAttr(_FILM_MM[1])
    away = float(np.linalg.norm(np.subtract(row.eye, row.to)))
    camera.CreateClippingRangeAttr(Gf.Vec2f(1e-3 * away, 1e4 * away))
    camera.AddTransformOp().Set(frame(np.subtract(row.eye, row.to), np.asarray(row.eye)))


def frame(back: np.ndarray, at: np.ndarray) -> Gf.Matrix4d:
    """The transform of a camera or light at `at` that looks along -`back`."""
    z = back / np.linalg.norm(back)
    x = np.cross([0.0, 1.0, 0.0] if abs(z[1]) < 0.999 else [0.0, 0.0, 1.0], z)
    x /= np.linalg.norm(x)
    rows = np.eye(4)
    rows[0, :3], rows[1, :3], rows[2, :3], rows[3, :3] = x, np.cross(z, x), z, at
    return Gf.Matrix4d(*rows.ravel().tolist())
