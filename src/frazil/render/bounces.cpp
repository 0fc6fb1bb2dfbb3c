#include "frazil/render/bounces.h"

#include <algorithm>
#include <memory>
#include <span>

#include "frazil/base/parallel.h"
#include "frazil/lighting/bounce.h"
#include "frazil/points/point_lookup.h"
#include "frazil/render/rays_each.h"
#include "frazil/render/stopwatch.h"
#include "frazil/render/translucency_sets.h"

namespace frazil {
namespace {

constexpr int kShadowRaysPerReflection = 1;  // per light, where a diffuse surface is seen
constexpr float kBounceTolerance = 20.0f;    // of gathers, times the render's
// Of so many bounces on the last two tell what all after them bring: no more than 19 times the last.
constexpr int kFewestForTail = 3;
constexpr double kLargestRatio = 0.95;

// A point that sees a point of ice: the light of `sender` counts so much in that of `receiver`.
struct Sightline {
    std::uint32_t receiver;  // index into the points of the object at hand
    std::uint32_t body;      // whose point is seen: a leader of translucency sets
    std::uint32_t sender;    // index into the points of its set
    Rgb weight;              // irradiance per exitance
    Rgb mirrored;            // irradiance per irradiance that enters there: what the surface reflects
    V3f along;               // BounceHit's
};

// Rays that look around from all points together, at most, so that what they find fits in 4 GB.
constexpr std::size_t kMostSightlines = (std::size_t(1) << 32) / sizeof(Sightline);

// All that an object's points see, batch after batch of points.
using Sightlines = std::vector<std::vector<Sightline>>;

// Light of the last bounce alone, (N, groups) per point: what enters a body, and its exitance, compensated.
struct Exchange {
    std::vector<Rgb> entering, exitance;
};

Exchange exchange_of(const Body& body, const PlacedPoints& points, std::vector<Rgb> irradiance, std::size_t groups,
                     const std::vector<Rgb>& gains, const GatherOptions& options) {
    // Ramps colour what is seen, not what bounces: they stay exact to change after the render.
    const auto tree = make_tree(points, body.plain_kernel, irradiance, groups);
    const std::vector<V3f> positions = points.cloud().inward_positions();
    // Bounces average over many points, and compensation keeps their energy: the plain sum will do, and large clusters.
    const GatherOptions coarse{kBounceTolerance * options.tolerance, Estimator::sum, false};
    Gathered gathered = tree->gather(positions.data(), positions.size(), coarse);
    compensate_bounce(body, gains, gathered);
    // Light of one scattering that camera rays trace leaves here as from a plane.
    for (std::size_t i = 0; i < irradiance.size(); ++i) gathered.exitance[i] += irradiance[i] * body.traced_once;
    return {std::move(irradiance), std::move(gathered.exitance)};
}

// What a boundary reflects at a cosine per unit of irradiance that enters, where light comes evenly from all around: with what
// leaves the core it makes a white furnace of radiance one. Other light is reflected as if it were spread so.
float mirrored_radiance(const Body& body, float cosine, float roughness) {
    return (1.0f - body.transmittance(cosine, roughness)) * kInvPi / body.transmittance_average(roughness);
}

// What a point of ice shows of its surface.
struct PointLook {
    Rgb radiance_per_exitance;  // inside
    float roughness;
    float entering;  // of the light, beside what overlays take
};

std::vector<PointLook> looks_of(const SurfaceResolver& resolver, const Body& body, std::uint32_t object,
                                const PointSet& in_world) {
    std::vector<PointLook> looks(in_world.size());
    resolver.look_at_points(object, in_world, [&](std::size_t k, const Surface& surface) {
        looks[k] = {body.inner_radiance_per_exitance(surface), surface.covering.roughness,
                    1.0f - surface.covering.scattered};
    });
    return looks;
}

// Finds the points of ice that rays meet.
class IceFinder {
  public:
    // `looks` are those of each object's own points.
    IceFinder(const std::vector<std::unique_ptr<Body>>& bodies, const TranslucencySets& sets,
              const SurfaceResolver& resolver, const std::vector<std::vector<PointLook>>& looks)
        : bodies_(bodies), sets_(sets), resolver_(resolver), lookups_(bodies.size()), looks_(bodies.size()) {
        for (std::size_t i = 0; i < bodies.size(); ++i) {
            if (bodies[i] && sets.is_leader(i) && sets.points(i).size() > 0) {
                lookups_[i] = sets.points(i).cloud().lookup();
                looks_[i] = sets.united(i, 1, [&](std::size_t k) { return &looks[k]; });
            }
        }
    }

