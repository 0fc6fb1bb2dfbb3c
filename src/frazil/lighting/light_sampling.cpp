#include "frazil/lighting/light_sampling.h"

#include <algorithm>
#include <map>

namespace frazil {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// What a light's power counts for a use.
float use_scale(const Light& light, LightUse use) {
    const auto of = [&](LightComponent component) { return std::abs(light.multipliers[int(component)]); };
    switch (use) {
        case LightUse::surface:
            return std::max(of(LightComponent::diffuse), of(LightComponent::specular));
        case LightUse::translucency:
            return of(LightComponent::translucency);
        case LightUse::refraction:
            return of(LightComponent::refraction);
        case LightUse::volume:
            return of(LightComponent::volume);
    }
    return 0.0f;
}

bool is_plain(const ShadowRules& shadow) {
    return shadow.is_enabled && shadow.color == Rgb(0.0f) && !(shadow.distance >= 0.0f) && !shadow.casters;
}

}  // namespace

LightSampler::LightSampler(const std::vector<Light>& lights) : lights_(lights) {
    const auto world = std::make_shared<World>();
    world->lights.reserve(lights.size());
    for (std::size_t i = 0; i < lights.size(); ++i) {
        const Light& light = lights[i];
        world->lights.emplace_back(light);
        world->link_of_light.push_back(world->table.add(light.lit));
        world->casters_of_light.push_back(world->table.add(light.shadow.casters));
        world->is_plain.push_back(is_plain(light.shadow));
        const auto* mesh = std::get_if<MeshLight>(&light.shape);
        if (!world->is_plain.back() && !mesh) world->odd_shadows.push_back(int(i));
        if (mesh && mesh->object != kNoObject) {
            if (world->light_of_object.size() <= mesh->object) world->light_of_object.resize(mesh->object + 1, -1);
            world->light_of_object[mesh->object] = int(i);
        }
    }

    std::vector<PickEntry> all;
    std::vector<std::string> groups;
    for (std::size_t i = 0; i < lights.size(); ++i) {
        all.push_back({int(i), 1.0f});
        groups.push_back(lights[i].group);
    }
    world->all = std::make_unique<const LightPicker>(world->lights, all, world->table, world->link_of_light);
    // Uses that weigh the lights alike share a picker.
    std::map<std::vector<float>, std::shared_ptr<GroupPicker>> made;
    for (std::size_t use = 0; use < kLightUseCount; ++use) {
        std::vector<float> scales;
        std::vector<PickEntry> entries;
        for (std::size_t i = 0; i < lights.size(); ++i) {
            scales.push_back(use_scale(lights[i], LightUse(use)));
            if (scales[i] > 0.0f) entries.push_back({int(i), scales[i]});
        }
        auto& picker = made[scales];
        if (!picker) {
            picker = std::make_shared<GroupPicker>(world->lights, entries, world->table, world->link_of_light, groups);
        }
        world->pickers[use] = picker;
    }
    world_ = world;
}

LightPick LightSampler::pick(const LightReceiver& receiver, float u, LightUse use) const {
    LightReceiver alone = receiver;
    alone.picks = 1.0f;
    const std::vector<LightPick>& picks = pick_all(alone, u, use);
    return picks.empty() ? LightPick() : picks.front();
}

const std::vector<LightPick>& LightSampler::pick_all(const LightReceiver& receiver, float u, LightUse use) const {
    thread_local GroupPicker::Weights weights;
    thread_local std::vector<LightPick> picks;
    picker(use).weigh(receiver, weights);
    picker(use).pick(receiver, weights, u, picks);
    return picks;
}

void LightSampler::sample(const LightReceiver& receiver, float u_pick, const V2f& u, std::vector<LightSample>& samples,
                          LightUse use) const {
    samples.clear();
    for (const LightPick& picked : pick_all(receiver, u_pick, use)) {
        samples.push_back(sample_one(picked.light, receiver.position, u));
        samples.back().pdf *= picked.probability;
    }
}

LightSample LightSampler::sample(const LightReceiver& receiver, float u_pick, const V2f& u, LightUse use) const {
    const LightPick picked = pick(receiver, u_pick, use);
    if (picked.light < 0) return {};
    LightSample sample = sample_one(picked.light, receiver.position, u);
    sample.pdf *= picked.probability;
    return sample;
}

