#include "frazil/lighting/bounce.h"

#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"
#include "frazil/lighting/places.h"

namespace frazil {
Irradiance bake_bounce(const PointSet& points, const RayScene& scene, std::size_t groups,
                       const BounceRadiance& radiance, const Transmittance& transmittance,
                       const IrradianceOptions& options, Progress* progress) {
    if (options.samples < 1 || options.samples > (1 << 20)) {
        throw ValueError(str("bake_bounce: samples must be in [1, 2^20], got ", options.samples, "."));
    }
    if (points.normals.size() != points.size()) {
        throw ValueError(
            str("PointSet: normals must be one per point (", points.size(), "), got ", points.normals.size(), "."));
    }
    Irradiance result;
    result.groups = groups;
    result.values.assign(points.size() * groups, Rgb(0.0f));
    if (options.with_flows) result.flows.assign(result.values.size(), Flow{});
    result.rays = std::uint64_t(points.size()) * std::uint64_t(options.samples);
    const ScrambledNet net(options.samples);
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    std::atomic<std::uint64_t> dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), kPointsPerBounceBatch, [&](std::size_t begin, std::size_t end) {
        // Look around from every point of the batch.
        std::vector<V2f> u(net.size());
        std::vector<Place> places;
        std::vector<std::uint32_t> place_of(net.size());
        std::vector<BounceHit> all;
        std::vector<Ray> rays;
        for (std::size_t k = begin; k < end; ++k) {
            const std::uint32_t i = order[k];
            find_places(points, options.cells, i, places);
            // The very rays by which an even dome is sampled: what ice in their way sends stands for the sky that it hides,
            // so that the sum of both has less noise than either.
            net.draw_part(options.seed, std::uint32_t(k), u);
            deal(places, 0, hash(options.seed, i), place_of);
            for (std::size_t sample = 0; sample < u.size(); ++sample) {
                const Place& place = places[place_of[sample]];
                const V3f local = cosine_hemisphere(u[sample]);
                const auto [s, t] = tangent_frame(place.normal);
                BounceHit hit;
                hit.point = i;
                hit.direction = s * local.x + t * local.y + place.normal * local.z;
                hit.along = along_surface(hit.direction, place.normal);
                // Cosine-distributed rays leave pi T L / n.
                hit.weight =
                    transmittance(std::max(0.0f, hit.direction.dot(place.normal))) * (kPi / float(options.samples));
                rays.push_back({offset_origin(place.position, place.normal), hit.direction});
                all.push_back(hit);
            }
        }
        std::vector<Hit> found(rays.size());
        scene.intersect(rays, found);
        std::vector<BounceHit> hits;
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (found[i].t == std::numeric_limits<float>::infinity()) continue;
            all[i].surface = found[i];
            all[i].position = rays[i].origin + rays[i].direction * found[i].t;
            hits.push_back(all[i]);
        }
        // Ask what the surfaces send, and let it in.
        std::vector<Rgb> sent(hits.size() * groups, Rgb(0.0f));
        radiance(begin / kPointsPerBounceBatch, hits, sent);
        for (std::size_t i = 0; i < hits.size(); ++i) {
            for (std::size_t g = 0; g < groups; ++g) {
                const Rgb value = sent[i * groups + g] * hits[i].weight;
                if (!is_finite(value)) {
                    ++dropped;
                    continue;
                }
                const std::size_t row = hits[i].point * groups + g;
                result.values[row] += value;
                if (options.with_flows) {
                    add_flow(result.flows[row], value, hits[i].along);
                }
            }
        }
        const std::size_t finished = done += end - begin;
        if (progress) progress->update("bounce", double(finished) / double(points.size()));
    });
    result.dropped_samples = dropped;
    return result;
}

BounceRadiance reflected_light(const RayScene& scene, const LightSampler& lights,
                               std::function<Rgb(const BounceHit&)> albedo, int samples, std::uint32_t seed) {
    return [&scene, &lights, albedo = std::move(albedo), samples, seed](
               std::size_t batch, std::span<const BounceHit> hits, std::span<Rgb> radiance) {
        // The surfaces that reflect become points of their own, on the side that is seen.
        PointSet lit;
        IrradianceOptions options;
        std::vector<std::size_t> index;
        std::vector<Rgb> share;
        for (std::size_t i = 0; i < hits.size(); ++i) {
            const Rgb a = albedo(hits[i]);
            if (a == Rgb(0.0f)) continue;
            const V3f& normal = hits[i].surface.geometric_normal;
            lit.positions.push_back(hits[i].position);
            lit.normals.push_back(normal.dot(hits[i].direction) > 0.0f ? -normal : normal);
            options.objects.push_back(hits[i].surface.placement);
            index.push_back(i);
            share.push_back(a * kInvPi);
        }
        if (index.empty()) return;
        options.samples = samples;
        options.seed = hash(seed, std::uint32_t(batch));  // another for every batch
        options.component = LightComponent::diffuse;
        const Irradiance direct = bake_irradiance(
            lit, scene, lights, [](float) { return Rgb(1.0f); }, options);
        for (std::size_t i = 0; i < index.size(); ++i) {
            for (std::size_t g = 0; g < direct.groups; ++g) {
                radiance[index[i] * direct.groups + g] = direct.values[i * direct.groups + g] * share[i];
            }
        }
    };
}

}  // namespace frazil
