// Where a mesh runs through itself.
// Model: two triangles that cross have an edge of one that goes through the other; every edge is followed as a segment by
//   Embree. Triangles that share a vertex of the edge are not asked: they meet it there.
// Valid: any mesh that check_mesh takes. Coordinates are single precision, so a crossing counts only where both ends of
//   the edge are farther from the other's plane than a thousandth of the edge.
// Not: triangles that lie in one plane on top of each other. Edges that touch exactly may count.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/geometry/mesh.h"

namespace frazil {

// The triangles that cross another, in their order.
std::vector<std::int32_t> self_intersections(const Mesh& mesh);

}  // namespace frazil
