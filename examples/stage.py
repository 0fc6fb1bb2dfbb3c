"""The example as a USD stage: meshes in a crate beside it, materials, lights and camera in text.

Model: UsdGeom meshes, UsdLux lights, UsdShade materials of frazil:ice and UsdPreviewSurface.
Units: metres, y up.
Not: animation, instances.
"""

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdLux, UsdShade, Vt

from frazil.formations.contour import Surface
from frazil.formations.sky import write_image

kStampKey = "glacier:madeFrom"

# Ice with a few bubbles. It absorbs about twelve times what pure ice does, a little less green, as two metres have to
# show what a glacier shows in twenty.
kIceScattering = (9.0, 9.0, 9.0)
kIceAbsorption = (2.0, 0.40, 0.10)
kClearTint = np.array([0.84, 1.02, 1.08])
kWhiteTint = np.array([1.9, 1.52, 1.34])


class SceneWriter:
    """Collects the meshes of the stage at `path`, then writes everything around them."""

    def __init__(self, path: Path):
        self._path = path
        self._mesh_path = path.with_name(path.stem + "_meshes.usdc")
        self._meshes = Usd.Stage.CreateInMemory()
        _set_units(self._meshes)
        root = UsdGeom.Xform.Define(self._meshes, "/Meshes")
        self._meshes.SetDefaultPrim(root.GetPrim())

    @staticmethod
    def stamp_of(path: Path) -> str | None:
        """What the stage at `path` says that it was made from; None if there is none."""
        layer = Sdf.Layer.FindOrOpen(str(path)) if path.exists() else None
        return layer.customLayerData.get(kStampKey) if layer else None

    def add_mesh(self, name: str, surface: Surface, normals, st=None, color=None) -> None:
        """Add a mesh with normals (F, 3, 3), texture coordinates (V, 2) and colours (V, 3)."""
        mesh = UsdGeom.Mesh.Define(self._meshes, f"/Meshes/{name}")
        positions = surface.positions.astype(np.float32)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(positions))
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(surface.triangles), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(surface.triangles.astype(np.int32).ravel()))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
        mesh.CreateExtentAttr([Gf.Vec3f(*map(float, p)) for p in (positions.min(0), positions.max(0))])
        primvars = UsdGeom.PrimvarsAPI(mesh)

        def author(primvar, kind, interpolation, values):
            array = np.ascontiguousarray(values, np.float32)
            make = Vt.Vec2fArray if array.shape[-1] == 2 else Vt.Vec3fArray
            primvars.CreatePrimvar(primvar, kind, interpolation).Set(make.FromNumpy(array))

        author("normals", Sdf.ValueTypeNames.Normal3fArray, "faceVarying", normals.reshape(-1, 3))
        if st is not None:
            author("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex", st)
        if color is not None:
            author("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex", color)

    def write(self, sun: np.ndarray, stamp: str) -> None:
        """Write the crate of meshes, the look-up images and, last, the stage; OSError where that fails."""
        _export(self._meshes, self._mesh_path)
        tint, roughness = _lookups()
        write_image(self._beside("_tint.exr"), tint)
        write_image(self._beside("_roughness.exr"), roughness)

        # Relative references resolve against the layer's own file: write it beside its goal and rename it.
        partial = self._path.with_name(self._path.stem + "_partial.usda")
        stage = _create(partial)
        _set_units(stage)
        stage.GetRootLayer().customLayerData = {kStampKey: stamp}
        world = UsdGeom.Xform.Define(stage, "/World")
        stage.SetDefaultPrim(world.GetPrim())
        materials = self._add_materials(stage)
        for prim in self._meshes.GetPrimAtPath("/Meshes").GetChildren():
            name = prim.GetName()
            mesh = stage.DefinePrim(f"/World/{name}", "Mesh")
            mesh.GetReferences().AddReference(f"./{self._mesh_path.name}", f"/Meshes/{name}")
            UsdShade.MaterialBindingAPI.Apply(mesh).Bind(materials[name.removesuffix("Left").removesuffix("Right")])
        self._add_lights(stage, sun)
        self._add_camera(stage)
        _export(stage, partial)
        partial.replace(self._path)

    def _beside(self, ending: str) -> Path:
        return self._path.with_name(self._path.stem + ending)

    def _add_materials(self, stage: Usd.Stage) -> dict[str, UsdShade.Material]:
        ice, shader = _material(stage, "Ice", "frazil:ice")
        _inputs(
            shader,
            sigma_s_prime=kIceScattering,
            sigma_a=kIceAbsorption,
            eta=1.31,
            compensation="ratio",
            spacing=0.025,
            refraction=1.0,
            refraction_roughness=0.35,
        )
        reader = UsdShade.Shader.Define(stage, "/World/Materials/Ice/St")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        for name, kind, channel in (("tint", "Color3f", "rgb"), ("roughness", "Float", "r")):
            texture = UsdShade.Shader.Define(stage, f"/World/Materials/Ice/{name.capitalize()}")
            texture.CreateIdAttr("UsdUVTexture")
            file = f"./{self._beside(f'_{name}.exr').name}"
            texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)
            texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("raw")
            for wrap in ("wrapS", "wrapT"):
                texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("clamp")
            st = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
            texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(st)
            value = texture.CreateOutput(
                channel, getattr(Sdf.ValueTypeNames, "Float3" if channel == "rgb" else "Float")
            )
            shader.CreateInput(name, getattr(Sdf.ValueTypeNames, kind)).ConnectToSource(value)

        snow, shader = _material(stage, "Snow", "UsdPreviewSurface")
        _inputs(shader, diffuseColor=(0.86, 0.89, 0.93), roughness=0.7, ior=1.31)

        rock, shader = _material(stage, "Rock", "UsdPreviewSurface")
        _inputs(shader, roughness=0.42, ior=1.5)
        reader = UsdShade.Shader.Define(stage, "/World/Materials/Rock/Color")
        reader.CreateIdAttr("UsdPrimvarReader_float3")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("displayColor")
        color = reader.CreateOutput("result", Sdf.ValueTypeNames.Float3)
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(color)

        field, shader = _material(stage, "Snowfield", "UsdPreviewSurface")
        _inputs(shader, diffuseColor=(0.80, 0.84, 0.90), roughness=0.65, ior=1.31)
        return {"Ice": ice, "Snow": snow, "Rock": rock, "Snowfield": field}

    def _add_lights(self, stage: Usd.Stage, sun: np.ndarray) -> None:
        dome = UsdLux.DomeLight.Define(stage, "/World/Lights/Sky")
        dome.CreateTextureFileAttr(f"./{self._beside('_sky.exr').name}")
        dome.CreateIntensityAttr(0.9)
        dome.CreateTextureFormatAttr(UsdLux.Tokens.latlong)
        distant = UsdLux.DistantLight.Define(stage, "/World/Lights/Sun")
        distant.CreateAngleAttr(2.5)
        distant.CreateIntensityAttr(4.6)
        distant.CreateNormalizeAttr(True)
        distant.CreateColorAttr(Gf.Vec3f(1.0, 0.84, 0.66))
        distant.AddTransformOp().Set(_frame(sun, np.zeros(3)))
        rim = UsdLux.RectLight.Define(stage, "/World/Lights/Rim")
        rim.CreateWidthAttr(0.8)
        rim.CreateHeightAttr(0.8)
        rim.CreateIntensityAttr(40.0)
        rim.CreateColorAttr(Gf.Vec3f(1.0, 0.5, 0.2))
        at, to = np.array([0.35, 1.05, -2.0]), np.array([0.1, 1.6, 0.0])
        rim.AddTransformOp().Set(_frame(at - to, at))
        for light, group in ((dome, "sky"), (distant, "sun"), (rim, "rim")):
            light.GetPrim().CreateAttribute("frazil:lightGroup", Sdf.ValueTypeNames.String).Set(group)

    def _add_camera(self, stage: Usd.Stage) -> None:
        camera = UsdGeom.Camera.Define(stage, "/World/Camera")
        camera.CreateFocalLengthAttr(40.0)
        camera.CreateHorizontalApertureAttr(36.0)
        camera.CreateVerticalApertureAttr(20.25)
        camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 1000.0))
        eye, to = np.array([1.05, 0.50, 6.2]), np.array([0.06, 1.40, 0.0])
        camera.AddTransformOp().Set(_frame(eye - to, eye))


