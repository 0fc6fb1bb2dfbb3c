#include "frazil/lighting/irradiance.h"

#include <atomic>
#include <numeric>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/sampler.h"

namespace frazil {
namespace {

constexpr int kTransmittanceSteps = 1024;
constexpr std::size_t kPointsPerChunk = 64;

// cos * T(cos), read linearly from a table.
class EntryTable {
  public:
    explicit EntryTable(const std::function<float(float)>& transmittance) : values_(kTransmittanceSteps + 2) {
        for (int i = 0; i <= kTransmittanceSteps; ++i) {
            values_[std::size_t(i)] = transmittance(float(i) / kTransmittanceSteps);
        }
        values_.back() = values_[kTransmittanceSteps];
    }
    float operator()(float cosine) const {
        const float x = std::min(cosine, 1.0f) * kTransmittanceSteps;
        const int i = int(x);
        const float f = x - float(i);
        return cosine * (values_[std::size_t(i)] * (1.0f - f) + values_[std::size_t(i) + 1] * f);
    }

  private:
    std::vector<float> values_;
};

// The interleaved bits of a point's cell in a 1024³ grid over the bounds: neighbours on this curve trace similar rays.
std::uint32_t morton_code(const V3f& p, const Box3f& box) {
    std::uint32_t code = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const float size = std::max(box.max[axis] - box.min[axis], 1e-30f);
        std::uint32_t x = std::uint32_t(std::clamp((p[axis] - box.min[axis]) / size, 0.0f, 1.0f) * 1023.0f);
        x = (x | (x << 16)) & 0x030000ffU;
        x = (x | (x << 8)) & 0x0300f00fU;
        x = (x | (x << 4)) & 0x030c30c3U;
        x = (x | (x << 2)) & 0x09249249U;
        code |= x << axis;
    }
    return code;
}

std::vector<std::uint32_t> spatial_order(const std::vector<V3f>& positions) {
    Box3f box;
    for (const V3f& p : positions) box.extendBy(p);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> keys(positions.size());
    for (std::uint32_t i = 0; i < positions.size(); ++i) keys[i] = {morton_code(positions[i], box), i};
    std::sort(keys.begin(), keys.end());
    std::vector<std::uint32_t> order(keys.size());
    for (std::size_t i = 0; i < keys.size(); ++i) order[i] = keys[i].second;
    return order;
}

// What one chunk of points needs again and again.
struct Workspace {
    std::vector<V2f> u;
    std::vector<LightSample> samples;
    std::uint64_t rays = 0, dropped = 0;
};

class Baker {
  public:
    Baker(const PointSet& points, const RayScene& scene, const LightSampler& lights, const EntryTable& entry,
          const IrradianceOptions& options)
        : points_(points), scene_(scene), lights_(lights), entry_(entry), options_(options) {}

    // E of one light at one point, its multiplier not applied.
    Rgb irradiance(std::uint32_t point, int light, Workspace& work) const {
        const WorldLight& world_light = lights_.world_light(light);
        const V3f& position = points_.positions[point];
        const V3f& normal = points_.normals[point];
        if (world_light.importance(position) == 0.0f) return Rgb(0.0f);

        draw_numbers(point, light, work);
        const std::size_t n = work.u.size();
        // Domes: the first part of the samples by cosine, all of it where the dome is uniform.
        std::size_t by_cosine = 0;
        if (world_light.is_dome()) by_cosine = world_light.is_uniform_dome() ? n : n / 2;
        const std::span<const V2f> u(work.u);
        sample_cosine(world_light, normal, u.first(by_cosine), work.samples.data());
        world_light.sample(position, u.subspan(by_cosine), std::span(work.samples).subspan(by_cosine));
        if (by_cosine > 0 && by_cosine < n) balance(world_light, position, normal, by_cosine, work);
        return gather(position, normal, work);
    }

  private:
    // A (0,m,2)-net of its own for every point. All lights share it: a light and its negative twin then cancel to the
    // bit, and a light's share does not depend on the others. A dome's two halves are each the start of a sequence.
    void draw_numbers(std::uint32_t point, int light, Workspace& work) const {
        const bool is_split = lights_.world_light(light).is_dome() && !lights_.world_light(light).is_uniform_dome();
        const std::uint32_t n = std::uint32_t(options_.samples), first = is_split ? n / 2 : n;
        work.u.resize(n);
        work.samples.resize(n);
        for (std::uint32_t i = 0; i < n; ++i) {
            Sampler sampler(options_.seed, point, i < first ? i : i - first);
            sampler.set_dimension(i < first ? 0 : 1);
            work.u[i] = sampler.next_2d();
        }
    }

