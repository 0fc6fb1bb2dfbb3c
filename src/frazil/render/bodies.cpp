#include "frazil/render/bodies.h"

#include <algorithm>
#include <map>
#include <optional>

#include "frazil/render/interior.h"
#include "frazil/render/stopwatch.h"
#include "frazil/render/thickness.h"
#include "frazil/render/translucency_sets.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

// Thickness varies slowly: its gathers may be this much coarser.
constexpr float kThicknessTolerance = 4.0f;

}  // namespace

float Body::transmittance(float cos_theta, float roughness) const {
    return 1.0f - material->specular * boundary->eval(cos_theta, alpha_from_roughness(roughness));
}

float Body::transmittance_average(float roughness) const {
    return 1.0f - material->specular * boundary->average(alpha_from_roughness(roughness));
}

Rgb Body::inner_radiance_per_exitance(const Surface& surface) const {
    const float average = transmittance_average(surface.covering.roughness);
    return eval_color(material->tint, surface.texture_point) * surface.covering.tint *
           (material->translucency * kInvPi / average);
}

Rgb Body::radiance_per_exitance(const Surface& surface, const V3f& wo) const {
    return inner_radiance_per_exitance(surface) * transmittance(surface.normal.dot(wo), surface.covering.roughness);
}

std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene) {
    std::vector<std::unique_ptr<Body>> bodies(scene.objects.size());
    std::map<float, std::shared_ptr<const DielectricAlbedo>> boundaries;  // by eta
    std::map<std::pair<const IceMaterial*, bool>, std::optional<Profile>> profiles;
    std::map<std::uint32_t, bool> closed;  // by mesh, of those that it matters for
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const auto* material = std::get_if<IceMaterial>(&scene.materials[scene.objects[i].material].model);
        if (!material) continue;
        auto& boundary = boundaries[material->medium.eta];
        if (!boundary) boundary = std::make_shared<DielectricAlbedo>(material->medium.eta);
        // What rays trace of the light that is scattered once, the profile leaves out.
        const Medium& medium = material->medium;
        bool is_traced = material->volume > 0.0f;
        if (is_traced) {
            const auto [found, is_new] = closed.try_emplace(scene.objects[i].mesh, false);
            if (is_new) found->second = is_closed(scene.meshes[scene.objects[i].mesh]);
            is_traced = found->second;
        }
        const double traced = is_traced ? material->volume : 0.0;
        auto& profile = profiles[{material, is_traced}];
        if (!profile) profile = make_profile(material->profile, medium, 1.0 - traced);
        bodies[i] =
            std::make_unique<Body>(Body{material, boundary, *profile, albedo(*profile), nullptr, nullptr, nullptr});
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

std::unique_ptr<const PointTree> make_thickness_tree(const Body& body, const PointSet& points,
                                                     const RayScene& ray_scene, const Shells* shells) {
    if (points.size() == 0) return nullptr;
    return std::make_unique<const PointTree>(
        points, thickness_gain(points, ray_scene, body.material->medium, body.traced_once, shells), 1, body.profile);
}

std::vector<Rgb> thickness_gains(const PointTree* thickness, const V3f* positions, std::size_t count,
                                 const GatherOptions& options) {
    if (!thickness) return {};
    const Gathered sums =
        thickness->gather(positions, count, {kThicknessTolerance * options.tolerance, Estimator::sum, false});
    std::vector<Rgb> gains(count, Rgb(1.0f));
    for (std::size_t i = 0; i < count; ++i) {
        for (int c = 0; c < 3; ++c) {
            if (sums.coverage[i][c] > 0.0f) gains[i][c] = std::max(1.0f, sums.exitance[i][c] / sums.coverage[i][c]);
        }
    }
    return gains;
}

Rgb Body::gain(const Compensation& compensation, const Rgb& coverage, const Rgb* thin) const {
    if (!thin) return compensation_gain(compensation, coverage, total_reflectance);
    Compensation full = compensation;
    full.strength = 1.0f;
    const Rgb gain = compensation_gain(full, coverage, total_reflectance) * *thin;
    return Rgb(1.0f) + (gain - Rgb(1.0f)) * compensation.strength;
}

void compensate_bounce(const Body& body, const std::vector<Rgb>& gains, Gathered& gathered) {
    const Compensation compensation;
    for (std::size_t i = 0; i < gathered.coverage.size(); ++i) {
        const Rgb gain = body.gain(compensation, gathered.coverage[i], gains.empty() ? nullptr : &gains[i]);
        for (std::size_t g = 0; g < gathered.groups; ++g) gathered.exitance[i * gathered.groups + g] *= gain;
    }
}

std::shared_ptr<const Cells> cells_of_body(const Scene& scene, std::size_t object, const LitPoints& lit) {
    if (lit.cells || lit.moments.empty()) return lit.cells;
    const Object& placed = scene.objects[object];
    return std::make_shared<const Cells>(
        cells_of(lit.points, transformed(scene.meshes[placed.mesh], placed.local_to_world), 1));
}

void plant_trees(const Scene& scene, const std::vector<LitPoints>& lit, std::size_t groups, const RayScene& ray_scene,
                 bool wants_depth, PointGatherPlan plan, std::vector<std::unique_ptr<Body>>& bodies,
                 RenderStats& stats) {
    Stopwatch watch(stats.seconds["tree"]);
    const TranslucencySets sets(scene, ray_scene, bodies, lit);
    stats.warnings.insert(stats.warnings.end(), sets.warnings().begin(), sets.warnings().end());
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0) continue;
        bodies[i]->spacing = static_cast<float>(lit[i].points.spacing);
        const Body& body = *bodies[i];
        if (!sets.is_leader(i)) {
            bodies[i]->tree = bodies[sets.leader(i)]->tree;
            bodies[i]->thickness = bodies[sets.leader(i)]->thickness;
            bodies[i]->at_points = bodies[sets.leader(i)]->at_points;
            continue;
        }
        const PointSet& points = sets.points(i);
        const std::shared_ptr<const Cells> cells =
            sets.cells(i, [&](std::size_t k) { return cells_of_body(scene, k, lit[k]); });
        std::vector<V3f> moments;
        if (cells && trees_take_moments(groups)) {
            moments = sets.united(i, groups, [&](std::size_t k) -> const std::vector<V3f>& { return lit[k].moments; });
        }
        bodies[i]->tree = std::make_shared<const PointTree>(
            points, sets.united(i, groups, [&](std::size_t k) -> const std::vector<Rgb>& { return lit[k].irradiance; }),
            groups, body.profile, body.material->ramp, cells.get(), moments);
        if (wants_depth || body.material->compensation.mode == CompensationMode::depth) {
            bodies[i]->thickness = make_thickness_tree(body, points, ray_scene, sets.shells(i));
        }
        bodies[i]->at_points = PointGathers::make(body, points, plan);
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
