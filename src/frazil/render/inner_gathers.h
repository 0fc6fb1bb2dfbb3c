// What ice would send from places inside it, gathered on a lattice, for cracks and whatever else paths meet there.
// Model: exitance varies over mean free paths, inside as on the surface, and places inside are met one here, one there, so
//   that a gather at each is dear: a lattice of 0.4 mean free paths, gathered brick by brick where paths come by, and
//   interpolated linearly.
// Units: as CoreSums; metres, where the body's trees stand.
// Valid: thread-safe; a brick's values are the same whoever asks for it first. Within 1 % RMS of a gather
//   right there, .2 % on the mean (tests/cpp/test_inner_gathers.cpp).
// Not: places on the surface (point_gathers.h).
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "frazil/render/core_sums.h"

namespace frazil {

struct Body;

class InnerGathers {
  public:
    // The body has its trees already, of so many light groups.
    InnerGathers(const Body& body, std::size_t groups, const GatherOptions& options);

    // Without overlays, which only the camera asks for.
    const SumColumns& columns() const { return columns_; }
    // Append the row of a place; `rows` begin with these columns.
    void append(const V3f& position, CoreSums& rows) const;

  private:
    using Brick = CoreSums;  // at its nodes
    using Place = std::array<std::int64_t, 3>;
    struct PlaceHash {
        std::size_t operator()(const Place& place) const;
    };
    // Threads that ask for different bricks seldom meet.
    struct Shelf {
        std::mutex mutex;
        std::unordered_map<Place, std::shared_ptr<const Brick>, PlaceHash> bricks;
    };
    static constexpr std::size_t kShelves = 64;

    std::shared_ptr<const Brick> brick(const Place& place) const;
    std::shared_ptr<const Brick> gather_brick(const Place& place) const;

    CoreTrees trees_;
    SumColumns columns_;
    GatherOptions options_;
    double cell_ = 0.0;                      // of the lattice, metres
    std::size_t most_bricks_per_shelf_ = 0;  // that are kept; the rest is gathered whenever it is asked for
    mutable std::array<Shelf, kShelves> shelves_;
};

}  // namespace frazil
