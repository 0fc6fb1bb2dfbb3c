// Vectors, matrices and colour: Imath types under the names that the core uses, and the few functions Imath lacks.
// Model: row vectors as in Imath and USD: world = local * matrix. A default-constructed vector is NOT zero (Imath leaves
//   it as it is), also in a std::vector; a default-constructed matrix is the identity.
// Units: positions in metres; Rgb is linear, Rec.709 primaries unless the scene says otherwise.
// Valid: any finite value.
// Not: spectra.
#pragma once

#include <Imath/ImathBox.h>
#include <Imath/ImathMatrix.h>
#include <Imath/ImathVec.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace frazil {

using Imath::Box3f;
using Imath::M44f;
using Imath::V2f;
using Imath::V3d;
using Imath::V3f;
using Imath::V3i;
using Rgb = Imath::V3f;

inline constexpr float kPi = 3.14159265358979323846f;
inline constexpr float kInvPi = 0.31830988618379067154f;

inline bool is_finite(const V3f& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
inline float max_component(const V3f& v) {
    return std::max(v.x, std::max(v.y, v.z));
}
inline float mean_component(const V3f& v) {
    return (v.x + v.y + v.z) / 3.0f;
}
inline float luminance(const Rgb& c) {
    return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
}
inline Rgb exp(const Rgb& c) {
    return {std::exp(c.x), std::exp(c.y), std::exp(c.z)};
}

// Two unit vectors that make a right-handed orthonormal frame with the unit vector n [Duff2017].
inline std::pair<V3f, V3f> tangent_frame(const V3f& n) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float b = n.x * n.y * a;
    return {V3f(1.0f + sign * n.x * n.x * a, sign * b, -sign * n.x), V3f(b, sign + n.y * n.y * a, -n.y)};
}

// A normal moved by local_to_world, given its inverse: unit length, or zero where the normal is zero.
inline V3f transform_normal(const V3f& n, const M44f& world_to_local) {
    const M44f& m = world_to_local;
    return V3f(m[0][0] * n.x + m[0][1] * n.y + m[0][2] * n.z, m[1][0] * n.x + m[1][1] * n.y + m[1][2] * n.z,
               m[2][0] * n.x + m[2][1] * n.y + m[2][2] * n.z)
        .normalized();
}

}  // namespace frazil
