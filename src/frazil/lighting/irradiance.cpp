#include "frazil/lighting/irradiance.h"

#include <atomic>
#include <unordered_map>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/base/random.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"
#include "frazil/lighting/shadow.h"

namespace frazil {
namespace {

constexpr int kTransmittanceSteps = 1024;
constexpr std::size_t kPointsPerChunk = 64;
constexpr std::size_t kCrowdSamples = 16;  // times the samples of one light

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
    std::vector<Rgb> values;               // what each ray brings where nothing is in its way
    std::vector<std::uint32_t> sample_of;  // the ray's index among the samples
    std::vector<int> lights;               // of each ray, in a crowd
    std::vector<Rgb> factors;              // what is left of it
    std::vector<float> arriving;           // luminance by sample
    std::vector<V3f> directions;           // of a dome's lookups, and what they give
    std::vector<float> pdfs;
    std::vector<Rgb> radiances;
    LightPicker::Weights weights;
    std::size_t count = 0;  // samples that the rays stand for
    std::uint64_t traced = 0, dropped = 0;
};

// A light that reaches the component, or a crowd of them, and where its irradiance goes.
struct Task {
    int light;  // -1 = the crowd
    std::size_t group;
    float multiplier;
    std::shared_ptr<const LightPicker> crowd;
};

std::vector<Task> light_tasks(const LightSampler& sampler, const std::vector<std::string>& groups,
                              LightComponent component) {
    const std::vector<Light>& lights = sampler.lights();
    std::vector<Task> tasks;
    std::vector<std::vector<PickEntry>> finite(groups.size());
    std::unordered_map<std::string, std::size_t> index_of;
    for (std::size_t i = 0; i < groups.size(); ++i) index_of.emplace(groups[i], i);
    for (std::size_t i = 0; i < lights.size(); ++i) {
        const float multiplier = lights[i].multipliers[int(component)];
        if (multiplier == 0.0f || lights[i].radiance == Rgb(0.0f)) continue;
        const std::size_t group = index_of.at(lights[i].group);
        tasks.push_back({int(i), group, multiplier, nullptr});
        if (sampler.world_light(int(i)).is_finite()) finite[group].push_back({int(i), std::abs(multiplier)});
    }
    const auto is_in_crowd = [&](const Task& task) {
        return finite[task.group].size() > kCrowd && sampler.world_light(task.light).is_finite();
    };
    std::erase_if(tasks, is_in_crowd);
    for (std::size_t group = 0; group < groups.size(); ++group) {
        if (finite[group].size() <= kCrowd) continue;
        tasks.push_back({-1, group, 1.0f, std::make_shared<const LightPicker>(sampler.make_picker(finite[group]))});
    }
    return tasks;
}

// The shadow rays that serve one light, or a crowd, at one point.
class RayMaker {
  public:
    RayMaker(const PointSet& points, const LightSampler& lights, const EntryTable& entry,
             const IrradianceOptions& options)
        : points_(points),
          lights_(lights),
          entry_(entry),
          options_(options),
          whole_(options.samples),
          first_half_(options.samples / 2),
          second_half_(options.samples - options.samples / 2) {}

    std::uint32_t object_of(std::uint32_t point) const {
        if (options_.objects.empty()) return kNoObject;
        return options_.objects.size() == 1 ? options_.objects[0] : options_.objects[point];
    }

    // Fill work.rays, values, sample_of, lights and count. Rounds are independent of one another.
    void make_rays(std::uint32_t point, const Task& task, std::uint32_t round, Workspace& work) const {
        work.rays.clear();
        work.values.clear();
        work.sample_of.clear();
        work.lights.clear();
        work.count = whole_.size();
        const std::uint32_t seed = round == 0 ? options_.seed : hash(options_.seed, round);
        if (task.light < 0) {
            sample_crowd(*task.crowd, point, seed, work);
            return;
        }
        const WorldLight& world_light = lights_.world_light(task.light);
        const V3f& position = points_.positions[point];
        const V3f& normal = points_.normals[point];
        if (!lights_.is_linked(task.light, object_of(point)) ||
            world_light.importance(position, points_.normals[point]) == 0.0f)
            return;

        work.u.resize(whole_.size());
        work.samples.resize(whole_.size());
        if (!world_light.is_dome()) {
            whole_.draw(seed, point, work.u);
            world_light.sample(position, work.u, work.samples);
        } else if (world_light.is_uniform_dome()) {
            whole_.draw(seed, point, work.u);
            sample_cosine(normal, work.u, work.samples);
            for (LightSample& sample : work.samples) sample.radiance = world_light.dome_radiance(sample.direction);
        } else {
            sample_dome(world_light, point, seed, work);
        }
        keep_useful(offset_origin(position, normal), normal, work);
    }

