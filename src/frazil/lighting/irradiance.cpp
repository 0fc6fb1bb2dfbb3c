#include "frazil/lighting/irradiance.h"

#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/lighting/bake_rays.h"
#include "frazil/lighting/shadow.h"

namespace frazil {
namespace {

constexpr std::size_t kPointsPerChunk = 64;

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
struct Workspace : BakeRays {
    std::vector<Rgb> factors;     // what is left of each ray's light
    std::vector<float> arriving;  // luminance by sample
    std::uint64_t traced = 0;
};

// What a task brings to a point: sums over rounds.
struct Estimate {
    V3d sum = V3d(0.0);       // of the rounds' means
    V3d moment = V3d(0.0);    // of the rounds' covariances with the place
    Flow flow{};              // of the rounds' means
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
void trace(const RayScene& scene, const LightSampler& lights, const BakeTask& task, Workspace& work,
           Estimate& estimate) {
    work.factors.resize(work.rays.size());
    if (task.light < 0) {
        shadow_factors(scene, lights, work.lights, work.rays, work.factors);
    } else {
        shadow_factors(scene, lights, task.light, work.rays, work.factors);
    }
    work.traced += work.rays.size();
    work.arriving.assign(work.count, 0.0f);
    V3d sum(0.0), moment(0.0);
    double unoccluded = 0.0;
    const V3f& about = work.places.front().position;
    Flow flow{};
    for (std::size_t i = 0; i < work.rays.size(); ++i) {
        unoccluded += absolute_luminance(work.values[i]);
        if (work.factors[i] == Rgb(0.0f)) continue;
        const Rgb value = work.values[i] * work.factors[i];
        sum += V3d(value);
        const Place& place = work.places[work.place_of[work.sample_of[i]]];
        moment += V3d(place.position - about) * (double(value.x) + double(value.y) + double(value.z));
        add_flow(flow, value, along_surface(work.rays[i].direction, place.normal));
        work.arriving[work.sample_of[i]] = luminance(value);
    }
    // Two samples that follow one another lie in neighbouring strata: their difference tells the variance within.
    double squares = 0.0;
    for (std::size_t i = 0; i + 1 < work.count; i += 2) {
        const double difference = double(work.arriving[i]) - double(work.arriving[i + 1]);
        squares += difference * difference;
    }
    const double n = double(work.count);
    if (work.places.size() > 1 && !work.rays.empty()) {
        // About the mean of the samples' own places: light that is the same everywhere then has no moment.
        V3d mean(0.0);
        for (std::size_t i = 0; i < work.count; ++i) mean += V3d(work.places[work.place_of[i]].position - about);
        estimate.moment += (moment - mean * ((sum.x + sum.y + sum.z) / n)) / n;
    }
    estimate.sum += sum / n;
    for (std::size_t c = 0; c < 3; ++c) estimate.flow[c] += flow[c] / float(n);
    estimate.variance += squares / (n * n);
    estimate.unoccluded += unoccluded / n;
    ++estimate.rounds;
}

// Trace one point's rays, more rounds where the error asks for it, and write its irradiance. The standard deviation.
float serve_point(std::uint32_t point, const RayScene& scene, const LightSampler& lights, const RayMaker& maker,
                  const std::vector<BakeTask>& tasks, const IrradianceOptions& options, Workspace& work,
                  std::span<Rgb> values, std::span<V3f> moments, std::span<Flow> flows) {
    std::vector<Estimate> estimates(tasks.size());
    maker.find_places(point, work);
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
        if (!moments.empty()) {
            moments[tasks[t].group] += V3f(estimates[t].moment * (double(tasks[t].multiplier) / estimates[t].rounds));
        }
        const float scale = tasks[t].multiplier / float(estimates[t].rounds);
        for (std::size_t c = 0; c < 3 && !flows.empty(); ++c) {
            flows[tasks[t].group][c] += estimates[t].flow[c] * scale;
        }
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
    const CellSource& cells = options.cells;
    if ((cells.cells == nullptr) != (cells.mesh == nullptr) || (cells.cells && cells.cells->size() != points.size())) {
        throw ValueError(
            str("bake_irradiance: cells must be those of the points (", points.size(), ") and come with their mesh."));
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
                           const Transmittance& transmittance, const IrradianceOptions& options, Progress* progress) {
    check_bake(points, options);
    const std::vector<std::string> groups = light_groups(lights.lights());
    Irradiance result;
    result.groups = groups.size();
    result.values.assign(points.size() * groups.size(), Rgb(0.0f));
    result.errors.assign(points.size(), 0.0f);
    if (options.cells.cells) result.moments.assign(result.values.size(), V3f(0.0f));
    if (options.with_flows) result.flows.assign(result.values.size(), Flow{});

    const std::vector<BakeTask> tasks = bake_tasks(lights, groups, options.component);
    if (tasks.empty() || points.size() == 0) return result;

    const EntryTable entry(transmittance);
    const RayMaker maker(points, lights, entry, options);
    const std::vector<std::uint32_t> order = spatial_order(points.positions);
    std::atomic<std::uint64_t> rays{0}, dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), kPointsPerChunk, [&](std::size_t begin, std::size_t end) {
        Workspace work;
        for (std::size_t i = begin; i < end; ++i) {
            const std::size_t row = std::size_t(order[i]) * groups.size();
            std::span<V3f> moments;
            if (!result.moments.empty()) moments = std::span(result.moments).subspan(row, groups.size());
            std::span<Flow> flows;
            if (!result.flows.empty()) flows = std::span(result.flows).subspan(row, groups.size());
            result.errors[order[i]] = serve_point(order[i], scene, lights, maker, tasks, options, work,
                                                  std::span(result.values).subspan(row, groups.size()), moments, flows);
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
    const EntryTable entry([](float) { return Rgb(1.0f); });
    const RayMaker maker(points, lights, entry, options);
    std::vector<Ray> rays;
    BakeRays work;
    const std::vector<BakeTask> tasks = bake_tasks(lights, light_groups(lights.lights()), options.component);
    for (const std::uint32_t point : spatial_order(points.positions)) {
        maker.find_places(point, work);
        for (const BakeTask& task : tasks) {
            maker.make_rays(point, task, 0, work);
            rays.insert(rays.end(), work.rays.begin(), work.rays.end());
        }
    }
    return rays;
}

}  // namespace frazil
