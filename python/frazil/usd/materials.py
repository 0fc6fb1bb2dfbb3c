"""Materials: which one a prim is bound to, and its surface shader as IceMaterial or StandardMaterial."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Tf, Usd, UsdShade

from .._frazil import Density, IceMaterial, Medium, Overlay, Scene, StandardMaterial
from ..grids import read_density
from ..ice import find_preset, preset_medium, preset_overlays
from .context import ReadContext
from .displacement import SurfaceDisplacement, read_displacement
from .expression import Expression
from .material_inputs import (
    DENSITY_INPUTS,
    ICE_INPUTS,
    OVERLAY_INPUTS,
    PREVIEW_IGNORED,
    PREVIEW_INPUTS,
    snake_case,
)
from .material_values import ShaderValues, texcoord_name
from .mtlx_library import DENSITY_NODE, ICE_NODE, OVERLAY_NODE, OVERLAY_SLOTS
from .nearest_surface import any_surface_shader, larger_of_mix, read_nearest
from .shading import ShaderReader
from .surface_models import MODELS, SurfaceModelReader

ICE_SHADERS = ("frazil:ice", ICE_NODE)
OVERLAY_SHADERS = ("frazil:overlay", OVERLAY_NODE)
DENSITY_SHADERS = ("frazil:density", DENSITY_NODE)
PREVIEW_SHADERS = ("UsdPreviewSurface", "ND_UsdPreviewSurface_surfaceshader")
# The surface of the first of these that the material has is read.
RENDER_CONTEXTS = ("frazil", "mtlx", "")
_OVERLAY_PREFIX = "overlays:"


@dataclass(frozen=True)
class BoundMaterial:
    """A material of the scene, the primvar that its textures are looked up by (None = no texture), and displacement."""

    index: int
    texcoord_name: str | None = None
    displacement: SurfaceDisplacement | None = None


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
            return self._add("", None, lambda: (StandardMaterial(uses_display_color=True), None))
        path = str(material.GetPath())
        if material.GetPrim().IsInstanceProxy():
            path = str(material.GetPrim().GetPrimInPrototype().GetPath())
        return self._add(path, material, lambda: self._read(material))

    def _add(self, path: str, material: UsdShade.Material | None, read) -> BoundMaterial:
        if path not in self._known:
            displacement = None
            try:
                model, primvar = read()
                if material is not None:
                    displacement = read_displacement(self._shaders, material, RENDER_CONTEXTS)
            except (ValueError, TypeError, IndexError, Tf.ErrorException) as error:
                # A broken material must not lose the meshes that it is bound to.
                self._context.warn(path, f"{' '.join(str(error).split())} displayColor is shown.")
                model, primvar = StandardMaterial(uses_display_color=True), None
            index = self._scene.add_material(path or "displayColor", model)
            if primvar is None and displacement is not None:
                primvar = displacement.texcoord_name
            self._known[path] = BoundMaterial(index, primvar, displacement)
        return self._known[path]

    def _warn_of_broken_binding(self, prim: Usd.Prim) -> None:
        """Name what an unbound prim is bound to after all: nothing that is there, or a material for previews alone."""
        preview, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("preview")
        path, holder = None, prim
        while holder and not path:  # its own binding, else the one it inherits
            path = UsdShade.MaterialBindingAPI(holder).GetDirectBinding().GetMaterialPath()
            holder = holder.GetParent()
        if path:
            self._context.warn(
                prim.GetPath(), f"is bound to <{path}>, which is no material. Its displayColor is shown."
            )
        elif preview:
            self._context.warn(
                prim.GetPath(),
                f"is bound to <{preview.GetPath()}> for the purpose 'preview' alone. Its displayColor is shown; bind a "
                "material for 'full' or for all purposes.",
            )

    def _read(self, material: UsdShade.Material):
        found = []
        for render_context in RENDER_CONTEXTS:
            shader, _, _ = material.ComputeSurfaceSource(render_context)  # of this context, else the universal one
            if shader:
                found.append(larger_of_mix(self._shaders, shader))
        known = (*ICE_SHADERS, *PREVIEW_SHADERS, *MODELS)
        shader = next((s for s in found if s.GetShaderId() in known), found[0] if found else None)
        if shader is None:
            shader = any_surface_shader(material)
        if shader is None:
            self._context.warn(material.GetPath(), "has no surface shader. displayColor is shown.")
            return StandardMaterial(uses_display_color=True), None
        kind = shader.GetShaderId()
        if kind in ICE_SHADERS:
            return self._read_ice(shader)
        if kind in PREVIEW_SHADERS:
            return self._read_preview(shader)
        if kind in MODELS:
            return SurfaceModelReader(self._shaders, shader).read()
        return read_nearest(self._shaders, shader)

    # -- frazil:ice

    def _read_ice(self, shader: UsdShade.Shader):
        path = shader.GetPath()
        read = ShaderValues(
            self._shaders, shader, ICE_INPUTS, frozenset((*OVERLAY_SLOTS, "density")), (_OVERLAY_PREFIX,)
        )
        values = read.values
        name, scale, depth = (values.pop(key) for key in ("preset", "preset_scale", "preset_depth"))
        preset = find_preset(name) if name != "none" else None
        if preset is not None:
            values |= {key: value for key, value in preset.inputs.items() if key not in read.authored}

        medium = self._read_medium(path, read.authored, values, preset, (scale, depth))
        overlays = preset_overlays(preset, scale, direction=self._up()) if preset is not None else []
        authored, masks = self._read_overlays(shader)
        values["ramp_distances"], values["ramp_colors"] = self._check_ramp(
            path, values["ramp_distances"], values["ramp_colors"]
        )
        in_medium = ("albedo", "mean_free_path", "sigma_s_prime", "sigma_a", "eta")
        model = IceMaterial(
            medium,
            overlays=overlays + authored,
            density=self._read_density(shader),
            **{key: value for key, value in values.items() if key not in in_medium},
        )
        return model, texcoord_name(self._context, path, [*read.expressions.values(), *masks])

    def _read_medium(self, path, authored: set[str], values, preset, size: tuple[float, float]) -> Medium:
        has_sigma = bool(authored & {"sigma_s_prime", "sigma_a"})
        has_albedo = bool(authored & {"albedo", "mean_free_path"})
        if has_sigma and has_albedo:
            self._context.warn(
                path, "has both albedo or mean_free_path and sigma_s_prime or sigma_a. The sigmas are used."
            )
        if preset is not None and not has_albedo:
            medium = preset_medium(preset, *size, values["eta"])
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

    def _read_overlays(self, ice: UsdShade.Shader) -> tuple[list[Overlay], list[Expression]]:
        """The overlays that are connected, in the order of their inputs' names, and what feeds their masks."""
        overlays: list[Overlay] = []
        masks: list[Expression] = []
        connected = sorted(
            name
            for name in (i.GetBaseName() for i in ice.GetInputs())
            if name.startswith(_OVERLAY_PREFIX) or name in OVERLAY_SLOTS
        )
        for name in connected:
            shader = self._shaders.shader_of(ice, name)
            if shader is None or shader.GetShaderId() not in OVERLAY_SHADERS:
                self._context.warn(
                    ice.GetPath(), f"{name} must be connected to a {OVERLAY_SHADERS[0]}. It is left out."
                )
                continue
            read = ShaderValues(self._shaders, shader, OVERLAY_INPUTS)
            values = read.values
            if "direction" not in read.authored:
                values["direction"] = self._up()
            if values["age_end"] < values["age_begin"]:
                self._context.warn(
                    shader.GetPath(),
                    f"age_end must be >= age_begin, {values['age_begin']:g}, got {values['age_end']:g}. "
                    f"{values['age_begin']:g} is used.",
                )
                values["age_end"] = values["age_begin"]
            overlays.append(Overlay(**values, name=name.removeprefix(_OVERLAY_PREFIX)))
            if "mask" in read.expressions:
                masks.append(read.expressions["mask"])
        return overlays, masks

    def _read_density(self, ice: UsdShade.Shader) -> Density:
        """The density that is connected; the same everywhere where there is none, or none that can be read."""
        shader = self._shaders.shader_of(ice, "density")
        if shader is None or shader.GetShaderId() not in DENSITY_SHADERS:
            if ice.GetInput("density"):
                self._context.warn(
                    ice.GetPath(), f"density must be connected to a {DENSITY_SHADERS[0]}. It is left out."
                )
            return Density()
        values = ShaderValues(self._shaders, shader, DENSITY_INPUTS)
        noise = {name: values.values[name] for name in ("scale", "absorption", "contrast", "size", "octaves", "seed")}
        if "file" not in values.authored:
            return Density(**noise)
        file, grid = values.values["file"], values.values["grid"]
        if not file:
            return Density()
        try:
            return read_density(file, grid, scale=noise["scale"], absorption=noise["absorption"])
        except (OSError, KeyError, ValueError, ImportError) as error:
            message = str(error.args[0]) if isinstance(error, KeyError) else str(error)
            self._context.warn(shader.GetPath(), f"{message} The density is left out.")
            return Density()

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
        read = ShaderValues(self._shaders, shader, PREVIEW_INPUTS, PREVIEW_IGNORED)
        diffuse = read.expressions.get("diffuseColor")
        model = StandardMaterial(
            uses_display_color=diffuse is not None and diffuse.is_display_color,
            **{snake_case(name): value for name, value in read.values.items()},
        )
        return model, texcoord_name(self._context, shader.GetPath(), list(read.expressions.values()))
