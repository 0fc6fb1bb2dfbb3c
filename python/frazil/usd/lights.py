"""UsdLux lights: shapes, radiance, shaping, shadows, linking, multipliers per component and light groups."""

from __future__ import annotations

import math

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux

from .._frazil import (
    CylinderLight,
    DiskLight,
    DistantLight,
    DomeLight,
    IesProfile,
    Light,
    MeshLight,
    RectLight,
    Scene,
    ShadowRules,
    Shaping,
    SphereLight,
)
from ..ies import read_ies
from .context import ReadContext, is_singular
from .light_images import read_light_image
from .light_names import LIGHT_GROUP, warn_of_unknown_names
from .linking import LinkReader
from .textures import resolve

_GREY_DOME = 0.5
_POINT_RADIUS = 1e-3  # metres, of lights that are told to be points or lines

# The dome of UsdLuxDomeLight_1 may stand on z: its own frame, pole +y, turned by 90 degrees about x.
_POLE_Y_TO_Z = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=np.float64)


def is_light(prim: Usd.Prim) -> bool:
    """Whether the prim emits light."""
    return prim.HasAPI(UsdLux.LightAPI)


class LightReader:
    """Reads lights while the stage is walked; they join the scene at the end, when all objects are known."""

    def __init__(self, context: ReadContext, scene: Scene, links: LinkReader) -> None:
        self._context = context
        self._scene = scene
        self._links = links
        self._lights: list[tuple[Light, Usd.Prim | None]] = []
        self._shining: set[int] = set()  # objects that a mesh light stands for
        self._portals: set[Sdf.Path] = set()  # that the walk has met

    def read(self, prim: Usd.Prim, matrix: np.ndarray, path: str) -> None:
        """The prim's light, placed by `matrix` (its frame to the world); a warning where it cannot be used."""
        kind = str(prim.GetTypeName())
        if kind == "PortalLight":
            self._portals.add(prim.GetPath())  # read with its dome
            return
        if is_singular(matrix):
            self._context.warn(path, "its transform cannot be inverted (a scale of 0?). The light is left out.")
            return
        shape = _read_shape(self._context, prim, kind, matrix)
        if shape is None:
            return
        if isinstance(shape, DomeLight | DistantLight):
            matrix = _rotation_of(matrix)
        if kind == "DomeLight_1":
            pole = _get(self._context, prim, "poleAxis", "scene")
            if pole == "Z" or (pole == "scene" and self._context.is_z_up):
                matrix = _POLE_Y_TO_Z @ matrix
        self._add(prim, shape, matrix, path)

    def read_mesh(self, prim: Usd.Prim, matrix: np.ndarray, path: str, index: int) -> None:
        """The light of a mesh (MeshLightAPI) that the scene shows as the object `index`."""
        self._shining.add(index)
        factors = None
        if _get(self._context, prim, "light:materialSyncMode", "materialGlowTintsLight") == "materialGlowTintsLight":
            factors = self._scene.triangle_emission(index)
        mesh = self._scene.mesh(self._scene.objects[index].mesh)
        if not mesh.area > 0.0:
            self._context.warn(path, "area must be > 0, got 0. The light is left out.")
            return
        is_two_sided = bool(self._context.get(UsdGeom.Gprim(prim).GetDoubleSidedAttr(), False))
        self._add(prim, MeshLight(mesh, index, factors, is_two_sided=is_two_sided), matrix, path)

    def add_to_scene(self) -> None:
        """Add what was read, linked, and a mesh light for every object whose material emits light."""
        for path in sorted(self._portals - self._portals_of_domes()):
            self._context.warn(path, "a portal guides the light of a dome that names it in its portals. None does.")
        for light, prim in self._lights:
            light.lit = self._links.lit_by(prim)
            casters = self._links.casters_of(prim)
            if casters is not None:
                light.shadow = light.shadow.with_casters(casters)
            self._scene.add_light(light)
        for index in self._scene.emissive_objects():
            if index in self._shining:
                continue
            item = self._scene.objects[index]
            mesh = self._scene.mesh(item.mesh)
            if not mesh.area > 0.0:
                continue  # nothing of it is seen either
            shape = MeshLight(
                mesh,
                index,
                self._scene.triangle_emission(index),
                is_two_sided=True,
                is_material=True,
            )
            self._scene.add_light(Light(shape, matrix=item.matrix, path=item.path))

    def _portals_of_domes(self) -> set[Sdf.Path]:
        found: set[Sdf.Path] = set()
        for _, prim in self._lights:
            relationship = prim.GetRelationship("portals")
            found.update(relationship.GetForwardedTargets() if relationship else ())
        return found

    def _add(self, prim: Usd.Prim, shape, matrix: np.ndarray, path: str) -> None:
        context = self._context
        _warn_of_unsupported(context, prim)
        warn_of_unknown_names(context, prim)
        radiance = _read_radiance(context, prim)
        if not np.isfinite(radiance).all():
            context.warn(path, f"intensity times color must be finite, got {radiance.tolist()}. The light is left out.")
            return
        group = context.get(prim.GetAttribute(LIGHT_GROUP)) or context.get(
            prim.GetAttribute(f"inputs:{LIGHT_GROUP}"), ""
        )
        light = Light(
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
            shaping=_read_shaping(context, prim),
            shadow=_read_shadow(context, prim),
        )
        try:
            light.check()
        except ValueError as error:
            context.warn(path, f"{str(error).removeprefix(f'{path}: ')} The light is left out.")
            return
        self._lights.append((light, prim))


