#include "frazil/lighting/bake_rays.h"

#include <algorithm>
#include <unordered_map>

#include "frazil/base/random.h"
#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kCrowdSamples = 16;  // times the samples of one light

// use(place, first, count) for every run of samples in order.
template <class Use>
void for_each_place(std::size_t begin, std::size_t end, const BakeRays& rays, const Use& use) {
    for (std::size_t first = begin; first < end;) {
        const std::uint32_t place = rays.place_of[rays.order[first]];
        std::size_t last = first + 1;
        while (last < end && rays.place_of[rays.order[last]] == place) ++last;
        use(rays.places[place], first, last - first);
        first = last;
    }
}

const Place& place_of(std::size_t i, const BakeRays& rays) {
    return rays.places[rays.place_of[rays.order[i]]];
}

// Whether a dome has portals before any of the places.
bool has_portal_before(const WorldLight& dome, const BakeRays& rays) {
    return std::any_of(rays.places.begin(), rays.places.end(),
                       [&](const Place& place) { return dome.has_portal_before(place.position); });
}

void sample_cosine(std::size_t begin, std::size_t end, BakeRays& rays) {
    for_each_place(begin, end, rays, [&](const Place& place, std::size_t first, std::size_t count) {
        const auto [s, t] = tangent_frame(place.normal);
        for (std::size_t i = first; i < first + count; ++i) {
            const V3f local = cosine_hemisphere(rays.u[i]);
            LightSample& sample = rays.samples[i];
            sample = LightSample();
            sample.direction = s * local.x + t * local.y + place.normal * local.z;
            sample.pdf = local.z * kInvPi;
        }
    });
}

}  // namespace

EntryTable::EntryTable(const Transmittance& transmittance) : values_(kSteps + 2) {
    for (int i = 0; i <= kSteps; ++i) values_[std::size_t(i)] = transmittance(float(i) / kSteps);
    values_.back() = values_[kSteps];
}

std::vector<BakeTask> bake_tasks(const LightSampler& sampler, const std::vector<std::string>& groups,
                                 LightComponent component) {
    const std::vector<Light>& lights = sampler.lights();
    std::vector<BakeTask> tasks;
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
    const auto is_in_crowd = [&](const BakeTask& task) {
        return finite[task.group].size() > kCrowd && sampler.world_light(task.light).is_finite();
    };
    std::erase_if(tasks, is_in_crowd);
    for (std::size_t group = 0; group < groups.size(); ++group) {
        if (finite[group].size() <= kCrowd) continue;
        tasks.push_back({-1, group, 1.0f, std::make_shared<const LightPicker>(sampler.make_picker(finite[group]))});
    }
    return tasks;
}

RayMaker::RayMaker(const PointSet& points, const LightSampler& lights, const EntryTable& entry,
                   const IrradianceOptions& options)
    : points_(points),
      lights_(lights),
      entry_(entry),
      options_(options),
      whole_(options.samples),
      first_half_(options.samples / 2),
      second_half_(options.samples - options.samples / 2) {}

std::uint32_t RayMaker::object_of(std::uint32_t point) const {
    if (options_.objects.empty()) return kNoObject;
    return options_.objects.size() == 1 ? options_.objects[0] : options_.objects[point];
}

void RayMaker::find_places(std::uint32_t point, BakeRays& rays) const {
    frazil::find_places(points_, options_.cells, point, rays.places);
}

void RayMaker::make_rays(std::uint32_t point, const BakeTask& task, std::uint32_t round, BakeRays& rays) const {
    rays.rays.clear();
    rays.values.clear();
    rays.sample_of.clear();
    rays.lights.clear();
    rays.count = whole_.size();
    const std::uint32_t seed = round == 0 ? options_.seed : hash(options_.seed, round);
    if (task.light < 0) {
        sample_crowd(*task.crowd, point, seed, rays);
        return;
    }
    const WorldLight& world_light = lights_.world_light(task.light);
    if (!lights_.is_linked(task.light, object_of(point))) return;
    if (const Place& only = rays.places[0];
        rays.places.size() == 1 && world_light.importance(only.position, only.normal) == 0.0f) {
        return;
    }

    const std::size_t n = whole_.size();
    rays.u.resize(n);
    rays.samples.resize(n);
    rays.place_of.resize(n);
    rays.order.resize(n);
    if (!world_light.is_dome()) {
        whole_.draw_part(seed, rays.part, rays.u);
        spread(0, n, hash(seed, point), rays);
        for_each_place(0, n, rays, [&](const Place& place, std::size_t first, std::size_t count) {
            world_light.sample(place.position, std::span(rays.u).subspan(first, count),
                               std::span(rays.samples).subspan(first, count));
        });
        if (rays.samples.front().is_delta) one_each(world_light, rays);
    } else if (world_light.is_uniform_dome() && !has_portal_before(world_light, rays)) {
        // To the bit the rays by which bounces look around (bake_bounce).
        whole_.draw_part(seed, rays.part, rays.u);
        spread(0, n, hash(seed, point), rays);
        sample_cosine(0, n, rays);
        for (LightSample& sample : rays.samples) sample.radiance = world_light.dome_radiance(sample.direction);
    } else {
        sample_dome(world_light, point, seed, rays);
    }
    keep_useful(rays);
}

