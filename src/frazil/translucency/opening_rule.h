// How large a cluster may be at a distance, so that a gather keeps to its tolerance.
// Model: a cluster's mean kernel is exact to second order, so its error grows as (size * bend)³, bend the profile's
//   relative change per metre, whatever light is on it, so that a group is held to it also where it alone is dark.
// Units: metres.
// Valid: measured by bench/gather.py on a bunny: 0.01 gives 0.09 % RMS and 0.5 % at worst, 0.003 0.04 % and 0.2 %; by
//   other bodies and lights: docs/translucency.md.
// Not: a bound; it is calibrated.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "frazil/translucency/kernel_table.h"

namespace frazil {

class OpeningRule {
  public:
    OpeningRule(const Profile& profile, const KernelTable& table, bool has_ramp, float tolerance);

    // The largest squared radius of a cluster at squared distance q, by its second moments.
    float largest_squared(float q) const {
        const float u = 1.0f + q * inverse_z0_squared_;
        const std::uint32_t bits = std::bit_cast<std::uint32_t>(u) - std::bit_cast<std::uint32_t>(1.0f);
        return largest_[std::min<std::uint32_t>(bits >> 21, kEntries - 1)];
    }

  private:
    static constexpr int kEntries = 128;  // octaves of u = 1 + q/z0², four pieces each
    float inverse_z0_squared_;
    std::array<float, kEntries> largest_;
};

}  // namespace frazil
