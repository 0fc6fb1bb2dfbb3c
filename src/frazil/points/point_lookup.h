// The point that stands for a place on the surface: the nearest one on its side.
// Model: a hashed grid with cells of the spacing; maximal points (poisson.h) leave no place farther than that from its point.
// Units: metres.
// Valid: thread-safe after construction. Ties go to the lower index.
// Not: places off the surface.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "frazil/base/random.h"
#include "frazil/points/point_set.h"

namespace frazil {

class PointLookup {
  public:
    static constexpr std::uint32_t kNone = ~std::uint32_t(0);

    explicit PointLookup(const PointSet& points) : PointLookup(points, points.spacing) {}
    // For visits as far as `reach`, metres.
    PointLookup(const PointSet& points, double reach);

    // The index of the nearest point whose normal agrees with `normal`, else of the nearest of any normal; kNone where none
    // lies within two spacings.
    std::uint32_t nearest(const V3f& position, const V3f& normal) const;

    // The points' indices in the order of the lookup, in which those near to each other mostly are neighbours.
    std::vector<std::uint32_t> order() const;

    // visit(index, k, position, normal), once for every point within reach and for some beyond; index = order()[k].
    // Before any, ahead(k, count) for each run of points that are about to be visited, so that their memory can be asked for.
    template <class Visit, class Ahead>
    void visit(const V3f& position, const Visit& visit, const Ahead& ahead) const;
    template <class Visit>
    void visit(const V3f& position, const Visit& visit) const {
        this->visit(position, visit, [](std::uint32_t, std::uint32_t) {});
    }

  private:
    struct Entry {
        V3f position;
        std::uint32_t index;  // of the point
    };
    // The cell of a place, and how far the next ones are.
    struct At {
        std::array<std::int64_t, 3> cell;
        std::array<std::array<float, 3>, 3> beyond;  // per axis: to the cell before, itself, and after; cells², squared
        float distance2(const std::array<std::uint8_t, 3>& neighbour) const {
            return beyond[0][neighbour[0]] + beyond[1][neighbour[1]] + beyond[2][neighbour[2]];
        }
    };
    // Of a cell, itself included, less one: the near ones first, so that few of the far ones need to be looked at.
    static const std::array<std::array<std::uint8_t, 3>, 27> kNeighbours;
    // Of squared distance, that rounding may take off.
    static constexpr float kRoundoff = 1e-3f;

    At locate(const V3f& position) const;
    std::uint32_t bucket(const At& at, const std::array<std::uint8_t, 3>& neighbour) const {
        return bucket(at.cell[0] + neighbour[0] - 1, at.cell[1] + neighbour[1] - 1, at.cell[2] + neighbour[2] - 1);
    }
    std::uint32_t bucket(std::int64_t x, std::int64_t y, std::int64_t z) const {
        // Cells of a block of eight lie side by side: those about a place are in few cache lines.
        const std::uint32_t block = hash(std::uint32_t(x >> 1), std::uint32_t(y >> 1), std::uint32_t(z >> 1));
        return (block << 3 | std::uint32_t(x & 1) | std::uint32_t(y & 1) << 1 | std::uint32_t(z & 1) << 2) & mask_;
    }

    V3f origin_ = V3f(0.0f);
    double inverse_size_ = 0.0;  // of cells, 1/m
    float size2_ = 0.0f;         // squared size, less what rounding may take off
    std::uint32_t mask_ = 0;
    std::vector<std::uint32_t> first_;  // of each bucket in entries_; one more than buckets
    std::vector<Entry> entries_;        // of the points, bucket by bucket
    std::vector<V3f> normals_;          // in the same order
};

template <class Visit, class Ahead>
void PointLookup::visit(const V3f& position, const Visit& visit, const Ahead& ahead) const {
    const At at = locate(position);
    std::array<std::uint32_t, 27> buckets;  // those that distant cells share are visited once
    std::size_t count = 0;
    // Ask for all of the memory before any of it is waited for.
    for (const auto& neighbour : kNeighbours) {
        if (at.distance2(neighbour) > 1.0f) continue;
        const std::uint32_t b = bucket(at, neighbour);
        if (std::find(buckets.begin(), buckets.begin() + count, b) != buckets.begin() + count) continue;
        buckets[count++] = b;
        __builtin_prefetch(&first_[b]);
    }
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t first = first_[buckets[i]];
        if (first == first_[buckets[i] + 1]) continue;
        __builtin_prefetch(&entries_[first]);
        __builtin_prefetch(&normals_[first]);
        ahead(first, first_[buckets[i] + 1] - first);
    }
    for (std::size_t i = 0; i < count; ++i) {
        for (std::uint32_t k = first_[buckets[i]]; k < first_[buckets[i] + 1]; ++k) {
            visit(entries_[k].index, k, entries_[k].position, normals_[k]);
        }
    }
}

}  // namespace frazil
