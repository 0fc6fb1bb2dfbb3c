#include "frazil/lighting/shadow.h"

#include <algorithm>

#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

constexpr float kNoLight = 1e-4f, kNoLightDepth = 9.2f;  // below it, or deeper than -log of it, light counts as stopped
constexpr float kFarAway = 1e18f;

// How much of a shadow is there, by the distance of what casts it.
float shadow_strength(const ShadowRules& rules, float distance) {
    if (rules.distance < 0.0f || rules.falloff <= 0.0f) return 1.0f;
    const float left = rules.distance - distance;
    if (left >= rules.falloff) return 1.0f;
    return std::pow(std::max(0.0f, left / rules.falloff), rules.falloff_gamma);
}

// The rays that nothing stops, by packets; the others are asked again where something may let light through.
void plain_factors(const RayScene& scene, std::span<const Ray> rays, std::span<Rgb> out) {
    thread_local std::vector<std::uint8_t> is_occluded;
    is_occluded.resize(rays.size());
    scene.are_occluded(rays, is_occluded);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        out[i] = Rgb(is_occluded[i] ? 0.0f : 1.0f);
        if (is_occluded[i] && !scene.passages().empty()) out[i] = transmittance(scene, rays[i]);
    }
}

}  // namespace

Rgb transmittance(const RayScene& scene, const Ray& ray, PlacementMask mask) {
    const std::vector<Passage>& passages = scene.passages();
    Rgb passing(1.0f);
    // The bodies that were entered and not left, as often as they were, in their order; and the one that fills the place.
    std::vector<std::uint32_t> entered;
    const auto filling = [&]() -> const Passage* {
        const Passage* best = nullptr;
        for (const std::uint32_t body : entered) {
            if (!best || passages[body].priority > best->priority) best = &passages[body];
        }
        return best;
    };
    const Passage* inside = nullptr;
    float t = ray.t_min;
    const auto go_on = [&](float end) {
        if (inside) passing *= inside->along(ray.origin + ray.direction * t, ray.direction, end - t);
        t = end;
    };
    Ray left = ray;
    Hit hit;
    while (true) {
        // Where nothing would be left of the light there is nothing to find.
        const float least =
            inside ? std::min({inside->attenuation.x, inside->attenuation.y, inside->attenuation.z}) : 0.0f;
        left.t_max = least > 0.0f ? std::min(ray.t_max, t + kNoLightDepth / least) : ray.t_max;
        if (!scene.intersect(left, hit, mask)) {
            if (left.t_max < ray.t_max) return Rgb(0.0f);
            go_on(std::min(ray.t_max, kFarAway));
            return passing;
        }
        if (hit.placement >= passages.size() || passages[hit.placement].share == 0.0f) return Rgb(0.0f);
        const Passage& passage = passages[hit.placement];
        go_on(hit.t);
        const float facing = -hit.geometric_normal.dot(ray.direction);
        const Passage* const before = inside;
        bool began_inside = false;
        if (facing > 0.0f) {
            entered.push_back(hit.placement);
        } else {
            const auto known = std::find(entered.rbegin(), entered.rend(), hit.placement);
            began_inside = known == entered.rend();
            if (!began_inside) entered.erase(std::next(known).base());
        }
        inside = filling();
        if (began_inside) {
            passing *= passage.along(ray.origin + ray.direction * ray.t_min, ray.direction, hit.t - ray.t_min);
        }
        if (began_inside || !before != !inside) {
            // A slab reflects as much where light leaves it as where it entered, at the angle outside.
            passing *= 1.0f - fresnel_dielectric(std::min(1.0f, std::abs(facing)), passage.eta);
            passing *= passage.tint;
            if (facing > 0.0f) passing *= passage.share;
        }
        if (max_component(passing) < kNoLight) return Rgb(0.0f);
        left.t_min = std::nextafter(hit.t * (1.0f + 1e-6f), std::numeric_limits<float>::infinity());
    }
}

Rgb shadow_factor(const RayScene& scene, const LightSampler& lights, int light, const Ray& ray) {
    const ShadowRules& rules = lights.lights()[std::size_t(light)].shadow;
    if (!rules.is_enabled || rules.distance == 0.0f) return Rgb(1.0f);
    const PlacementMask casters = lights.casters(light);
    Ray within = ray;
    if (rules.distance > 0.0f) within.t_max = std::min(ray.t_max, rules.distance);
    if (!scene.is_occluded(within, casters)) return Rgb(1.0f);
    Rgb passing = !scene.passages().empty() ? transmittance(scene, within, casters) : Rgb(0.0f);
    if (rules.distance > 0.0f && rules.falloff > 0.0f) {
        Hit hit;
        const bool is_hit = scene.intersect(within, hit, casters);
        const float strength = is_hit ? shadow_strength(rules, hit.t) : 0.0f;
        passing = passing * strength + Rgb(1.0f - strength);
    }
    return passing + rules.color * (Rgb(1.0f) - passing);
}

void shadow_factors(const RayScene& scene, const LightSampler& lights, int light, std::span<const Ray> rays,
                    std::span<Rgb> out) {
    if (lights.has_plain_shadow(light)) {
        plain_factors(scene, rays, out);
        return;
    }
    for (std::size_t i = 0; i < rays.size(); ++i) out[i] = shadow_factor(scene, lights, light, rays[i]);
}

void shadow_factors(const RayScene& scene, const LightSampler& lights, std::span<const int> light,
                    std::span<const Ray> rays, std::span<Rgb> out) {
    const bool is_plain =
        std::all_of(light.begin(), light.end(), [&](int index) { return lights.has_plain_shadow(index); });
    if (is_plain) {
        plain_factors(scene, rays, out);
        return;
    }
    for (std::size_t i = 0; i < rays.size(); ++i) out[i] = shadow_factor(scene, lights, light[i], rays[i]);
}

}  // namespace frazil
