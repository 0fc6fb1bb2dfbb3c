// Sine, cosine and arc tangent as short polynomials: several times faster than the library's, and the same bits with
// every library.
// Model: arc tangent [Abramowitz1964] 4.4.49; sine and cosine by their series on an eighth of a turn.
// Units: cos_sin_turns takes turns (1 = 2 pi), fast_atan2 gives radians.
// Valid: turns in [0, 1], error below 1e-6; atan2 everywhere, error below 3e-7 (test: trigonometry).
#pragma once

#include "frazil/base/vec.h"

namespace frazil {

// (cos, sin) of 2 pi turns.
inline V2f cos_sin_turns(float turns) {
    const int quarter = static_cast<int>(4.0f * turns + 0.5f);
    const float a = 2.0f * kPi * (turns - 0.25f * static_cast<float>(quarter)), a2 = a * a;
    const float s = a * (1.0f + a2 * (-1.0f / 6.0f + a2 * (1.0f / 120.0f - a2 * (1.0f / 5040.0f))));
    const float c = 1.0f + a2 * (-0.5f + a2 * (1.0f / 24.0f + a2 * (-1.0f / 720.0f + a2 * (1.0f / 40320.0f))));
    const float x = (quarter & 1) ? -s : c, y = (quarter & 1) ? c : s;
    return (quarter & 2) ? V2f(-x, -y) : V2f(x, y);
}

inline float fast_atan2(float y, float x) {
    const float ax = std::abs(x), ay = std::abs(y);
    const float largest = std::max(std::max(ax, ay), 1e-37f);
    const float t = std::min(ax, ay) / largest, t2 = t * t;
    float p = 0.0028662257f;
    for (const float c : {-0.0161657367f, 0.0429096138f, -0.0752896400f, 0.1065626393f, -0.1420889944f, 0.1999355085f,
                          -0.3333314528f, 1.0f}) {
        p = p * t2 + c;
    }
    p *= t;
    if (ay > ax) p = 0.5f * kPi - p;
    if (x < 0.0f) p = kPi - p;
    return std::copysign(p, y);
}

}  // namespace frazil
