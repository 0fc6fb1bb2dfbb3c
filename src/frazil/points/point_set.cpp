#include "frazil/points/point_set.h"

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"

namespace frazil {
namespace {

// Metres; squares of distances stay in float's range.
constexpr float kFarthest = 1e15f;

}  // namespace

void resize(PointSet& points, std::size_t count) {
    points.positions.resize(count);
    points.normals.resize(count);
    points.areas.resize(count);
    points.triangles.resize(count);
    points.barycentrics.resize(count);
}

void check_points(const PointSet& points, const char* object) {
    const std::size_t n = points.size();
    if (points.areas.size() != n || points.normals.size() != n) {
        throw ValueError(str(object, ": points must have a normal and an area each, got ", n, " positions, ",
                             points.normals.size(), " normals, ", points.areas.size(),
                             " areas. Make them with poisson_points."));
    }
    if (!(points.spacing >= 0.0 && std::isfinite(points.spacing))) {
        throw ValueError(str(object, ": spacing of the points must be >= 0 and finite, got ", points.spacing,
                             ". It is the distance of neighbours, in metres."));
    }
    parallel_for(n, 8192, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const V3f& p = points.positions[k];
            if (!is_finite(p)) {
                throw ValueError(str(object, ": positions must be finite, got NaN or infinity at point ", k,
                                     ". Leave that point out."));
            }
            if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > kFarthest) {
                throw ValueError(str(object, ": positions must be within ", kFarthest, " m of the origin, got ", p.x,
                                     ", ", p.y, ", ", p.z, " at point ", k, ". Bring the body nearer."));
            }
            if (!is_finite(points.normals[k])) {
                throw ValueError(str(object, ": normals must be finite, got NaN or infinity at point ", k,
                                     ". Leave that point out."));
            }
            if (!(points.areas[k] >= 0.0f && std::isfinite(points.areas[k]))) {
                throw ValueError(str(object, ": areas must be >= 0 and finite, got ", points.areas[k], " at point ", k,
                                     ". It is the surface that the point stands for, in m²."));
            }
        }
    });
}

}  // namespace frazil
