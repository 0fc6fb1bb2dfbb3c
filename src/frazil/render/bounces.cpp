#include "frazil/render/bounces.h"

#include <algorithm>
#include <memory>
#include <numeric>

#include "frazil/lighting/bounce.h"
#include "frazil/points/point_lookup.h"
#include "frazil/render/stopwatch.h"
#include "frazil/render/translucency_sets.h"

namespace frazil {
namespace {

constexpr int kShadowRaysPerReflection = 1;  // per light, where a diffuse surface is seen

// What a body sends out, point by point: the light of the last bounce alone.
struct Exitance {
    std::vector<Rgb> values;  // (N, groups), compensated; empty where there is no body
    std::unique_ptr<const PointLookup> lookup;
};

Exitance exitance_of(const Body& body, const PointSet& points, const Cells* cells, const Irradiance& last,
                     const std::vector<Rgb>& gains, const GatherOptions& options) {
    const std::vector<Rgb>& irradiance = last.values;
    // Ramps colour what is seen, not what bounces: they stay exact to change after the render.
    const PointTree tree(points, irradiance, last.groups, body.profile, {}, cells, last.moments);
    Gathered gathered = tree.gather(points.positions.data(), points.size(), options);
    compensate_bounce(body, gains, gathered);
    // Light of one scattering that camera rays trace leaves here as from a plane.
    for (std::size_t i = 0; i < irradiance.size(); ++i) gathered.exitance[i] += irradiance[i] * body.traced_once;
    return {std::move(gathered.exitance), std::make_unique<const PointLookup>(points)};
}

// Fill in what the ice that is seen sends; other surfaces are left as they are.
void add_ice(const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<Exitance>& exitance,
             const TranslucencySets& sets, const SurfaceResolver& resolver, std::size_t groups,
             std::span<const BounceHit> hits, std::span<Rgb> radiance) {
    for (std::size_t i = 0; i < hits.size(); ++i) {
        const BounceHit& hit = hits[i];
        const Exitance& sent = exitance[sets.leader(hit.surface.placement)];
        if (!sent.lookup) continue;
        const std::uint32_t point = sent.lookup->nearest(hit.position, hit.surface.geometric_normal);
        if (point == PointLookup::kNone) continue;
        const Surface surface = resolver.resolve(hit.surface, hit.direction);
        const Rgb scale = bodies[hit.surface.placement]->radiance_per_exitance(surface, -hit.direction);
        for (std::size_t g = 0; g < groups; ++g) radiance[i * groups + g] = sent.values[point * groups + g] * scale;
    }
}

// The diffuse albedo of what a ray of a point meets; 0 for ice.
Rgb diffuse_albedo(const SurfaceResolver& resolver, const BounceHit& hit) {
    const Surface surface = resolver.resolve(hit.surface, hit.direction);
    const auto* standard = std::get_if<StandardMaterial>(&surface.material->model);
    if (!standard) return Rgb(0.0f);
    const float cosine = std::clamp(-surface.normal.dot(hit.direction), 0.0f, 1.0f);
    const V3f wo(std::sqrt(1.0f - cosine * cosine), 0.0f, cosine);
    return StandardBsdf(*standard, surface.texture_point, surface.display_color).albedo(wo).diffuse;
}

}  // namespace

void keep_entering(const std::vector<float>& entering, Irradiance& irradiance) {
    if (entering.empty()) return;
    for (std::size_t k = 0; k < irradiance.values.size(); ++k) {
        irradiance.values[k] *= entering[k / irradiance.groups];
        if (!irradiance.moments.empty()) irradiance.moments[k] *= entering[k / irradiance.groups];
    }
}

void add_bounces(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                 const RenderOptions& options, const std::vector<std::unique_ptr<Body>>& bodies,
                 std::vector<LitPoints>& lit, RenderStats& stats, Progress* progress) {
    if (options.bake_bounces == 0 || lights.is_empty()) return;
    Stopwatch watch(stats.seconds["bounces"]);
    const std::size_t groups = light_groups(lights.lights()).size();
    const SurfaceResolver resolver(scene);
    const BounceRadiance reflected = reflected_light(
        ray_scene, lights, [&](const BounceHit& hit) { return diffuse_albedo(resolver, hit); },
        kShadowRaysPerReflection, options.seed);

    const TranslucencySets sets(scene, ray_scene, bodies, lit);
    std::vector<Irradiance> last(lit.size());                     // what the last bounce brought, by object
    std::vector<std::vector<Rgb>> gains(lit.size());              // of thin parts, by set
    std::vector<std::shared_ptr<const Cells>> cells(lit.size());  // by set
    for (std::size_t i = 0; i < lit.size(); ++i) {
        last[i].groups = groups;
        last[i].values = lit[i].irradiance;
        last[i].moments = lit[i].moments;
        if (!bodies[i] || !sets.is_leader(i)) continue;
        cells[i] = sets.cells(i, [&](std::size_t k) { return lit[k].cells; });
        const PointSet& points = sets.points(i);
        const auto thickness = make_thickness_tree(*bodies[i], points, ray_scene, sets.shells(i));
        gains[i] = thickness_gains(thickness.get(), points.positions.data(), points.size(), options.gather);
    }
    for (int bounce = 0; bounce < options.bake_bounces; ++bounce) {
        std::vector<Exitance> exitance(lit.size());
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].values.empty() || !sets.is_leader(i)) continue;
            Irradiance light;
            light.groups = groups;
            light.values =
                sets.united(i, groups, [&](std::size_t k) -> const std::vector<Rgb>& { return last[k].values; });
            if (cells[i]) {
                light.moments =
                    sets.united(i, groups, [&](std::size_t k) -> const std::vector<V3f>& { return last[k].moments; });
            }
            exitance[i] = exitance_of(*bodies[i], sets.points(i), cells[i].get(), light, gains[i], options.gather);
        }
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].values.empty()) continue;
            const IceMaterial& material = *bodies[i]->material;
            IrradianceOptions bake_options{std::max(1, options.bake_samples / 4),
                                           options.seed + static_cast<std::uint32_t>(bounce)};
            Mesh mesh;
            if (lit[i].cells) {
                mesh = transformed(scene.meshes[scene.objects[i].mesh], scene.objects[i].local_to_world);
                bake_options.cells = {lit[i].cells.get(), &mesh};
            }
            last[i] = bake_bounce(
                lit[i].points, ray_scene, groups,
                [&](std::span<const BounceHit> hits, std::span<Rgb> radiance) {
                    add_ice(bodies, exitance, sets, resolver, groups, hits, radiance);
                    if (bounce == 0) reflected(hits, radiance);
                },
                [&](float cosine) { return bodies[i]->transmittance(cosine, material.roughness.value); }, bake_options,
                progress);
            stats.bake_rays += last[i].rays;
            stats.dropped_samples += last[i].dropped_samples;
            keep_entering(resolver.entering(static_cast<std::uint32_t>(i), lit[i].points), last[i]);
            for (std::size_t k = 0; k < last[i].values.size(); ++k) lit[i].irradiance[k] += last[i].values[k];
            for (std::size_t k = 0; k < last[i].moments.size(); ++k) lit[i].moments[k] += last[i].moments[k];
        }
    }
}

}  // namespace frazil
