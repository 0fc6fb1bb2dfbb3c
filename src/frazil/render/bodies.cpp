#include "frazil/render/bodies.h"

#include <map>

#include "frazil/render/stopwatch.h"

namespace frazil {

float Body::transmittance(float cos_theta, float roughness) const {
    return 1.0f - material->specular * boundary->eval(cos_theta, alpha_from_roughness(roughness));
}

float Body::transmittance_average(float roughness) const {
    return 1.0f - material->specular * boundary->average(alpha_from_roughness(roughness));
}

Rgb Body::inner_radiance_per_exitance(const Surface& surface) const {
    const float average = transmittance_average(eval_float(material->roughness, surface.st));
    return eval_color(material->tint, surface.st) * (material->translucency * kInvPi / average);
}

Rgb Body::radiance_per_exitance(const Surface& surface, const V3f& wo) const {
    const float roughness = eval_float(material->roughness, surface.st);
    return inner_radiance_per_exitance(surface) * transmittance(surface.normal.dot(wo), roughness);
}

std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene) {
    std::vector<std::unique_ptr<Body>> bodies(scene.objects.size());
    std::map<float, std::shared_ptr<const DielectricAlbedo>> boundaries;  // by eta
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const auto* material = std::get_if<IceMaterial>(&scene.materials[scene.objects[i].material].model);
        if (!material) continue;
        auto& boundary = boundaries[material->medium.eta];
        if (!boundary) boundary = std::make_shared<DielectricAlbedo>(material->medium.eta);
        const Profile profile = Dipole(material->medium);
        bodies[i] = std::make_unique<Body>(Body{material, boundary, profile, albedo(profile), nullptr});
    }
    return bodies;
}

void plant_trees(const std::vector<LitPoints>& lit, std::size_t groups, std::vector<std::unique_ptr<Body>>& bodies,
                 RenderStats& stats) {
    Stopwatch watch(stats.seconds["tree"]);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0) continue;
        bodies[i]->tree = std::make_unique<const PointTree>(lit[i].points, lit[i].irradiance, groups,
                                                            bodies[i]->profile, bodies[i]->material->ramp);
        bodies[i]->spacing = static_cast<float>(lit[i].points.spacing);
        stats.points += bodies[i]->tree->point_count();
        stats.nodes += bodies[i]->tree->node_count();
    }
}

std::vector<Passage> passages_of(const Scene& scene) {
    std::vector<Passage> passages(scene.objects.size());
    for (std::size_t i = 0; i < passages.size(); ++i) {
        const auto* ice = std::get_if<IceMaterial>(&scene.materials[scene.objects[i].material].model);
        if (!ice || ice->refraction == 0.0f) continue;
        passages[i] = {ice->refraction, ice->medium.eta, ice->medium.sigma_s_prime + ice->medium.sigma_a};
    }
    return passages;
}

}  // namespace frazil
