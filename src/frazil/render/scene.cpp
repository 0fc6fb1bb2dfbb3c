#include "frazil/render/scene.h"

#include "frazil/base/error.h"

namespace frazil {
namespace {

void check_material(const Material& material) {
    const auto* ice = std::get_if<IceMaterial>(&material.model);
    if (!ice) return;
    check_medium(ice->medium, material.path);
    if (!ice->ramp.is_empty()) check_ramp(ice->ramp, material.path);
    const auto require = [&](bool holds, const char* rule, float value) {
        if (!holds) throw ValueError(str(material.path, ": ", rule, ", got ", value, ". Mend the shader's input."));
    };
    require(ice->roughness.value >= 0.0f && ice->roughness.value <= 1.0f, "roughness must be in 0..1",
            ice->roughness.value);
    require(ice->specular >= 0.0f && ice->specular <= 1.0f, "specular must be in 0..1", ice->specular);
    require(ice->translucency >= 0.0f && ice->translucency <= 1.0f, "translucency must be in 0..1", ice->translucency);
    require(ice->refraction >= 0.0f && ice->refraction <= 1.0f, "refraction must be in 0..1", ice->refraction);
    require(ice->refraction_roughness <= 1.0f, "refraction_roughness must be in 0..1", ice->refraction_roughness);
    for (int c = 0; c < 3; ++c) {
        require(ice->refraction_tint[c] >= 0.0f && ice->refraction_tint[c] <= 1.0f, "refraction_tint must be in 0..1",
                ice->refraction_tint[c]);
    }
    require(ice->volume >= 0.0f && ice->volume <= 1.0f, "volume must be in 0..1", ice->volume);
    require(ice->anisotropy >= -0.95f && ice->anisotropy <= 0.95f, "anisotropy must be in -0.95..0.95",
            ice->anisotropy);
    require(ice->age >= 0.0f && ice->age <= 1.0f, "age must be in 0..1", ice->age);
    check_density(ice->density, material.path);
    for (std::size_t i = 0; i < ice->overlays.size(); ++i) {
        check_overlay(ice->overlays[i], str(material.path, ": overlay ", i));
    }
    require(ice->compensation.limit >= 1.0f, "compensation_limit must be >= 1", ice->compensation.limit);
    require(ice->compensation.strength >= 0.0f && ice->compensation.strength <= 1.0f,
            "compensation_strength must be in 0..1", ice->compensation.strength);
    require(ice->spacing.value >= 0.0f && std::isfinite(ice->spacing.value), "spacing must be >= 0",
            ice->spacing.value);
}

}  // namespace

void check_scene(const Scene& scene) {
    for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
        check_mesh(scene.meshes[i], i < scene.mesh_paths.size() ? scene.mesh_paths[i] : str("mesh ", i));
    }
    for (const Material& material : scene.materials) check_material(material);
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
