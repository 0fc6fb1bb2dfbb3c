#include "frazil/points/point_set.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/fragment.h"

namespace frazil {

PointSet points_on(const PointSet& points, const Mesh& rest, const Mesh& pose) {
    if (rest.triangles != pose.triangles) {
        throw ValueError(str("Mesh: triangles must be those of the mesh that the points were made on (",
                             rest.triangles.size(), "), got ", pose.triangles.size(),
                             " or another order. Give a pose of the same mesh."));
    }
    PointSet moved = points;
    parallel_for(points.size(), 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::int32_t triangle = points.triangles[i];
            const V3i& t = pose.triangles[triangle];
            const V2f& uv = points.barycentrics[i];
            const V3d position = V3d(pose.positions[t.x]) * (1.0 - uv.x - uv.y) +
                                 V3d(pose.positions[t.y]) * double(uv.x) + V3d(pose.positions[t.z]) * double(uv.y);
            moved.positions[i] = V3f(position);
            moved.normals[i] = unit_normal(pose, triangle);
            const double before = triangle_cross(rest, triangle).length();
            if (before > 0.0) moved.areas[i] *= float(triangle_cross(pose, triangle).length() / before);
        }
    });
    return moved;
}

}  // namespace frazil
