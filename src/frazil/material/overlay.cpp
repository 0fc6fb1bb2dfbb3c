#include "frazil/material/overlay.h"

#include <cmath>

#include "frazil/base/error.h"

namespace frazil {

void check_overlay(const Overlay& overlay, const std::string& path) {
    const auto require = [&](bool holds, const char* rule, double value) {
        if (!holds) throw ValueError(str(path, ": ", rule, ", got ", value, ". Mend the overlay's input."));
    };
    const auto fraction = [&](float value, const char* rule) { require(value >= 0.0f && value <= 1.0f, rule, value); };
    for (int c = 0; c < 3; ++c) fraction(overlay.color[c], "color must be in 0..1");
    fraction(overlay.opacity, "opacity must be in 0..1");
    fraction(overlay.roughness, "roughness must be in 0..1");
    fraction(overlay.scattering, "scattering must be in 0..1");
    fraction(overlay.internal, "internal must be in 0..1");
    if (!overlay.mask.lookup.texture) fraction(overlay.mask.value, "mask must be in 0..1");
    require(std::isfinite(overlay.bump), "bump must be finite", overlay.bump);
    fraction(overlay.age_begin, "age_begin must be in 0..1");
    require(overlay.age_end >= overlay.age_begin && overlay.age_end <= 1.0f, "age_end must be in age_begin..1",
            overlay.age_end);
    check_pattern(overlay.pattern, path);
}

float age_weight(const Overlay& overlay, float age) {
    if (age >= overlay.age_end) return 1.0f;
    if (age <= overlay.age_begin) return 0.0f;
    const float t = (age - overlay.age_begin) / (overlay.age_end - overlay.age_begin);
    return t * t * (3.0f - 2.0f * t);
}

namespace {

// An overlay's opacity where its pattern is full.
float strength_at(const Overlay& overlay, float age, const TexturePoint& texture_at) {
    const float strength = overlay.opacity * age_weight(overlay, age);
    return strength > 0.0f ? strength * std::clamp(eval_float(overlay.mask, texture_at), 0.0f, 1.0f) : 0.0f;
}

}  // namespace

Covering eval_overlays(std::span<const Overlay> overlays, float age, float roughness, const PatternPoint& point,
                       const TexturePoint& texture_at, bool with_slope, std::vector<float>* opacities) {
    Covering all;
    if (opacities) opacities->assign(overlays.size(), 0.0f);
    all.roughness = all.bare_roughness = roughness;
    for (const Overlay& overlay : overlays) {
        const float strength = strength_at(overlay, age, texture_at);
        if (!(strength > 0.0f)) continue;
        PatternPoint at = point;
        const float mask = eval_pattern(overlay.pattern, at);
        if (with_slope && overlay.bump != 0.0f && mask > 0.0f) {
            const float step = std::max(point.footprint, 0.25f * overlay.pattern.width + 1e-5f);
            for (int axis = 0; axis < 3; ++axis) {
                at.position = point.position;
                at.position[axis] += step;
                all.slope[axis] += (eval_pattern(overlay.pattern, at) - mask) * strength * overlay.bump / step;
            }
        }
        const float opacity = strength * mask;
        if (!(opacity > 0.0f)) continue;
        if (opacities) (*opacities)[std::size_t(&overlay - overlays.data())] = opacity;
        const float scattered = opacity * overlay.scattering;
        all.covered = 1.0f - (1.0f - all.covered) * (1.0f - opacity);
        all.scattered = 1.0f - (1.0f - all.scattered) * (1.0f - scattered);
        all.reflectance = all.reflectance * (1.0f - scattered) + overlay.color * scattered;
        all.tint *= Rgb(1.0f) - (Rgb(1.0f) - overlay.color) * opacity;
        all.roughness += (overlay.roughness - all.roughness) * opacity;
    }
    return all;
}

std::vector<CoveringSlope> covering_slopes(std::span<const Overlay> overlays, std::span<const float> opacity) {
    std::vector<CoveringSlope> slopes(overlays.size());
    for (std::size_t k = 0; k < overlays.size(); ++k) {
        if (!(opacity[k] > 0.0f)) continue;
        // As eval_overlays lays them over one another, overlay k by its derivative.
        CoveringSlope& slope = slopes[k];
        Rgb below(0.0f), tint(1.0f);
        float bare = 1.0f, entering = 1.0f;  // but for overlay k
        for (std::size_t j = 0; j < overlays.size(); ++j) {
            const Overlay& overlay = overlays[j];
            const float scattered = opacity[j] * overlay.scattering;
            if (j == k) {
                slope.reflectance = (overlay.color - below) * scattered;
                tint *= (overlay.color - Rgb(1.0f)) * opacity[j];
                continue;
            }
            bare *= 1.0f - opacity[j];
            entering *= 1.0f - scattered;
            if (j < k) below = below * (1.0f - scattered) + overlay.color * scattered;
            if (j > k) slope.reflectance *= 1.0f - scattered;
            tint *= Rgb(1.0f) - (Rgb(1.0f) - overlay.color) * opacity[j];
        }
        slope.tint = tint;
        slope.covered = opacity[k] * bare;
        slope.scattered = opacity[k] * overlays[k].scattering * entering;
    }
    return slopes;
}

}  // namespace frazil
