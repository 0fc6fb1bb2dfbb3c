// The point that stands for a place on the surface: the nearest one on its side.
// Model: a hashed grid with cells of the spacing; maximal points (poisson.h) leave no place farther than that from its point.
// Units: metres.
// Valid: thread-safe after construction. Ties go to the lower index.
// Not: places off the surface.
#pragma once

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

    // The buckets that points around a place are in; those that distant cells share are there once.
    struct Around {
        std::array<std::uint32_t, 27> buckets;
        std::size_t count = 0;
    };
    // A visit's three steps, each of which asks for the memory that the next one reads: what visits many places takes each
    // step for some of them at once.
    Around around(const V3f& position) const;
    // ahead(k, count) for each run of points that are about to be visited, so that the caller's memory can be asked for too.
    template <class Ahead>
    void fetch(const Around& around, const Ahead& ahead) const;
    // visit(index, k, position, normal), once for every point within reach and for some beyond; index = order()[k].
    template <class Visit>
    void visit(const Around& around, const Visit& visit) const;
    // All three.
    template <class Visit>
    void visit(const V3f& position, const Visit& visit) const {
        const Around here = around(position);
        fetch(here, [](std::uint32_t, std::uint32_t) {});
        this->visit(here, visit);
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

template <class Ahead>
void PointLookup::fetch(const Around& around, const Ahead& ahead) const {
    for (std::size_t i = 0; i < around.count; ++i) {
        const std::uint32_t first = first_[around.buckets[i]], last = first_[around.buckets[i] + 1];
        if (first == last) continue;
        __builtin_prefetch(&entries_[first]);
        __builtin_prefetch(&normals_[first]);
        ahead(first, last - first);
    }
}

template <class Visit>
void PointLookup::visit(const Around& around, const Visit& visit) const {
    for (std::size_t i = 0; i < around.count; ++i) {
        for (std::uint32_t k = first_[around.buckets[i]]; k < first_[around.buckets[i] + 1]; ++k) {
            visit(entries_[k].index, k, entries_[k].position, normals_[k]);
        }
    }
}

}  // namespace frazil
