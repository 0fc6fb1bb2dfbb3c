#include "frazil/render/bodies.h"

#include <algorithm>
#include <map>

#include "frazil/render/interior.h"
#include "frazil/render/stopwatch.h"
#include "frazil/render/thickness.h"
#include "frazil/translucency/half_space.h"

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
        // What rays trace of the light that is scattered once, the profile leaves out.
        const Medium& medium = material->medium;
        const bool is_traced = material->volume > 0.0f && is_closed(scene.meshes[scene.objects[i].mesh]);
        const double traced = is_traced ? material->volume : 0.0;
        const Profile profile = make_profile(material->profile, medium, 1.0 - traced);
        bodies[i] = std::make_unique<Body>(Body{material, boundary, profile, albedo(profile), nullptr});
        if (!is_traced || !lacks_single_scattering(material->profile)) continue;
        const double white = half_space_albedo(1.0, medium.eta).single;
        bodies[i]->core_scale = Rgb(static_cast<float>(1.0 / (1.0 - traced * white)));
        for (int c = 0; c < 3; ++c) {
            const double alpha = medium.sigma_s_prime[c] / (double(medium.sigma_s_prime[c]) + medium.sigma_a[c]);
            bodies[i]->traced_once[c] = static_cast<float>(traced * half_space_albedo(alpha, medium.eta).single);
        }
    }
    return bodies;
}

std::vector<Rgb> thickness_gains(const Body& body, const PointSet& points, const RayScene& ray_scene) {
    if (body.material->compensation.mode != CompensationMode::depth) return {};
    return thickness_gain(points, ray_scene, body.material->medium, body.traced_once);
}

PointTree make_tree(const Body& body, const PointSet& points, const std::vector<Rgb>& irradiance, std::size_t groups,
                    const std::vector<Rgb>& thickness_gains) {
    if (thickness_gains.empty()) return {points, irradiance, groups, body.profile, body.material->ramp};
    std::vector<Rgb> values((groups + 1) * points.size(), Rgb(0.0f));
    for (std::size_t k = 0; k < points.size(); ++k) {
        std::copy_n(&irradiance[k * groups], groups, &values[k * (groups + 1)]);
        values[k * (groups + 1) + groups] = thickness_gains[k];
    }
    return {points, std::move(values), groups + 1, body.profile, body.material->ramp};
}

Gathered compensated_exitance(const Body& body, const PointTree& tree, const V3f* positions, std::size_t count,
                              const GatherOptions& options) {
    Gathered gathered = tree.gather(positions, count, options);
    const Compensation& compensation = body.material->compensation;
    const bool has_thickness = compensation.mode == CompensationMode::depth;
    const std::size_t all = gathered.groups, groups = all - has_thickness;
    for (std::size_t i = 0; i < count; ++i) {
        const Rgb& coverage = gathered.coverage[i];
        Rgb gain = compensation_gain(compensation, coverage, body.total_reflectance);
        if (has_thickness) {
            const Rgb& sum = gathered.exitance[i * all + groups];
            for (int c = 0; c < 3; ++c) {
                if (!(coverage[c] > 0.0f)) continue;
                gain[c] *= 1.0f + compensation.strength * (std::max(sum[c] / coverage[c], 1.0f) - 1.0f);
            }
        }
        for (std::size_t g = 0; g < groups; ++g)
            gathered.exitance[i * groups + g] = gathered.exitance[i * all + g] * gain;
    }
    gathered.groups = groups;
    gathered.exitance.resize(count * groups);
    return gathered;
}

void plant_trees(const std::vector<LitPoints>& lit, std::size_t groups, const RayScene& ray_scene,
                 std::vector<std::unique_ptr<Body>>& bodies, RenderStats& stats) {
    Stopwatch watch(stats.seconds["tree"]);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0) continue;
        const Body& body = *bodies[i];
        bodies[i]->tree = std::make_unique<const PointTree>(
            make_tree(body, lit[i].points, lit[i].irradiance, groups, thickness_gains(body, lit[i].points, ray_scene)));
        stats.points += bodies[i]->tree->point_count();
        stats.nodes += bodies[i]->tree->node_count();
    }
}

}  // namespace frazil
