// Points on a mesh that stand for its surface: where light enters, and what the translucency sum runs over.
// Model: every point has the area of the surface nearest to it; the areas sum to the mesh's.
// Units: metres, m².
// Valid: made by poisson_points or tessellated_points; arrays of equal length.
// Not: irradiance, which belongs to a shot, not to the mesh.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/geometry/mesh.h"

namespace frazil {

struct PointSet {
    std::vector<V3f> positions;
    std::vector<V3f> normals;  // geometric, unit length
    std::vector<float> areas;
    std::vector<std::int32_t> triangles;
    std::vector<V2f> barycentrics;  // of the triangle's second and third corner
    double spacing = 0.0;           // the largest, where it varies

    std::size_t size() const { return positions.size(); }
};

// Make room for `count` points.
void resize(PointSet& points, std::size_t count);

// ValueError where arrays are of unequal length, positions or normals are not finite, areas or the spacing negative;
// `object` is who asks.
void check_points(const PointSet& points, const char* object);

}  // namespace frazil
