// What each overlay does to the light of the ice that the camera sees: what its opacity can be changed by after a render.
// Model: derivatives of the additive layers by the logarithm of one overlay's opacity: what it scatters itself (diffuse), what
//   it takes from the core below, from the light that enters the points, and from what is seen through the surface. A
//   layer is affine in each opacity, so that the derivative is the whole change for one overlay [Xie2014].
// Units: radiance.
// Valid: exact for one overlay at a time, or several that do not overlap; to first order where they overlap.
// Not: the gloss of the surface, bump, fracture planes inside, and light that bounces on from what an overlay changes.
#pragma once

#include <memory>
#include <vector>

#include "frazil/render/bodies.h"
#include "frazil/render/surface.h"
#include "frazil/render/translucency_sets.h"

namespace frazil {

// Of one overlay at the place that a path shows first: changes relative to the light, by its way.
struct OverlayShare {
    std::uint32_t overlay = 0;  // of its material
    Rgb diffuse = Rgb(0.0f), core = Rgb(0.0f), seen_through = Rgb(0.0f);
    float clearness = 0.0f;  // of what the core leaves out for what is seen through
};

// Of those that are there, by what the covering's slopes tell.
std::vector<OverlayShare> overlay_shares(const Surface& surface, const std::vector<CoveringSlope>& slopes);

// A share's change of light from the core, of which `share` is not seen through.
Rgb change_of_core(const OverlayShare& overlay, const Rgb& share);

// Give every body with overlays a tree of the light that each of them takes from its points: (N, layers * groups). A
// translucency set has one of all of its members' overlays. `layer_of` is by material and its overlay.
void plant_overlay_trees(const Scene& scene, const std::vector<LitPoints>& lit, const TranslucencySets& sets,
                         const std::vector<std::vector<std::uint32_t>>& layer_of, std::size_t groups,
                         std::vector<std::unique_ptr<Body>>& bodies);

}  // namespace frazil