void RayMaker::spread(std::size_t begin, std::size_t end, std::uint32_t salt, BakeRays& rays) {
    deal(rays.places, begin, salt, std::span(rays.place_of).subspan(begin, end - begin));
    const std::size_t places = rays.places.size();
    if (places == 1) {
        for (std::size_t i = begin; i < end; ++i) rays.order[i] = std::uint32_t(i);
        return;
    }
    rays.counts.assign(places + 1, 0);
    for (std::size_t i = begin; i < end; ++i) ++rays.counts[rays.place_of[i] + 1];
    for (std::size_t k = 0; k < places; ++k) rays.counts[k + 1] += rays.counts[k];
    rays.drawn.assign(rays.u.begin() + std::ptrdiff_t(begin), rays.u.begin() + std::ptrdiff_t(end));
    for (std::size_t i = begin; i < end; ++i) {
        const std::size_t to = begin + rays.counts[rays.place_of[i]]++;
        rays.order[to] = std::uint32_t(i);
        rays.u[to] = rays.drawn[i - begin];
    }
}

void RayMaker::one_each(const WorldLight& light, BakeRays& rays) {
    rays.count = std::min(rays.count, rays.places.size());
    if (rays.count == 1 || rays.count < rays.places.size()) return;
    rays.u.resize(rays.count, V2f(0.5f));
    rays.samples.resize(std::max(rays.count, rays.samples.size()));
    rays.place_of.resize(rays.samples.size());
    rays.order.resize(rays.samples.size());
    for (std::size_t k = 0; k < rays.count; ++k) {
        light.sample(rays.places[k].position, std::span(rays.u).subspan(k, 1), std::span(rays.samples).subspan(k, 1));
        rays.samples[k].radiance *= rays.places[k].share * float(rays.count);
        rays.place_of[k] = rays.order[k] = std::uint32_t(k);
    }
}

void RayMaker::sample_dome(const WorldLight& dome, std::uint32_t point, std::uint32_t seed, BakeRays& rays) const {
    const std::size_t n = rays.u.size(), half = first_half_.size();
    const std::span<V2f> u(rays.u);
    const std::span<LightSample> samples(rays.samples);
    if (half > 0) first_half_.draw_part(seed, rays.part, u.first(half));
    second_half_.draw_part(seed + 0x9e3779b9U, rays.part, u.subspan(half));
    spread(0, half, hash(seed, point), rays);
    spread(half, n, hash(seed + 1, point), rays);
    sample_cosine(0, half, rays);
    const bool has_portals = has_portal_before(dome, rays);
    for_each_place(half, n, rays, [&](const Place& place, std::size_t first, std::size_t count) {
        if (has_portals) {
            dome.sample(place.position, u.subspan(first, count), samples.subspan(first, count));
        } else {
            dome.sample_dome(place.normal, u.subspan(first, count), samples.subspan(first, count));
        }
    });
    rays.directions.resize(half);
    rays.pdfs.resize(half);
    rays.radiances.resize(half);
    for (std::size_t i = 0; i < half; ++i) rays.directions[i] = samples[i].direction;
    if (has_portals) {
        for (std::size_t i = 0; i < half; ++i) {
            LightHit hit;
            dome.intersect(place_of(i, rays).position, rays.directions[i], kInfinity, hit);
            rays.pdfs[i] = hit.pdf, rays.radiances[i] = hit.radiance;
        }
    } else {
        dome.dome_radiances(rays.directions, rays.pdfs, rays.radiances);
    }
    const float share = float(half) / float(n);
    for (std::size_t i = 0; i < n; ++i) {
        LightSample& sample = samples[i];
        const float cosine = std::max(0.0f, sample.direction.dot(place_of(i, rays).normal));
        if (i < half) sample.radiance = rays.radiances[i];
        sample.pdf = share * cosine * kInvPi + (1.0f - share) * (i < half ? rays.pdfs[i] : sample.pdf);
    }
}

void RayMaker::sample_crowd(const LightPicker& crowd, std::uint32_t point, std::uint32_t seed, BakeRays& rays) const {
    rays.count = kCrowdSamples * whole_.size();
    rays.samples.assign(rays.count, LightSample());
    rays.u.assign(rays.count, V2f(0.0f));
    rays.place_of.resize(rays.count);
    rays.order.resize(rays.count);
    spread(0, rays.count, hash(seed, point), rays);
    for_each_place(0, rays.count, rays, [&](const Place& place, std::size_t first, std::size_t count) {
        const LightReceiver receiver{place.position, place.normal, object_of(point)};
        crowd.weigh(receiver, rays.weights);
        for (std::size_t i = first; i < first + count; ++i) {
            Sampler random(seed, point, rays.order[i]);
            const LightPick pick = crowd.pick_one(receiver, rays.weights, random.next_1d());
            if (pick.light < 0) return;
            LightSample& sample = rays.samples[i];
            sample = lights_.sample_one(pick.light, receiver.position, random.next_2d());
            sample.pdf *= pick.probability;
            sample.radiance *= lights_.lights()[std::size_t(pick.light)].multipliers[int(options_.component)];
        }
    });
    keep_useful(rays);
    for (const std::uint32_t i : rays.kept) rays.lights.push_back(rays.samples[i].light);
}

void RayMaker::keep_useful(BakeRays& rays) const {
    rays.kept.clear();
    for_each_place(0, rays.count, rays, [&](const Place& place, std::size_t first, std::size_t count) {
        const V3f origin = offset_origin(place.position, place.normal);
        for (std::size_t i = first; i < first + count; ++i) {
            const LightSample& sample = rays.samples[i];
            const float cosine = sample.direction.dot(place.normal);
            if (!(sample.pdf > 0.0f) || !(cosine > 0.0f)) continue;
            const Rgb value = sample.radiance * entry_(cosine) / sample.pdf;
            if (value == Rgb(0.0f)) continue;
            if (!is_finite(value)) {
                ++rays.dropped;
                continue;
            }
            rays.rays.push_back({origin, sample.direction, 0.0f, sample.distance});
            rays.values.push_back(value);
            rays.sample_of.push_back(rays.order[i]);
            rays.kept.push_back(std::uint32_t(i));
        }
    });
}

}  // namespace frazil
