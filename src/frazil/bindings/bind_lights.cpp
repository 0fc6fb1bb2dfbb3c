#include <nanobind/stl/array.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/variant.h>

#include "frazil/bindings/bindings.h"
#include "frazil/lighting/light.h"

namespace frazil {
namespace {

using Triple = std::array<float, 3>;
using ImageArray = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

Rgb to_rgb(const Triple& c) {
    return {c[0], c[1], c[2]};
}

Triple to_triple(const Rgb& c) {
    return {c.x, c.y, c.z};
}

// An Environment or LightImage of the pixels; none where there are none.
template <class Image>
std::shared_ptr<const Image> to_image(const std::optional<ImageArray>& image, const std::string& path) {
    if (!image) return nullptr;
    const auto* pixels = reinterpret_cast<const Rgb*>(image->data());
    return std::make_shared<const Image>(int(image->shape(1)), int(image->shape(0)),
                                         std::vector<Rgb>(pixels, pixels + image->shape(0) * image->shape(1)), path);
}

// The pixels of a light's image as a view, None where it has none.
template <class Shape>
nb::object image_of(nb::handle self) {
    const Shape& light = nb::cast<const Shape&>(self);
    if (!light.image) return nb::none();
    const auto& image = *light.image;
    return nb::cast(
        view(&image.pixels().data()->x, {std::size_t(image.height()), std::size_t(image.width()), 3}, self));
}

// The default group goes by no name inside; its layers are called `default`.
std::string group_named(const std::string& name) {
    return name == "default" ? std::string() : name;
}

}  // namespace

void bind_lights(nb::module_& module) {
    nb::class_<DomeLight>(
        module, "DomeLight",
        "Light from all around.\n\n"
        "Parameters\n----------\n"
        "image : (height, width, 3) float32 lat-long radiance, row 0 = +y, centre = +z, or None for a\n"
        "    uniform dome. Copied.\n"
        "portals : list of (4, 4) float64, openings that the light comes through: the unit square in x and y to\n"
        "    the world, for row vectors; light goes along its -z. They guide sampling alone.")
        .def(
            "__init__",
            [](DomeLight* self, const std::optional<ImageArray>& image, const std::string& path,
               const std::vector<MatrixArray>& portals) {
                DomeLight light{to_image<Environment>(image, path)};
                for (const MatrixArray& portal : portals) light.portals.push_back(to_matrix(portal));
                new (self) DomeLight(std::move(light));
            },
            "image"_a = nb::none(), "path"_a = "DomeLight", "portals"_a = std::vector<MatrixArray>())
        .def_prop_ro("portals",
                     [](const DomeLight& light) {
                         nb::list matrices;
                         for (const M44f& portal : light.portals) matrices.append(from_matrix(portal));
                         return matrices;
                     })
        .def_prop_ro("has_image", [](const DomeLight& light) { return light.image != nullptr; })
        .def_prop_ro(
            "image", [](nb::handle self) { return image_of<DomeLight>(self); }, "(height, width, 3) float32, or None.")
        .def(
            "radiance",
            [](const DomeLight& light, const Triple& direction) {
                const Rgb c = light.image ? light.image->eval(V3f(direction[0], direction[1], direction[2])) : Rgb(1);
                return Triple{c.x, c.y, c.z};
            },
            "direction"_a, "Radiance from a unit direction in the light's own frame; 1 without an image.");
    nb::class_<DistantLight>(module, "DistantLight", "A sun along -z; `angle` is its full angle in degrees.")
        .def(nb::init<float>(), "angle"_a = 0.53f)
        .def_rw("angle", &DistantLight::angle);
    nb::class_<RectLight>(
        module, "RectLight",
        "A rectangle in x and y that shines along -z, in the light's units.\n\n"
        "Parameters\n----------\n"
        "width, height : the sides.\n"
        "image : (height, width, 3) float32 that multiplies the radiance, upright (+y up) as seen from\n"
        "    the side that shines, or None. Copied.")
        .def(
            "__init__",
            [](RectLight* self, float width, float height, const std::optional<ImageArray>& image,
               const std::string& path) {
                new (self) RectLight{width, height, to_image<LightImage>(image, path)};
            },
            "width"_a = 1.0f, "height"_a = 1.0f, "image"_a = nb::none(), "path"_a = "RectLight")
        .def_prop_ro("has_image", [](const RectLight& light) { return light.image != nullptr; })
        .def_prop_ro(
            "image", [](nb::handle self) { return image_of<RectLight>(self); }, "(height, width, 3) float32, or None.")
        .def_rw("width", &RectLight::width)
        .def_rw("height", &RectLight::height);
    nb::class_<DiskLight>(module, "DiskLight", "A disk in x and y that shines along -z, in the light's units.")
        .def(nb::init<float>(), "radius"_a = 0.5f)
        .def_rw("radius", &DiskLight::radius);
    nb::class_<SphereLight>(module, "SphereLight", "A sphere that shines outwards, in the light's units.")
        .def(nb::init<float>(), "radius"_a = 0.5f)
        .def_rw("radius", &SphereLight::radius);
    nb::class_<CylinderLight>(module, "CylinderLight",
                              "A tube about x without caps that shines outwards, in the light's units.")
        .def(nb::init<float, float>(), "length"_a = 1.0f, "radius"_a = 0.5f)
        .def_rw("length", &CylinderLight::length)
        .def_rw("radius", &CylinderLight::radius);

    nb::class_<MeshLight>(
        module, "MeshLight",
        "A mesh that shines along its normals.\n\n"
        "Parameters\n----------\n"
        "mesh : Mesh, in the light's frame. Copied.\n"
        "object : index of the scene's object that shows this mesh at the light's matrix; None = none,\n"
        "    then rays do not run into the light.\n"
        "triangle_factors : (F, 3) float32 that multiplies the radiance by triangle, or None.\n"
        "is_two_sided : shine from both sides.\n"
        "is_material : it stands for the emission of the object's material, which the camera sees itself.")
        .def(
            "__init__",
            [](MeshLight* self, const Mesh& mesh, std::optional<std::uint32_t> object,
               const std::optional<FloatArray>& triangle_factors, bool is_two_sided, bool is_material) {
                MeshLight light;
                light.mesh = std::make_shared<const Mesh>(mesh);
                light.object = object.value_or(kNoObject);
                if (triangle_factors) {
                    light.triangle_factors = std::make_shared<const std::vector<Rgb>>(
                        to_vectors3(*triangle_factors, "MeshLight: triangle_factors"));
                }
                light.is_two_sided = is_two_sided;
                light.is_material = is_material;
                new (self) MeshLight(std::move(light));
            },
            "mesh"_a, "object"_a = nb::none(), "triangle_factors"_a = nb::none(), nb::kw_only(),
            "is_two_sided"_a = false, "is_material"_a = false)
        .def_prop_ro("object",
                     [](const MeshLight& light) {
                         return light.object == kNoObject ? std::optional<std::uint32_t>() : light.object;
                     })
        .def_prop_ro(
            "mesh", [](const MeshLight& light) { return *light.mesh; }, "A copy of the mesh.")
        .def_prop_ro(
            "triangle_factors",
            [](nb::handle self) -> nb::object {
                const MeshLight& light = nb::cast<const MeshLight&>(self);
                if (!light.triangle_factors) return nb::none();
                return nb::cast(view(&light.triangle_factors->data()->x, {light.triangle_factors->size(), 3}, self));
            },
            "(F, 3) float32, or None.")
        .def_ro("is_two_sided", &MeshLight::is_two_sided)
        .def_ro("is_material", &MeshLight::is_material);

    nb::class_<ObjectSet>(module, "ObjectSet",
                          "Objects of a scene by index, for light and shadow linking. Lights may share one.")
        .def(nb::init<std::vector<std::uint32_t>>(), "objects"_a)
        .def_ro("objects", &ObjectSet::objects)
        .def("__len__", [](const ObjectSet& set) { return set.objects.size(); });
    nb::class_<IesProfile>(
        module, "IesProfile",
        "A luminaire's light by direction (IES LM-63, type C), bilinear in the angles; see read_ies.\n\n"
        "Parameters\n----------\n"
        "vertical : (V,) degrees that rise within 0 (the light's -z) to 180; beyond them it gives nothing.\n"
        "horizontal : (H,) degrees, from 0 to 0, 90, 180 or 360, or from 90 to 270: less than a turn is mirrored.\n"
        "values : (H, V) intensities in candela, >= 0.\n"
        "path : name for messages.")
        .def(
            "__init__",
            [](IesProfile* self, const std::vector<float>& vertical, const std::vector<float>& horizontal,
               const std::vector<std::vector<float>>& values, const std::string& path) {
                std::vector<float> flat;
                for (const std::vector<float>& row : values) {
                    if (row.size() != vertical.size()) {
                        throw ValueError(str(path, ": intensities must be one for each vertical angle (",
                                             vertical.size(), "), got ", row.size(), "."));
                    }
                    flat.insert(flat.end(), row.begin(), row.end());
                }
                new (self) IesProfile(vertical, horizontal, std::move(flat), path);
            },
            "vertical"_a, "horizontal"_a, "values"_a, "path"_a = "IesProfile")
        .def_prop_ro("vertical", &IesProfile::vertical)
        .def_prop_ro("horizontal", &IesProfile::horizontal)
        .def_prop_ro("values",
                     [](const IesProfile& profile) {
                         std::vector<std::vector<float>> rows;
                         const std::size_t columns = profile.vertical().size();
                         for (std::size_t h = 0; h < profile.horizontal().size(); ++h) {
                             const auto first = profile.values().begin() + std::ptrdiff_t(h * columns);
                             rows.emplace_back(first, first + std::ptrdiff_t(columns));
                         }
                         return rows;
                     })
        .def_prop_ro("mean", &IesProfile::mean, "Mean intensity over the sphere, or the hemisphere that it covers.")
        .def(
            "intensity",
            [](const IesProfile& profile, const Triple& direction) { return profile.eval(-to_v3f(direction)); },
            "direction"_a, "Intensity towards a unit direction in the light's own frame; -z is vertical angle 0.");
    nb::class_<Shaping>(
        module, "Shaping",
        "How the light depends on the angle from -z (UsdLuxShapingAPI).\n\n"
        "Parameters\n----------\n"
        "cone_angle : degrees from the axis beyond which nothing shines, 0 to 180; 180 = no cone.\n"
        "cone_softness : >= 0; the part of the angle over which the light fades.\n"
        "focus : >= 0; exponent of the cosine. focus_tint : RGB that takes the place of what focus removes.\n"
        "ies : IesProfile that multiplies the light, None = none. ies_angle_scale : widens (> 1) or narrows (< 1) the\n"
        "    profile about straight down, negative ones about straight up; 0 = neither.\n"
        "ies_normalize : divide the profile by its mean.")
        .def(
            "__init__",
            [](Shaping* self, float cone_angle, float cone_softness, float focus, const Triple& focus_tint,
               std::shared_ptr<const IesProfile> ies, float ies_angle_scale, bool ies_normalize) {
                new (self) Shaping{cone_angle,     cone_softness,   focus,        to_rgb(focus_tint),
                                   std::move(ies), ies_angle_scale, ies_normalize};
            },
            nb::kw_only(), "cone_angle"_a = 180.0f, "cone_softness"_a = 0.0f, "focus"_a = 0.0f,
            "focus_tint"_a = Triple{0, 0, 0}, "ies"_a = nb::none(), "ies_angle_scale"_a = 0.0f,
            "ies_normalize"_a = false)
        .def_ro("cone_angle", &Shaping::cone_angle)
        .def_ro("cone_softness", &Shaping::cone_softness)
        .def_ro("focus", &Shaping::focus)
        .def_prop_ro("focus_tint", [](const Shaping& shaping) { return to_triple(shaping.focus_tint); })
        .def_prop_ro("ies", [](const Shaping& shaping) { return shaping.ies; })
        .def_ro("ies_angle_scale", &Shaping::ies_angle_scale)
        .def_ro("ies_normalize", &Shaping::ies_normalize);
    nb::class_<ShadowRules>(module, "ShadowRules",
                            "How a light's shadows depart from opaque ones (UsdLuxShadowAPI).\n\n"
                            "Parameters\n----------\n"
                            "is_enabled : whether it casts shadows.\n"
                            "color : RGB, what is left of the light in shadow.\n"
                            "distance : metres from the shadowed place within which things cast shadows; < 0 = any.\n"
                            "falloff : metres within `distance` over which the shadow fades; < 0 = none.\n"
                            "falloff_gamma : exponent of the fade, > 0.\n"
                            "casters : ObjectSet of the only objects that cast shadows, None = all.")
        .def(
            "__init__",
            [](ShadowRules* self, bool is_enabled, const Triple& color, float distance, float falloff,
               float falloff_gamma, std::shared_ptr<const ObjectSet> casters) {
                new (self) ShadowRules{is_enabled, to_rgb(color), distance, falloff, falloff_gamma, std::move(casters)};
            },
            nb::kw_only(), "is_enabled"_a = true, "color"_a = Triple{0, 0, 0}, "distance"_a = -1.0f,
            "falloff"_a = -1.0f, "falloff_gamma"_a = 1.0f, "casters"_a = nb::none())
        .def_ro("is_enabled", &ShadowRules::is_enabled)
        .def_prop_ro("color", [](const ShadowRules& rules) { return to_triple(rules.color); })
        .def_ro("distance", &ShadowRules::distance)
        .def_ro("falloff", &ShadowRules::falloff)
        .def_ro("falloff_gamma", &ShadowRules::falloff_gamma)
        .def_prop_ro("casters", [](const ShadowRules& rules) { return rules.casters; })
        .def(
            "with_casters",
            [](ShadowRules rules, std::shared_ptr<const ObjectSet> casters) {
                rules.casters = std::move(casters);
                return rules;
            },
            "casters"_a.none(), "The same rules with other casters.");

    nb::class_<Light>(
        module, "Light",
        "A light of the scene.\n\n"
        "Parameters\n----------\n"
        "shape : DomeLight, DistantLight, RectLight, DiskLight, SphereLight, CylinderLight or MeshLight.\n"
        "radiance : RGB, the product of intensity, exposure, colour and colour temperature.\n"
        "matrix : (4, 4) float64 light to world, for row vectors; None = identity.\n"
        "path : name for messages. group : light group, '' or 'default' = the default one.\n"
        "normalize : divide by the light's area in square metres.\n"
        "diffuse, specular, translucency, refraction, volume : multipliers of what the light does to each component.\n"
        "shaping : Shaping. shadow : ShadowRules.\n"
        "lit : ObjectSet of the only objects that it lights, None = all.")
        .def(
            "__init__",
            [](Light* self, LightShape shape, const Triple& radiance, const std::optional<MatrixArray>& matrix,
               const std::string& path, const std::string& group, bool normalize, float diffuse, float specular,
               float translucency, float refraction, float volume, const Shaping& shaping, const ShadowRules& shadow,
               std::shared_ptr<const ObjectSet> lit) {
                new (self) Light{path,
                                 group_named(group),
                                 std::move(shape),
                                 Rgb(radiance[0], radiance[1], radiance[2]),
                                 normalize,
                                 to_matrix_or_identity(matrix),
                                 shaping,
                                 shadow,
                                 std::move(lit),
                                 {diffuse, specular, translucency, refraction, volume}};
            },
            "shape"_a, nb::kw_only(), "radiance"_a = Triple{1, 1, 1}, "matrix"_a = nb::none(), "path"_a = "Light",
            "group"_a = "", "normalize"_a = false, "diffuse"_a = 1.0f, "specular"_a = 1.0f, "translucency"_a = 1.0f,
            "refraction"_a = 1.0f, "volume"_a = 1.0f, "shaping"_a = Shaping(), "shadow"_a = ShadowRules(),
            "lit"_a = nb::none())
        .def_rw("path", &Light::path)
        .def_prop_rw(
            "group", [](const Light& light) { return light.group; },
            [](Light& light, const std::string& name) { light.group = group_named(name); })
        .def_rw("shape", &Light::shape)
        .def_prop_rw(
            "radiance",
            [](const Light& light) {
                return Triple{light.radiance.x, light.radiance.y, light.radiance.z};
            },
            [](Light& light, const Triple& value) { light.radiance = Rgb(value[0], value[1], value[2]); })
        .def_rw("normalize", &Light::normalize)
        .def_rw("shaping", &Light::shaping)
        .def_rw("shadow", &Light::shadow)
        .def_prop_rw(
            "lit", [](const Light& light) { return light.lit; },
            [](Light& light, std::shared_ptr<const ObjectSet> lit) { light.lit = std::move(lit); }, "lit"_a.none())
        .def_prop_rw(
            "matrix", [](const Light& light) { return from_matrix(light.light_to_world); },
            [](Light& light, const MatrixArray& matrix) { light.light_to_world = to_matrix(matrix); })
        .def_prop_ro("diffuse", [](const Light& light) { return light.multipliers[int(LightComponent::diffuse)]; })
        .def_prop_ro("specular", [](const Light& light) { return light.multipliers[int(LightComponent::specular)]; })
        .def_prop_ro("translucency",
                     [](const Light& light) { return light.multipliers[int(LightComponent::translucency)]; })
        .def_prop_ro("refraction",
                     [](const Light& light) { return light.multipliers[int(LightComponent::refraction)]; })
        .def_prop_ro("volume", [](const Light& light) { return light.multipliers[int(LightComponent::volume)]; })
        .def("check", &check_light, "ValueError beginning with the light's path where a value of it cannot be used.")
        .def("__repr__", [](const Light& light) {
            constexpr const char* kShapes[] = {"dome", "distant", "rect", "disk", "sphere", "cylinder", "mesh"};
            return str("Light(", light.path, ", ", kShapes[light.shape.index()], ", radiance=(", light.radiance.x, ", ",
                       light.radiance.y, ", ", light.radiance.z, "))");
        });
}

}  // namespace frazil
