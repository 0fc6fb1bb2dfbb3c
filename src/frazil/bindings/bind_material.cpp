#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/variant.h>

#include <cstring>

#include "frazil/bindings/bindings.h"
#include "frazil/material/displacement.h"
#include "frazil/material/ice.h"
#include "frazil/material/standard.h"

namespace frazil {
namespace {

// What a material input is given as: a constant or a texture.
using ColorInput = std::variant<TextureLookup, Triple>;
using FloatInput = std::variant<TextureLookup, float>;

const std::pair<CompensationMode, const char*> kCompensationNames[] = {
    {CompensationMode::off, compensation_name(CompensationMode::off)},
    {CompensationMode::ratio, compensation_name(CompensationMode::ratio)},
    {CompensationMode::conserve, compensation_name(CompensationMode::conserve)},
    {CompensationMode::depth, compensation_name(CompensationMode::depth)},
    {CompensationMode::fill, compensation_name(CompensationMode::fill)},
    {CompensationMode::linear, compensation_name(CompensationMode::linear)}};

MaterialInput<Rgb> to_input(const ColorInput& input) {
    if (const auto* lookup = std::get_if<TextureLookup>(&input)) return {Rgb(0.0f), *lookup};
    return {to_v3f(std::get<Triple>(input)), {}};
}
MaterialInput<float> to_input(const FloatInput& input) {
    if (const auto* lookup = std::get_if<TextureLookup>(&input)) return {0.0f, *lookup};
    return {std::get<float>(input), {}};
}
ColorInput from_input(const MaterialInput<Rgb>& input) {
    if (input.lookup.texture) return input.lookup;
    return from_v3f(input.value);
}
FloatInput from_input(const MaterialInput<float>& input) {
    if (input.lookup.texture) return input.lookup;
    return input.value;
}

// A property that reads and writes a MaterialInput as a constant or a TextureLookup.
template <class Class, class Model, class Value>
void def_input(Class& cls, const char* name, MaterialInput<Value> Model::*member) {
    using Input = std::conditional_t<std::is_same_v<Value, float>, FloatInput, ColorInput>;
    cls.def_prop_rw(
        name, [member](const Model& model) { return from_input(model.*member); },
        [member](Model& model, const Input& input) { model.*member = to_input(input); });
}

template <class Model, class Class>
void def_normal(Class& cls) {
    cls.def_prop_rw(
        "normal", [](const Model& model) { return model.normal.texture ? std::optional(model.normal) : std::nullopt; },
        [](Model& model, const std::optional<TextureLookup>& map) { model.normal = map.value_or(TextureLookup{}); },
        "value"_a.none());
}

void bind_standard(nb::module_& module) {
    const StandardMaterial preset;
    nb::class_<StandardMaterial> cls(module, "StandardMaterial",
                                     "UsdPreviewSurface. Inputs take a constant or a TextureLookup; the names and\n"
                                     "defaults are the specification's, in snake_case. bump: height in metres, a\n"
                                     "TextureLookup.");
    cls.def(
        "__init__",
        [](StandardMaterial* self, const ColorInput& diffuse_color, bool uses_display_color,
           const ColorInput& emissive_color, bool use_specular_workflow, const ColorInput& specular_color,
           const FloatInput& metallic, const FloatInput& roughness, const FloatInput& clearcoat,
           const FloatInput& clearcoat_roughness, const FloatInput& opacity, float opacity_threshold, float ior,
           const std::optional<TextureLookup>& normal, const FloatInput& bump) {
            new (self) StandardMaterial{
                to_input(diffuse_color),          uses_display_color, to_input(emissive_color), use_specular_workflow,
                to_input(specular_color),         to_input(metallic), to_input(roughness),      to_input(clearcoat),
                to_input(clearcoat_roughness),    to_input(opacity),  opacity_threshold,        ior,
                normal.value_or(TextureLookup{}), to_input(bump)};
        },
        nb::kw_only(), "diffuse_color"_a = ColorInput(from_v3f(preset.diffuse_color.value)),
        "uses_display_color"_a = false, "emissive_color"_a = ColorInput(Triple{0, 0, 0}),
        "use_specular_workflow"_a = false, "specular_color"_a = ColorInput(Triple{0, 0, 0}),
        "metallic"_a = FloatInput(preset.metallic.value), "roughness"_a = FloatInput(preset.roughness.value),
        "clearcoat"_a = FloatInput(preset.clearcoat.value),
        "clearcoat_roughness"_a = FloatInput(preset.clearcoat_roughness.value),
        "opacity"_a = FloatInput(preset.opacity.value), "opacity_threshold"_a = 0.0f, "ior"_a = preset.ior,
        "normal"_a = nb::none(), "bump"_a = FloatInput(0.0f));
    def_input(cls, "diffuse_color", &StandardMaterial::diffuse_color);
    def_input(cls, "emissive_color", &StandardMaterial::emissive_color);
    def_input(cls, "specular_color", &StandardMaterial::specular_color);
    def_input(cls, "metallic", &StandardMaterial::metallic);
    def_input(cls, "roughness", &StandardMaterial::roughness);
    def_input(cls, "clearcoat", &StandardMaterial::clearcoat);
    def_input(cls, "clearcoat_roughness", &StandardMaterial::clearcoat_roughness);
    def_input(cls, "opacity", &StandardMaterial::opacity);
    def_input(cls, "bump", &StandardMaterial::bump);
    def_normal<StandardMaterial>(cls);
    cls.def_rw("uses_display_color", &StandardMaterial::uses_display_color)
        .def_rw("use_specular_workflow", &StandardMaterial::use_specular_workflow)
        .def_rw("opacity_threshold", &StandardMaterial::opacity_threshold)
        .def_rw("ior", &StandardMaterial::ior)
        .def("__repr__", [](const StandardMaterial& model) {
            const Rgb& c = model.diffuse_color.value;
            if (model.uses_display_color) return std::string("StandardMaterial(displayColor)");
            if (model.diffuse_color.lookup.texture) return std::string("StandardMaterial(textured)");
            return str("StandardMaterial(diffuse_color=(", c.x, ", ", c.y, ", ", c.z, "))");
        });
}

constexpr std::pair<VectorSpace, const char*> kSpaceNames[] = {{VectorSpace::tangent, "tangent"},
                                                               {VectorSpace::object, "object"}};
constexpr std::pair<PatternKind, const char*> kPatternNames[] = {
    {PatternKind::solid, "solid"}, {PatternKind::fracture, "fracture"}, {PatternKind::cells, "cells"},
    {PatternKind::frost, "frost"}, {PatternKind::bubbles, "bubbles"},   {PatternKind::snow, "snow"},
    {PatternKind::bands, "bands"}};

void bind_overlay(nb::module_& module) {
    const Overlay preset;
    const Pattern& pattern = preset.pattern;
    nb::class_<Overlay> cls(
        module, "Overlay",
        "A layer of cracks, frost, snow or dirt on ice. Lengths in metres, fractions in [0, 1].\n\n"
        "Parameters\n----------\n"
        "pattern : 'solid', 'fracture', 'cells', 'frost', 'bubbles', 'snow' or 'bands'.\n"
        "color, opacity, roughness : of the layer where its mask is 1.\n"
        "scattering : part of the light that it reflects diffusely, so that it does not enter.\n"
        "bump : height where the mask is 1. internal : opacity of fracture planes seen inside the body.\n"
        "age_begin, age_end : opacity grows from nothing to all of it between these ages.\n"
        "size : of cells and features, distance of planes and bands. width : of lines, bubbles and bands.\n"
        "feather : over which edges fade. warp : bend of lines, of size. scales : of cells, octaves of frost.\n"
        "amount : how much there is. slope : -1..1, more where the surface faces `direction`. seed : another pattern.\n"
        "mask : multiplies the pattern; a constant or a TextureLookup. name : of its layers in a picture.\n\n"
        "Ranges are checked when the scene is rendered.");
    cls.def(
        "__init__",
        [](Overlay* self, const std::string& kind, const Triple& color, float opacity, float roughness,
           float scattering, float bump, float internal, float age_begin, float age_end, float size, float width,
           float feather, float warp, int scales, float amount, float slope, const Triple& direction,
           std::uint32_t seed, const FloatInput& mask, const std::string& name) {
            Overlay made;
            made.name = name;
            made.color = to_v3f(color);
            made.opacity = opacity;
            made.roughness = roughness;
            made.scattering = scattering;
            made.bump = bump;
            made.internal = internal;
            made.age_begin = age_begin;
            made.age_end = age_end;
            made.pattern = {from_name(kPatternNames, kind, "Overlay: pattern"),
                            size,
                            width,
                            feather,
                            warp,
                            scales,
                            amount,
                            slope,
                            to_v3f(direction),
                            seed};
            made.mask = to_input(mask);
            new (self) Overlay(std::move(made));
        },
        "pattern"_a = "solid", nb::kw_only(), "color"_a = from_v3f(preset.color), "opacity"_a = preset.opacity,
        "roughness"_a = preset.roughness, "scattering"_a = preset.scattering, "bump"_a = preset.bump,
        "internal"_a = preset.internal, "age_begin"_a = preset.age_begin, "age_end"_a = preset.age_end,
        "size"_a = pattern.size, "width"_a = pattern.width, "feather"_a = pattern.feather, "warp"_a = pattern.warp,
        "scales"_a = pattern.scales, "amount"_a = pattern.amount, "slope"_a = pattern.slope,
        "direction"_a = from_v3f(pattern.direction), "seed"_a = pattern.seed, "mask"_a = FloatInput(1.0f),
        "name"_a = "");
    cls.def_rw("name", &Overlay::name)
        .def_prop_ro("pattern", [](const Overlay& o) { return to_name(kPatternNames, o.pattern.kind); })
        .def_prop_rw(
            "color", [](const Overlay& o) { return from_v3f(o.color); },
            [](Overlay& o, const Triple& color) { o.color = to_v3f(color); })
        .def_rw("opacity", &Overlay::opacity)
        .def_rw("roughness", &Overlay::roughness)
        .def_rw("scattering", &Overlay::scattering)
        .def_rw("bump", &Overlay::bump)
        .def_rw("internal", &Overlay::internal)
        .def_rw("age_begin", &Overlay::age_begin)
        .def_rw("age_end", &Overlay::age_end);
    const auto def_pattern = [&](const char* name, auto Pattern::*member) {
        using Value = std::remove_reference_t<decltype(std::declval<Pattern&>().*member)>;
        cls.def_prop_rw(
            name, [member](const Overlay& o) { return o.pattern.*member; },
            [member](Overlay& o, Value value) { o.pattern.*member = value; });
    };
    def_pattern("size", &Pattern::size);
    def_pattern("width", &Pattern::width);
    def_pattern("feather", &Pattern::feather);
    def_pattern("warp", &Pattern::warp);
    def_pattern("scales", &Pattern::scales);
    def_pattern("amount", &Pattern::amount);
    def_pattern("slope", &Pattern::slope);
    def_pattern("seed", &Pattern::seed);
    cls.def_prop_rw(
        "direction", [](const Overlay& o) { return from_v3f(o.pattern.direction); },
        [](Overlay& o, const Triple& direction) { o.pattern.direction = to_v3f(direction); });
    def_input(cls, "mask", &Overlay::mask);
    cls.def(
           "eval",
           [](const Overlay& o, const FloatArray& positions, const FloatArray& normals, float footprint) {
               const auto p = to_vectors3(positions, "Overlay.eval: positions");
               const auto n = to_vectors3(normals, "Overlay.eval: normals");
               if (p.size() != n.size()) {
                   throw ValueError(
                       str("Overlay.eval: normals must be as many as positions, ", p.size(), ", got ", n.size(), "."));
               }
               check_pattern(o.pattern, "Overlay");
               std::vector<float> masks(p.size());
               {
                   nb::gil_scoped_release release;
                   for (std::size_t i = 0; i < p.size(); ++i)
                       masks[i] = eval_pattern(o.pattern, {p[i], n[i], footprint});
               }
               return masks;
           },
           "positions"_a, "normals"_a, "footprint"_a = 0.0f,
           "The pattern's mask at positions (N, 3) with normals (N, 3), in metres of rest space, averaged over a\n"
           "footprint of this radius; the texture mask is left out. A list of N floats.")
        .def("__repr__", [](const Overlay& o) {
            return str("Overlay('", to_name(kPatternNames, o.pattern.kind), "', opacity=", o.opacity, ")");
        });
}

void bind_ice(nb::module_& module) {
    nb::class_<IceMaterial> cls(
        module, "IceMaterial",
        "frazil:ice: a translucent core under a glossy dielectric boundary.\n\n"
        "Parameters\n----------\n"
        "medium : Medium, in 1/m.\n"
        "roughness : float in [0, 1], or a TextureLookup.\n"
        "specular, translucency : weights in [0, 1] of the reflection and of the core.\n"
        "refraction : how much of what the medium leaves unscattered is seen through the boundary, in [0, 1].\n"
        "refraction_roughness : of light that goes through the boundary, in [0, 1]; None = as roughness.\n"
        "refraction_tint : RGB factor in [0, 1] on light each time that it goes through the boundary unscattered.\n"
        "volume : how much of the light scattered once inside is traced, in [0, 1].\n"
        "anisotropy : g of that light, in [-0.95, 0.95].\n"
        "density : Density, by which the medium is multiplied along refracted rays, from place to place.\n"
        "priority : where bodies overlap, the highest fills the place.\n"
        "overlays : list of Overlay, from below to the top; age : 0 = fresh .. 1 = old.\n"
        "tint : RGB factor on what leaves the core, or a TextureLookup.\n"
        "ramp_distances, ramp_colors : knots of the colour ramp over distance, metres and RGB.\n"
        "ramp_preserve_energy : keep the total reflectance whatever the ramp.\n"
        "profile : 'multiple_scattering', 'photon_beam', 'normalized_diffusion', 'better_dipole' or 'dipole'.\n"
        "compensation : 'off', 'ratio', 'conserve', 'depth', 'fill' or 'linear'; compensation_limit >= 1;\n"
        "    compensation_strength in [0, 1].\n"
        "spacing : of the points, metres; 0 = from the mean free path. A TextureLookup is read at the mesh's "
        "vertices.\n"
        "normal : tangent-space normal map, a TextureLookup (usually scale 2, bias -1), or None.\n"
        "bump : height in metres, a TextureLookup.\n\n"
        "Ranges are checked when the scene is rendered.");
    cls.def(
        "__init__",
        [](IceMaterial* self, const Medium& medium, const std::string& profile, const FloatInput& roughness,
           float specular, float translucency, float refraction, const std::optional<float>& refraction_roughness,
           const Triple& refraction_tint, float volume, float anisotropy, const Density& density, int priority,
           const std::vector<Overlay>& overlays, float age, const ColorInput& tint,
           const std::vector<float>& ramp_distances, const std::vector<Triple>& ramp_colors, bool ramp_preserve_energy,
           const std::string& compensation, float compensation_limit, float compensation_strength,
           const FloatInput& spacing, const std::optional<TextureLookup>& normal, const FloatInput& bump) {
            IceMaterial model;
            model.medium = medium;
            model.roughness = to_input(roughness);
            model.specular = specular;
            model.translucency = translucency;
            model.refraction = refraction;
            model.refraction_roughness = refraction_roughness.value_or(model.refraction_roughness);
            model.refraction_tint = to_v3f(refraction_tint);
            model.volume = volume;
            model.anisotropy = anisotropy;
            model.density = density;
            model.priority = priority;
            model.overlays = overlays;
            model.age = age;
            model.tint = to_input(tint);
            model.ramp = {ramp_distances, {}, ramp_preserve_energy};
            for (const Triple& color : ramp_colors) model.ramp.colors.push_back(to_v3f(color));
            model.compensation = {from_name(kCompensationNames, compensation, "IceMaterial: compensation"),
                                  compensation_limit, compensation_strength};
            model.spacing = to_input(spacing);
            model.normal = normal.value_or(TextureLookup{});
            model.bump = to_input(bump);
            model.profile = profile_named(profile, "IceMaterial");
            new (self) IceMaterial(std::move(model));
        },
        "medium"_a, nb::kw_only(), "profile"_a = "multiple_scattering", "roughness"_a = FloatInput(0.1f),
        "specular"_a = 1.0f, "translucency"_a = 1.0f, "refraction"_a = 1.0f, "refraction_roughness"_a = nb::none(),
        "refraction_tint"_a = Triple{1, 1, 1}, "volume"_a = 0.0f, "anisotropy"_a = 0.0f, "density"_a = Density(),
        "priority"_a = 0, "overlays"_a = std::vector<Overlay>(), "age"_a = 0.5f, "tint"_a = ColorInput(Triple{1, 1, 1}),
        "ramp_distances"_a = std::vector<float>(), "ramp_colors"_a = std::vector<Triple>(),
        "ramp_preserve_energy"_a = false, "compensation"_a = "depth", "compensation_limit"_a = Compensation().limit,
        "compensation_strength"_a = 1.0f, "spacing"_a = FloatInput(0.0f), "normal"_a = nb::none(),
        "bump"_a = FloatInput(0.0f));
    def_input(cls, "roughness", &IceMaterial::roughness);
    def_input(cls, "tint", &IceMaterial::tint);
    def_input(cls, "bump", &IceMaterial::bump);
    def_normal<IceMaterial>(cls);
    def_input(cls, "spacing", &IceMaterial::spacing);
    cls.def_rw("medium", &IceMaterial::medium)
        .def_rw("specular", &IceMaterial::specular)
        .def_rw("translucency", &IceMaterial::translucency)
        .def_rw("refraction", &IceMaterial::refraction)
        .def_prop_rw(
            "refraction_roughness",
            [](const IceMaterial& model) {
                return model.refraction_roughness < 0.0f ? std::nullopt : std::optional(model.refraction_roughness);
            },
            [](IceMaterial& model, const std::optional<float>& value) {
                model.refraction_roughness = value.value_or(-1.0f);
            },
            "value"_a.none())
        .def_prop_rw(
            "refraction_tint", [](const IceMaterial& model) { return from_v3f(model.refraction_tint); },
            [](IceMaterial& model, const Triple& tint) { model.refraction_tint = to_v3f(tint); })
        .def_rw("volume", &IceMaterial::volume)
        .def_rw("anisotropy", &IceMaterial::anisotropy)
        .def_rw("density", &IceMaterial::density)
        .def_rw("priority", &IceMaterial::priority)
        .def_rw("overlays", &IceMaterial::overlays)
        .def_rw("age", &IceMaterial::age)
        .def_prop_ro("ramp_distances", [](const IceMaterial& model) { return model.ramp.distances; })
        .def_prop_ro("ramp_colors",
                     [](const IceMaterial& model) {
                         std::vector<Triple> colors;
                         for (const Rgb& color : model.ramp.colors) colors.push_back(from_v3f(color));
                         return colors;
                     })
        .def_prop_ro("ramp_preserve_energy", [](const IceMaterial& model) { return model.ramp.preserve_energy; })
        .def_prop_rw(
            "profile", [](const IceMaterial& model) { return name_of(model.profile); },
            [](IceMaterial& model, const std::string& name) { model.profile = profile_named(name, "IceMaterial"); })
        .def_prop_rw(
            "compensation",
            [](const IceMaterial& model) { return to_name(kCompensationNames, model.compensation.mode); },
            [](IceMaterial& model, const std::string& name) {
                model.compensation.mode = from_name(kCompensationNames, name, "IceMaterial: compensation");
            })
        .def_prop_rw(
            "compensation_limit", [](const IceMaterial& model) { return model.compensation.limit; },
            [](IceMaterial& model, float limit) { model.compensation.limit = limit; })
        .def_prop_rw(
            "compensation_strength", [](const IceMaterial& model) { return model.compensation.strength; },
            [](IceMaterial& model, float strength) { model.compensation.strength = strength; })
        .def("__repr__", [](const IceMaterial& model) {
            const Medium& m = model.medium;
            return str("IceMaterial(sigma_s_prime=(", m.sigma_s_prime.x, ", ", m.sigma_s_prime.y, ", ",
                       m.sigma_s_prime.z, "), sigma_a=(", m.sigma_a.x, ", ", m.sigma_a.y, ", ", m.sigma_a.z,
                       "), eta=", m.eta, ")");
        });
}

void bind_displacement(nb::module_& module) {
    nb::class_<Displacement>(
        module, "Displacement",
        "What moves a surface before points and rays meet it. Lengths in the mesh's own units.\n\n"
        "Parameters\n----------\n"
        "height : along the normal; a constant or a TextureLookup.\n"
        "vector : takes the place of height; a TextureLookup or a constant, in `space` 'tangent' (along s, along t,\n"
        "    normal) or 'object'.\n"
        "pattern : an Overlay, whose pattern (not its opacity or mask) multiplies either; metres.")
        .def(
            "__init__",
            [](Displacement* self, const FloatInput& height, const std::optional<ColorInput>& vector,
               const std::string& space, const std::optional<Overlay>& pattern) {
                Displacement made;
                made.height = to_input(height);
                if (vector) made.vector = to_input(*vector);
                made.space = from_name(kSpaceNames, space, "Displacement: space");
                if (pattern) made.pattern = pattern->pattern;
                check_displacement(made, "Displacement");
                new (self) Displacement(std::move(made));
            },
            nb::kw_only(), "height"_a = FloatInput(0.0f), "vector"_a = nb::none(), "space"_a = "tangent",
            "pattern"_a = nb::none())
        .def_prop_ro("height", [](const Displacement& d) { return from_input(d.height); })
        .def_prop_ro(
            "vector",
            [](const Displacement& d) { return d.vector ? std::optional(from_input(*d.vector)) : std::nullopt; })
        .def_prop_ro("space", [](const Displacement& d) { return to_name(kSpaceNames, d.space); })
        .def(
            "eval",
            [](const Displacement& displacement, const Mesh& mesh, float metres_per_unit) {
                std::vector<V3f> offsets;
                {
                    nb::gil_scoped_release released;
                    offsets = eval_displacement(displacement, mesh, metres_per_unit);
                }
                auto* kept = new std::vector<V3f>(std::move(offsets));
                nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<V3f>*>(memory); });
                return nb::ndarray<nb::numpy, float, nb::ndim<2>>(kept->data(), {kept->size(), 3}, owner);
            },
            "mesh"_a, "metres_per_unit"_a = 1.0f, "Offsets (3F, 3) at the corners of a mesh, for displaced().");
}

}  // namespace

void bind_material(nb::module_& module) {
    bind_texture(module);
    bind_standard(module);
    bind_overlay(module);
    bind_density(module);
    bind_ice(module);
    bind_displacement(module);
}

}  // namespace frazil
