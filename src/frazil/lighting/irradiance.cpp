#include "frazil/lighting/irradiance.h"

#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"

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

// Points along a Morton curve: neighbours on it trace similar rays.
std::vector<std::uint32_t> spatial_order(const std::vector<V3f>& positions) {
    Box3f box;
    for (const V3f& p : positions) box.extendBy(p);
    const MortonGrid grid(box);
    std::vector<KeyedIndex> keys(positions.size()), scratch;
    for (std::uint32_t i = 0; i < positions.size(); ++i) keys[i] = {grid.code(positions[i]), i};
    radix_sort(keys, 3 * kMortonBits, scratch);
    std::vector<std::uint32_t> order(keys.size());
    for (std::size_t i = 0; i < keys.size(); ++i) order[i] = keys[i].index;
    return order;
}

// What one chunk of points needs again and again.
struct Workspace {
    std::vector<V2f> u;
    std::vector<LightSample> samples;
    std::vector<Ray> rays;
    std::vector<Rgb> values;  // what each ray brings where nothing is in its way
    std::vector<std::uint8_t> is_occluded;
    std::size_t count = 0;  // samples that the rays stand for
    std::uint64_t dropped = 0;
};

// The shadow rays that serve one light at one point.
class RayMaker {
  public:
    RayMaker(const PointSet& points, const LightSampler& lights, const EntryTable& entry,
             const IrradianceOptions& options)
        : points_(points),
          lights_(lights),
          entry_(entry),
          seed_(options.seed),
          whole_(options.samples),
          first_half_(options.samples / 2),
          second_half_(options.samples - options.samples / 2) {}

    // Fill work.rays, values and count.
    void make_rays(std::uint32_t point, int light, Workspace& work) const {
        const WorldLight& world_light = lights_.world_light(light);
        const V3f& position = points_.positions[point];
        const V3f& normal = points_.normals[point];
        work.rays.clear();
        work.values.clear();
        work.count = whole_.size();
        if (world_light.importance(position) == 0.0f) return;

        work.u.resize(whole_.size());
        work.samples.resize(whole_.size());
        if (!world_light.is_dome()) {
            whole_.draw(seed_, point, work.u);
            world_light.sample(position, work.u, work.samples);
        } else if (world_light.is_uniform_dome()) {
            whole_.draw(seed_, point, work.u);
            sample_cosine(normal, work.u, work.samples);
            for (LightSample& sample : work.samples) sample.radiance = world_light.dome_radiance(sample.direction);
        } else {
            sample_dome(world_light, point, work);
        }
        keep_useful(offset_origin(position, normal), normal, work);
    }

  private:
    // Half of the samples by cosine, half by the image, each a net of its own, under the balance heuristic [Veach1995]:
    // the density of a sample is the mean of both techniques', by their shares.
    void sample_dome(const WorldLight& dome, std::uint32_t point, Workspace& work) const {
        const V3f& normal = points_.normals[point];
        const std::size_t n = work.u.size(), half = first_half_.size();
        const std::span<V2f> u(work.u);
        const std::span<LightSample> samples(work.samples);
        if (half > 0) first_half_.draw(seed_, point, u.first(half));
        second_half_.draw(seed_ + 0x9e3779b9U, point, u.subspan(half));
        sample_cosine(normal, u.first(half), samples.first(half));
        dome.sample(points_.positions[point], u.subspan(half), samples.subspan(half));
        const float share = float(half) / float(n);
        for (std::size_t i = 0; i < n; ++i) {
            LightSample& sample = samples[i];
            float image_pdf = sample.pdf;
            if (i < half) sample.radiance = dome.dome_radiance(sample.direction, image_pdf);
            const float cosine_pdf = std::max(0.0f, sample.direction.dot(normal)) * kInvPi;
            sample.pdf = share * cosine_pdf + (1.0f - share) * image_pdf;
        }
    }

    static void sample_cosine(const V3f& normal, std::span<const V2f> u, std::span<LightSample> out) {
        const auto [s, t] = tangent_frame(normal);
        for (std::size_t i = 0; i < u.size(); ++i) {
            const V2f circle = cos_sin_turns(u[i].y) * std::sqrt(u[i].x);
            const float cosine = std::sqrt(std::max(0.0f, 1.0f - u[i].x));
            LightSample& sample = out[i];
            sample = LightSample();
            sample.direction = s * circle.x + t * circle.y + normal * cosine;
            sample.pdf = cosine * kInvPi;
        }
    }

