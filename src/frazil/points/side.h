// Which points and surfaces lie on the same side, so that the walls of a thin sheet do not compete for points.
// Model: two places are on the same side where the angle of their normals is below 90°: dot > kSameSideCosine. The tiny
//   threshold puts faces that are perpendicular but for rounding, as on a turned box, on different sides everywhere.
// Units: unit normals.
// Valid: a symmetric relation, evaluated in the same order everywhere, so that all stages take the same decision.
// Not: transitive; points on a sphere much smaller than the spacing form several sides.
#pragma once

#include "frazil/base/vec.h"

namespace frazil {

inline constexpr float kSameSideCosine = 1e-6f;

// The cosine that two normals on one side must exceed; any do where walls are not told apart.
inline constexpr float least_cosine(bool thin_walls) {
    return thin_walls ? kSameSideCosine : -4.0f;
}

inline bool is_same_side(const V3f& a, const V3f& b, bool thin_walls) {
    return a.x * b.x + a.y * b.y + a.z * b.z > least_cosine(thin_walls);
}

}  // namespace frazil
