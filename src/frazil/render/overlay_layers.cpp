#include "frazil/render/overlay_layers.h"

#include <algorithm>
#include <map>
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
    shares.reserve(slopes.size());
    for (std::uint32_t k = 0; k < slopes.size(); ++k) {
        const CoveringSlope& slope = slopes[k];
        if (slope == CoveringSlope()) continue;
        const float seen_through = -slope.covered / bare;
        shares.push_back({k, over(slope.reflectance, covering.reflectance), over(slope.tint, covering.tint),
                          Rgb(seen_through), seen_through + slope.scattered / entering});
    }
    return shares;
}

Rgb change_of_core(const OverlayShare& overlay, const Rgb& share) {
    return overlay.core - over((Rgb(1.0f) - share) * overlay.clearness, share);
}

void plant_overlay_trees(const Scene& scene, const std::vector<LitPoints>& lit, const TranslucencySets& sets,
                         const std::vector<std::vector<std::uint32_t>>& layer_of, std::size_t groups,
                         std::vector<std::unique_ptr<Body>>& bodies) {
    const SurfaceResolver resolver(scene);
    const auto layers_of = [&](std::size_t i) -> const std::vector<std::uint32_t>& {
        return layer_of[scene.objects[i].material];
    };
    // Of each body that stands for itself or for its set: the layers of all that gather with it.
    std::vector<std::vector<std::uint32_t>> layers(bodies.size());
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || lit[i].points.size() == 0) continue;
        std::vector<std::uint32_t>& all = layers[sets.leader(i)];
        for (const std::uint32_t layer : layers_of(i)) {
            if (std::find(all.begin(), all.end(), layer) == all.end()) all.push_back(layer);
        }
    }
    // As much of the light of a body's points, and of its moments, as each overlay takes: (N, columns * groups).
    const auto taken_of = [&](std::size_t i, const std::vector<std::uint32_t>& columns, const auto& values) {
        using Values = std::remove_cvref_t<decltype(values)>;
        Values result(values.size() * columns.size(), typename Values::value_type(0.0f));
        if (values.empty()) return result;
        const std::vector<float> taken =
            resolver.taken_by_overlays(static_cast<std::uint32_t>(i), lit[i].points.in_world());
        const std::size_t overlays = layers_of(i).size();
        for (std::size_t k = 0; k < overlays; ++k) {
            const auto column =
                static_cast<std::size_t>(std::find(columns.begin(), columns.end(), layers_of(i)[k]) - columns.begin());
            for (std::size_t n = 0; n < lit[i].points.size(); ++n) {
                for (std::size_t g = 0; g < groups; ++g) {
                    result[(n * columns.size() + column) * groups + g] =
                        values[n * groups + g] * -taken[n * overlays + k];
                }
            }
        }
        return result;
    };
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (layers[i].empty()) continue;
        const std::size_t columns = layers[i].size() * groups;
        const auto all_taken = [&](auto LitPoints::*values) {
            std::map<std::size_t, std::remove_cvref_t<decltype(lit[i].*values)>> of_member;
            const auto of = [&](std::size_t member) {
                const auto [found, is_new] = of_member.try_emplace(member);
                if (is_new) found->second = taken_of(member, layers[i], lit[member].*values);
                return &found->second;
            };
            return sets.united(i, columns, of);
        };
        bodies[i]->overlay_layers = layers[i];
        bodies[i]->trees.overlays = make_tree(sets.points(i), bodies[i]->kernel, all_taken(&LitPoints::irradiance),
                                              columns, all_taken(&LitPoints::moments));
    }
    for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (!bodies[i] || sets.is_leader(i)) continue;
        bodies[i]->overlay_layers = bodies[sets.leader(i)]->overlay_layers;
        bodies[i]->trees.overlays = bodies[sets.leader(i)]->trees.overlays;
    }
}

}  // namespace frazil
