// Sine, cosine and arc tangent as short polynomials: several times faster than the library's, and the same bits with
// every library.
// Model: arc tangent [Abramowitz1964] 4.4.49; sine and cosine by their series on an eighth of a turn.
// Units: cos_sin_turns takes turns (1 = 2 pi), fast_atan2 gives radians.
// Valid: turns in [0, 1], error below 1e-6; atan2 everywhere, error below 3e-7 (test: trigonometry).
//   trigonometry-inl.h has the same for SIMD, to the bit.
#pragma once

#include <cstddef>

#include "frazil/base/vec.h"

namespace frazil {

// Polynomials by Horner's rule from the highest power: arc tangent over t and of t², sine over a and cosine of a².
inline constexpr float kAtanTerms[] = {0.0028662257f,  -0.0161657367f, 0.0429096138f,
                                       -0.0752896400f, 0.1065626393f,  -0.1420889944f,
                                       0.1999355085f,  -0.3333314528f, 1.0f};
inline constexpr float kSineTerms[] = {-1.0f / 5040.0f, 1.0f / 120.0f, -1.0f / 6.0f, 1.0f};
inline constexpr float kCosineTerms[] = {1.0f / 40320.0f, -1.0f / 720.0f, 1.0f / 24.0f, -0.5f, 1.0f};

template <std::size_t N>
inline float horner(const float (&terms)[N], float x) {
    float p = terms[0];
    for (std::size_t i = 1; i < N; ++i) p = p * x + terms[i];
    return p;
}

// (cos, sin) of 2 pi turns.
inline V2f cos_sin_turns(float turns) {
    const int quarter = static_cast<int>(4.0f * turns + 0.5f);
    const float a = 2.0f * kPi * (turns - 0.25f * static_cast<float>(quarter)), a2 = a * a;
    const float s = a * horner(kSineTerms, a2), c = horner(kCosineTerms, a2);
    const float x = (quarter & 1) ? -s : c, y = (quarter & 1) ? c : s;
    return (quarter & 2) ? V2f(-x, -y) : V2f(x, y);
}

// A direction about +z whose density is the cosine over pi.
inline V3f cosine_hemisphere(const V2f& u) {
    const V2f circle = cos_sin_turns(u.y) * std::sqrt(u.x);
    return {circle.x, circle.y, std::sqrt(std::max(0.0f, 1.0f - u.x))};
}

inline float fast_atan2(float y, float x) {
    const float ax = std::abs(x), ay = std::abs(y);
    const float largest = std::max(std::max(ax, ay), 1e-37f);
    const float t = std::min(ax, ay) / largest, t2 = t * t;
    float p = t * horner(kAtanTerms, t2);
    if (ay > ax) p = 0.5f * kPi - p;
    if (x < 0.0f) p = kPi - p;
    return std::copysign(p, y);
}

}  // namespace frazil
