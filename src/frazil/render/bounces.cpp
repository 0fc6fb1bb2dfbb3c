#include "frazil/render/bounces.h"

#include <algorithm>
#include <memory>
#include <span>

#include "frazil/base/parallel.h"
#include "frazil/lighting/bounce.h"
#include "frazil/points/point_lookup.h"
#include "frazil/render/stopwatch.h"
#include "frazil/render/translucency_sets.h"

namespace frazil {
namespace {

constexpr int kShadowRaysPerReflection = 1;  // per light, where a diffuse surface is seen

// Rays that look around from all points together, at most, so that what they find fits in memory: some 40 bytes each where
// they meet ice.
constexpr std::size_t kMostSightlines = std::size_t(1) << 27;

// A point that sees a point of ice: the light of `sender` counts so much in that of `receiver`.
struct Sightline {
    std::uint32_t receiver;  // index into the points of the object at hand
    std::uint32_t body;      // whose point is seen: a leader of translucency sets
    std::uint32_t sender;    // index into the points of its set
    Rgb weight;              // irradiance per exitance
    V3f offset;              // as in BounceHit
};

// All that an object's points see, batch after batch of points.
using Sightlines = std::vector<std::vector<Sightline>>;

// What a body sends out, point by point, (N, groups): the light of the last bounce alone, compensated.
std::vector<Rgb> exitance_of(const Body& body, const PointSet& points, const Cells* cells, const Irradiance& last,
                             const std::vector<Rgb>& gains, const GatherOptions& options) {
    const std::vector<Rgb>& irradiance = last.values;
    // Ramps colour what is seen, not what bounces: they stay exact to change after the render.
    const PointTree tree(points, irradiance, last.groups, body.profile, {}, cells, last.moments);
    // Bounces average over many points, and compensation keeps their energy: the plain sum will do.
    Gathered gathered = tree.gather(points.positions.data(), points.size(), {options.tolerance, Estimator::sum, false});
    compensate_bounce(body, gains, gathered);
    // Light of one scattering that camera rays trace leaves here as from a plane.
    for (std::size_t i = 0; i < irradiance.size(); ++i) gathered.exitance[i] += irradiance[i] * body.traced_once;
    return std::move(gathered.exitance);
}

// Finds the points of ice that rays meet.
class IceFinder {
  public:
    IceFinder(const std::vector<std::unique_ptr<Body>>& bodies, const TranslucencySets& sets,
              const SurfaceResolver& resolver, std::span<const LitPoints> lit)
        : bodies_(bodies), sets_(sets), resolver_(resolver), lookups_(lit.size()) {
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (lit[i].points.size() > 0 && sets.is_leader(i)) {
                lookups_[i] = std::make_unique<const PointLookup>(sets.points(i));
            }
        }
    }

    std::vector<Sightline> find(std::span<const BounceHit> hits) const {
        std::vector<Sightline> found;
        for (const BounceHit& hit : hits) {
            const std::size_t leader = sets_.leader(hit.surface.placement);
            if (!lookups_[leader]) continue;
            const std::uint32_t point = lookups_[leader]->nearest(hit.position, hit.surface.geometric_normal);
            if (point == PointLookup::kNone) continue;
            const Surface surface = resolver_.resolve(hit.surface, hit.direction);
            const Rgb scale = bodies_[hit.surface.placement]->radiance_per_exitance(surface, -hit.direction);
            found.push_back({hit.point, static_cast<std::uint32_t>(leader), point, scale * hit.weight, hit.offset});
        }
        found.shrink_to_fit();
        return found;
    }

