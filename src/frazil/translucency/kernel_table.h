// A profile's three channels as functions of q = r², cut into octaves with a polynomial each, for SIMD evaluation.
// Model: with u = 1 + q/z0², segment = the upper bits of the float u, so that pieces grow with distance; degree-5
//   polynomials through Chebyshev nodes in each. Slopes and curvatures in q come from the same polynomials.
// Units: q in m², values in 1/m².
// Valid: error times 2 pi r², a ring's share of energy, <= 1e-4 of the albedo (test_translucency.cpp); beyond `reach`,
//   where r² Rd falls under 1e-7 of the albedo, exactly zero. Fitted for relative errors down to that.
// Not: ramps, whose kinks no polynomial takes: they multiply afterwards, exactly.
#pragma once

#include <array>
#include <cstdint>

#include "frazil/translucency/profile.h"

namespace frazil {

struct KernelTable {
    static constexpr int kSegments = 32, kCoefficients = 6;  // the last segment stays zero

    // coefficient[channel][power][segment], in powers of t - 1/2 for t in [0, 1) across the segment
    alignas(64) std::array<std::array<std::array<float, kSegments>, kCoefficients>, 3> coefficient{};
    float inverse_z0_squared = 1.0f;  // u = 1 + q * inverse_z0_squared
    int split = 0;                    // every octave has 2^split segments
    float reach = 0.0f;               // metres; zero beyond
    float last_u = 2.0f;              // first u beyond the last segment in use

    // Value, first and second derivative in q of one channel.
    struct Jet {
        float value, slope, curvature;
    };
    Jet eval(int channel, float q) const;
};

KernelTable tabulate(const Profile& profile);

}  // namespace frazil
