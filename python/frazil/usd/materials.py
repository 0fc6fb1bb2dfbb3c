"""Materials: which one a prim is bound to, and its surface shader as IceMaterial or StandardMaterial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Tf, Usd, UsdShade

from .._frazil import IceMaterial, Medium, Overlay, Scene, StandardMaterial, TextureLookup
from ..ice import find_preset, preset_medium, preset_overlays
from .context import ReadContext
from .material_inputs import (
    ICE_INPUTS,
    OVERLAY_INPUTS,
    PREVIEW_IGNORED,
    PREVIEW_INPUTS,
    MaterialInput,
    find_input,
    nearest_name,
    snake_case,
)
from .shading import ShaderReader, Source

ICE_SHADER = "frazil:ice"
OVERLAY_SHADER = "frazil:overlay"
_OVERLAY_PREFIX = "overlays:"

# Inputs of shaders that Frazil does not know, and the input of UsdPreviewSurface that they come nearest to.
_NEAREST_INPUTS = {
    "diffuseColor": (
        "diffuseColor",
        "base_color",
        "baseColor",
        "diffuse_color",
        "diffuse_reflection_color",
        "basecolor",
        "diffuse",
        "Kd",
        "color",
        "albedo",
        "tint",
        "displayColor",
    ),
    "roughness": ("roughness", "specular_roughness", "specularRoughness", "reflection_roughness_constant"),
    "metallic": ("metallic", "metalness", "metallic_constant"),
    "ior": ("ior", "specular_IOR", "specular_ior", "IOR"),
    "emissiveColor": ("emissiveColor", "emission_color", "emissive_color"),
    "opacity": ("opacity", "alpha"),
}


@dataclass(frozen=True)
class BoundMaterial:
    """A material of the scene, and the primvar that its textures are looked up by (None = no texture)."""

    index: int
    texcoord_name: str | None = None


class MaterialReader:
    """Adds each material to the scene once."""

    def __init__(self, context: ReadContext, scene: Scene) -> None:
        self._context = context
        self._scene = scene
        self._shaders = ShaderReader(context)
        self._known: dict[str, BoundMaterial] = {}

    def bound_to(self, prim: Usd.Prim) -> BoundMaterial:
        """The material that the prim is bound to, or one that shows its displayColor."""
        material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("full")
        if not material:
            self._warn_of_broken_binding(prim)
            return self._add("", lambda: (StandardMaterial(uses_display_color=True), None))
        path = str(material.GetPath())
        if material.GetPrim().IsInstanceProxy():
            path = str(material.GetPrim().GetPrimInPrototype().GetPath())
        return self._add(path, lambda: self._read(material))

    def _add(self, path: str, read) -> BoundMaterial:
        if path not in self._known:
            try:
                model, texcoord_name = read()
            except (ValueError, TypeError, Tf.ErrorException) as error:
                # A broken material must not lose the meshes that it is bound to.
                self._context.warn(path, f"{' '.join(str(error).split())} displayColor is shown.")
                model, texcoord_name = StandardMaterial(uses_display_color=True), None
            index = self._scene.add_material(path or "displayColor", model)
            self._known[path] = BoundMaterial(index, texcoord_name)
        return self._known[path]

    def _warn_of_broken_binding(self, prim: Usd.Prim) -> None:
        binding = UsdShade.MaterialBindingAPI(prim).GetDirectBinding()
        path = binding.GetMaterialPath()
        if path:
            self._context.warn(
                prim.GetPath(), f"is bound to <{path}>, which is no material. Its displayColor is shown."
            )

    def _read(self, material: UsdShade.Material):
        shader, _, _ = material.ComputeSurfaceSource("frazil")  # or the universal one
        if not shader:
            return self._read_nearest(material, None)
        kind = shader.GetShaderId()
        if kind == ICE_SHADER:
            return self._read_ice(shader)
        if kind == "UsdPreviewSurface":
            return self._read_preview(shader)
        return self._read_nearest(material, shader)

    # -- frazil:ice

    def _read_ice(self, shader: UsdShade.Shader):
        path = shader.GetPath()
        self._warn_of_unknown_inputs(shader, ICE_INPUTS, frozenset(), _OVERLAY_PREFIX)
        sources = {row.name: self._shaders.read(shader, row.name) for row in ICE_INPUTS}
        values = {row.name: self._to_value(shader, row, sources[row.name]) for row in ICE_INPUTS}
        name, scale = values.pop("preset"), values.pop("preset_scale")
        preset = find_preset(name) if name != "none" else None
        if preset is not None:
            values |= {key: value for key, value in preset.inputs.items() if sources[key] is None}

        medium = self._read_medium(path, sources, values, preset, scale)
        overlays = preset_overlays(preset, scale, direction=self._up()) if preset is not None else []
        authored, masks = self._read_overlays(shader)
        values["ramp_distances"], values["ramp_colors"] = self._check_ramp(
            path, values["ramp_distances"], values["ramp_colors"]
        )
        in_medium = ("albedo", "mean_free_path", "sigma_s_prime", "sigma_a", "eta")
        model = IceMaterial(
            medium,
            overlays=overlays + authored,
            **{key: value for key, value in values.items() if key not in in_medium},
        )
        return model, _texcoord_name(self._context, path, sources | masks)

    def _read_medium(self, path, sources, values, preset, scale: float) -> Medium:
        has_sigma = sources["sigma_s_prime"] is not None or sources["sigma_a"] is not None
        has_albedo = sources["albedo"] is not None or sources["mean_free_path"] is not None
        if has_sigma and has_albedo:
            self._context.warn(
                path, "has both albedo or mean_free_path and sigma_s_prime or sigma_a. The sigmas are used."
            )
        if preset is not None and not has_albedo:
            medium = preset_medium(preset, scale, values["eta"])
            return Medium(
                values["sigma_s_prime"] or medium.sigma_s_prime, values["sigma_a"] or medium.sigma_a, values["eta"]
            )
        if has_sigma and values["sigma_s_prime"] is None:
            self._context.warn(path, "has sigma_a without sigma_s_prime. albedo and mean_free_path are used.")
            has_sigma = False
        if has_sigma:
            sigma_a = values["sigma_a"] or (0.0, 0.0, 0.0)
            return Medium(values["sigma_s_prime"], sigma_a, values["eta"])
        return Medium.from_albedo(values["albedo"], values["mean_free_path"], values["eta"], values["profile"])

    def _up(self) -> tuple[float, float, float]:
        """The stage's up axis, in its own frame: patterns are read in the frames of its meshes."""
        return (0.0, 0.0, 1.0) if self._context.is_z_up else (0.0, 1.0, 0.0)

    def _read_overlays(self, ice: UsdShade.Shader) -> tuple[list[Overlay], dict[str, Source | None]]:
        """The overlays that are connected, in the order of their inputs' names, and their texture masks."""
        overlays: list[Overlay] = []
        masks: dict[str, Source | None] = {}
        connected = sorted(
            (i for i in ice.GetInputs() if i.GetBaseName().startswith(_OVERLAY_PREFIX)), key=lambda i: i.GetBaseName()
        )
        for overlay_input in connected:
            attributes = overlay_input.GetValueProducingAttributes()
            shader = UsdShade.Shader(attributes[0].GetPrim()) if attributes else None
            if not shader or shader.GetShaderId() != OVERLAY_SHADER:
                self._context.warn(
                    ice.GetPath(),
                    f"{overlay_input.GetBaseName()} must be connected to a {OVERLAY_SHADER}. It is left out.",
                )
                continue
            self._warn_of_unknown_inputs(shader, OVERLAY_INPUTS, frozenset())
            sources = {row.name: self._shaders.read(shader, row.name) for row in OVERLAY_INPUTS}
            values = {row.name: self._to_value(shader, row, sources[row.name]) for row in OVERLAY_INPUTS}
            if sources["direction"] is None:
                values["direction"] = self._up()
            if values["age_end"] < values["age_begin"]:
                self._context.warn(
                    shader.GetPath(),
                    f"age_end must be >= age_begin, {values['age_begin']:g}, got {values['age_end']:g}. "
                    f"{values['age_begin']:g} is used.",
                )
                values["age_end"] = values["age_begin"]
            name = overlay_input.GetBaseName().removeprefix(_OVERLAY_PREFIX)
            overlays.append(Overlay(**values, name=name))
            masks[str(shader.GetPath())] = sources["mask"]
        return overlays, masks

    def _check_ramp(self, path, distances, colors):
        if len(distances) != len(colors):
            self._context.warn(
                path,
                f"ramp_colors must have {len(distances)} values (one per ramp_distances), got {len(colors)}. "
                f"The ramp is left out.",
            )
            return [], []
        if any(b <= a for a, b in zip(distances, distances[1:], strict=False)):
            self._context.warn(path, "ramp_distances must be strictly increasing. The ramp is left out.")
            return [], []
        return distances, colors

    # -- UsdPreviewSurface

    def _read_preview(self, shader: UsdShade.Shader):
        self._warn_of_unknown_inputs(shader, PREVIEW_INPUTS, PREVIEW_IGNORED)
        sources = {row.name: self._shaders.read(shader, row.name) for row in PREVIEW_INPUTS}
        normal = self._shaders.read(shader, "normal")
        displacement = self._shaders.read(shader, "displacement")
        if displacement is not None and (displacement.lookup is not None or displacement.value):
            self._context.warn(shader.GetPath(), "displacement is not supported. The surface is rendered as it is.")
        return self._standard(shader, sources, normal)

    def _standard(self, shader: UsdShade.Shader, sources: dict[str, Source | None], normal: Source | None):
        values = {}
        for row in PREVIEW_INPUTS:
            source = sources.get(row.name)
            if source is not None and source.is_display_color:
                continue
            values[snake_case(row.name)] = self._to_value(shader, row, source)
        diffuse = sources.get("diffuseColor")
        model = StandardMaterial(
            uses_display_color=diffuse is not None and diffuse.is_display_color,
            normal=normal.lookup if normal is not None else None,
            **values,
        )
        return model, _texcoord_name(self._context, shader.GetPath(), {**sources, "normal": normal})

    # -- anything else

    def _read_nearest(self, material: UsdShade.Material, shader: UsdShade.Shader | None):
        context = self._context
        if shader is None:
            shader = _any_surface_shader(material)
        if shader is None:
            context.warn(material.GetPath(), "has no surface shader. displayColor is shown.")
            return StandardMaterial(uses_display_color=True), None
        kind = shader.GetShaderId() or shader.GetPrim().GetTypeName() or "?"
        sources: dict[str, Source | None] = {}
        for name, candidates in _NEAREST_INPUTS.items():
            found = next((c for c in candidates if shader.GetInput(c)), None)
            if found:
                sources[name] = self._shaders.read(shader, found)
        context.warn(
            shader.GetPath(),
            f"the shader '{kind}' is not supported. Its nearest match in UsdPreviewSurface is rendered.",
            once="shader",
        )
        if sources.get("diffuseColor") is None:
            return StandardMaterial(uses_display_color=True), None
        return self._standard(shader, sources, None)

    # -- values

    def _warn_of_unknown_inputs(
        self, shader, table: tuple[MaterialInput, ...], ignored: frozenset[str], prefix: str = ""
    ) -> None:
        for shader_input in shader.GetInputs():
            name = shader_input.GetBaseName()
            if prefix and name.startswith(prefix):
                continue
            if find_input(table, name) is None and name not in ignored:
                self._context.warn(
                    shader.GetPath(), f"has no input '{name}'. The nearest is '{nearest_name(table, name)}'."
                )

    def _to_value(self, shader: UsdShade.Shader, row: MaterialInput, source: Source | None):
        """The source as the core wants it: in metres, in range; the row's default where there is none."""
        if source is None:
            return row.default
        if source.lookup is not None:
            if row.takes_texture:
                return _scaled(source.lookup, self._context.meters_per_unit**row.length_power)
            self._context.warn(shader.GetPath(), f"{row.name} takes no texture. {row.default} is used.")
            return row.default
        try:
            return self._checked(shader, row, source.value)
        except (TypeError, ValueError):
            self._context.warn(
                shader.GetPath(), f"{row.name} must be a {row.kind}, got {source.value!r}. {row.default} is used."
            )
            return row.default

    def _checked(self, shader: UsdShade.Shader, row: MaterialInput, value):
        if row.kind == "bool":
            return bool(value)
        if row.kind == "token":
            if str(value) in row.choices:
                return str(value)
            self._context.warn(
                shader.GetPath(), f"{row.name} must be {row.rule}, got '{value}'. '{row.default}' is used."
            )
            return row.default
        array = np.asarray(value, dtype=np.float64)
        if row.kind == "color" and array.size == 1:
            array = np.repeat(array.reshape(1), 3)
        if row.kind == "float" and array.size == 3:
            array = array.reshape(3).mean()  # a colour where a number is wanted
        width = {"float": 1, "int": 1, "color": 3, "vector": 3, "floats": -1, "colors": 3}[row.kind]
        array = array.reshape(-1, 3) if row.kind == "colors" else array.reshape(width)
        array = array * self._context.meters_per_unit**row.length_power
        if not np.isfinite(array).all():
            self._context.warn(shader.GetPath(), f"{row.name} must be finite, got {value}. {row.default} is used.")
            return row.default
        if (array < row.minimum).any() or (array > row.maximum).any():
            clamped = np.clip(array, row.minimum, row.maximum)
            unit = {1: " m", -1: " 1/m", 0: ""}[row.length_power]
            self._context.warn(
                shader.GetPath(),
                f"{row.name} must be {row.rule}{unit}, got {_text(array)}. {_text(clamped)} is used.",
            )
            array = clamped
        if row.kind == "float":
            return float(array[0])
        if row.kind == "int":
            return round(float(array[0]))
        if row.kind == "colors":
            return [tuple(color) for color in array.tolist()]
        return tuple(array.tolist())


