#include "frazil/lighting/bounce.h"

#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

constexpr std::size_t kPointsPerBatch = 64;

}  // namespace

Irradiance bake_bounce(const PointSet& points, const RayScene& scene, std::size_t groups,
                       const BounceRadiance& radiance, const std::function<float(float)>& transmittance,
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
    result.rays = std::uint64_t(points.size()) * std::uint64_t(options.samples);
    const ScrambledNet net(options.samples);
    std::atomic<std::uint64_t> dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), kPointsPerBatch, [&](std::size_t begin, std::size_t end) {
        // Look around from every point of the batch.
        std::vector<V2f> u(net.size());
        std::vector<BounceHit> hits;
        for (std::size_t i = begin; i < end; ++i) {
            const V3f& normal = points.normals[i];
            const V3f origin = offset_origin(points.positions[i], normal);
            const auto [s, t] = tangent_frame(normal);
            net.draw(hash(options.seed, 0x626f756eU), std::uint32_t(i), u);
            for (const V2f& v : u) {
                const V2f circle = cos_sin_turns(v.y) * std::sqrt(v.x);
                BounceHit hit;
                hit.point = std::uint32_t(i);
                hit.direction = s * circle.x + t * circle.y + normal * std::sqrt(std::max(0.0f, 1.0f - v.x));
                if (!scene.intersect({origin, hit.direction}, hit.surface)) continue;
                hit.position = origin + hit.direction * hit.surface.t;
                hits.push_back(hit);
            }
        }
        // Ask what the surfaces send, and let it in: cosine-distributed rays leave pi T L / n.
        std::vector<Rgb> sent(hits.size() * groups, Rgb(0.0f));
        radiance(hits, sent);
        for (std::size_t i = 0; i < hits.size(); ++i) {
            const float cosine = std::max(0.0f, hits[i].direction.dot(points.normals[hits[i].point]));
            const float weight = kPi * transmittance(cosine) / float(options.samples);
            for (std::size_t g = 0; g < groups; ++g) {
                const Rgb value = sent[i * groups + g] * weight;
                if (is_finite(value)) {
                    result.values[hits[i].point * groups + g] += value;
                } else {
                    ++dropped;
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
    return [&scene, &lights, albedo = std::move(albedo), samples, seed](std::span<const BounceHit> hits,
                                                                        std::span<Rgb> radiance) {
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
        // Another seed for every batch: its first point tells it apart.
        options.samples = samples;
        options.seed = hash(seed, hits.front().point);
        options.component = LightComponent::diffuse;
        const Irradiance direct = bake_irradiance(
            lit, scene, lights, [](float) { return 1.0f; }, options);
        for (std::size_t i = 0; i < index.size(); ++i) {
            for (std::size_t g = 0; g < direct.groups; ++g) {
                radiance[index[i] * direct.groups + g] = direct.values[i * direct.groups + g] * share[i];
            }
        }
    };
}

}  // namespace frazil