    std::vector<Sightline> find(std::span<const BounceHit> hits) const {
        std::vector<Sightline> found;
        for (const BounceHit& hit : hits) {
            const std::size_t leader = sets_.leader(hit.surface.placement);
            if (!lookups_[leader]) continue;
            const PlacedPoints& points = sets_.points(leader);
            const std::uint32_t point = lookups_[leader]->nearest(hit.position * points.to_cloud(),
                                                                  points.into_cloud(hit.surface.geometric_normal));
            if (point == PointLookup::kNone) continue;
            const float cosine = -resolver_.glimpse(hit.surface, hit.direction).normal.dot(hit.direction);
            const Body& body = *bodies_[hit.surface.placement];
            const PointLook& look = looks_[leader][point];
            found.push_back({hit.point, static_cast<std::uint32_t>(leader), point,
                             look.radiance_per_exitance * hit.weight * body.enters(cosine, look.roughness),
                             hit.weight * mirrored_radiance(body, cosine, look.roughness), hit.along});
        }
        found.shrink_to_fit();
        return found;
    }

  private:
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const TranslucencySets& sets_;
    const SurfaceResolver& resolver_;
    std::vector<std::shared_ptr<const PointLookup>> lookups_;  // by leader
    std::vector<std::vector<PointLook>> looks_;                // of its set's points
};

// Light along all sightlines of an object: what the points that are seen send.
void add_light(const Sightlines& sightlines, const std::vector<Exchange>& bodies, Irradiance& light) {
    parallel_for(sightlines.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t batch = begin; batch < end; ++batch) {
            for (const Sightline& line : sightlines[batch]) {
                const Exchange& body = bodies[line.body];
                const std::size_t from = line.sender * light.groups, to = line.receiver * light.groups;
                for (std::size_t g = 0; g < light.groups; ++g) {
                    const Rgb value = body.exitance[from + g] * line.weight + body.entering[from + g] * line.mirrored;
                    light.values[to + g] += value;
                    add_flow(light.flows[to + g], value, line.along);
                }
            }
        }
    });
}

// What all points receive together, per group; light that subtracts counts as much.
void add_power(const Irradiance& light, const std::vector<float>& areas, std::vector<V3d>& power) {
    for (std::size_t k = 0; k < light.values.size(); ++k) {
        V3d& sum = power[k % light.groups];
        for (int c = 0; c < 3; ++c) sum[c] += double(std::abs(light.values[k][c])) * double(areas[k / light.groups]);
    }
}

void add_bounce(const Irradiance& light, const std::vector<Rgb>& scales, LitPoints& lit) {
    for (std::size_t k = 0; k < light.values.size(); ++k) {
        const Rgb& scale = scales[k % light.groups];
        lit.irradiance[k] += light.values[k] * scale;
        for (std::size_t c = 0; c < 3; ++c) lit.flows[k][c] += light.flows[k][c] * scale[static_cast<int>(c)];
    }
}

// All bounces after the last over the last, were each the same part of the one before: r + r² + ... = r/(1 - r). Light that
// has bounced a few times lies where its slowest part does, which then shrinks by one factor.
std::vector<Rgb> tail_of(const std::vector<V3d>& before, const std::vector<V3d>& last) {
    std::vector<Rgb> tail(last.size(), Rgb(0.0f));
    for (std::size_t g = 0; g < last.size(); ++g) {
        for (int c = 0; c < 3; ++c) {
            const double ratio = before[g][c] != 0.0 ? std::min(last[g][c] / before[g][c], kLargestRatio) : 0.0;
            if (ratio > 0.0) tail[g][c] = static_cast<float>(ratio / (1.0 - ratio));
        }
    }
    return tail;
}

