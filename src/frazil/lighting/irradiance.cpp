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
    std::vector<Place> places;            // of the point at hand
    std::vector<std::uint32_t> place_of;  // by sample
    std::vector<std::uint32_t> order;     // samples, place after place
    std::vector<V2f> drawn;
    std::vector<std::size_t> counts;
    std::vector<std::uint32_t> kept;  // the ray's index in order of place
    std::vector<V2f> u;
    std::vector<LightSample> samples;
    std::vector<Ray> rays;
    std::vector<Rgb> values;               // what each ray brings where nothing is in its way
    std::vector<std::uint32_t> sample_of;  // the ray's index among the samples as they were drawn
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

    // Fill work.places with where the rays of a point start.
    void find_places(std::uint32_t point, Workspace& work) const {
        frazil::find_places(points_, options_.cells, point, work.places);
    }

    // Fill work.rays, values, sample_of, place_of, lights and count; find_places comes first. Rounds are independent of one
    // another.
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
        if (!lights_.is_linked(task.light, object_of(point))) return;
        if (const Place& only = work.places[0];
            work.places.size() == 1 && world_light.importance(only.position, only.normal) == 0.0f) {
            return;
        }

        const std::size_t n = whole_.size();
        work.u.resize(n);
        work.samples.resize(n);
        work.place_of.resize(n);
        work.order.resize(n);
        if (!world_light.is_dome()) {
            whole_.draw(seed, point, work.u);
            spread(0, n, hash(seed, point), work);
            for_each_place(0, n, work, [&](const Place& place, std::size_t first, std::size_t count) {
                world_light.sample(place.position, std::span(work.u).subspan(first, count),
                                   std::span(work.samples).subspan(first, count));
            });
            if (work.samples.front().is_delta) one_each(world_light, work);
        } else if (world_light.is_uniform_dome()) {
            whole_.draw(seed, point, work.u);
            spread(0, n, hash(seed, point), work);
            sample_cosine(0, n, work);
            for (LightSample& sample : work.samples) sample.radiance = world_light.dome_radiance(sample.direction);
        } else {
            sample_dome(world_light, point, seed, work);
        }
        keep_useful(work);
    }

  private:
    // Deal the samples [begin, end) out to the places, by their shares, so that those that follow one another go to
    // different places, and bring them and their u in order of place.
    void spread(std::size_t begin, std::size_t end, std::uint32_t salt, Workspace& work) const {
        deal(work.places, begin, salt, std::span(work.place_of).subspan(begin, end - begin));
        const std::size_t places = work.places.size();
        if (places == 1) {
            for (std::size_t i = begin; i < end; ++i) work.order[i] = std::uint32_t(i);
            return;
        }
        work.counts.assign(places + 1, 0);
        for (std::size_t i = begin; i < end; ++i) ++work.counts[work.place_of[i] + 1];
        for (std::size_t k = 0; k < places; ++k) work.counts[k + 1] += work.counts[k];
        work.drawn.assign(work.u.begin() + std::ptrdiff_t(begin), work.u.begin() + std::ptrdiff_t(end));
        for (std::size_t i = begin; i < end; ++i) {
            const std::size_t to = begin + work.counts[work.place_of[i]]++;
            work.order[to] = std::uint32_t(i);
            work.u[to] = work.drawn[i - begin];
        }
    }

    // work(place, first, count) for every run of samples in order.
    template <class Work>
    static void for_each_place(std::size_t begin, std::size_t end, const Workspace& work, const Work& use) {
        for (std::size_t first = begin; first < end;) {
            const std::uint32_t place = work.place_of[work.order[first]];
            std::size_t last = first + 1;
            while (last < end && work.place_of[work.order[last]] == place) ++last;
            use(work.places[place], first, last - first);
            first = last;
        }
    }

    // A light that needs one ray alone gets one from every place, unless there are more of these than samples.
    void one_each(const WorldLight& light, Workspace& work) const {
        work.count = std::min(work.count, work.places.size());
        if (work.count == 1 || work.count < work.places.size()) return;
        work.u.resize(work.count, V2f(0.5f));
        work.samples.resize(std::max(work.count, work.samples.size()));
        work.place_of.resize(work.samples.size());
        work.order.resize(work.samples.size());
        for (std::size_t k = 0; k < work.count; ++k) {
            light.sample(work.places[k].position, std::span(work.u).subspan(k, 1),
                         std::span(work.samples).subspan(k, 1));
            work.samples[k].radiance *= work.places[k].share * float(work.count);
            work.place_of[k] = work.order[k] = std::uint32_t(k);
        }
    }

    // Half of the samples by cosine, half by the image, each a net of its own, under the balance heuristic [Veach1995]:
    // the density of a sample is the mean of both techniques', by their shares.
    void sample_dome(const WorldLight& dome, std::uint32_t point, std::uint32_t seed, Workspace& work) const {
        const std::size_t n = work.u.size(), half = first_half_.size();
        const std::span<V2f> u(work.u);
        const std::span<LightSample> samples(work.samples);
        if (half > 0) first_half_.draw(seed, point, u.first(half));
        second_half_.draw(seed + 0x9e3779b9U, point, u.subspan(half));
        spread(0, half, hash(seed, point), work);
        spread(half, n, hash(seed + 1, point), work);
        sample_cosine(0, half, work);
        for_each_place(half, n, work, [&](const Place& place, std::size_t first, std::size_t count) {
            dome.sample(place.position, u.subspan(first, count), samples.subspan(first, count));
        });
        work.directions.resize(half);
        work.pdfs.resize(half);
        work.radiances.resize(half);
        for (std::size_t i = 0; i < half; ++i) work.directions[i] = samples[i].direction;
        dome.dome_radiances(work.directions, work.pdfs, work.radiances);
        const float share = float(half) / float(n);
        for (std::size_t i = 0; i < n; ++i) {
            LightSample& sample = samples[i];
            const float cosine = std::max(0.0f, sample.direction.dot(place_of(i, work).normal));
            if (i < half) sample.radiance = work.radiances[i];
            sample.pdf = share * cosine * kInvPi + (1.0f - share) * (i < half ? work.pdfs[i] : sample.pdf);
        }
    }

    static const Place& place_of(std::size_t i, const Workspace& work) {
        return work.places[work.place_of[work.order[i]]];
    }

    // Each sample picks a light of the crowd.
    void sample_crowd(const LightPicker& crowd, std::uint32_t point, std::uint32_t seed, Workspace& work) const {
        work.count = kCrowdSamples * whole_.size();
        work.samples.assign(work.count, LightSample());
        work.u.assign(work.count, V2f(0.0f));
        work.place_of.resize(work.count);
        work.order.resize(work.count);
        spread(0, work.count, hash(seed, point), work);
        for_each_place(0, work.count, work, [&](const Place& place, std::size_t first, std::size_t count) {
            const LightReceiver receiver{place.position, place.normal, object_of(point)};
            crowd.weigh(receiver, work.weights);
            for (std::size_t i = first; i < first + count; ++i) {
                Sampler random(seed, point, work.order[i]);
                const LightPick pick = crowd.pick_one(receiver, work.weights, random.next_1d());
                if (pick.light < 0) return;
                LightSample& sample = work.samples[i];
                sample = lights_.sample_one(pick.light, receiver.position, random.next_2d());
                sample.pdf *= pick.probability;
                sample.radiance *= lights_.lights()[std::size_t(pick.light)].multipliers[int(options_.component)];
            }
        });
        keep_useful(work);
        for (const std::uint32_t i : work.kept) work.lights.push_back(work.samples[i].light);
    }

    static void sample_cosine(std::size_t begin, std::size_t end, Workspace& work) {
        for_each_place(begin, end, work, [&](const Place& place, std::size_t first, std::size_t count) {
            const auto [s, t] = tangent_frame(place.normal);
            for (std::size_t i = first; i < first + count; ++i) {
                const V2f& u = work.u[i];
                const V2f circle = cos_sin_turns(u.y) * std::sqrt(u.x);
                const float cosine = std::sqrt(std::max(0.0f, 1.0f - u.x));
                LightSample& sample = work.samples[i];
                sample = LightSample();
                sample.direction = s * circle.x + t * circle.y + place.normal * cosine;
                sample.pdf = cosine * kInvPi;
            }
        });
    }

    // Keep the samples that can bring light: L T cos / pdf and the ray that asks whether it arrives.
    void keep_useful(Workspace& work) const {
        work.kept.clear();
        for_each_place(0, work.count, work, [&](const Place& place, std::size_t first, std::size_t count) {
            const V3f origin = offset_origin(place.position, place.normal);
            for (std::size_t i = first; i < first + count; ++i) {
                const LightSample& sample = work.samples[i];
                const float cosine = sample.direction.dot(place.normal);
                if (!(sample.pdf > 0.0f) || !(cosine > 0.0f)) continue;
                const Rgb value = sample.radiance * (entry_(cosine) / sample.pdf);
                if (value == Rgb(0.0f)) continue;
                if (!is_finite(value)) {
                    ++work.dropped;
                    continue;
                }
                work.rays.push_back({origin, sample.direction, 0.0f, sample.distance});
                work.values.push_back(value);
                work.sample_of.push_back(work.order[i]);
                work.kept.push_back(std::uint32_t(i));
            }
        });
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
    V3d moment = V3d(0.0);    // of the rounds' covariances with the place
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
    V3d sum(0.0), moment(0.0);
    double unoccluded = 0.0;
    const V3f& about = work.places.front().position;
    for (std::size_t i = 0; i < work.rays.size(); ++i) {
        unoccluded += absolute_luminance(work.values[i]);
        if (work.factors[i] == Rgb(0.0f)) continue;
        const Rgb value = work.values[i] * work.factors[i];
        sum += V3d(value);
        moment += V3d(work.places[work.place_of[work.sample_of[i]]].position - about) *
                  (double(value.x) + double(value.y) + double(value.z));
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
    estimate.variance += squares / (n * n);
    estimate.unoccluded += unoccluded / n;
    ++estimate.rounds;
}

// Trace one point's rays, more rounds where the error asks for it, and write its irradiance. The standard deviation.
float serve_point(std::uint32_t point, const RayScene& scene, const LightSampler& lights, const RayMaker& maker,
                  const std::vector<Task>& tasks, const IrradianceOptions& options, Workspace& work,
                  std::span<Rgb> values, std::span<V3f> moments) {
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
                           const std::function<float(float)>& transmittance, const IrradianceOptions& options,
                           Progress* progress) {
    check_bake(points, options);
    const std::vector<std::string> groups = light_groups(lights.lights());
    Irradiance result;
    result.groups = groups.size();
    result.values.assign(points.size() * groups.size(), Rgb(0.0f));
    result.errors.assign(points.size(), 0.0f);
    if (options.cells.cells) result.moments.assign(result.values.size(), V3f(0.0f));

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
            const std::size_t row = std::size_t(order[i]) * groups.size();
            std::span<V3f> moments;
            if (!result.moments.empty()) moments = std::span(result.moments).subspan(row, groups.size());
            result.errors[order[i]] = serve_point(order[i], scene, lights, maker, tasks, options, work,
                                                  std::span(result.values).subspan(row, groups.size()), moments);
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
        maker.find_places(point, work);
        for (const Task& task : tasks) {
            maker.make_rays(point, task, 0, work);
            rays.insert(rays.end(), work.rays.begin(), work.rays.end());
        }
    }
    return rays;
}

}  // namespace frazil
