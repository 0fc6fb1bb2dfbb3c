// Regular points like the micropolygon centres of a tessellating renderer: the baseline that Poisson points beat.
// Model: every triangle is cut into a grid of sub-triangles whose edges are at most `edge_length`; one point in the
//   centre of each, with its area [Xie2014, Figure 5].
// Units: metres, m².
// Not: evenly spaced; that is the point of the comparison.
#pragma once

#include "frazil/geometry/mesh.h"
#include "frazil/points/point_set.h"

namespace frazil {

// ValueError where edge_length is not > 0, the mesh has no area, or the points would not fit into memory.
PointSet tessellated_points(const Mesh& mesh, double edge_length);

}  // namespace frazil