  private:
    // Half of the samples by cosine, half by the image, each a net of its own, under the balance heuristic [Veach1995]:
    // the density of a sample is the mean of both techniques', by their shares.
    void sample_dome(const WorldLight& dome, std::uint32_t point, std::uint32_t seed, Workspace& work) const {
        const V3f& normal = points_.normals[point];
        const std::size_t n = work.u.size(), half = first_half_.size();
        const std::span<V2f> u(work.u);
        const std::span<LightSample> samples(work.samples);
        if (half > 0) first_half_.draw(seed, point, u.first(half));
        second_half_.draw(seed + 0x9e3779b9U, point, u.subspan(half));
        sample_cosine(normal, u.first(half), samples.first(half));
        dome.sample(points_.positions[point], u.subspan(half), samples.subspan(half));
        work.directions.resize(half);
        work.pdfs.resize(half);
        work.radiances.resize(half);
        for (std::size_t i = 0; i < half; ++i) work.directions[i] = samples[i].direction;
        dome.dome_radiances(work.directions, work.pdfs, work.radiances);
        const float share = float(half) / float(n);
        for (std::size_t i = 0; i < n; ++i) {
            LightSample& sample = samples[i];
            const float cosine = std::max(0.0f, sample.direction.dot(normal));
            if (i < half) sample.radiance = work.radiances[i];
            sample.pdf = share * cosine * kInvPi + (1.0f - share) * (i < half ? work.pdfs[i] : sample.pdf);
        }
    }

    // Each sample picks a light of the crowd.
    void sample_crowd(const LightPicker& crowd, std::uint32_t point, std::uint32_t seed, Workspace& work) const {
        const LightReceiver receiver{points_.positions[point], points_.normals[point], object_of(point)};
        crowd.weigh(receiver, work.weights);
        work.count = kCrowdSamples * whole_.size();
        work.samples.assign(work.count, LightSample());
        for (std::size_t i = 0; i < work.count; ++i) {
            Sampler random(seed, point, std::uint32_t(i));
            const LightPick pick = crowd.pick_one(receiver, work.weights, random.next_1d());
            if (pick.light < 0) return;
            LightSample& sample = work.samples[i];
            sample = lights_.sample_one(pick.light, receiver.position, random.next_2d());
            sample.pdf *= pick.probability;
            sample.radiance *= lights_.lights()[std::size_t(pick.light)].multipliers[int(options_.component)];
        }
        keep_useful(offset_origin(receiver.position, receiver.normal), receiver.normal, work);
        for (const std::uint32_t i : work.sample_of) work.lights.push_back(work.samples[i].light);
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
            work.sample_of.push_back(std::uint32_t(i));
        }
    }

    const PointSet& points_;
    const LightSampler& lights_;
    const EntryTable& entry_;
    const IrradianceOptions& options_;
    // A (0,m,2)-net for every point. All lights share it: a light and its negative twin then cancel to the bit, and a
    // light's share does not depend on the others.
    const ScrambledNet whole_, first_half_, second_half_;
};

// What a task brings to a point: sums over rounds.
struct Estimate {
    V3d sum = V3d(0.0);       // of the rounds' means
    double variance = 0.0;    // of the luminance of `sum`
    double unoccluded = 0.0;  // sum of the rounds' absolute luminance were nothing in the way
    int rounds = 0;

    Rgb mean() const { return Rgb(sum / double(rounds)); }
    double mean_variance() const { return variance / (double(rounds) * double(rounds)); }
};

double absolute_luminance(const Rgb& c) {
    return double(luminance({std::abs(c.x), std::abs(c.y), std::abs(c.z)}));
}

// Trace a round's rays.
void trace(const RayScene& scene, const LightSampler& lights, const Task& task, Workspace& work, Estimate& estimate) {
    work.factors.resize(work.rays.size());
    if (task.light < 0) {
        shadow_factors(scene, lights, work.lights, work.rays, work.factors);
    } else {
        shadow_factors(scene, lights, task.light, work.rays, work.factors);
    }
    work.traced += work.rays.size();
    work.arriving.assign(work.count, 0.0f);
    V3d sum(0.0);
    double unoccluded = 0.0;
    for (std::size_t i = 0; i < work.rays.size(); ++i) {
        unoccluded += absolute_luminance(work.values[i]);
        if (work.factors[i] == Rgb(0.0f)) continue;
        const Rgb value = work.values[i] * work.factors[i];
        sum += V3d(value);
        work.arriving[work.sample_of[i]] = luminance(value);
    }
    // Two samples that follow one another lie in neighbouring strata: their difference tells the variance within.
    double squares = 0.0;
    for (std::size_t i = 0; i + 1 < work.count; i += 2) {
        const double difference = double(work.arriving[i]) - double(work.arriving[i + 1]);
        squares += difference * difference;
    }
    const double n = double(work.count);
    estimate.sum += sum / n;
    estimate.variance += squares / (n * n);
    estimate.unoccluded += unoccluded / n;
    ++estimate.rounds;
}