    // Keep the samples that can bring light: L T cos / pdf and the ray that asks whether it arrives.
    void keep_useful(const V3f& origin, const V3f& normal, Workspace& work) const {
        if (work.samples.front().is_delta) work.count = 1;
        for (std::size_t i = 0; i < work.count; ++i) {
            const LightSample& sample = work.samples[i];
            const float cosine = sample.direction.dot(normal);
            if (!(sample.pdf > 0.0f) || !(cosine > 0.0f)) continue;
            const Rgb value = sample.radiance * (entry_(cosine) / sample.pdf);
            if (value == Rgb(0.0f)) continue;
            if (!is_finite(value)) {
                ++work.dropped;
                continue;
            }
            work.rays.push_back({origin, sample.direction, 0.0f, sample.distance});
            work.values.push_back(value);
        }
    }

    const PointSet& points_;
    const LightSampler& lights_;
    const EntryTable& entry_;
    const std::uint32_t seed_;
    // A (0,m,2)-net for every point. All lights share it: a light and its negative twin then cancel to the bit, and a
    // light's share does not depend on the others.
    const ScrambledNet whole_, first_half_, second_half_;
};

// The mean of what arrives.
Rgb trace(const RayScene& scene, Workspace& work) {
    work.is_occluded.resize(work.rays.size());
    scene.are_occluded(work.rays, work.is_occluded);
    V3d sum(0.0);
    for (std::size_t i = 0; i < work.rays.size(); ++i) {
        if (!work.is_occluded[i]) sum += V3d(work.values[i]);
    }
    return Rgb(sum / double(work.count));
}

// A light that reaches the component, and where its irradiance goes.
struct Task {
    int light;
    std::size_t group;
    float multiplier;
};

std::vector<Task> light_tasks(const std::vector<Light>& lights, const std::vector<std::string>& groups,
                              LightComponent component) {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < lights.size(); ++i) {
        const float multiplier = lights[i].multipliers[int(component)];
        if (multiplier == 0.0f || lights[i].radiance == Rgb(0.0f)) continue;
        const auto group = std::find(groups.begin(), groups.end(), lights[i].group) - groups.begin();
        tasks.push_back({int(i), std::size_t(group), multiplier});
    }
    return tasks;
}

void check_bake(const PointSet& points, const IrradianceOptions& options) {
    if (options.samples < 1 || options.samples > (1 << 20)) {
        throw ValueError(str("bake_irradiance: samples must be in [1, 2^20], got ", options.samples, "."));
    }
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
    check_bake(points, options);
    const std::vector<std::string> groups = light_groups(lights.lights());
    Irradiance result;
    result.groups = groups.size();
    result.values.assign(points.size() * groups.size(), Rgb(0.0f));

    const std::vector<Task> tasks = light_tasks(lights.lights(), groups, options.component);
    if (tasks.empty() || points.size() == 0) return result;

    const EntryTable entry(transmittance);
    const RayMaker maker(points, lights, entry, options);
    const std::vector<std::uint32_t> order = spatial_order(points.positions);
    std::atomic<std::uint64_t> rays{0}, dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
        Workspace work;
        std::uint64_t traced = 0;
        for (std::size_t i = begin; i < end; ++i) {
            Rgb* values = &result.values[std::size_t(order[i]) * groups.size()];
            for (const Task& task : tasks) {
                maker.make_rays(order[i], task.light, work);
                traced += work.rays.size();
                values[task.group] += trace(scene, work) * task.multiplier;
            }
        }
        rays += traced;
        dropped += work.dropped;
        const std::size_t finished = done += end - begin;
        if (progress) progress->update("bake", double(finished) / double(points.size()));
    });
    result.rays = rays;
    result.dropped_samples = dropped;
    return result;
}

std::vector<Ray> shadow_rays(const PointSet& points, const LightSampler& lights, const IrradianceOptions& options) {
    check_bake(points, options);
    const EntryTable entry([](float) { return 1.0f; });
    const RayMaker maker(points, lights, entry, options);
    std::vector<Ray> rays;
    Workspace work;
    for (const std::uint32_t point : spatial_order(points.positions)) {
        for (const Task& task : light_tasks(lights.lights(), light_groups(lights.lights()), options.component)) {
            maker.make_rays(point, task.light, work);
            rays.insert(rays.end(), work.rays.begin(), work.rays.end());
        }
    }
    return rays;
}

}  // namespace frazil
