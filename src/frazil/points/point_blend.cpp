#include "frazil/points/point_blend.h"

#include <numeric>

#include "frazil/points/point_budget.h"

namespace frazil {
namespace {

// Points that are so many times as dense as their spacing says have one that varies.
constexpr double kVaries = 2.0;

}  // namespace

bool PointBlend::suits(const PointSet& points) {
    if (!(points.spacing > 0.0)) return false;
    const double area = std::accumulate(points.areas.begin(), points.areas.end(), 0.0);
    return double(points.size()) * points.spacing * points.spacing < kVaries * kPointsPerSpacing2 * area;
}

}  // namespace frazil
