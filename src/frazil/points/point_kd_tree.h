// The nearest points to any place, however the points lie: what statistics and areas on a moved mesh ask.
// Model: a k-d tree in an array: the middle of every range splits it along its longest axis.
// Units: metres; distances in double between float positions.
// Valid: any points, also coincident ones; thread-safe after construction; the points must outlive it.
// Not: as fast as tiles (tile_filler.h), which know that points keep their distance.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "frazil/points/point_set.h"
#include "frazil/points/side.h"

namespace frazil {

class PointKdTree {
  public:
    static constexpr std::uint32_t kNone = ~std::uint32_t(0);
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    explicit PointKdTree(const PointSet& points);

    struct Nearest {
        std::uint32_t point = kNone;
        double distance2 = kInfinity;
    };

    // The nearest point but for the point `self`; of those on the side of `normal` (side.h) where thin_walls.
    Nearest nearest(const V3d& place, const V3f& normal, bool thin_walls, std::uint32_t self = kNone) const {
        Nearest best;
        search(0, order_.size(), {place, normal, thin_walls}, self, best);
        return best;
    }

    // Find the points within `distance2`, on the side of `normal` as above; ends, with false, where there are more than
    // `most`.
    bool within(const V3d& place, const V3f& normal, bool thin_walls, double distance2, std::size_t most,
                std::vector<std::uint32_t>& found) const {
        found.clear();
        return collect(0, order_.size(), {place, normal, thin_walls}, distance2, most, found);
    }

  private:
    void build(std::size_t begin, std::size_t end);
    struct Query {
        const V3d& place;
        const V3f& normal;
        bool thin_walls;
    };
    bool is_seen(const Query& query, std::uint32_t point) const {
        return is_same_side(points_.normals[point], query.normal, query.thin_walls);
    }
    void search(std::size_t begin, std::size_t end, const Query& query, std::uint32_t self, Nearest& best) const;
    bool collect(std::size_t begin, std::size_t end, const Query& query, double distance2, std::size_t most,
                 std::vector<std::uint32_t>& found) const;

    const PointSet& points_;
    std::vector<std::uint32_t> order_;
    std::vector<std::uint8_t> axes_;
};

}  // namespace frazil
