// What ice sends from each of its points, gathered once, for places that the camera sees by way of other surfaces.
// Model: such places are many and lie anywhere, so that no traversal serves several of them. Exitance varies over mean free
//   paths, and points are nearer to each other than that: a mean of the points around a place, by a kernel as wide as one
//   and a half spacings, comes within a few thousandths of a gather right there.
// Units: as CoreSums; metres.
// Valid: thread-safe after construction.
// Not: what the camera sees itself, which is gathered where it is seen.
#pragma once

#include <memory>
#include <vector>

#include "frazil/points/point_blend.h"
#include "frazil/render/core_sums.h"

namespace frazil {

struct Body;
class PointCloud;

// Whether gathers at all points are worth their time and memory.
struct PointGatherPlan {
    double paths = 0.0;        // of the whole picture, less the points that were gathered at: they are never the more
    std::size_t bytes = 0;     // that are left for all bodies
    GatherOptions gather;      // of the render
    bool keeps_knots = false;  // gathers ask for ramp layers where a body has a ramp

    GatherOptions options_for(const Body& body) const;
};

// Where light is absorbed below points, on the mean over angles.
AbsorbingPlaces absorbing_below(const Body& body, const PointSet& points);

class PointGathers {
  public:
    // Null where the plan has no use for it, or the points' spacing varies. Takes its points and memory off the plan's. The
    // body has its trees already, of so many light groups.
    static std::shared_ptr<const PointGathers> make(const Body& body, const PointCloud& cloud, std::size_t groups,
                                                    PointGatherPlan& plan);

    // Without overlays, which only the camera asks for.
    const SumColumns& columns() const { return at_points_.columns(); }

    // Append the row of a place on the surface with this outward normal; false where no point is near. `rows` begin with these
    // columns.
    bool append(const V3f& position, const V3f& normal, CoreSums& rows) const;

  private:
    PointGathers(PointBlend blend, const SumColumns& columns) : blend_(std::move(blend)), at_points_(columns) {}

    PointBlend blend_;
    CoreSums at_points_;  // in the order of the blend
};

}  // namespace frazil
