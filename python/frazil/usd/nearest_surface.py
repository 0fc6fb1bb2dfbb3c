"""Surfaces that Frazil does not know as the UsdPreviewSurface that comes nearest: Arnold, RenderMan, MDL, glTF, unlit.

Model: inputs are found by the names that are usual for them; a color counts times its weight, and not at all where the
shader switches it off. Images that MDL's OmniPBR names in its own inputs are read too.
Not: what the shader does beyond that. Each one is named in a warning.
"""

from __future__ import annotations

import numpy as np
from pxr import UsdShade

from .._frazil import StandardMaterial
from .expression import Expression, Placement, image_expression
from .material_inputs import PREVIEW_INPUTS, find_input, snake_case
from .material_values import texcoord_name, to_value
from .shading import ShaderReader, UsdNode

UNLIT_SHADERS = ("ND_surface_unlit",)
MIX_SHADERS = ("ND_mix_surfaceshader",)

# Each input of UsdPreviewSurface, and what others call it.
_NAMES = {
    "diffuseColor": (
        "diffuseColor",
        "base_color",
        "baseColor",
        "diffuse_color",
        "diffuse_color_constant",
        "diffuse_reflection_color",
        "basecolor",
        "diffuse",
        "Kd",
        "color",
        "albedo",
        "tint",
        "glass_color",
        "displayColor",
    ),
    "roughness": (
        "roughness",
        "specular_roughness",
        "specularRoughness",
        "reflection_roughness_constant",
        "frosting_roughness",
    ),
    "metallic": ("metallic", "metalness", "metallic_constant"),
    "ior": ("ior", "specular_IOR", "specular_ior", "IOR", "glass_ior"),
    "emissiveColor": ("emissiveColor", "emission_color", "emissive_color", "emissive", "glowColor"),
    "opacity": ("opacity", "alpha", "opacity_constant", "geometry_opacity"),
    "normal": ("normal", "geometry_normal"),
}
# What multiplies a color, and its value where it is not authored.
_WEIGHTS = {
    "base_color": (("base", 1.0), ("base_weight", 1.0)),
    "diffuseColor": (("diffuseGain", 1.0),),
    "emission_color": (("emission", 0.0), ("emission_weight", 0.0), ("emission_luminance", 0.0)),
    "emissive_color": (("emissive_intensity", 1.0),),
    "emissive": (("emissive_strength", 1.0),),
    "glowColor": (("glowGain", 0.0),),
}
_SWITCHES = {"emissive_color": "enable_emission", "opacity_constant": "enable_opacity"}
# OmniPBR: the input that names an image, its channels, and what switches it on.
_IMAGES = {
    "diffuseColor": ("diffuse_texture", (0, 1, 2), ""),
    "normal": ("normalmap_texture", (0, 1, 2), ""),
    "roughness": ("ORM_texture", (1,), "enable_ORM_texture"),
    "metallic": ("ORM_texture", (2,), "enable_ORM_texture"),
}


def read_nearest(reader: ShaderReader, shader: UsdShade.Shader):
    """The material, and the primvar of its images."""
    context = reader.context
    if shader.GetShaderId() in UNLIT_SHADERS:
        return _read_unlit(reader, shader)
    context.warn(
        shader.GetPath(),
        f"the shader '{_name_of(shader)}' is not supported. Its nearest match in UsdPreviewSurface is rendered.",
        once="shader",
    )
    expressions = {name: fed for name in _NAMES if (fed := _find(reader, shader, name)) is not None}
    if "diffuseColor" not in expressions:
        return StandardMaterial(uses_display_color=True), None
    values = {
        name: to_value(context, shader.GetPath(), find_input(PREVIEW_INPUTS, name), fed)
        for name, fed in expressions.items()
    }
    model = StandardMaterial(
        uses_display_color=expressions["diffuseColor"].is_display_color,
        **{snake_case(name): value for name, value in values.items()},
    )
    return model, texcoord_name(context, shader.GetPath(), list(expressions.values()))


def larger_of_mix(reader: ShaderReader, shader: UsdShade.Shader) -> UsdShade.Shader:
    """The surface of the larger weight where a shader mixes two, after a warning; others as they are."""
    for _ in range(16):
        if shader.GetShaderId() not in MIX_SHADERS:
            return shader
        share = reader.read(shader, "mix")
        weight = 0.0 if share is None else float(share.bias[0]) if share.image is None else share.mean()[0]
        name = "fg" if weight > 0.5 else "bg"
        reader.context.warn(
            shader.GetPath(),
            f"mixes two surfaces, which is not supported. '{name}' is rendered, which has the larger weight.",
        )
        found = reader.shader_of(shader, name)
        if found is None:
            return shader
        shader = found
    return shader