    static void sample_cosine(const WorldLight& dome, const V3f& normal, std::span<const V2f> u, LightSample* out) {
        const auto [s, t] = tangent_frame(normal);
        for (std::size_t i = 0; i < u.size(); ++i) {
            const float r = std::sqrt(u[i].x), phi = 2.0f * kPi * u[i].y;
            const float cosine = std::sqrt(std::max(0.0f, 1.0f - u[i].x));
            LightSample& sample = out[i];
            sample = LightSample();
            sample.direction = s * (r * std::cos(phi)) + t * (r * std::sin(phi)) + normal * cosine;
            sample.radiance = dome.dome_radiance(sample.direction);
            sample.pdf = cosine * kInvPi;
        }
    }

    // Balance heuristic [Veach1995]: the density of a sample becomes the mean of both techniques', by their shares.
    static void balance(const WorldLight& dome, const V3f& position, const V3f& normal, std::size_t by_cosine,
                        Workspace& work) {
        const float share = float(by_cosine) / float(work.samples.size());
        for (std::size_t i = 0; i < work.samples.size(); ++i) {
            LightSample& sample = work.samples[i];
            const float cosine_pdf = std::max(0.0f, sample.direction.dot(normal)) * kInvPi;
            float image_pdf = sample.pdf;
            if (i < by_cosine) {
                LightHit hit;
                dome.intersect(position, sample.direction, std::numeric_limits<float>::infinity(), hit);
                image_pdf = hit.pdf;
            }
            sample.pdf = share * cosine_pdf + (1.0f - share) * image_pdf;
        }
    }

    // The mean of L T cos V / pdf.
    Rgb gather(const V3f& position, const V3f& normal, Workspace& work) const {
        const V3f origin = offset_origin(position, normal);
        V3d sum(0.0);
        const bool is_delta = work.samples.front().is_delta;
        const std::size_t count = is_delta ? 1 : work.samples.size();
        for (std::size_t i = 0; i < count; ++i) {
            const LightSample& sample = work.samples[i];
            const float cosine = sample.direction.dot(normal);
            if (!(sample.pdf > 0.0f) || !(cosine > 0.0f)) continue;
            const Rgb value = sample.radiance * (entry_(cosine) / sample.pdf);
            if (value == Rgb(0.0f)) continue;
            if (!is_finite(value)) {
                ++work.dropped;
                continue;
            }
            ++work.rays;
            if (!scene_.is_occluded({origin, sample.direction, 0.0f, sample.distance})) sum += V3d(value);
        }
        return Rgb(sum / double(count));
    }

    const PointSet& points_;
    const RayScene& scene_;
    const LightSampler& lights_;
    const EntryTable& entry_;
    const IrradianceOptions& options_;
};

void check_points(const PointSet& points) {
    if (points.normals.size() == points.positions.size()) return;
    throw ValueError(str("PointSet: normals must be one per point (", points.positions.size(), "), got ",
                         points.normals.size(), "."));
}

}  // namespace

std::vector<std::string> light_groups(const std::vector<Light>& lights) {
    std::vector<std::string> groups;
    for (const Light& light : lights) {
        if (std::find(groups.begin(), groups.end(), light.group) == groups.end()) groups.push_back(light.group);
    }
    if (groups.empty()) groups.emplace_back();
    return groups;
}

Irradiance bake_irradiance(const PointSet& points, const RayScene& scene, const LightSampler& lights,
                           const std::function<float(float)>& transmittance, const IrradianceOptions& options,
                           Progress* progress) {
    if (options.samples < 1) {
        throw ValueError(str("bake_irradiance: samples must be >= 1, got ", options.samples, "."));
    }
    check_points(points);
    const std::vector<std::string> groups = light_groups(lights.lights());
    Irradiance result;
    result.groups = groups.size();
    result.values.assign(points.size() * groups.size(), Rgb(0.0f));

    // The lights that reach translucency, with the group that each belongs to.
    struct Task {
        int light;
        std::size_t group;
        float multiplier;
    };
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < lights.lights().size(); ++i) {
        const Light& light = lights.lights()[i];
        const float multiplier = light.multipliers[int(LightComponent::translucency)];
        if (multiplier == 0.0f || light.radiance == Rgb(0.0f)) continue;
        const auto group = std::find(groups.begin(), groups.end(), light.group) - groups.begin();
        tasks.push_back({int(i), std::size_t(group), multiplier});
    }
    if (tasks.empty() || points.size() == 0) return result;

    const EntryTable entry(transmittance);
    const Baker baker(points, scene, lights, entry, options);
    const std::vector<std::uint32_t> order = spatial_order(points.positions);
    std::atomic<std::uint64_t> rays{0}, dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
        Workspace work;
        for (std::size_t i = begin; i < end; ++i) {
            Rgb* values = &result.values[std::size_t(order[i]) * groups.size()];
            for (const Task& task : tasks) {
                values[task.group] += baker.irradiance(order[i], task.light, work) * task.multiplier;
            }
        }
        rays += work.rays;
        dropped += work.dropped;
        const std::size_t finished = done += end - begin;
        if (progress) progress->update("bake", double(finished) / double(points.size()));
    });
    result.rays = rays;
    result.dropped_samples = dropped;
    return result;
}

}  // namespace frazil
