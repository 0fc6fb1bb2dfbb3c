#include "frazil/points/point_set.h"

namespace frazil {

void resize(PointSet& points, std::size_t count) {
    points.positions.resize(count);
    points.normals.resize(count);
    points.areas.resize(count);
    points.triangles.resize(count);
    points.barycentrics.resize(count);
}

}  // namespace frazil
