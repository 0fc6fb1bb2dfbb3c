// Morton codes: positions in a box on a Z-shaped curve, so that what is near in space is near in memory.
// Model: 21 bits an axis, interleaved.
// Units: none.
// Valid: positions outside the box take the code of the nearest cell inside.
// Not: a measure of distance.
#pragma once

#include <algorithm>
#include <cstdint>

#include "frazil/base/vec.h"

namespace frazil {

inline constexpr int kMortonBits = 21;

inline std::uint64_t spread_bits(std::uint64_t x) {
    x &= 0x1fffffu;
    x = (x | x << 32) & 0x001f00000000ffffu;
    x = (x | x << 16) & 0x001f0000ff0000ffu;
    x = (x | x << 8) & 0x100f00f00f00f00fu;
    x = (x | x << 4) & 0x10c30c30c30c30c3u;
    x = (x | x << 2) & 0x1249249249249249u;
    return x;
}

class MortonGrid {
  public:
    explicit MortonGrid(const Box3f& box) : origin_(box.min) {
        const V3f size = box.size();
        const float side = std::max(size.x, std::max(size.y, size.z));
        scale_ = side > 0.0f ? (1 << kMortonBits) / side : 0.0f;
    }

    std::uint64_t code(const V3f& p) const {
        return spread_bits(cell(p.x - origin_.x)) << 2 | spread_bits(cell(p.y - origin_.y)) << 1 |
               spread_bits(cell(p.z - origin_.z));
    }

  private:
    std::uint64_t cell(float offset) const {
        constexpr float last = (1 << kMortonBits) - 1;
        return static_cast<std::uint64_t>(std::clamp(offset * scale_, 0.0f, last));
    }

    V3f origin_;
    float scale_ = 0.0f;
};

}  // namespace frazil
