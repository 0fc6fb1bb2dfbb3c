#include "frazil/lighting/irradiance.h"

#include <algorithm>
#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/lighting/bake_rays.h"
#include "frazil/lighting/shadow.h"

namespace frazil {
namespace {

constexpr std::size_t kRaysPerBatch = 4096, kMostPointsPerBatch = 256;  // of one light; they fit in the cache

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

// A point of a batch, and what its tasks have brought so far.
struct Served {
    std::uint32_t point = 0;
    BakeRays work;
    std::vector<Estimate> estimates;  // by task
};

// Room for tracing the rays of a batch of points together.
struct Batch {
    std::vector<Ray> rays;
    std::vector<int> lights;      // of each ray, in a crowd
    std::vector<Rgb> factors;     // what is left of each ray's light
    std::vector<float> arriving;  // luminance by sample
    std::uint64_t traced = 0;
};

// Add a round: what arrives along the rays at hand.
void add_round(const BakeRays& work, std::span<const Rgb> factors, std::vector<float>& arriving, Estimate& estimate) {
    arriving.assign(work.count, 0.0f);
    V3d sum(0.0), moment(0.0);
    double unoccluded = 0.0;
    const V3f& about = work.places.front().position;
    Flow flow{};
    for (std::size_t i = 0; i < work.rays.size(); ++i) {
        unoccluded += absolute_luminance(work.values[i]);
        if (factors[i] == Rgb(0.0f)) continue;
        const Rgb value = work.values[i] * factors[i];
        sum += V3d(value);
        const Place& place = work.places[work.place_of[work.sample_of[i]]];
        moment += V3d(place.position - about) * (double(value.x) + double(value.y) + double(value.z));
        add_flow(flow, value, along_surface(work.rays[i].direction, place.normal));
        arriving[work.sample_of[i]] = luminance(value);
    }
    // Two samples that follow one another lie in neighbouring strata: their difference tells the variance within.
    double squares = 0.0;
    for (std::size_t i = 0; i + 1 < work.count; i += 2) {
        const double difference = double(arriving[i]) - double(arriving[i + 1]);
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

// What a bake asks and answers with; its parts must outlive it.
class Bake {
  public:
    Bake(const RayScene& scene, const LightSampler& lights, const RayMaker& maker, const std::vector<BakeTask>& tasks,
         const IrradianceOptions& options, Irradiance& result)
        : scene_(scene), lights_(lights), maker_(maker), tasks_(tasks), options_(options), result_(result) {}

    // Trace the rays of some points, more rounds where the error asks for it, and write their irradiance.
    void serve(std::span<Served> points, Batch& batch) const {
        std::vector<Served*> asking;
        for (Served& served : points) {
            served.estimates.assign(tasks_.size(), Estimate());
            maker_.find_places(served.point, served.work);
            asking.push_back(&served);
        }
        for (std::size_t t = 0; t < tasks_.size(); ++t) trace(asking, t, batch);
        for (int round = 1; options_.error > 0.0f && round < options_.max_rounds && !asking.empty(); ++round) {
            std::vector<std::vector<Served*>> wanting(tasks_.size());
            for (Served* served : asking) {
                const double allowed = allowed_variance(*served);
                for (std::size_t t = 0; t < tasks_.size(); ++t) {
                    const double scale = double(tasks_[t].multiplier) * double(tasks_[t].multiplier);
                    if (scale * served->estimates[t].mean_variance() > allowed) wanting[t].push_back(served);
                }
            }
            asking.clear();
            for (std::size_t t = 0; t < tasks_.size(); ++t) {
                trace(wanting[t], t, batch);
                asking.insert(asking.end(), wanting[t].begin(), wanting[t].end());
            }
            std::sort(asking.begin(), asking.end());
            asking.erase(std::unique(asking.begin(), asking.end()), asking.end());
        }
        for (const Served& served : points) write(served);
    }

  private:
    // Trace a round's rays of a task.
    void trace(std::span<Served* const> points, std::size_t t, Batch& batch) const {
        const BakeTask& task = tasks_[t];
        batch.rays.clear(), batch.lights.clear();
        for (Served* served : points) {
            BakeRays& work = served->work;
            maker_.make_rays(served->point, task, std::uint32_t(served->estimates[t].rounds), work);
            batch.rays.insert(batch.rays.end(), work.rays.begin(), work.rays.end());
            batch.lights.insert(batch.lights.end(), work.lights.begin(), work.lights.end());
        }
        batch.factors.resize(batch.rays.size());
        if (task.light < 0) {
            shadow_factors(scene_, lights_, batch.lights, batch.rays, batch.factors);
        } else {
            shadow_factors(scene_, lights_, task.light, batch.rays, batch.factors);
        }
        batch.traced += batch.rays.size();
        std::span<const Rgb> factors(batch.factors);
        for (Served* served : points) {
            const std::size_t count = served->work.rays.size();
            add_round(served->work, factors.first(count), batch.arriving, served->estimates[t]);
            factors = factors.subspan(count);
        }
    }

    // Each light has an equal part of the variance that is allowed, so that twins take the same number of rounds.
    double allowed_variance(const Served& served) const {
        double arriving = 0.0, unoccluded = 0.0;
        for (std::size_t t = 0; t < tasks_.size(); ++t) {
            const double scale = std::abs(double(tasks_[t].multiplier));
            arriving += scale * std::abs(double(luminance(served.estimates[t].mean())));
            unoccluded += scale * served.estimates[t].unoccluded / served.estimates[t].rounds;
        }
        const double allowed = double(options_.error) * std::max(arriving, 0.1 * unoccluded);
        return allowed * allowed / double(tasks_.size());
    }

    void write(const Served& served) const {
        const std::size_t row = std::size_t(served.point) * result_.groups;
        double variance = 0.0;
        for (std::size_t t = 0; t < tasks_.size(); ++t) {
            const BakeTask& task = tasks_[t];
            const Estimate& estimate = served.estimates[t];
            const std::size_t to = row + task.group;
            const float scale = task.multiplier / float(estimate.rounds);
            result_.values[to] += estimate.mean() * task.multiplier;
            if (!result_.moments.empty()) {
                result_.moments[to] += V3f(estimate.moment * (double(task.multiplier) / estimate.rounds));
            }
            for (std::size_t c = 0; c < 3 && !result_.flows.empty(); ++c) {
                result_.flows[to][c] += estimate.flow[c] * scale;
            }
            variance += double(task.multiplier) * double(task.multiplier) * estimate.mean_variance();
        }
        result_.errors[served.point] = static_cast<float>(std::sqrt(variance));
    }

    const RayScene& scene_;
    const LightSampler& lights_;
    const RayMaker& maker_;
    const std::vector<BakeTask>& tasks_;
    const IrradianceOptions& options_;
    Irradiance& result_;
};

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
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    const Bake bake(scene, lights, maker, tasks, options, result);
    const std::size_t samples = std::size_t(options.samples);
    const std::size_t chunk = std::clamp<std::size_t>(kRaysPerBatch / samples, 1, kMostPointsPerBatch);
    std::atomic<std::uint64_t> rays{0}, dropped{0};
    std::atomic<std::size_t> done{0};
    parallel_for(points.size(), chunk, [&](std::size_t begin, std::size_t end) {
        std::vector<Served> served(end - begin);
        for (std::size_t i = begin; i < end; ++i) {
            served[i - begin].point = order[i];
            served[i - begin].work.part = std::uint32_t(i);
        }
        Batch batch;
        bake.serve(served, batch);
        rays += batch.traced;
        for (const Served& one : served) dropped += one.work.dropped;
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
    for (const std::uint32_t point : morton_order(points.positions)) {
        maker.find_places(point, work);
        for (const BakeTask& task : tasks) {
            maker.make_rays(point, task, 0, work);
            rays.insert(rays.end(), work.rays.begin(), work.rays.end());
        }
        ++work.part;
    }
    return rays;
}

}  // namespace frazil