def _lookups() -> tuple[np.ndarray, np.ndarray]:
    # Tint and roughness (64, 64, 3) over frost (left to right) and layer (bottom to top).
    frost = np.linspace(0.0, 1.0, 64)[None, :, None]
    layer = np.linspace(1.0, 0.0, 64)[:, None, None]
    clear = kClearTint * (0.88 + 0.24 * layer)
    tint = clear * (1.0 - frost) + kWhiteTint * frost
    roughness = (0.17 + 0.40 * frost) * np.ones((64, 64, 3))
    return tint, roughness


def _material(stage: Usd.Stage, name: str, kind: str) -> tuple[UsdShade.Material, UsdShade.Shader]:
    material = UsdShade.Material.Define(stage, f"/World/Materials/{name}")
    shader = UsdShade.Shader.Define(stage, f"/World/Materials/{name}/Surface")
    shader.CreateIdAttr(kind)
    output = shader.CreateOutput("surface", Sdf.ValueTypeNames.Token)
    material.CreateSurfaceOutput("frazil" if kind == "frazil:ice" else "").ConnectToSource(output)
    return material, shader


def _inputs(shader: UsdShade.Shader, **values) -> None:
    kinds = {float: Sdf.ValueTypeNames.Float, tuple: Sdf.ValueTypeNames.Color3f, str: Sdf.ValueTypeNames.Token}
    for name, value in values.items():
        shader.CreateInput(name, kinds[type(value)]).Set(Gf.Vec3f(*value) if isinstance(value, tuple) else value)


def _frame(back: np.ndarray, at: np.ndarray) -> Gf.Matrix4d:
    # Cameras and lights look along their -z, so +z points back.
    z = back / np.linalg.norm(back)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    rows = np.eye(4)
    rows[0, :3], rows[1, :3], rows[2, :3], rows[3, :3] = x, np.cross(z, x), z, at
    return Gf.Matrix4d(*rows.ravel().tolist())


def _set_units(stage: Usd.Stage) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)


def _create(path: Path) -> Usd.Stage:
    path.unlink(missing_ok=True)
    try:
        return Usd.Stage.CreateNew(str(path))
    except Tf.ErrorException as error:
        raise OSError(f"{path}: cannot be written: {error}") from error


def _export(stage: Usd.Stage, path: Path) -> None:
    try:
        layer = stage.GetRootLayer()
        done = layer.Save() if layer.realPath == str(path.resolve()) else layer.Export(str(path))
    except Tf.ErrorException as error:
        raise OSError(f"{path}: cannot be written: {error}") from error
    if not done:
        raise OSError(f"{path}: cannot be written.")
