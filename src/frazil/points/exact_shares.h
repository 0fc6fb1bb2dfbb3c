// A flat polygon shared out among its nearest points in double: where floats are not enough to tell whether a patch is
// covered, and where nothing is known of how the points lie.
// Model: that of share_patch in patch_kernel.h.
// Units: any; for patches the tile's own (see TileFrame).
// Valid: any number of points; about 1e-12 of the polygon's size. Of points at the same place the first has all.
// Not: fast.
#pragma once

#include <vector>

#include "frazil/points/patch_kernel.h"
#include "frazil/points/polygon_clip.h"

namespace frazil {

// A place in a plane, and a quantity that is linear there.
struct PlaneCorner {
    double x, y, spacing;
};
using PlanePart = ClipPolygon<PlaneCorner, 64>;

// A point as the plane sees it: its projection, and its squared distance from the plane's origin.
struct PlanePoint {
    double x, y, s;
};

// The part of the polygon that is nearest to point `self`, and twice a part's area.
PlanePart nearest_part(const PlanePart& polygon, const std::vector<PlanePoint>& points, std::size_t self);
double twice_area(const PlanePart& part);

// A corner of a share, and by which part of the spacing it is farther than that from its point.
struct ExactGap {
    double x, y;
    double excess;
};

// Share a patch out. `worlds` are the positions of the points that the candidates name; `gaps` become the corners that exceed the spacing by
// more than `tolerance`, the farthest first. Without candidates that is the middle of the patch.
void share_exactly(const Patch& patch, const TileFrame& frame, const Candidates& candidates,
                   const std::vector<V3f>& worlds, double tolerance, std::vector<Share>& shares,
                   std::vector<ExactGap>& gaps);

}  // namespace frazil
