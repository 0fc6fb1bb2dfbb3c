#include "frazil/render/bounces.h"

#include <algorithm>
#include <numeric>

#include "frazil/lighting/bounce.h"
#include "frazil/render/stopwatch.h"

namespace frazil {
namespace {

constexpr int kShadowRaysPerReflection = 1;  // per light, where a diffuse surface is seen

// What ice sends towards the points that see it, from trees of the last bounce's light alone.
class IceRadiance {
  public:
    IceRadiance(const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::unique_ptr<PointTree>>& trees,
                const SurfaceResolver& resolver, const GatherOptions& options, std::size_t groups)
        : bodies_(bodies), trees_(trees), resolver_(resolver), options_(options), groups_(groups) {}

    void operator()(std::span<const BounceHit> hits, std::span<Rgb> radiance) const {
        // One gather per body that is seen.
        std::vector<std::size_t> order;
        for (std::size_t i = 0; i < hits.size(); ++i) {
            if (trees_[hits[i].surface.placement]) order.push_back(i);
        }
        std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
            return hits[a].surface.placement < hits[b].surface.placement;
        });
        std::vector<V3f> positions;
        for (std::size_t begin = 0; begin < order.size();) {
            const std::uint32_t object = hits[order[begin]].surface.placement;
            positions.clear();
            std::size_t end = begin;
            for (; end < order.size() && hits[order[end]].surface.placement == object; ++end) {
                positions.push_back(hits[order[end]].position);
            }
            const Body& body = *bodies_[object];
            const Gathered gathered = trees_[object]->gather(positions.data(), positions.size(), options_);
            for (std::size_t k = begin; k < end; ++k) {
                const BounceHit& hit = hits[order[k]];
                const Rgb gain = compensation_gain(body.material->compensation, gathered.coverage[k - begin],
                                                   body.total_reflectance);
                const Surface surface = resolver_.resolve(hit.surface, hit.direction);
                const Rgb scale = gain * body.radiance_per_exitance(surface, -hit.direction);
                for (std::size_t g = 0; g < groups_; ++g) {
                    radiance[order[k] * groups_ + g] = gathered.exitance[(k - begin) * groups_ + g] * scale;
                }
            }
            begin = end;
        }
    }

  private:
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const std::vector<std::unique_ptr<PointTree>>& trees_;
    const SurfaceResolver& resolver_;
    GatherOptions options_;
    std::size_t groups_;
};

// The diffuse albedo of what a ray of a point meets; 0 for ice.
Rgb diffuse_albedo(const SurfaceResolver& resolver, const BounceHit& hit) {
    const Surface surface = resolver.resolve(hit.surface, hit.direction);
    const auto* standard = std::get_if<StandardMaterial>(&surface.material->model);
    if (!standard) return Rgb(0.0f);
    const float cosine = std::clamp(-surface.normal.dot(hit.direction), 0.0f, 1.0f);
    const V3f wo(std::sqrt(1.0f - cosine * cosine), 0.0f, cosine);
    return StandardBsdf(*standard, surface.st, surface.display_color).albedo(wo).diffuse;
}

}  // namespace

void add_bounces(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                 const RenderOptions& options, const std::vector<std::unique_ptr<Body>>& bodies,
                 std::vector<LitPoints>& lit, RenderStats& stats, Progress* progress) {
    if (options.bake_bounces == 0 || lights.is_empty()) return;
    Stopwatch watch(stats.seconds["bounces"]);
    const std::size_t groups = light_groups(scene.lights).size();
    const SurfaceResolver resolver(scene);
    const BounceRadiance reflected = reflected_light(
        ray_scene, lights, [&](const BounceHit& hit) { return diffuse_albedo(resolver, hit); },
        kShadowRaysPerReflection, options.seed);

    std::vector<std::vector<Rgb>> last(lit.size());  // what the last bounce brought
    for (std::size_t i = 0; i < lit.size(); ++i) last[i] = lit[i].irradiance;
    for (int bounce = 0; bounce < options.bake_bounces; ++bounce) {
        std::vector<std::unique_ptr<PointTree>> trees(lit.size());
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].empty()) continue;
            trees[i] = std::make_unique<PointTree>(lit[i].points, last[i], groups, bodies[i]->profile,
                                                   bodies[i]->material->ramp);
        }
        const IceRadiance ice(bodies, trees, resolver, options.gather, groups);
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].empty()) continue;
            const IceMaterial& material = *bodies[i]->material;
            const Irradiance brought = bake_bounce(
                lit[i].points, ray_scene, groups,
                [&](std::span<const BounceHit> hits, std::span<Rgb> radiance) {
                    ice(hits, radiance);
                    if (bounce == 0) reflected(hits, radiance);
                },
                [&](float cosine) { return bodies[i]->transmittance(cosine, material.roughness.value); },
                {std::max(1, options.bake_samples / 4), options.seed + static_cast<std::uint32_t>(bounce)}, progress);
            stats.bake_rays += brought.rays;
            stats.dropped_samples += brought.dropped_samples;
            for (std::size_t k = 0; k < brought.values.size(); ++k) lit[i].irradiance[k] += brought.values[k];
            last[i] = brought.values;
        }
    }
}

}  // namespace frazil