// Trace one point's rays, more rounds where the error asks for it, and write its irradiance. The standard deviation.
float serve_point(std::uint32_t point, const RayScene& scene, const LightSampler& lights, const RayMaker& maker,
                  const std::vector<Task>& tasks, const IrradianceOptions& options, Workspace& work,
                  std::span<Rgb> values) {
    std::vector<Estimate> estimates(tasks.size());
    const auto add_round = [&](std::size_t t) {
        maker.make_rays(point, tasks[t], std::uint32_t(estimates[t].rounds), work);
        trace(scene, lights, tasks[t], work, estimates[t]);
    };
    for (std::size_t t = 0; t < tasks.size(); ++t) add_round(t);
    // Each light has an equal part of the variance that is allowed, so that twins take the same number of rounds.
    for (int round = 1; options.error > 0.0f && round < options.max_rounds; ++round) {
        double arriving = 0.0, unoccluded = 0.0;
        for (std::size_t t = 0; t < tasks.size(); ++t) {
            const double scale = std::abs(double(tasks[t].multiplier));
            arriving += scale * std::abs(double(luminance(estimates[t].mean())));
            unoccluded += scale * estimates[t].unoccluded / estimates[t].rounds;
        }
        const double allowed = double(options.error) * std::max(arriving, 0.1 * unoccluded);
        bool is_done = true;
        for (std::size_t t = 0; t < tasks.size(); ++t) {
            const double scale = double(tasks[t].multiplier) * double(tasks[t].multiplier);
            if (scale * estimates[t].mean_variance() <= allowed * allowed / double(tasks.size())) continue;
            add_round(t);
            is_done = false;
        }
        if (is_done) break;
    }
    double variance = 0.0;
    for (std::size_t t = 0; t < tasks.size(); ++t) {
        values[tasks[t].group] += estimates[t].mean() * tasks[t].multiplier;
        variance += double(tasks[t].multiplier) * double(tasks[t].multiplier) * estimates[t].mean_variance();
    }
    return static_cast<float>(std::sqrt(variance));
}

void check_bake(const PointSet& points, const IrradianceOptions& options) {
    if (options.samples < 1 || options.samples > (1 << 20)) {
        throw ValueError(str("bake_irradiance: samples must be in [1, 2^20], got ", options.samples, "."));
    }
    if (!(options.error >= 0.0f) || !std::isfinite(options.error)) {
        throw ValueError(str("bake_irradiance: error must be >= 0 and finite, got ", options.error, "."));
    }
    if (options.max_rounds < 1) {
        throw ValueError(str("bake_irradiance: max_rounds must be >= 1, got ", options.max_rounds, "."));
    }
    if (options.objects.size() > 1 && options.objects.size() != points.size()) {
        throw ValueError(str("bake_irradiance: objects must be one per point (", points.size(), ") or one, got ",
                             options.objects.size(), "."));
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
    result.errors.assign(points.size(), 0.0f);

    const std::vector<Task> tasks = light_tasks(lights, groups, options.component);
    if (tasks.empty() || points.size() == 0) return result;

    const EntryTable entry(transmittance);
    const RayMaker maker(points, lights, entry, options);
    const std::vector<std::uint32_t> order = spatial_order(points.positions);
    std::atomic<std::uint64_t> rays{0}, dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
        Workspace work;
        for (std::size_t i = begin; i < end; ++i) {
            Rgb* values = &result.values[std::size_t(order[i]) * groups.size()];
            result.errors[order[i]] =
                serve_point(order[i], scene, lights, maker, tasks, options, work, {values, groups.size()});
        }
        rays += work.traced;
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
    const std::vector<Task> tasks = light_tasks(lights, light_groups(lights.lights()), options.component);
    for (const std::uint32_t point : spatial_order(points.positions)) {
        for (const Task& task : tasks) {
            maker.make_rays(point, task, 0, work);
            rays.insert(rays.end(), work.rays.begin(), work.rays.end());
        }
    }
    return rays;
}

}  // namespace frazil