def _name_of(shader: UsdShade.Shader) -> str:
    kind = shader.GetShaderId()
    if not kind:
        asset = shader.GetSourceAsset("mdl") or shader.GetSourceAsset()
        kind = asset.path if asset else ""
    return kind or shader.GetPrim().GetTypeName() or "?"


def _find(reader: ShaderReader, shader: UsdShade.Shader, name: str) -> Expression | None:
    """What feeds the input that stands for one of UsdPreviewSurface's."""
    image = _image_of(reader, shader, name)
    if image is not None:
        return image
    own = next((n for n in _NAMES[name] if shader.GetInput(n)), None)
    fed = reader.read(shader, own) if own else None
    switch = _SWITCHES.get(own)
    if fed is None or (switch and not _is_on(reader, shader, switch)):
        return None
    options = _WEIGHTS.get(own, ())
    weight = next((n for n, _ in options if shader.GetInput(n)), None)
    share = reader.read(shader, weight) if weight else None
    if share is None and options:
        share = Expression.constant(options[0][1])
    if share is None or fed.is_display_color:
        return fed
    if share.image is not None:
        reader.context.warn(shader.GetPath(), f"{weight} takes no texture here. Its mean is used.")
    return fed.affine(share.bias if share.image is None else share.mean(), 0.0)


def _is_on(reader: ShaderReader, shader: UsdShade.Shader, name: str) -> bool:
    """Whether something is switched on; MDL's own switches are off unless they are authored."""
    value = reader.raw(shader, name)
    return shader.GetSourceAsset("mdl") is None if value is None else bool(value)


def _image_of(reader: ShaderReader, shader: UsdShade.Shader, name: str) -> Expression | None:
    if name not in _IMAGES:
        return None
    own, channels, switch = _IMAGES[name]
    node = UsdNode(reader, shader)
    asset, _, _ = node.file(own)
    if asset is None or not asset.path or (switch and not _is_on(reader, shader, switch)):
        return None
    is_color = name == "diffuseColor"
    image = reader.open_file(node, own, None if is_color else "raw", "auto", np.array([0.5, 0.5, 1.0, 1.0]))
    if image is None:
        return None
    scale, bias = (2.0, -1.0) if name == "normal" else (1.0, 0.0)
    count = len(channels)
    return image_expression(image, list(channels), np.full(count, scale), np.full(count, bias), Placement())


def _read_unlit(reader: ShaderReader, shader: UsdShade.Shader):
    """Light of its own, and nothing else."""
    one = Expression.constant(1.0)
    weight, color, opacity, through = (
        reader.read(shader, name) or default
        for name, default in (
            ("emission", one),
            ("emission_color", Expression.constant((1.0, 1.0, 1.0))),
            ("opacity", one),
            ("transmission", Expression.constant(0.0)),
        )
    )
    path = shader.GetPath()
    if through.image is not None or through.bias.any():
        reader.context.warn(path, "transmission: not carried over (docs/usd.md).")
    light = color.affine(weight.bias, 0.0) if weight.image is None else weight.affine(color.mean(), 0.0)
    if weight.image is not None and color.image is not None:
        reader.context.warn(path, "emission_color takes no texture beside that of emission. Its mean is used.")
    rows = {name: find_input(PREVIEW_INPUTS, name) for name in ("emissiveColor", "opacity")}
    model = StandardMaterial(
        diffuse_color=(0.0, 0.0, 0.0),
        emissive_color=to_value(reader.context, path, rows["emissiveColor"], light.widened(3)),
        opacity=to_value(reader.context, path, rows["opacity"], opacity),
        ior=1.0,
    )
    return model, texcoord_name(reader.context, path, [light, opacity])


def any_surface_shader(material: UsdShade.Material) -> UsdShade.Shader | None:
    """The surface shader of whatever render context there is."""
    for output in material.GetSurfaceOutputs():
        for attribute in UsdShade.Utils.GetValueProducingAttributes(output):
            if UsdShade.Output.IsOutput(attribute):
                return UsdShade.Shader(attribute.GetPrim())
    return None
