// How good a point set is: nearest pair, largest gap, and how evenly points and areas are spread.
// Model: distances through the air between places on the same side (see side.h); the gap is the largest distance from the
//   surface to its nearest point, over a stratified random sampling of the surface.
// Units: metres; spreads are standard deviations over means.
// Valid: any point set. The sampled gap is a lower bound of the true one.
// Not: a spectrum; bench/points.py draws that.
#pragma once

#include "frazil/geometry/mesh.h"
#include "frazil/points/point_set.h"

namespace frazil {

struct PointStatistics {
    std::size_t count = 0;
    double min_distance = 0.0;   // of any two points on the same side; infinite for a point alone
    double mean_distance = 0.0;  // from a point to its nearest
    double distance_spread = 0.0;
    double gap = 0.0;
    double mean_area = 0.0;
    double area_spread = 0.0;
    double area_sum = 0.0;
};

// `samples` places on the surface are looked up; 0 means 10 a point, at least 100,000.
PointStatistics point_statistics(const PointSet& points, const Mesh& mesh, bool thin_walls = true,
                                 std::size_t samples = 0);

}  // namespace frazil
