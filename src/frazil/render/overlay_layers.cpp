#include "frazil/render/overlay_layers.h"

#include <algorithm>
#include <type_traits>

namespace frazil {
namespace {

// Below this nothing is left that a change could be relative to.
constexpr float kNothing = 1e-4f;

Rgb over(const Rgb& change, const Rgb& value) {
    Rgb result(0.0f);
    for (int c = 0; c < 3; ++c) result[c] = value[c] > 0.0f ? change[c] / value[c] : 0.0f;
    return result;
}

}  // namespace

std::vector<OverlayShare> overlay_shares(const Surface& surface, const std::vector<CoveringSlope>& slopes) {
    const Covering& covering = surface.covering;
    const float bare = std::max(kNothing, 1.0f - covering.covered),
                entering = std::max(kNothing, 1.0f - covering.scattered);
    std::vector<OverlayShare> shares;
    // Those that are not here count too: light to the points around here is theirs.
    for (std::uint32_t k = 0; k < slopes.size(); ++k) {
        const CoveringSlope& slope = slopes[k];
        const float seen_through = -slope.covered / bare;
        shares.push_back({k, over(slope.reflectance, covering.reflectance), over(slope.tint, covering.tint),
                          Rgb(seen_through), seen_through + slope.scattered / entering});
    }
    return shares;
}

Rgb change_of_core(const OverlayShare& overlay, const Rgb& share) {
    return overlay.core - over((Rgb(1.0f) - share) * overlay.clearness, share);
}

void plant_overlay_trees(const Scene& scene, const std::vector<LitPoints>& lit, std::size_t groups,
                         std::vector<std::unique_ptr<Body>>& bodies) {
    const SurfaceResolver resolver(scene);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0 || bodies[i]->material->overlays.empty()) continue;
        const std::size_t overlays = bodies[i]->material->overlays.size(), count = lit[i].points.size();
        const std::vector<float> taken =
            resolver.taken_by_overlays(static_cast<std::uint32_t>(i), lit[i].points.in_world());
        // As much of the light, and of its moments, as each overlay takes.
        const auto taken_of = [&](const auto& values) {
            std::remove_cvref_t<decltype(values)> result(values.size() * overlays);
            for (std::size_t n = 0; n < count && !values.empty(); ++n) {
                for (std::size_t k = 0; k < overlays; ++k) {
                    for (std::size_t g = 0; g < groups; ++g) {
                        result[(n * overlays + k) * groups + g] = values[n * groups + g] * -taken[n * overlays + k];
                    }
                }
            }
            return result;
        };
        bodies[i]->to_own_points = lit[i].points.to_cloud();
        bodies[i]->overlay_tree = make_tree(lit[i].points, bodies[i]->kernel, taken_of(lit[i].irradiance),
                                            overlays * groups, taken_of(lit[i].moments));
    }
}

}  // namespace frazil
