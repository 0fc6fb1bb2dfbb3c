#include "frazil/lighting/light_sampling.h"

namespace frazil {
namespace {

std::vector<WorldLight> to_world(const std::vector<Light>& lights) {
    std::vector<WorldLight> result;
    result.reserve(lights.size());
    for (const Light& light : lights) result.emplace_back(light);
    return result;
}

}  // namespace

LightSampler::LightSampler(const std::vector<Light>& lights)
    : lights_(lights), world_lights_(std::make_shared<const std::vector<WorldLight>>(to_world(lights))) {}

float LightSampler::pick_weight(std::size_t light, const V3f& position) const {
    const float* multipliers = lights_[light].multipliers;
    const float scale = std::max(std::abs(multipliers[int(LightComponent::diffuse)]),
                                 std::abs(multipliers[int(LightComponent::specular)]));
    return scale == 0.0f ? 0.0f : scale * (*world_lights_)[light].importance(position);
}

float LightSampler::pick_total(const V3f& position) const {
    float total = 0.0f;
    for (std::size_t i = 0; i < lights_.size(); ++i) total += pick_weight(i, position);
    return total;
}

LightSample LightSampler::sample(const V3f& position, float u_pick, const V2f& u) const {
    const float total = pick_total(position);
    if (!(total > 0.0f)) return {};
    float left = u_pick * total;
    int picked = -1;
    float weight = 0.0f;
    for (std::size_t i = 0; i < lights_.size(); ++i) {
        const float w = pick_weight(i, position);
        if (w == 0.0f) continue;
        picked = int(i), weight = w;
        if (left < w) break;
        left -= w;
    }
    LightSample sample = sample_one(picked, position, u);
    sample.pdf *= weight / total;
    return sample;
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

void LightSampler::intersect(const V3f& origin, const V3f& direction, float t_max, std::vector<LightHit>& hits) const {
    float total = -1.0f;
    for (std::size_t i = 0; i < lights_.size(); ++i) {
        LightHit hit;
        hit.light = int(i);
        if (!(*world_lights_)[i].intersect(origin, direction, t_max, hit)) continue;
        if (total < 0.0f) total = pick_total(origin);
        hit.pdf *= total > 0.0f ? pick_weight(i, origin) / total : 0.0f;
        hits.push_back(hit);
    }
}

Rgb LightSampler::background(const V3f& direction) const {
    Rgb sum(0.0f);
    for (const WorldLight& light : *world_lights_) {
        if (light.is_dome()) sum += light.dome_radiance(direction);
    }
    return sum;
}

}  // namespace frazil
