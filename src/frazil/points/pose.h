// Points that ride on a moving mesh: same points, same ids, new places, normals and areas.
// Model: a point is a triangle and barycentrics. Areas are shared out anew: triangles are halved until few points can be
//   nearest to a part, and every part is split exactly among those (exact_shares.h).
// Units: metres, m².
// Valid: any point set on any pose, however stretched or folded: nothing is assumed of how the points cover it. Areas sum
//   to the pose's within float rounding and are the same bits for any number of threads.
// Not: as fast as making areas beside the points (tile_filler.h); geodesic: nearest is through the air.
#pragma once

#include <vector>

#include "frazil/geometry/mesh.h"
#include "frazil/points/point_set.h"

namespace frazil {

// The surface of the mesh nearest to each point, on its side where thin_walls; where no point is on a place's side, the
// nearest of all has it.
std::vector<float> areas_on(const PointSet& points, const Mesh& mesh, bool thin_walls = true);

// The same points on another pose of their mesh. The spacing grows as the root of the surface does. ValueError where the
// pose has too few triangles.
PointSet points_on(const PointSet& points, const Mesh& pose, bool thin_walls = true);

// make(mesh), or for a mesh with a rest pose make(rest pose) moved to the mesh, so that its points are those of every pose.
template <class Make>
PointSet place_in_rest(const Mesh& mesh, bool thin_walls, const Make& make) {
    if (mesh.rest.empty() || mesh.rest == mesh.positions) return make(mesh);
    check_mesh(mesh, "Mesh");
    return points_on(make(rest_pose(mesh)), mesh, thin_walls);
}

}  // namespace frazil