// The diffuse albedo of what a ray of a point meets; 0 for ice.
Rgb diffuse_albedo(const Scene& scene, const SurfaceResolver& resolver, const BounceHit& hit) {
    const Material& material = scene.materials[scene.objects[hit.surface.placement].material];
    const auto* standard = std::get_if<StandardMaterial>(&material.model);
    if (!standard) return Rgb(0.0f);
    const Surface surface = resolver.resolve(hit.surface, hit.direction);
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
        if (irradiance.flows.empty()) continue;
        for (V3f& flow : irradiance.flows[k].channel) flow *= entering[k / irradiance.groups];
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
        ray_scene, lights, [&](const BounceHit& hit) { return diffuse_albedo(scene, resolver, hit); },
        kShadowRaysPerReflection, options.seed);

    const TranslucencySets sets(scene, ray_scene, bodies, lit);
    ThicknessTrees thickness(scene, ray_scene, bodies, sets);
    std::vector<std::shared_ptr<const std::vector<Rgb>>> gains(lit.size());  // of thin parts, by set
    std::size_t points = 0;
    for (std::size_t i = 0; i < lit.size(); ++i) {
        points += lit[i].points.size();
        if (bodies[i] && sets.is_leader(i)) gains[i] = thickness.gains_at_points(i);
    }
    if (points == 0) return;

    // What each point sees: ice, along lines that all bounces take, and what straight light makes of other surfaces.
    const int most_rays = static_cast<int>(std::min<std::size_t>(kMostSightlines / points, std::size_t(1) << 20));
    std::vector<std::vector<PointLook>> looks(lit.size());
    std::vector<std::vector<float>> entering(lit.size());
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        looks[i] = looks_of(resolver, *bodies[i], static_cast<std::uint32_t>(i), lit[i].points.in_world());
        for (const PointLook& look : looks[i]) entering[i].push_back(look.entering);
    }
    const IceFinder ice(bodies, sets, resolver, looks);
    std::vector<Sightlines> sightlines(lit.size());
    std::vector<Irradiance> last(lit.size());  // what the last bounce brought; at first what surfaces reflect
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        const PointSet in_world = lit[i].points.in_world();
        const int rays = bake_samples_each(in_world, bodies[i]->mean_free_path(), options);
        IrradianceOptions bake_options{std::max(1, std::min(rays, most_rays)), options.seed};
        Mesh mesh;
        const std::shared_ptr<const Cells> cells = lit[i].points.cloud().cells();
        if (cells) {
            mesh = transformed(scene.meshes[scene.objects[i].mesh], scene.objects[i].local_to_world);
            bake_options.cells = {cells.get(), &mesh};
        }
        sightlines[i].resize((lit[i].points.size() + kPointsPerBounceBatch - 1) / kPointsPerBounceBatch);
        bake_options.with_flows = true;
        last[i] = bake_bounce(
            in_world, ray_scene, groups,
            [&](std::size_t batch, std::span<const BounceHit> hits, std::span<Rgb> radiance) {
                sightlines[i][batch] = ice.find(hits);
                reflected(batch, hits, radiance);
            },
            [&](float cosine) { return bodies[i]->enters(cosine, bodies[i]->material->roughness.value); }, bake_options,
            progress);
        stats.bake_rays += last[i].rays;
        stats.dropped_samples += last[i].dropped_samples;
    }

    const std::vector<Rgb> whole(groups, Rgb(1.0f));
    std::vector<V3d> power, power_before;  // of the last two bounces, by group
    for (int bounce = 0; bounce < options.bake_bounces; ++bounce) {
        std::vector<Exchange> exchange(lit.size());
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (!gains[i] || lit[i].points.size() == 0) continue;
            // At first the light that is there, then what the last bounce brought.
            const auto values = [&](std::size_t k) { return bounce == 0 ? &lit[k].irradiance : &last[k].values; };
            exchange[i] = exchange_of(*bodies[i], sets.points(i), sets.united(i, groups, values), groups, *gains[i],
                                      options.gather);
        }
        power_before = std::move(power);
        power.assign(groups, V3d(0.0));
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].values.empty()) continue;
            if (bounce > 0) {
                std::fill(last[i].values.begin(), last[i].values.end(), Rgb(0.0f));
                std::fill(last[i].flows.begin(), last[i].flows.end(), Flow{});
            }
            add_light(sightlines[i], exchange, last[i]);
            keep_entering(entering[i], last[i]);
            add_power(last[i], lit[i].points.cloud().points().areas, power);
            add_bounce(last[i], whole, lit[i]);
        }
        if (progress) progress->update("bounce", 1.0);  // rays took the time; asks whether to go on
    }
    if (options.bake_bounces < kFewestForTail) return;
    const std::vector<Rgb> rest = tail_of(power_before, power);
    for (std::size_t i = 0; i < lit.size(); ++i) add_bounce(last[i], rest, lit[i]);
}

}  // namespace frazil
