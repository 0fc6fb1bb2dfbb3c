// Paths: fracture planes inside ice.
#include <algorithm>

#include "frazil/base/trigonometry.h"
#include "frazil/render/path.h"
#include "frazil/render/path_state.h"

namespace frazil {
// The first fracture plane inside ice that stops the path: each in turn by the chance of its opacity.
bool PathTracer::find_sheet(const Path& path, float length, float& t, V3f& normal, Rgb& color) const {
    const int body = interiors_.filling(path.inside);
    if (body == InsideOf::kNone) return false;
    const IceMaterial& ice = *bodies_[std::size_t(body)]->material;
    if (!ice.has_sheets()) return false;
    // Nothing is seen through so much ice.
    const Rgb sigma = ice.medium.sigma_s_prime + ice.medium.sigma_a;
    const float deepest = 8.0f / std::max(std::min(sigma.x, std::min(sigma.y, sigma.z)), 1e-6f);
    const DensityField* density = interiors_.density(body);
    const float reach = density && ice.density.absorption == 1.0f
                            ? density->place(path.ray.origin, path.ray.direction, deepest, length)
                        : density ? length
                                  : std::min(length, deepest);
    const auto object = static_cast<std::uint32_t>(body);
    FractureRay ray;
    ray.origin = path.ray.origin * resolver_.world_to_rest(object);
    resolver_.world_to_rest(object).multDirMatrix(path.ray.direction, ray.direction);
    ray.radius = path.width, ray.spread = path.spread;
    Sampler coins = path.sampler;
    coins.set_dimension(kSheetDimensions + 32U * path.vertex);
    bool is_found = false;
    for (const Overlay& overlay : ice.overlays) {
        const float opacity = overlay.internal * age_weight(overlay, ice.age);
        if (overlay.pattern.kind != PatternKind::fracture || !(opacity > 0.0f)) continue;
        ray.t_min = 0.5f * overlay.pattern.width + 1e-4f;
        ray.t_max = is_found ? t : reach;
        V3f met_normal;
        if (!find_fracture(overlay.pattern, opacity, ray, coins, t, met_normal)) continue;
        color = overlay.color, is_found = true;
        resolver_.rest_to_world(object).multDirMatrix(met_normal, normal);
    }
    return is_found;
}

// A fracture plane: a thin diffuse sheet that sends half of its light to either side.
bool PathTracer::meet_sheet(Path& path, const V3f& position, const V3f& normal, const Rgb& color, Tile& tile) const {
    const int body = interiors_.filling(path.inside);
    add_matte(path, std::size_t(body), Rgb(1.0f), tile);
    const auto cosine_pdf = [&](const V3f& wi) { return 0.5f * kInvPi * std::abs(normal.dot(wi)); };
    if (!lights_.is_empty()) {
        const float u_pick = path.sampler.next_1d();
        const LightReceiver receiver{position, V3f(0.0f), static_cast<std::uint32_t>(body)};
        const LightSample sample = lights_.sample(receiver, u_pick, path.sampler.next_2d(), LightUse::refraction);
        const float value = cosine_pdf(sample.direction);
        if (sample.pdf > 0.0f && value > 0.0f) {
            bool is_straight = true;
            const Ray shadow{position, sample.direction, 0.0f, sample.distance * (1.0f - 1e-4f)};
            const Rgb visible = visibility(path, sample.light, shadow, path.inside, tile, is_straight);
            const float mis = sample.is_delta || !is_straight ? 1.0f : sample.pdf / (sample.pdf + value);
            const Light& light = lights_.lights()[std::size_t(sample.light)];
            const Rgb lobe = color * (value * multiplier(light, LightComponent::refraction));
            const Rgb arriving = sample.radiance * visible * (mis / sample.pdf);
            Scattering weights = path.weights();
            weights.scale(lobe);
            deliver(path, Component::refraction, weights, group_of_light_[std::size_t(sample.light)], arriving, tile);
            add_lpes_beyond(path, LpeKind::diffuse, std::size_t(body), sample.light, lobe * arriving, tile);
        }
    }
    if (path.scattered >= max_bounces_ || path.inner >= kMaxInnerBounces) {
        IceCore core = path.core;
        core.is_primary = false;
        core.position = position;
        core.normal = V3f(0.0f);
        request_gather(path, core, color, tile);
        return false;
    }
    ++path.scattered, ++path.inner;
    const float u_side = path.sampler.next_1d();
    const V3f local = cosine_hemisphere(path.sampler.next_2d());
    const V3f wi = Frame(u_side < 0.5f ? normal : -normal).to_world(local);
    path.scatter({color, Rgb(0.0f), Rgb(0.0f), cosine_pdf(wi)}, std::size_t(body));
    path.receiver = {position, V3f(0.0f), static_cast<std::uint32_t>(body)};
    path.use = LightUse::refraction;
    path.has_passed = false;
    path.is_delta = false;
    path.has_direct_light = path.sees_lamps = true;
    path.is_glossy = false;
    path.light_share = Rgb(1.0f);
    path.spread += kDiffuseSpread;
    path.add_blur(kDiffuseBlur);
    path.ray = {position, wi};
    IceCore core = path.core;
    core.is_primary = false;
    core.position = position;
    core.normal = V3f(0.0f);
    path.begin_piece(core, bodies_[std::size_t(body)]->material->volume);
    return true;
}

}  // namespace frazil