def add_grey_dome(context: ReadContext, scene: Scene) -> None:
    """The light of a scene that has none."""
    context.warn(context.file, f"has no lights. A grey dome of radiance {_GREY_DOME} is used.")
    scene.add_light(Light(DomeLight(), radiance=[_GREY_DOME] * 3, path="/grey_dome"))


def _get(context: ReadContext, prim: Usd.Prim, name: str, default):
    """An input: inputs:NAME, or NAME alone as before USD 21.02 (and as some still are)."""
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


def _read_shape(context: ReadContext, prim: Usd.Prim, kind: str, matrix: np.ndarray):
    if kind in ("DomeLight", "DomeLight_1"):
        return _read_dome(context, prim, matrix)
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
    values = _hinted_sizes(context, prim, kind, values)
    for (name, _), value in zip(sizes, values, strict=True):
        if value <= 0:
            context.warn(prim.GetPath(), f"{name} must be > 0, got {value}. The light is left out.")
            return None
    if kind == "RectLight":
        return RectLight(*values, _read_image(context, prim, "It shines evenly."), str(prim.GetPath()))
    return {"DiskLight": DiskLight, "SphereLight": SphereLight, "CylinderLight": CylinderLight}[kind](*values)


def _hinted_sizes(context: ReadContext, prim: Usd.Prim, kind: str, values: list[float]) -> list[float]:
    # treatAsPoint and treatAsLine let a renderer that has no areas leave them out. Ours has: only lights of radius 0
    # are given a small one for it, which with `normalize` is as strong.
    hint = {"SphereLight": "treatAsPoint", "CylinderLight": "treatAsLine"}.get(kind)
    if hint is None or not context.get(prim.GetAttribute(hint), False) or values[-1] != 0.0:
        return values
    radius = _POINT_RADIUS / context.meters_per_unit
    if not _get(context, prim, "normalize", False):
        context.warn(
            prim.GetPath(),
            f"{hint} with radius 0 has no area to shine from: normalize should be on. Radius {radius:g} is used.",
        )
    return [*values[:-1], radius]


def _read_image(context: ReadContext, prim: Usd.Prim, instead: str) -> np.ndarray | None:
    asset = _get(context, prim, "texture:file", None)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return None
    attribute = prim.GetAttribute("inputs:texture:file") or prim.GetAttribute("texture:file")
    return read_light_image(context, prim, attribute, asset, instead)


def _read_dome(context: ReadContext, prim: Usd.Prim, matrix: np.ndarray) -> DomeLight:
    layout = str(_get(context, prim, "texture:format", "automatic"))
    pixels = None
    if layout in ("automatic", "latlong"):
        pixels = _read_image(context, prim, "A uniform dome is used.")
    else:
        context.warn(prim.GetPath(), f"dome images must be latlong, got '{layout}'. A uniform dome is used.")
    return DomeLight(pixels, str(prim.GetPath()), _read_portals(context, prim, matrix))


