// Which places of a pixel lie together: cells over the box of the places.
// Model: equal cells no larger than a size, as few as fill the box; places closer together than the size are mostly in
//   one, where a grid that stands still would cut half of such pairs apart.
// Units: metres.
// Not: places outside the box.
#pragma once

#include <cmath>
#include <cstdint>

#include "frazil/base/random.h"
#include "frazil/base/vec.h"

namespace frazil {

class PlaceCells {
  public:
    PlaceCells(const Box3f& box, float size) : origin_(box.min) {
        for (int axis = 0; axis < 3; ++axis) {
            const float extent = box.max[axis] - box.min[axis], cells = std::ceil(extent / size);
            // A hair wider, so that the far side is in the last one.
            scale_[axis] = cells > 1.0f ? 0.9999f * cells / extent : 0.0f;
        }
    }

    // A number of the cell that a place lies in.
    std::uint32_t cell(const V3f& place) const {
        const auto along = [&](int axis) {
            return static_cast<std::uint32_t>(static_cast<std::int64_t>((place[axis] - origin_[axis]) * scale_[axis]));
        };
        return hash(along(0), along(1), along(2));
    }

  private:
    V3f origin_, scale_;
};

}  // namespace frazil