  private:
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const TranslucencySets& sets_;
    const SurfaceResolver& resolver_;
    std::vector<std::unique_ptr<const PointLookup>> lookups_;  // by leader
};

// Light along all sightlines of an object: what the exitance of the points that are seen brings.
void add_light(const Sightlines& sightlines, const std::vector<std::vector<Rgb>>& exitance, Irradiance& light) {
    parallel_for(sightlines.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t batch = begin; batch < end; ++batch) {
            for (const Sightline& line : sightlines[batch]) {
                const Rgb* sent = &exitance[line.body][line.sender * light.groups];
                for (std::size_t g = 0; g < light.groups; ++g) {
                    const Rgb value = sent[g] * line.weight;
                    light.values[line.receiver * light.groups + g] += value;
                    if (light.moments.empty()) continue;
                    light.moments[line.receiver * light.groups + g] += line.offset * (value.x + value.y + value.z);
                }
            }
        }
    });
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
    std::vector<Irradiance> last(lit.size());                     // what the last bounce brought, by object
    std::vector<std::vector<Rgb>> gains(lit.size());              // of thin parts, by set
    std::vector<std::shared_ptr<const Cells>> cells(lit.size());  // by set
    std::size_t points = 0;
    for (std::size_t i = 0; i < lit.size(); ++i) {
        last[i].groups = groups;
        last[i].values = lit[i].irradiance;
        last[i].moments = lit[i].moments;
        points += lit[i].points.size();
        if (!bodies[i] || !sets.is_leader(i)) continue;
        cells[i] = sets.cells(i, [&](std::size_t k) { return lit[k].cells; });
        const auto thickness = make_thickness_tree(*bodies[i], sets.points(i), ray_scene, sets.shells(i));
        gains[i] =
            thickness_gains(thickness.get(), sets.points(i).positions.data(), sets.points(i).size(), options.gather);
    }
    if (points == 0) return;

    // What each point sees: ice, along lines that all bounces take, and what straight light makes of other surfaces.
    const std::size_t wanted = static_cast<std::size_t>(std::max(1, options.bake_samples / 4));
    const int rays = static_cast<int>(std::clamp<std::size_t>(kMostSightlines / points, 1, wanted));
    const IceFinder ice(bodies, sets, resolver, lit);
    std::vector<Sightlines> sightlines(lit.size());
    std::vector<Irradiance> reflected_once(lit.size());
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (last[i].values.empty()) continue;
        IrradianceOptions bake_options{rays, options.seed};
        Mesh mesh;
        if (lit[i].cells) {
            mesh = transformed(scene.meshes[scene.objects[i].mesh], scene.objects[i].local_to_world);
            bake_options.cells = {lit[i].cells.get(), &mesh};
        }
        sightlines[i].resize((lit[i].points.size() + kPointsPerBounceBatch - 1) / kPointsPerBounceBatch);
        reflected_once[i] = bake_bounce(
            lit[i].points, ray_scene, groups,
            [&](std::span<const BounceHit> hits, std::span<Rgb> radiance) {
                if (hits.empty()) return;
                sightlines[i][hits.front().point / kPointsPerBounceBatch] = ice.find(hits);
                reflected(hits, radiance);
            },
            [&](float cosine) { return bodies[i]->transmittance(cosine, bodies[i]->material->roughness.value); },
            bake_options, progress);
        stats.bake_rays += reflected_once[i].rays;
        stats.dropped_samples += reflected_once[i].dropped_samples;
    }

    std::vector<std::vector<float>> entering(lit.size());
    for (std::size_t i = 0; i < lit.size(); ++i) {
        entering[i] = resolver.entering(static_cast<std::uint32_t>(i), lit[i].points);
    }
    for (int bounce = 0; bounce < options.bake_bounces; ++bounce) {
        std::vector<std::vector<Rgb>> exitance(lit.size());
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].values.empty() || !sets.is_leader(i)) continue;
            Irradiance light;
            light.groups = groups;
            light.values =
                sets.united(i, groups, [&](std::size_t k) -> const std::vector<Rgb>& { return last[k].values; });
            if (cells[i] && trees_take_moments(groups)) {
                light.moments =
                    sets.united(i, groups, [&](std::size_t k) -> const std::vector<V3f>& { return last[k].moments; });
            }
            exitance[i] = exitance_of(*bodies[i], sets.points(i), cells[i].get(), light, gains[i], options.gather);
        }
        for (std::size_t i = 0; i < lit.size(); ++i) {
            if (last[i].values.empty()) continue;
            if (bounce == 0) {
                last[i] = std::move(reflected_once[i]);
            } else {
                std::fill(last[i].values.begin(), last[i].values.end(), Rgb(0.0f));
                std::fill(last[i].moments.begin(), last[i].moments.end(), V3f(0.0f));
            }
            add_light(sightlines[i], exitance, last[i]);
            keep_entering(entering[i], last[i]);
            for (std::size_t k = 0; k < last[i].values.size(); ++k) lit[i].irradiance[k] += last[i].values[k];
            for (std::size_t k = 0; k < last[i].moments.size(); ++k) lit[i].moments[k] += last[i].moments[k];
        }
        if (progress) progress->update("bounce", 1.0);  // rays took the time; asks whether to go on
    }
}

}  // namespace frazil
