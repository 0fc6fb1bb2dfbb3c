"""UsdLux lights: shapes, radiance, multipliers per component, light groups and dome images."""

from __future__ import annotations

import math

import numpy as np
from pxr import Gf, Sdf, Usd, UsdLux

from .._frazil import CylinderLight, DiskLight, DistantLight, DomeLight, Light, RectLight, Scene, SphereLight
from .context import ReadContext, is_singular
from .textures import decode_srgb, is_srgb, read_image, resolve

_GREY_DOME = 0.5

# The dome of UsdLuxDomeLight_1 may stand on z: its own frame, pole +y, turned by 90 degrees about x.
_POLE_Y_TO_Z = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)

# Shaping inputs and the values at which they do nothing.
_SHAPING = {"shaping:focus": 0.0, "shaping:cone:angle": 90.0, "shaping:ies:file": None}


def is_light(prim: Usd.Prim) -> bool:
    """Whether the prim emits light."""
    return prim.HasAPI(UsdLux.LightAPI)


def add_light(context: ReadContext, scene: Scene, prim: Usd.Prim, matrix: np.ndarray, path: str) -> None:
    """Add the prim's light, placed by `matrix` (its frame to the world); a warning where it cannot be used."""
    kind = str(prim.GetTypeName())
    shape = _read_shape(context, prim, kind)
    if shape is None:
        return
    if is_singular(matrix):
        context.warn(path, "its transform cannot be inverted (a scale of 0?). The light is left out.")
        return
    _warn_of_unsupported(context, prim)
    radiance = _read_radiance(context, prim)
    if not np.isfinite(radiance).all():
        context.warn(path, f"intensity times color must be finite, got {radiance.tolist()}. The light is left out.")
        return
    if isinstance(shape, DomeLight | DistantLight):
        matrix = _rotation_of(matrix)
    if kind == "DomeLight_1":
        pole = _get(context, prim, "poleAxis", "scene")
        if pole == "Z" or (pole == "scene" and context.is_z_up):
            matrix = _POLE_Y_TO_Z @ matrix
    group = context.get(prim.GetAttribute("frazil:lightGroup")) or context.get(
        prim.GetAttribute("inputs:frazil:lightGroup"), ""
    )
    scene.add_light(
        Light(
            shape,
            radiance=radiance.tolist(),
            matrix=np.ascontiguousarray(matrix),
            path=path,
            group=str(group),
            normalize=bool(_get(context, prim, "normalize", False)),
            diffuse=_number(context, prim, "diffuse", 1.0),
            specular=_number(context, prim, "specular", 1.0),
            translucency=_number(context, prim, "frazil:translucency", 1.0),
            refraction=_number(context, prim, "frazil:refraction", 1.0),
            volume=_number(context, prim, "frazil:volume", 1.0),
        )
    )


def add_grey_dome(context: ReadContext, scene: Scene) -> None:
    """The light of a scene that has none."""
    context.warn(context.file, f"has no lights. A grey dome of radiance {_GREY_DOME} is used.")
    scene.add_light(Light(DomeLight(), radiance=[_GREY_DOME] * 3, path="/grey_dome"))


def _get(context: ReadContext, prim: Usd.Prim, name: str, default):
    """An input: inputs:NAME, or NAME alone as before USD 21.02."""
    attribute, older = prim.GetAttribute(f"inputs:{name}"), prim.GetAttribute(name)
    if not (attribute and attribute.HasAuthoredValue()) and older and older.HasAuthoredValue():
        attribute = older
    return context.get(attribute, default)


def _number(context: ReadContext, prim: Usd.Prim, name: str, default: float) -> float:
    value = _get(context, prim, name, default)
    if not isinstance(value, int | float) or not math.isfinite(value):
        context.warn(prim.GetPath(), f"{name} must be a finite number, got {value}. {default} is used.")
        return default
    return float(value)