def _text(array: np.ndarray) -> str:
    values = ", ".join(f"{value:g}" for value in array.reshape(-1))
    return values if array.size == 1 else f"({values})"


def _scaled(lookup: TextureLookup, unit: float) -> TextureLookup:
    """A lookup whose values are multiplied by a unit."""
    if unit == 1.0:
        return lookup
    return TextureLookup(
        lookup.texture,
        lookup.first_channel,
        [unit * x for x in lookup.scale],
        [unit * x for x in lookup.bias],
        lookup.st_scale,
        lookup.st_rotation,
        lookup.st_translation,
    )


def _texcoord_name(context: ReadContext, path, sources: dict[str, Source | None]) -> str | None:
    names = list(dict.fromkeys(s.texcoord_name for s in sources.values() if s is not None and s.texcoord_name))
    if len(names) > 1:
        context.warn(path, f"reads textures by several primvars ({', '.join(names)}). '{names[0]}' is used for all.")
    return names[0] if names else None


def _any_surface_shader(material: UsdShade.Material) -> UsdShade.Shader | None:
    """The surface shader of whatever render context there is."""
    for output in material.GetSurfaceOutputs():
        for attribute in UsdShade.Utils.GetValueProducingAttributes(output):
            if UsdShade.Output.IsOutput(attribute):
                return UsdShade.Shader(attribute.GetPrim())
    return None
