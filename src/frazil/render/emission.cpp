#include "frazil/render/emission.h"

#include <tuple>

namespace frazil {
namespace {

// Null where the object's material emits nothing.
const StandardMaterial* emitter_of(const Scene& scene, std::uint32_t object) {
    const auto* material = std::get_if<StandardMaterial>(&scene.materials[scene.objects[object].material].model);
    if (!material) return nullptr;
    const MaterialInput<Rgb>& emission = material->emissive_color;
    return emission.lookup.texture || emission.value != Rgb(0.0f) ? material : nullptr;
}

}  // namespace

std::vector<std::uint32_t> emissive_objects(const Scene& scene) {
    std::vector<std::uint32_t> result;
    for (std::uint32_t i = 0; i < scene.objects.size(); ++i) {
        if (emitter_of(scene, i) && !scene.meshes[scene.objects[i].mesh].triangles.empty()) result.push_back(i);
    }
    return result;
}

std::vector<Rgb> triangle_emission(const Scene& scene, std::uint32_t object) {
    const StandardMaterial* material = emitter_of(scene, object);
    if (!material) return {};
    const Mesh& mesh = scene.meshes[scene.objects[object].mesh];
    std::vector<Rgb> result(mesh.triangle_count(), Rgb(0.0f));
    // A rule of degree 5 on the triangle [Cowper1973]: the middle, and three places each near corners and edges.
    constexpr float kNear = 0.10128651f, kFar = 0.47014206f;
    constexpr float kMiddleWeight = 0.225f, kNearWeight = 0.12593918f, kFarWeight = 0.13239415f;
    for (std::uint32_t i = 0; i < result.size(); ++i) {
        const auto emission = [&](float u, float v) {
            TexturePoint at = mesh.uvs.is_empty() ? V2f(0.0f) : mesh.uvs.at(mesh.triangles, i, {u, v});
            const V3i& t = mesh.triangles[i];
            const V3f &a = mesh.positions[t.x], e1 = mesh.positions[t.y] - a, e2 = mesh.positions[t.z] - a;
            at.position = a + e1 * u + e2 * v;
            at.normal = e1.cross(e2).normalized();
            at.has_st = !mesh.uvs.is_empty();
            if (at.has_st) {
                const V2f st0 = mesh.uvs.at(mesh.triangles, i, {0.0f, 0.0f});
                at.set_gradients(e1, e2, mesh.uvs.at(mesh.triangles, i, {1.0f, 0.0f}) - st0,
                                 mesh.uvs.at(mesh.triangles, i, {0.0f, 1.0f}) - st0);
            }
            // Each of the seven places stands for a disc of its share.
            const float radius = std::sqrt(0.5f * e1.cross(e2).length() * kInvPi / 7.0f);
            std::tie(at.long_axis, at.short_axis) = tangent_frame(at.normal);
            at.long_axis *= radius, at.short_axis *= radius;
            return eval_color(material->emissive_color, at);
        };
        if (!material->emissive_color.lookup.texture) {
            result[i] = material->emissive_color.value;
            continue;
        }
        result[i] = emission(1.0f / 3, 1.0f / 3) * kMiddleWeight;
        for (const auto& [a, weight] : {std::pair(kNear, kNearWeight), std::pair(kFar, kFarWeight)}) {
            const float b = 1.0f - 2.0f * a;
            result[i] += (emission(a, a) + emission(a, b) + emission(b, a)) * weight;
        }
    }
    return result;
}

}  // namespace frazil