def _read_shape(context: ReadContext, prim: Usd.Prim, kind: str):
    if kind in ("DomeLight", "DomeLight_1"):
        return _read_dome(context, prim)
    if kind == "DistantLight":
        angle = _number(context, prim, "angle", 0.53)
        if not 0.0 <= angle <= 360.0:
            context.warn(prim.GetPath(), f"angle must be in 0..360 degrees, got {angle}. 0.53 is used.")
            angle = 0.53
        return DistantLight(angle)
    sizes = {
        "RectLight": (("width", 1.0), ("height", 1.0)),
        "DiskLight": (("radius", 0.5),),
        "SphereLight": (("radius", 0.5),),
        "CylinderLight": (("length", 1.0), ("radius", 0.5)),
    }.get(kind)
    if sizes is None:
        context.warn(prim.GetPath(), f"lights of type {kind or 'none'} are not supported. It is left out.")
        return None
    values = [_number(context, prim, name, default) for name, default in sizes]
    for (name, _), value in zip(sizes, values, strict=True):
        if value <= 0:
            context.warn(prim.GetPath(), f"{name} must be > 0, got {value}. The light is left out.")
            return None
    if kind == "RectLight":
        if _get(context, prim, "texture:file", Sdf.AssetPath()).path:
            context.warn(prim.GetPath(), "textures on rect lights are not supported. It shines evenly.")
        return RectLight(*values)
    return {"DiskLight": DiskLight, "SphereLight": SphereLight, "CylinderLight": CylinderLight}[kind](*values)


def _read_dome(context: ReadContext, prim: Usd.Prim) -> DomeLight:
    asset = _get(context, prim, "texture:file", None)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return DomeLight()
    layout = str(_get(context, prim, "texture:format", "automatic"))
    if layout not in ("automatic", "latlong"):
        context.warn(prim.GetPath(), f"dome images must be latlong, got '{layout}'. A uniform dome is used.")
        return DomeLight()
    try:
        attribute = prim.GetAttribute("inputs:texture:file") or prim.GetAttribute("texture:file")
        path = resolve(context, asset, attribute)
        if not path:
            raise OSError(f"@{asset.path}@ cannot be found.")
        pixels, is_8_bit = read_image(path)
    except OSError as error:
        context.warn(prim.GetPath(), f"{error} A uniform dome is used.")
        return DomeLight()
    color_space = (attribute.GetColorSpace() or "auto") if attribute else "auto"
    pixels = pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)
    if is_srgb(color_space, is_8_bit, 3):
        pixels = decode_srgb(pixels)
    is_good = np.isfinite(pixels)
    if not is_good.all():
        context.warn(prim.GetPath(), f"{path} has {int((~is_good).sum())} NaN or infinite values. They are taken as 0.")
        pixels = np.where(is_good, pixels, 0.0)
    return DomeLight(np.ascontiguousarray(pixels, dtype=np.float32), str(prim.GetPath()))


def _read_radiance(context: ReadContext, prim: Usd.Prim) -> np.ndarray:
    color = np.asarray(_get(context, prim, "color", (1, 1, 1)), dtype=np.float64).reshape(3)
    if _get(context, prim, "enableColorTemperature", False):
        kelvin = _number(context, prim, "colorTemperature", 6500.0)
        color = color * np.asarray(UsdLux.BlackbodyTemperatureAsRgb(kelvin), dtype=np.float64)
    intensity = float(_get(context, prim, "intensity", 1.0))
    exposure = float(_get(context, prim, "exposure", 0.0))
    with np.errstate(over="ignore", invalid="ignore"):
        return (color * intensity * np.exp2(exposure)).astype(np.float32)


def _rotation_of(matrix: np.ndarray) -> np.ndarray:
    """The matrix without its translation and scale."""
    rotation = Gf.Matrix4d(matrix.tolist()).RemoveScaleShear()
    result = np.array(rotation, dtype=np.float64)
    result[3, :3] = 0.0
    return result


def _warn_of_unsupported(context: ReadContext, prim: Usd.Prim) -> None:
    path = prim.GetPath()
    for name, neutral in _SHAPING.items():
        attribute = prim.GetAttribute(f"inputs:{name}")
        if attribute and attribute.HasAuthoredValue() and context.get(attribute) != neutral:
            if name == "shaping:cone:angle" and context.get(attribute) >= 90.0:
                continue
            context.warn(path, f"inputs:{name} is not supported. The light shines unshaped.", once="shaping")
    filters = prim.GetRelationship("light:filters")
    if filters and filters.GetTargets():
        context.warn(path, "light filters are not supported. They are left out.")
    for collection in ("lightLink", "shadowLink"):
        for relation in ("includes", "excludes"):
            relationship = prim.GetRelationship(f"collection:{collection}:{relation}")
            if relationship and relationship.GetTargets():
                context.warn(path, f"{collection} is not supported. The light reaches everything.", once=collection)
    enable = prim.GetAttribute("inputs:shadow:enable")
    if enable and context.get(enable) is False:
        context.warn(path, "inputs:shadow:enable = false is not supported. The light casts shadows.")
