"""Shader networks: what feeds an input - a constant, an image with its transform and primvar, or displayColor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pxr import Sdf, UsdShade

from .._frazil import Texture, TextureLookup
from .context import ReadContext
from .textures import TextureError, decode_srgb, is_srgb, read_image, resolve

_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3, "rgb": 0, "rgba": 0}
_WRAPS = {"repeat": "repeat", "clamp": "clamp", "mirror": "mirror", "black": "black", "useMetadata": "black"}
_DISPLAY_COLOR_READERS = ("UsdPrimvarReader_float3", "UsdPrimvarReader_vector", "UsdPrimvarReader_color")


@dataclass
class Source:
    """What feeds an input: exactly one of a value, a lookup, or the mesh's displayColor."""

    value: object = None
    lookup: TextureLookup | None = None
    is_display_color: bool = False
    texcoord_name: str | None = None


class ShaderReader:
    """Follows connections; each image is read once per colour space and wrap."""

    def __init__(self, context: ReadContext) -> None:
        self._context = context
        self._pixels: dict[str, tuple[np.ndarray, bool] | None] = {}
        self._textures: dict[tuple, Texture] = {}

    def read(self, shader: UsdShade.Shader, name: str) -> Source | None:
        """What feeds an input of the shader; None where nothing is authored or it cannot be followed."""
        shader_input = shader.GetInput(name)
        if not shader_input:
            return None
        attributes = shader_input.GetValueProducingAttributes()
        if not attributes:
            return None
        attribute = attributes[0]
        if not UsdShade.Output.IsOutput(attribute):
            value = self._context.get(attribute)
            return None if value is None else Source(value=value)
        node = UsdShade.Shader(attribute.GetPrim())
        kind = node.GetShaderId() or ""
        if kind == "UsdUVTexture":
            return self._read_texture(node, UsdShade.Output(attribute).GetBaseName())
        if kind in _DISPLAY_COLOR_READERS and self._value(node, "varname", "") in ("displayColor", "Cd"):
            return Source(is_display_color=True)
        if kind.startswith("UsdPrimvarReader"):
            fallback = self._value(node, "fallback", None)
            self._context.warn(
                node.GetPath(),
                f"reads the primvar '{self._value(node, 'varname', '')}' for '{name}', which is not supported. "
                f"Its fallback is used.",
            )
            return None if fallback is None else Source(value=fallback)
        self._context.warn(
            node.GetPath(), f"is a '{kind}' node for '{name}', which is not supported. The default is used."
        )
        return None

    def _value(self, shader: UsdShade.Shader, name: str, default):
        """A constant input (through material interfaces), or the default."""
        shader_input = shader.GetInput(name)
        if not shader_input:
            return default
        for attribute in shader_input.GetValueProducingAttributes():
            if not UsdShade.Output.IsOutput(attribute):
                return self._context.get(attribute, default)
        return default

    def _read_texture(self, node: UsdShade.Shader, output: str) -> Source | None:
        context = self._context
        scale = np.asarray(self._value(node, "scale", (1, 1, 1, 1)), np.float32)
        bias = np.asarray(self._value(node, "bias", (0, 0, 0, 0)), np.float32)
        fallback = np.asarray(self._value(node, "fallback", (0, 0, 0, 1)), np.float32)
        channel = _CHANNELS.get(output, 0)
        is_color = output in ("rgb", "rgba")

        texture = self._texture(node)
        if texture is None:
            value = fallback * scale + bias
            return Source(value=tuple(map(float, value[:3])) if is_color else float(value[channel]))
        channels = texture.texels.shape[2]
        if channel >= channels:
            if channels == 1 and channel < 3:
                channel = 0  # grey
            else:  # no alpha: opaque; a missing colour is black
                return Source(value=float((1.0 if channel == 3 else 0.0) * scale[channel] + bias[channel]))
        index = _CHANNELS.get(output, 0)
        lookup_scale = scale[:3] if is_color else np.repeat(scale[index], 3)
        lookup_bias = bias[:3] if is_color else np.repeat(bias[index], 3)
        texcoords = self._read_texcoords(node)
        lookup = TextureLookup(
            texture,
            channel,
            lookup_scale.tolist(),
            lookup_bias.tolist(),
            **{key: texcoords[key] for key in ("st_scale", "st_rotation", "st_translation")},
        )
        if not np.isfinite(scale).all() or not np.isfinite(bias).all():
            context.warn(node.GetPath(), "scale and bias must be finite. The texture is left out.")
            return None
        return Source(lookup=lookup, texcoord_name=texcoords["name"])

    def _texture(self, node: UsdShade.Shader) -> Texture | None:
        """The node's image, or None (after a warning) where there is none to read."""
        context = self._context
        file_input = node.GetInput("file")
        attributes = file_input.GetValueProducingAttributes() if file_input else []
        asset = context.get(attributes[0]) if attributes else None
        if not isinstance(asset, Sdf.AssetPath) or not asset.path:
            context.warn(node.GetPath(), "names no image in 'file'. Its fallback is used.")
            return None
        attribute = attributes[0]
        if "<UDIM>" in asset.path:
            context.warn(node.GetPath(), "UDIM tiles are not supported. Tile 1001 is used everywhere.")
            asset = Sdf.AssetPath(asset.path.replace("<UDIM>", "1001"))
        path = resolve(context, asset, attribute)
        if path not in self._pixels:
            self._pixels[path] = None
            try:
                if not path:
                    raise TextureError(f"@{asset.path}@ cannot be found.")
                self._pixels[path] = read_image(path)
            except OSError as error:
                context.warn(node.GetPath(), f"{error} The texture's fallback is used.")
        loaded = self._pixels[path]
        if loaded is None:
            return None
        pixels, is_8_bit = loaded
        color_space = self._value(node, "sourceColorSpace", None) or attribute.GetColorSpace() or "auto"
        decode = is_srgb(str(color_space), is_8_bit, pixels.shape[2])
        wraps = tuple(_WRAPS.get(str(self._value(node, name, "useMetadata")), "repeat") for name in ("wrapS", "wrapT"))
        key = (path, decode, wraps)
        if key not in self._textures:
            if pixels.shape[2] == 2:  # grey and alpha
                pixels = pixels[..., [0, 0, 0, 1]]
            texels = decode_srgb(pixels) if decode else pixels
            if not np.isfinite(texels).all():
                context.warn(node.GetPath(), f"{path} has NaN or infinite pixels. They are taken as 0.")
                texels = np.nan_to_num(texels, nan=0.0, posinf=0.0, neginf=0.0)
            self._textures[key] = Texture(np.ascontiguousarray(texels, dtype=np.float32), *wraps)
        return self._textures[key]

    def _read_texcoords(self, node: UsdShade.Shader) -> dict:
        """The primvar and the UsdTransform2d between it and the image."""
        result = {"name": "st", "st_scale": (1.0, 1.0), "st_rotation": 0.0, "st_translation": (0.0, 0.0)}
        reader, transforms = self._upstream(node, "st"), 0
        while reader is not None and reader.GetShaderId() == "UsdTransform2d":
            transforms += 1
            if transforms == 1:
                result["st_scale"] = tuple(map(float, self._value(reader, "scale", (1, 1))))
                result["st_rotation"] = float(self._value(reader, "rotation", 0.0))
                result["st_translation"] = tuple(map(float, self._value(reader, "translation", (0, 0))))
            else:
                self._context.warn(
                    reader.GetPath(), "a second UsdTransform2d in a row is not supported. It is left out."
                )
            if transforms > 8:
                break
            reader = self._upstream(reader, "in")
        if reader is not None and (reader.GetShaderId() or "").startswith("UsdPrimvarReader"):
            result["name"] = str(self._value(reader, "varname", "st") or "st")
        return result

    def _upstream(self, node: UsdShade.Shader, name: str) -> UsdShade.Shader | None:
        shader_input = node.GetInput(name)
        if not shader_input:
            return None
        for attribute in shader_input.GetValueProducingAttributes():
            if UsdShade.Output.IsOutput(attribute):
                return UsdShade.Shader(attribute.GetPrim())
        return None
