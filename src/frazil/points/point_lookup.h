// The point that stands for a place on the surface: the nearest one on its side.
// Model: a hashed grid with cells of the spacing; maximal points (poisson.h) leave no place farther than that from its point.
// Units: metres.
// Valid: thread-safe after construction. Ties go to the lower index.
// Not: places off the surface.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/points/point_set.h"

namespace frazil {

class PointLookup {
  public:
    static constexpr std::uint32_t kNone = ~std::uint32_t(0);

    explicit PointLookup(const PointSet& points);

    // The index of the nearest point whose normal agrees with `normal`, else of the nearest of any normal; kNone where none
    // lies within two spacings.
    std::uint32_t nearest(const V3f& position, const V3f& normal) const;

  private:
    std::uint32_t bucket(std::int64_t x, std::int64_t y, std::int64_t z) const;

    struct Entry {
        V3f position;
        std::uint32_t index;  // of the point
    };

    V3f origin_ = V3f(0.0f);
    double inverse_size_ = 0.0;
    std::uint32_t mask_ = 0;
    std::vector<std::uint32_t> first_;  // of each bucket in entries_; one more than buckets
    std::vector<Entry> entries_;        // of the points, bucket by bucket
    std::vector<V3f> normals_;          // in the same order
};

}  // namespace frazil