def _read_portals(context: ReadContext, dome: Usd.Prim, matrix: np.ndarray) -> list[np.ndarray]:
    """The unit square of each of a dome's portals to the world; `matrix` places the dome."""
    portals = []
    relationship = dome.GetRelationship("portals")
    for path in relationship.GetForwardedTargets() if relationship else ():
        prim = context.stage.GetPrimAtPath(path)
        if not prim or prim.GetTypeName() != "PortalLight":
            context.warn(dome.GetPath(), f"portals must be PortalLight prims, got {path}. It is left out.")
            continue
        if UsdGeom.Imageable(prim).ComputeVisibility(context.time) == UsdGeom.Tokens.invisible:
            continue
        size = [_number(context, prim, name, 1.0) for name in ("width", "height")]
        # Where an instance holds both, it moves them together.
        to_dome = context.local_to_world(prim) @ np.linalg.inv(context.local_to_world(dome))
        portal = np.diag([*size, 1.0, 1.0]) @ to_dome @ matrix
        if min(size) <= 0.0 or is_singular(portal):
            context.warn(path, f"width, height and scale must be > 0, got {size}. The portal is left out.")
            continue
        portals.append(np.ascontiguousarray(portal))
    return portals


def _read_shaping(context: ReadContext, prim: Usd.Prim) -> Shaping:
    if not prim.HasAPI(UsdLux.ShapingAPI):
        return Shaping()
    names = ("shaping:cone:angle", "shaping:cone:softness")
    has_cone = any(prim.GetAttribute(f"inputs:{name}").HasAuthoredValue() for name in names)
    return Shaping(
        cone_angle=_within(context, prim, "shaping:cone:angle", 90.0, 0.0, 180.0) if has_cone else 180.0,
        cone_softness=_within(context, prim, "shaping:cone:softness", 0.0, 0.0, math.inf),
        focus=_within(context, prim, "shaping:focus", 0.0, 0.0, math.inf),
        focus_tint=_color(context, prim, "shaping:focusTint"),
        ies=_read_profile(context, prim),
        ies_angle_scale=_number(context, prim, "shaping:ies:angleScale", 0.0),
        ies_normalize=bool(_get(context, prim, "shaping:ies:normalize", False)),
    )


def _read_profile(context: ReadContext, prim: Usd.Prim) -> IesProfile | None:
    asset = _get(context, prim, "shaping:ies:file", None)
    if not isinstance(asset, Sdf.AssetPath) or not asset.path:
        return None
    attribute = prim.GetAttribute("inputs:shaping:ies:file") or prim.GetAttribute("shaping:ies:file")
    try:
        file = resolve(context, asset, attribute)
        if not file:
            raise OSError(f"@{asset.path}@ cannot be found.")
        return read_ies(file)
    except (OSError, ValueError) as error:
        context.warn(prim.GetPath(), f"{error} The light shines without its profile.")
        return None


def _read_shadow(context: ReadContext, prim: Usd.Prim) -> ShadowRules:
    if not prim.HasAPI(UsdLux.ShadowAPI):
        return ShadowRules()
    scale = context.meters_per_unit
    return ShadowRules(
        is_enabled=bool(_get(context, prim, "shadow:enable", True)),
        color=_color(context, prim, "shadow:color"),
        distance=_number(context, prim, "shadow:distance", -1.0) * scale,
        falloff=_number(context, prim, "shadow:falloff", -1.0) * scale,
        falloff_gamma=_within(context, prim, "shadow:falloffGamma", 1.0, 1e-6, math.inf),
    )


def _within(context: ReadContext, prim: Usd.Prim, name: str, default: float, low: float, high: float) -> float:
    value = _number(context, prim, name, default)
    if low <= value <= high:
        return value
    rule = f"in {low:g}..{high:g}" if math.isfinite(high) else f">= {low:g}"
    nearest = min(max(value, low), high)
    context.warn(prim.GetPath(), f"{name} must be {rule}, got {value:g}. {nearest:g} is used.")
    return nearest


def _color(context: ReadContext, prim: Usd.Prim, name: str) -> list[float]:
    value = [float(x) for x in _get(context, prim, name, (0, 0, 0))]
    if all(map(math.isfinite, value)):
        return value
    context.warn(prim.GetPath(), f"{name} must be finite, got {value}. Black is used.")
    return [0.0, 0.0, 0.0]


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
    filters = prim.GetRelationship("light:filters")
    if filters and filters.GetTargets():
        context.warn(path, "light filters are not supported. They are left out.")
