#include "frazil/render/scene.h"

#include <cmath>
#include <string>

#include "frazil/base/error.h"

namespace frazil {
namespace {

// Refuses the values of one material that are out of range, by its path.
class MaterialCheck {
  public:
    explicit MaterialCheck(const Material& material) : path_(material.path) {
        std::visit([&](const auto& model) { check(model); }, material.model);
    }

  private:
    void check(const IceMaterial& ice) const {
        check_medium(ice.medium, path_);
        if (!ice.ramp.is_empty() || !ice.ramp.colors.empty()) check_ramp(ice.ramp, path_ + ": ramp");
        fraction("roughness", ice.roughness);
        fraction("specular", ice.specular);
        fraction("translucency", ice.translucency);
        fraction("refraction", ice.refraction);
        if (ice.refraction_roughness != -1.0f) fraction("refraction_roughness", ice.refraction_roughness);
        fraction("refraction_tint", ice.refraction_tint);
        fraction("volume", ice.volume);
        require(ice.anisotropy >= -0.95f && ice.anisotropy <= 0.95f, "anisotropy must be in -0.95..0.95",
                ice.anisotropy);
        require(std::abs(ice.priority) <= 1000, "priority must be in -1000..1000", float(ice.priority));
        fraction("age", ice.age);
        at_least("tint", ice.tint, 0.0f);
        finite("bump", ice.bump);
        normal(ice.normal);
        check_density(ice.density, path_);
        for (std::size_t i = 0; i < ice.overlays.size(); ++i) {
            check_overlay(ice.overlays[i], str(path_, ": overlay ", i));
            lookup("mask", ice.overlays[i].mask.lookup);
        }
        at_least("compensation_limit", ice.compensation.limit, 1.0f);
        fraction("compensation_strength", ice.compensation.strength);
        at_least("spacing", ice.spacing, 0.0f);
    }

    void check(const StandardMaterial& standard) const {
        at_least("diffuse_color", standard.diffuse_color, 0.0f);
        at_least("emissive_color", standard.emissive_color, 0.0f);
        at_least("specular_color", standard.specular_color, 0.0f);
        fraction("metallic", standard.metallic);
        fraction("roughness", standard.roughness);
        fraction("clearcoat", standard.clearcoat);
        fraction("clearcoat_roughness", standard.clearcoat_roughness);
        fraction("opacity", standard.opacity);
        fraction("opacity_threshold", standard.opacity_threshold);
        require(standard.ior >= 1.0f && standard.ior <= 100.0f, "ior must be in 1..100", standard.ior);
        finite("bump", standard.bump);
        normal(standard.normal);
    }

    void require(bool holds, const std::string& rule, float value) const {
        if (!holds) throw ValueError(str(path_, ": ", rule, ", got ", value, ". Mend the shader's input."));
    }
    void fraction(const char* name, float value) const {
        require(value >= 0.0f && value <= 1.0f, str(name, " must be in 0..1"), value);
    }
    void fraction(const char* name, const Rgb& color) const {
        for (int c = 0; c < 3; ++c) fraction(name, color[c]);
    }
    void at_least(const char* name, float value, float smallest) const {
        require(value >= smallest && std::isfinite(value), str(name, " must be >= ", smallest, " and finite"), value);
    }
    void at_least(const char* name, const Rgb& color, float smallest) const {
        for (int c = 0; c < 3; ++c) at_least(name, color[c], smallest);
    }
    // A constant counts only where there is no texture.
    template <class T>
    void fraction(const char* name, const MaterialInput<T>& input) const {
        lookup(name, input.lookup);
        if (!input.lookup.texture) fraction(name, input.value);
    }
    template <class T>
    void at_least(const char* name, const MaterialInput<T>& input, float smallest) const {
        lookup(name, input.lookup);
        if (!input.lookup.texture) at_least(name, input.value, smallest);
    }
    void finite(const char* name, const MaterialInput<float>& input) const {
        lookup(name, input.lookup);
        require(std::isfinite(input.value), str(name, " must be finite"), input.value);
    }
    void normal(const TextureLookup& map) const { lookup("normal", map); }
    void lookup(const char* name, const TextureLookup& map) const {
        if (!map.texture) return;
        for (int c = 0; c < 3; ++c) {
            require(std::isfinite(map.scale[c]), str(name, ": scale of its texture must be finite"), map.scale[c]);
            require(std::isfinite(map.bias[c]), str(name, ": bias of its texture must be finite"), map.bias[c]);
        }
    }

    const std::string& path_;
};

}  // namespace

void check_scene(const Scene& scene) {
    for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
        check_mesh(scene.meshes[i], i < scene.mesh_paths.size() ? scene.mesh_paths[i] : str("mesh ", i));
    }
    for (const Material& material : scene.materials) MaterialCheck{material};
    for (const Object& object : scene.objects) {
        if (object.mesh >= scene.meshes.size()) {
            throw ValueError(str(object.path, ": mesh must be an index below ", scene.meshes.size(), ", got ",
                                 object.mesh, ". Add the mesh before the object."));
        }
        if (object.material >= scene.materials.size()) {
            throw ValueError(str(object.path, ": material must be an index below ", scene.materials.size(), ", got ",
                                 object.material, ". Add the material before the object."));
        }
        const float determinant = object.local_to_world.determinant();
        if (!std::isfinite(determinant) || determinant == 0.0f) {
            throw ValueError(str(object.path, ": the transform's determinant must be finite and not 0, got ",
                                 determinant, ". A scale of 0 hides an object; use visibility instead."));
        }
    }
    for (const Light& light : scene.lights) check_light(light);
    check_camera(scene.camera);
}

}  // namespace frazil
