"""standard_surface and open_pbr_surface as what Frazil has: a standard material, or ice where light goes through.

Model: without transmission and subsurface a StandardMaterial. With either an IceMaterial: subsurface by inverting its
colour and radius to a medium; transmission by Beer-Lambert (color over depth) with rough refraction; what is neither
lies over it as a diffuse overlay. Where both are there, the one of the larger weight makes the medium.
Units: radius and depth in scene units.
Not: the inputs of NOT_CARRIED, which are named in one warning where they are authored and would change the picture.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass

import numpy as np
from pxr import UsdShade

from .._frazil import IceMaterial, Medium, Overlay, StandardMaterial
from .context import ReadContext
from .expression import Expression, bake
from .material_inputs import ICE_INPUTS, PREVIEW_INPUTS, MaterialInput, find_input
from .material_values import ior_of_f0, is_close, number_text, texcoord_name, to_value
from .mtlx_library import library
from .shading import ShaderReader

_SMALLEST_SCATTERING = 1e-6  # 1/m
_LARGEST_ALBEDO = 0.999


@dataclass(frozen=True)
class SurfaceModel:
    """The names by which a model calls what both have; '' = it has none."""

    node: str
    base: str
    base_color: str
    metalness: str
    specular: str
    specular_color: str
    roughness: str
    ior: str
    transmission: str
    transmission_color: str
    transmission_depth: str
    transmission_scatter: str
    transmission_anisotropy: str
    extra_roughness: str
    subsurface: str
    subsurface_color: str
    subsurface_radius: str
    subsurface_scale: str
    subsurface_anisotropy: str
    coat: str
    coat_roughness: str
    emission: str
    emission_color: str
    opacity: str
    normal: str
    coat_normal: str
    # Never carried over; what that leaves out; and the input without which it does not matter ('' = it always does).
    not_carried: tuple[tuple[str, str, str], ...]

    @property
    def carried(self) -> set[str]:
        """Names of the inputs that are read."""
        return {value for key, value in vars(self).items() if key not in ("node", "not_carried") and value}


STANDARD_SURFACE = SurfaceModel(
    node="ND_standard_surface_surfaceshader",
    base="base",
    base_color="base_color",
    metalness="metalness",
    specular="specular",
    specular_color="specular_color",
    roughness="specular_roughness",
    ior="specular_IOR",
    transmission="transmission",
    transmission_color="transmission_color",
    transmission_depth="transmission_depth",
    transmission_scatter="transmission_scatter",
    transmission_anisotropy="transmission_scatter_anisotropy",
    extra_roughness="transmission_extra_roughness",
    subsurface="subsurface",
    subsurface_color="subsurface_color",
    subsurface_radius="subsurface_radius",
    subsurface_scale="subsurface_scale",
    subsurface_anisotropy="subsurface_anisotropy",
    coat="coat",
    coat_roughness="coat_roughness",
    emission="emission",
    emission_color="emission_color",
    opacity="opacity",
    normal="normal",
    coat_normal="coat_normal",
    not_carried=(
        ("diffuse_roughness", "Oren-Nayar diffuse", ""),
        ("specular_anisotropy, specular_rotation, tangent", "anisotropic reflection", "specular_anisotropy"),
        ("transmission_dispersion", "dispersion", "transmission"),
        ("sheen, sheen_color, sheen_roughness", "sheen", "sheen"),
        (
            "coat_color, coat_IOR, coat_anisotropy, coat_rotation",
            "a coat other than clear at the base's IOR",
            "coat",
        ),
        ("coat_affect_color, coat_affect_roughness", "what the coat does to the base below", "coat"),
        ("thin_film_thickness, thin_film_IOR", "thin film", "thin_film_thickness"),
        ("thin_walled", "thin walls: bodies are solid", ""),
    ),
)

OPEN_PBR_SURFACE = SurfaceModel(
    node="ND_open_pbr_surface_surfaceshader",
    base="base_weight",
    base_color="base_color",
    metalness="base_metalness",
    specular="specular_weight",
    specular_color="specular_color",
    roughness="specular_roughness",
    ior="specular_ior",
    transmission="transmission_weight",
    transmission_color="transmission_color",
    transmission_depth="transmission_depth",
    transmission_scatter="transmission_scatter",
    transmission_anisotropy="transmission_scatter_anisotropy",
    extra_roughness="",
    subsurface="subsurface_weight",
    subsurface_color="subsurface_color",
    subsurface_radius="subsurface_radius_scale",
    subsurface_scale="subsurface_radius",
    subsurface_anisotropy="subsurface_scatter_anisotropy",
    coat="coat_weight",
    coat_roughness="coat_roughness",
    emission="emission_luminance",
    emission_color="emission_color",
    opacity="geometry_opacity",
    normal="geometry_normal",
    coat_normal="geometry_coat_normal",
    not_carried=(
        ("base_diffuse_roughness", "Oren-Nayar diffuse", ""),
        ("specular_roughness_anisotropy, geometry_tangent", "anisotropic reflection", "specular_roughness_anisotropy"),
        (
            "transmission_dispersion_scale, transmission_dispersion_abbe_number",
            "dispersion",
            "transmission_dispersion_scale",
        ),
        ("fuzz_weight, fuzz_color, fuzz_roughness", "fuzz", "fuzz_weight"),
        (
            "coat_color, coat_ior, coat_darkening, coat_roughness_anisotropy, geometry_coat_tangent",
            "a coat other than clear at the base's IOR",
            "coat_weight",
        ),
        ("thin_film_weight, thin_film_thickness, thin_film_ior", "thin film", "thin_film_weight"),
        ("geometry_thin_walled", "thin walls: bodies are solid", ""),
    ),
)

MODELS = {
    "ND_standard_surface_surfaceshader": STANDARD_SURFACE,
    "ND_standard_surface_surfaceshader_100": STANDARD_SURFACE,
    "ND_open_pbr_surface_surfaceshader": OPEN_PBR_SURFACE,
    "arnold:standard_surface": STANDARD_SURFACE,
    "standard_surface": STANDARD_SURFACE,
}
# What may be less, or may not be as little, as a definition says.
_SMALLEST = {"ior": 1.0, "transmission_anisotropy": -1.0, "subsurface_anisotropy": -1.0}
# What has a largest value in a definition and may be larger all the same.
_UNBOUNDED = ("emission_color", "transmission_scatter")


def not_carried_markdown() -> str:
    """The table of what is left out as docs/material.md shows it."""
    lines = ["| left out | standard_surface | open_pbr_surface |", "|---|---|---|"]
    other = {meaning: names for names, meaning, _ in OPEN_PBR_SURFACE.not_carried}
    for names, meaning, _ in STANDARD_SURFACE.not_carried:
        lines.append(f"| {meaning} | {_code(names)} | {_code(other.pop(meaning, ''))} |")
    lines += [f"| {meaning} | | {_code(names)} |" for meaning, names in other.items()]
    return "\n".join(lines)


def _code(names: str) -> str:
    return ", ".join(f"`{name.strip()}`" for name in names.split(",") if name.strip())


class SurfaceModelReader:
    """Reads one shader of either model."""

    def __init__(self, reader: ShaderReader, shader: UsdShade.Shader) -> None:
        self._reader, self._shader = reader, shader
        self._context: ReadContext = reader.context
        self._path = shader.GetPath()
        self._model = MODELS[shader.GetShaderId()]
        self._definition = library().getNodeDef(self._model.node)
        self._read: list[Expression] = []
        self._fed: dict[str, Expression] = {}
        self._lost: list[str] = []  # inputs that are not carried over

    def read(self):
        """The material, and the primvar of its images."""
        self._warn_of_unknown_inputs()
        for names, _, gate in self._model.not_carried:
            if not gate or self._reaches(gate):
                self._lost += [n.strip() for n in names.split(",") if self._is_changed(n.strip())]
        metalness = float(self._get("metalness").mean()[0])
        transmission = self._get("transmission")
        subsurface = self._get("subsurface")
        is_clear = metalness < 0.5 and (_largest(transmission) > 0.0 or _largest(subsurface) > 0.0)
        model = self._ice(transmission, subsurface) if is_clear else self._standard()
        if self._lost:
            self._context.warn(self._path, f"{', '.join(self._lost)}: not carried over (docs/material.md).")
        return model, texcoord_name(self._context, self._path, self._read)

    # -- inputs

    def _warn_of_unknown_inputs(self) -> None:
        known = [i.getName() for i in self._definition.getActiveInputs()]
        for shader_input in self._shader.GetInputs():
            name = shader_input.GetBaseName()
            if name not in known and shader_input.GetValueProducingAttributes():
                nearest = difflib.get_close_matches(name, known, n=1, cutoff=0.0)[0]
                self._context.warn(self._path, f"has no input '{name}'. The nearest is '{nearest}'.")

    def _get(self, role: str) -> Expression:
        """What feeds an input, in range, or its default."""
        name = getattr(self._model, role)
        if not name:
            return Expression.constant(0.0)
        if name not in self._fed:
            self._fed[name] = self._checked(name, role)
        self._read.append(self._fed[name])
        return self._fed[name]

    def _checked(self, name: str, role: str) -> Expression:
        found = self._definition.getActiveInput(name)
        default = found.getValue()
        default = np.atleast_1d(np.asarray(default.asTuple() if hasattr(default, "asTuple") else default, np.float64))
        fed = self._reader.read(self._shader, name)
        raw = self._reader.raw(self._shader, name) if fed is None else None
        if fed is None and raw is None:
            return Expression(default)
        if fed is not None and (fed.image is not None or fed.is_display_color):
            return fed
        # A fourth number is alpha.
        is_right = fed is not None and fed.width in (1, len(default), len(default) + 1)
        value = fed.bias[: len(default)] if is_right else default
        if not is_right or not np.isfinite(value).all():
            rule = "finite" if is_right else f"a {found.getType()}"
            got = repr(raw) if fed is None else number_text(fed.bias)
            self._context.warn(self._path, f"{name} must be {rule}, got {got}. {number_text(default)} is used.")
            return Expression(default)
        low = _SMALLEST.get(role, _bound(found.getAttribute("uimin"), 0.0))
        high = np.inf if role in _UNBOUNDED else _bound(found.getAttribute("uimax"), np.inf)
        clamped = np.clip(value, low, high)
        if (clamped != value).any():
            rule = f"in {low:g}..{high:g}" if np.isfinite(high) else f">= {low:g}"
            self._context.warn(
                self._path, f"{name} must be {rule}, got {number_text(value)}. {number_text(clamped)} is used."
            )
        return Expression(clamped)

    def _number(self, role: str) -> float:
        """A number where only one will do: the mean of an image."""
        return float(self._mean(role)[0])

    def _mean(self, role: str) -> np.ndarray:
        fed = self._get(role)
        if fed.image is not None:
            self._context.warn(self._path, f"{getattr(self._model, role)} takes no texture here. Its mean is used.")
        return fed.mean()

    def _reaches(self, name: str) -> bool:
        """Whether a weight may be above 0 anywhere."""
        fed = self._reader.read(self._shader, name)
        if fed is None:
            return False
        return _largest(fed) > 0.0

    def _is_changed(self, name: str) -> bool:
        fed = self._reader.read(self._shader, name)
        if fed is None:
            raw = self._reader.raw(self._shader, name)
            found = self._shader.GetInput(name)
            return bool(found) and raw is None and found.HasConnectedSource()
        default = self._definition.getActiveInput(name)
        value = default.getValue() if default is not None else None
        if value is None:
            return True
        value = value.asTuple() if hasattr(value, "asTuple") else value
        return fed.image is not None or not is_close(fed.bias, value)

    def _product(self, a: Expression, b: Expression, name: str) -> Expression:
        if b.is_display_color:
            if a.image is not None or not is_close(a.bias, 1.0):
                self._lost.append(name)
            return b
        if a.image is None:
            return b.affine(a.bias, 0.0)
        if b.image is None:
            return a.affine(b.bias, 0.0)
        return bake([a, b], np.multiply, name, self._context, self._path)

    def _value(self, row: MaterialInput, fed: Expression):
        return to_value(self._context, self._path, row, fed)

    def _normal(self):
        fed = self._reader.read(self._shader, self._model.normal)
        if fed is None or fed.image is None:
            return None  # the surface's own
        self._read.append(fed)
        return self._value(find_input(PREVIEW_INPUTS, "normal"), fed)

    def _check_coat_normal(self) -> None:
        """One normal turns base and coat; name a coat that has another."""
        base, coat = (self._reader.read(self._shader, n) for n in (self._model.normal, self._model.coat_normal))
        keys = [None if e is None or e.image is None else e.key() for e in (base, coat)]
        if keys[0] != keys[1] and self._reaches(self._model.coat):
            self._lost.append(self._model.coat_normal)

    def _grey(self, role: str) -> Expression:
        """A color where only a number will do: its mean."""
        fed = self._get(role)
        if fed.width == 1 or (fed.image is not None and len(set(fed.channels[:3])) == 1):
            return fed.component(0)
        if fed.image is not None:
            return bake([fed], lambda x: x[..., :3].mean(axis=-1, keepdims=True), role, self._context, self._path)
        if not is_close(fed.bias[:3], fed.bias[0]):
            name = getattr(self._model, role)
            self._context.warn(self._path, f"{name} has a color, which is not supported. Its mean is used.")
        return Expression.constant(fed.bias[:3].mean())

    # -- materials

    def _standard(self) -> StandardMaterial:
        row = {r.name: r for r in PREVIEW_INPUTS}
        color = self._product(self._get("base"), self._get("base_color"), "base")
        specular, ior = self._number("specular"), self._number("ior")
        specular_color = self._mean("specular_color")
        metalness = self._get("metalness")
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2 * specular
        self._check_coat_normal()
        is_tinted = not is_close(specular_color, 1.0) and metalness.image is None and float(metalness.bias[0]) == 0.0
        if not is_close(specular_color, 1.0) and not is_tinted:
            self._lost.append(self._model.specular_color)
        emission = self._product(self._get("emission"), self._get("emission_color"), "emission")
        return StandardMaterial(
            diffuse_color=self._value(row["diffuseColor"], color.widened(3)),
            uses_display_color=color.is_display_color,
            emissive_color=self._value(row["emissiveColor"], emission.widened(3)),
            use_specular_workflow=is_tinted,
            specular_color=tuple(np.clip(f0 * specular_color, 0.0, 1.0).tolist()) if is_tinted else (0.0, 0.0, 0.0),
            metallic=self._value(row["metallic"], metalness),
            roughness=self._value(row["roughness"], self._get("roughness")),
            clearcoat=self._value(row["clearcoat"], self._get("coat")),
            clearcoat_roughness=self._value(row["clearcoatRoughness"], self._get("coat_roughness")),
            opacity=self._value(row["opacity"], self._grey("opacity")),
            ior=ior_of_f0(f0),
            normal=self._normal(),
        )

    def _ice(self, transmission: Expression, subsurface: Expression) -> IceMaterial:
        row = {r.name: r for r in ICE_INPUTS}
        through, below = _largest(transmission), _largest(subsurface)
        is_transmission = through >= below * (1.0 - through)
        eta = float(np.clip(self._number("ior"), 1.0, 4.0))
        unit = self._context.meters_per_unit
        if is_transmission:
            (medium, boundary_tint), tint = self._transmitting(unit, eta), (1.0, 1.0, 1.0)
            scatters = max(medium.sigma_s_prime) > 10 * _SMALLEST_SCATTERING
        else:
            (medium, tint), boundary_tint = self._scattering(unit, eta, row["tint"]), (1.0, 1.0, 1.0)
            scatters = True
        for role in ("coat", "emission"):
            if _largest(self._get(role)) > 0.0:
                self._lost.append(getattr(self._model, role))
        if _smallest(self._get("opacity")) < 1.0:
            self._lost.append(self._model.opacity)
        if not is_close(self._mean("specular_color"), 1.0):
            self._lost.append(self._model.specular_color)
        roughness = self._get("roughness")
        extra = self._number("extra_roughness") if self._model.extra_roughness else 0.0
        refraction_roughness = None
        if extra and roughness.image is None:
            refraction_roughness = float(np.clip(roughness.bias[0] + extra, 0.0, 1.0))
        return IceMaterial(
            medium,
            roughness=self._value(row["roughness"], roughness),
            specular=float(np.clip(self._number("specular"), 0.0, 1.0)),
            translucency=1.0 if scatters else 0.0,
            refraction=1.0 if is_transmission else 0.0,
            refraction_roughness=refraction_roughness,
            refraction_tint=boundary_tint,
            overlays=self._rest(transmission if is_transmission else subsurface),
            tint=tint,
            normal=self._normal(),
        )

    def _rest(self, weight: Expression) -> list[Overlay]:
        """The opaque diffuse part, 1 - weight, as an overlay."""
        if _smallest(weight) >= 1.0:
            return []
        color = np.clip(self._product(self._get("base"), self._get("base_color"), "base").widened(3).mean(), 0.0, 1.0)
        layer = {"pattern": "solid", "color": tuple(color.tolist()), "scattering": 1.0, "age_end": 0.0}
        roughness = float(np.clip(self._get("roughness").mean()[0], 0.0, 1.0))
        cover = weight.component(0).affine(-1.0, 1.0)
        if cover.image is None:
            return [Overlay(**layer, roughness=roughness, opacity=float(np.clip(cover.bias[0], 0.0, 1.0)))]
        mask = cover.to_lookup(self._context, self._path, 1)
        return [] if mask is None else [Overlay(**layer, roughness=roughness, mask=mask)]

    def _transmitting(self, unit: float, eta: float) -> tuple[Medium, tuple[float, float, float]]:
        """The medium, and the tint of its boundary: without a depth the color is the boundary's."""
        color = np.clip(np.resize(self._mean("transmission_color"), 3), 1e-4, 1.0)
        depth = self._number("transmission_depth") * unit
        scatter = np.clip(np.resize(self._mean("transmission_scatter"), 3), 0.0, None)
        if depth <= 0.0:
            return Medium([_SMALLEST_SCATTERING] * 3, [0.0] * 3, eta), tuple(color.tolist())
        extinction, sigma_s = -np.log(color) / depth, scatter / depth
        sigma_a = extinction - sigma_s
        sigma_a = sigma_a - min(0.0, float(sigma_a.min()))
        forward = float(np.clip(self._number("transmission_anisotropy"), -0.95, 0.95))
        reduced = np.maximum(sigma_s * (1.0 - forward), _SMALLEST_SCATTERING)
        return Medium(reduced.tolist(), sigma_a.tolist(), eta), (1.0, 1.0, 1.0)

    def _scattering(self, unit: float, eta: float, tint_row: MaterialInput):
        color = self._get("subsurface_color").widened(3)
        mean = np.clip(color.mean(), 1e-3, _LARGEST_ALBEDO)
        tint = (1.0, 1.0, 1.0)
        if color.image is not None:
            tint = self._value(tint_row, color.affine(1.0 / mean, 0.0))
        forward = float(np.clip(self._number("subsurface_anisotropy"), -0.95, 0.95))
        radius = np.resize(self._mean("subsurface_radius"), 3) * self._number("subsurface_scale") * unit
        radius = np.maximum(radius / (1.0 - forward), find_input(ICE_INPUTS, "mean_free_path").minimum)
        return Medium.from_albedo(mean.tolist(), radius.tolist(), eta, find_input(ICE_INPUTS, "profile").default), tint


def _bound(text: str, otherwise: float) -> float:
    """The first number of uimin or uimax."""
    return float(text.split(",")[0]) if text else otherwise


def _largest(value: Expression) -> float:
    return float(value.bias.max()) if value.image is None else 1.0


def _smallest(value: Expression) -> float:
    return float(value.bias.min()) if value.image is None else 0.0
