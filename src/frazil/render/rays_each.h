// How many rays each point sends where points share what their rays tell: light is blended over a free path or so.
// Model: as many rays to a square of half a free path, however many points stand in it (ScrambledNet::draw_part makes rays
//   of neighbours fill their square together).
// Units: metres.
// Valid: a power of two from `fewest` to `most`, which both are; `most` where the points' spacing is not known.
#pragma once

#include <algorithm>
#include <bit>

#include "frazil/points/point_set.h"
#include "frazil/render/options.h"

namespace frazil {

inline int rays_each(const PointSet& points, float mean_free_path, int most, int fewest) {
    if (!(points.spacing > 0.0f)) return most;
    const double apart = 2.0 * double(points.spacing) / double(mean_free_path);
    const double many = std::clamp(most * apart * apart, double(fewest), double(most));
    return static_cast<int>(std::bit_ceil(static_cast<unsigned>(many)));
}

// Shadow rays per point and light.
inline int bake_samples_each(const PointSet& points, float mean_free_path, const RenderOptions& options) {
    return options.bake_samples > 0 ? options.bake_samples : rays_each(points, mean_free_path, kBakeSamples, 8);
}

}  // namespace frazil
