"""Materials read from USD and MaterialX: displaced and normal-mapped ice, and one ice said in four languages.

    python examples/materials.py surface -o out/materials_surface.png [--size 200] [--samples 30]
    python examples/materials.py models -o out/materials_models.png

`surface`: a block of ice, plain; with a normal map; displaced by the image that the map is made of; by Frazil's cells.
`models`: above, translucent ice by frazil:ice, MaterialX frazil_ice, standard_surface, open_pbr_surface; below, clear
ice by the same four. Images, a USD stage and a MaterialX document are written beside the picture, under materials/.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

import frazil as fz
from frazil.formations.sky import make_sky
from frazil.image import write_png

kSun = np.array([-0.8, 0.5, -0.35])
kTexels = 256
kTypes = Sdf.ValueTypeNames

# The same medium in the words of each model: albedo and transport mean free path, IOR, roughness.
kTranslucent = {
    "frazil_ice": """
      <input name="albedo" type="color3" value="0.78, 0.9, 0.95" />
      <input name="mean_free_path" type="color3" value="0.03, 0.05, 0.07" />
      <input name="refraction" type="float" value="0" />
      <input name="roughness" type="float" value="0.22" />""",
    "standard_surface": """
      <input name="subsurface" type="float" value="1" />
      <input name="subsurface_color" type="color3" value="0.78, 0.9, 0.95" />
      <input name="subsurface_radius" type="color3" value="0.3, 0.5, 0.7" />
      <input name="subsurface_scale" type="float" value="0.1" />
      <input name="specular_IOR" type="float" value="1.31" />
      <input name="specular_roughness" type="float" value="0.22" />""",
    "open_pbr_surface": """
      <input name="subsurface_weight" type="float" value="1" />
      <input name="subsurface_color" type="color3" value="0.78, 0.9, 0.95" />
      <input name="subsurface_radius" type="float" value="0.1" />
      <input name="subsurface_radius_scale" type="color3" value="0.3, 0.5, 0.7" />
      <input name="specular_ior" type="float" value="1.31" />
      <input name="specular_roughness" type="float" value="0.22" />""",
}
# exp(-sigma_a d) over one metre, and a little scattering.
kClear = {
    "frazil_ice": """
      <input name="sigma_s_prime" type="color3" value="0.15, 0.15, 0.15" />
      <input name="sigma_a" type="color3" value="2.1526, 0.5608, 0.1363" />
      <input name="roughness" type="float" value="0.08" />""",
    "standard_surface": """
      <input name="transmission" type="float" value="1" />
      <input name="transmission_color" type="color3" value="0.1, 0.4912, 0.751" />
      <input name="transmission_depth" type="float" value="1" />
      <input name="transmission_scatter" type="color3" value="0.15, 0.15, 0.15" />
      <input name="specular_IOR" type="float" value="1.31" />
      <input name="specular_roughness" type="float" value="0.08" />""",
    "open_pbr_surface": """
      <input name="transmission_weight" type="float" value="1" />
      <input name="transmission_color" type="color3" value="0.1, 0.4912, 0.751" />
      <input name="transmission_depth" type="float" value="1" />
      <input name="transmission_scatter" type="color3" value="0.15, 0.15, 0.15" />
      <input name="specular_ior" type="float" value="1.31" />
      <input name="specular_roughness" type="float" value="0.08" />""",
}


def write_image(path: Path, pixels: np.ndarray) -> None:
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.HALF)
    image = oiio.ImageBuf(spec)
    image.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels, np.float32))
    image.write(str(path))


def draw_height(path: Path) -> np.ndarray:
    """A tileable weathered surface: noise of falling amplitude, hollows deeper than ridges are high; -1..1."""
    frequency = np.fft.fftfreq(kTexels) * kTexels
    radius = np.hypot(*np.meshgrid(frequency, frequency))
    amplitude = np.where(radius > 0, np.maximum(radius, 4.0) ** -1.9, 0.0) * (radius < kTexels / 5)
    noise = np.fft.fft2(np.random.default_rng(5).standard_normal((kTexels, kTexels)))
    height = np.fft.ifft2(noise * amplitude).real
    height = height / np.abs(height).max()
    height = 0.35 - np.abs(height + 0.1) ** 0.8  # ridges are sharp, as the sun leaves them
    height -= height.mean()
    height /= np.abs(height).max()
    write_image(path, height[..., None])
    return height


def draw_normals(path: Path, height: np.ndarray, slope: float) -> None:
    """The tangent-space normals of a height image; `slope` is its height over the width of a repeat."""
    ds = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * 0.5 * kTexels * slope
    dt = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) * 0.5 * kTexels * slope
    normals = np.stack([-ds, -dt, np.ones_like(ds)], -1)
    write_image(path, normals / np.linalg.norm(normals, axis=-1, keepdims=True) * 0.5 + 0.5)


def add_block(stage: Usd.Stage, path: str, x: float) -> UsdGeom.Mesh:
    """A rounded block, about a metre high, without texture coordinates."""
    corners = [(i & 1, i >> 1 & 1, i >> 2) for i in range(8)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr([Gf.Vec3f(a * 0.9 - 0.45, b * 1.15, c * 0.8 - 0.4) for a, b, c in corners])
    mesh.CreateFaceVertexCountsAttr([4] * 6)
    mesh.CreateFaceVertexIndicesAttr([i for face in faces for i in face])
    edges = sorted({tuple(sorted((f[i], f[(i + 1) % 4]))) for f in faces for i in range(4)})
    mesh.CreateCreaseIndicesAttr([i for edge in edges for i in edge])
    mesh.CreateCreaseLengthsAttr([2] * len(edges))
    mesh.CreateCreaseSharpnessesAttr([2.2] * len(edges))
    mesh.AddTranslateOp().Set(Gf.Vec3d(x, -0.04, 0))
    mesh.AddRotateYOp().Set(28.0)
    return mesh


def new_stage(path: Path, count: int) -> Usd.Stage:
    """Snow under a cold sky and a low sun behind, and a camera for a row of `count` blocks."""
    write_image(path.parent / "sky.exr", make_sky(512, kSun, 3))
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    dome = UsdLux.DomeLight.Define(stage, "/Sky")
    dome.CreateTextureFileAttr("./sky.exr")
    sun = UsdLux.DistantLight.Define(stage, "/Sun")
    sun.CreateAngleAttr(1.5)
    sun.CreateIntensityAttr(5500.0)
    sun.CreateColorAttr(Gf.Vec3f(1.0, 0.86, 0.68))
    toward = Gf.Rotation(Gf.Vec3d(0, 0, 1), Gf.Vec3d(*kSun.tolist()))
    sun.AddOrientOp().Set(Gf.Quatf(toward.GetQuat()))
    floor = UsdGeom.Plane.Define(stage, "/Snow")
    floor.CreateAxisAttr("Y")
    floor.CreateWidthAttr(40.0)
    floor.CreateLengthAttr(40.0)
    snow = UsdShade.Material.Define(stage, "/Materials/Snow")
    shader = UsdShade.Shader.Define(stage, "/Materials/Snow/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", kTypes.Color3f).Set(Gf.Vec3f(0.55, 0.57, 0.6))
    shader.CreateInput("roughness", kTypes.Float).Set(0.8)
    snow.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(floor.GetPrim()).Bind(snow)
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.CreateFocalLengthAttr(60.0)
    camera.CreateHorizontalApertureAttr(60.0 * (1.45 * count) / 7.2)
    camera.CreateVerticalApertureAttr(60.0 * 1.45 / 7.2)
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 1.3, 7.05))
    camera.AddRotateXOp().Set(-6.2)
    return stage


def add_texture(stage: Usd.Stage, path: str, file: str, size: float, **inputs) -> UsdShade.Shader:
    texture = UsdShade.Shader.Define(stage, path)
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", kTypes.Asset).Set(file)
    texture.CreateInput("sourceColorSpace", kTypes.Token).Set("raw")
    texture.CreateInput("frazil:triplanarSize", kTypes.Float).Set(size)
    for wrap in ("wrapS", "wrapT"):
        texture.CreateInput(wrap, kTypes.Token).Set("repeat")
    for name, value in inputs.items():
        texture.CreateInput(name, kTypes.Float4).Set(Gf.Vec4f(value))
    return texture


def surface_scene(folder: Path) -> fz.Scene:
    """Plain, normal-mapped, displaced by an image, displaced by a pattern."""
    repeat, depth = 0.9, 0.05
    height = draw_height(folder / "height.exr")
    draw_normals(folder / "normals.exr", height, depth / repeat)
    stage = new_stage(folder / "surface.usda", 4)
    for number, kind in enumerate(("plain", "normal", "image", "pattern")):
        block = add_block(stage, f"/Ice_{kind}", (number - 1.5) * 1.42)
        base = f"/Materials/{kind}"
        material = UsdShade.Material.Define(stage, base)
        ice = UsdShade.Shader.Define(stage, f"{base}/Surface")
        ice.CreateIdAttr("frazil:ice")
        ice.CreateInput("albedo", kTypes.Color3f).Set(Gf.Vec3f(0.78, 0.9, 0.95))
        ice.CreateInput("mean_free_path", kTypes.Color3f).Set(Gf.Vec3f(0.03, 0.05, 0.07))
        ice.CreateInput("roughness", kTypes.Float).Set(0.22)
        ice.CreateInput("refraction", kTypes.Float).Set(0.0)
        material.CreateSurfaceOutput().ConnectToSource(ice.ConnectableAPI(), "surface")
        if kind == "normal":
            texture = add_texture(stage, f"{base}/Normals", "./normals.exr", repeat, scale=2.0, bias=-1.0)
            ice.CreateInput("normal", kTypes.Normal3f).ConnectToSource(texture.ConnectableAPI(), "rgb")
        elif kind != "plain":
            shape = UsdShade.Shader.Define(stage, f"{base}/Shape")
            shape.CreateIdAttr("frazil:displacement")
            shape.CreateInput("edge_length", kTypes.Float).Set(0.012)
            material.CreateDisplacementOutput().ConnectToSource(shape.ConnectableAPI(), "displacement")
            if kind == "image":
                texture = add_texture(stage, f"{base}/Height", "./height.exr", repeat, scale=depth)
                shape.CreateInput("height", kTypes.Float).ConnectToSource(texture.ConnectableAPI(), "r")
            else:
                shape.CreateInput("height", kTypes.Float).Set(-0.045)
                for name, value in (("size", 0.34), ("width", 0.02), ("feather", 0.07), ("warp", 0.3)):
                    shape.CreateInput(name, kTypes.Float).Set(value)
                shape.CreateInput("pattern", kTypes.Token).Set("cells")
                shape.CreateInput("scales", kTypes.Int).Set(1)
        UsdShade.MaterialBindingAPI.Apply(block.GetPrim()).Bind(material)
    stage.Save()
    return fz.load_usd(folder / "surface.usda")


def models_scene(folder: Path, words: dict[str, str], name: str) -> fz.Scene:
    """Four blocks, all bound by the look of a document but the first, which is frazil:ice in USD."""
    stage = new_stage(folder / f"{name}.usda", 4)
    text, assigns = [], []
    for number, node in enumerate(("usd", *words)):
        path = f"/Ice_{node}"
        block = add_block(stage, path, (number - 1.5) * 1.42)
        if node == "usd":
            add_usd_ice(stage, block, words["frazil_ice"])
            continue
        text.append(f"""
  <{node} name="{node}_shader" type="surfaceshader">{words[node]}
  </{node}>
  <surfacematerial name="{node}_look" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="{node}_shader" />
  </surfacematerial>""")
        assigns.append(f'\n    <materialassign name="{node}_to" material="{node}_look" geom="{path}" />')
    stage.Save()
    document = folder / f"{name}.mtlx"
    body = "".join(text) + '\n  <look name="ice">' + "".join(assigns) + "\n  </look>\n"
    document.write_text(f'<?xml version="1.0"?>\n<materialx version="1.39">{body}</materialx>\n', encoding="utf-8")
    return fz.load_usd(folder / f"{name}.usda", materials=document)


def add_usd_ice(stage: Usd.Stage, block: UsdGeom.Mesh, words: str) -> None:
    """The inputs of frazil_ice as frazil:ice has them."""
    material = UsdShade.Material.Define(stage, "/Materials/Ice")
    shader = UsdShade.Shader.Define(stage, "/Materials/Ice/Surface")
    shader.CreateIdAttr("frazil:ice")
    for line in words.strip().splitlines():
        name, kind, value = (line.split(f'{key}="')[1].split('"')[0] for key in ("name", "type", "value"))
        numbers = [float(number) for number in value.split(",")]
        if kind == "color3":
            shader.CreateInput(name, kTypes.Color3f).Set(Gf.Vec3f(*numbers))
        else:
            shader.CreateInput(name, kTypes.Float).Set(numbers[0])
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(block.GetPrim()).Bind(material)


def render(scene: fz.Scene, size: int, samples: int) -> np.ndarray:
    options = {"samples": samples, "shading_samples": max(1, samples // 3), "spacing_scale": 1.5, "denoise": True}
    film = fz.render(scene, resolution=(4 * size, size), **options)
    return np.asarray(film.layers["beauty"])[..., :3]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("surface", "models"))
    parser.add_argument("-o", "--output", type=Path, required=True, help="the PNG to write")
    parser.add_argument("--size", type=int, default=200, help="pixels along a side of one block's picture")
    parser.add_argument("--samples", type=int, default=30, help="per pixel; a third of them are shaded")
    options = parser.parse_args(arguments)
    start = time.process_time()
    folder = options.output.parent / "materials"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if options.what == "surface":
            pixels = render(surface_scene(folder), options.size, options.samples)
        else:
            scenes = [models_scene(folder, kTranslucent, "translucent"), models_scene(folder, kClear, "clear")]
            pixels = np.concatenate([render(scene, options.size, options.samples) for scene in scenes])
        write_png(options.output, np.ascontiguousarray(pixels))
    except OSError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{options.output}: {time.process_time() - start:.1f} s of processor time.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