void LightSampler::sample_many(std::span<const LightReceiver> receivers, std::span<const float> u_pick,
                               std::span<const V2f> u, std::span<LightSample> out, LightUse use) const {
    std::vector<LightPick> picks;
    for (std::size_t i = 0; i < receivers.size(); ++i) picks.push_back(pick(receivers[i], u_pick[i], use));
    std::vector<V2f> u_dome;
    std::vector<LightSample> of_dome;
    for (std::size_t light = 0; light < lights_.size(); ++light) {
        if (!world_light(int(light)).is_same_everywhere()) continue;
        u_dome.clear();
        for (std::size_t i = 0; i < picks.size(); ++i) {
            if (picks[i].light == int(light)) u_dome.push_back(u[i]);
        }
        if (u_dome.empty()) continue;
        of_dome.resize(u_dome.size());
        sample_many(int(light), receivers.front().position, u_dome, of_dome);
        for (std::size_t i = 0, k = 0; i < picks.size(); ++i) {
            if (picks[i].light == int(light)) out[i] = of_dome[k++];
        }
    }
    for (std::size_t i = 0; i < picks.size(); ++i) {
        if (picks[i].light < 0) {
            out[i] = {};
            continue;
        }
        if (!world_light(picks[i].light).is_same_everywhere()) {
            out[i] = sample_one(picks[i].light, receivers[i].position, u[i]);
        }
        out[i].pdf *= picks[i].probability;
    }
}

LightSample LightSampler::sample_one(int light, const V3f& position, const V2f& u) const {
    LightSample sample;
    sample_many(light, position, {&u, 1}, {&sample, 1});
    return sample;
}

void LightSampler::sample_many(int light, const V3f& position, std::span<const V2f> u,
                               std::span<LightSample> out) const {
    world_light(light).sample(position, u, out);
    for (LightSample& sample : out) sample.light = light;
}

void LightSampler::intersect(const LightReceiver& receiver, const V3f& origin, const V3f& direction, float t_max,
                             std::vector<LightHit>& hits, LightUse use) const {
    thread_local std::vector<int> candidates;
    thread_local GroupPicker::Weights weights;
    candidates.clear();
    world().all->find_along(origin, direction, t_max, candidates);
    // Light from infinity, and lights that shine through what is in the way.
    world().all->append_infinite(candidates);
    candidates.insert(candidates.end(), world().odd_shadows.begin(), world().odd_shadows.end());
    std::sort(candidates.begin(), candidates.end());
    candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
    bool is_weighed = false;
    for (const int light : candidates) {
        if (!is_linked(light, receiver.object)) continue;
        LightHit hit;
        hit.light = light;
        if (!world_light(light).intersect(origin, direction, has_plain_shadow(light) ? t_max : kInfinity, hit))
            continue;
        if (!is_weighed) picker(use).weigh(receiver, weights);
        is_weighed = true;
        hit.pdf *= picker(use).probability(receiver, weights, light);
        hits.push_back(hit);
    }
}

int LightSampler::light_of_object(std::uint32_t object) const {
    const std::vector<int>& lights = world().light_of_object;
    return object < lights.size() ? lights[object] : -1;
}

bool LightSampler::hit_object(const LightReceiver& receiver, std::uint32_t object, std::uint32_t triangle,
                              const V3f& direction, float t, LightHit& hit, LightUse use) const {
    hit.light = light_of_object(object);
    if (hit.light < 0 || !is_linked(hit.light, receiver.object)) return false;
    if (!world_light(hit.light).hit_triangle(triangle, direction, t, hit)) return false;
    thread_local GroupPicker::Weights weights;
    picker(use).weigh(receiver, weights);
    hit.pdf *= picker(use).probability(receiver, weights, hit.light);
    return true;
}

Rgb LightSampler::background(const V3f& direction) const {
    Rgb sum(0.0f);
    for (const WorldLight& light : world().lights) {
        if (light.is_dome()) sum += light.dome_radiance(direction);
    }
    return sum;
}

}  // namespace frazil
