#include "frazil/points/point_set.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/patch.h"

namespace frazil {

void resize(PointSet& points, std::size_t count) {
    points.positions.resize(count);
    points.normals.resize(count);
    points.areas.resize(count);
    points.triangles.resize(count);
    points.barycentrics.resize(count);
    points.triangle_areas.resize(count);
}

PointSet points_on(const PointSet& points, const Mesh& pose) {
    check_mesh(pose, "Mesh");
    const auto triangles = static_cast<std::int64_t>(pose.triangle_count());
    for (const std::int32_t triangle : points.triangles) {
        if (triangle < 0 || triangle >= triangles) {
            throw ValueError(str("Mesh: triangles must be those of the mesh that the points were made on, got ",
                                 triangles, " triangles for a point on triangle ", triangle,
                                 ". Give a pose of the same mesh."));
        }
    }
    constexpr std::size_t kGrain = 4096;
    PointSet moved = points;
    const double total = parallel_sum(points.size(), kGrain, 0.0, [&](std::size_t begin, std::size_t end) {
        double sum = 0.0;
        for (std::size_t i = begin; i < end; ++i) {
            const std::int32_t triangle = points.triangles[i];
            const V3i& t = pose.triangles[triangle];
            const V2f& uv = points.barycentrics[i];
            moved.positions[i] = V3f(V3d(pose.positions[t.x]) * (1.0 - uv.x - uv.y) +
                                     V3d(pose.positions[t.y]) * double(uv.x) + V3d(pose.positions[t.z]) * double(uv.y));
            moved.normals[i] = unit_normal(pose, triangle);
            moved.triangle_areas[i] = static_cast<float>(0.5 * triangle_cross(pose, triangle).length());
            if (points.triangle_areas[i] > 0.0f) {
                moved.areas[i] = points.areas[i] * (moved.triangle_areas[i] / points.triangle_areas[i]);
            }
            sum += moved.areas[i];
        }
        return sum;
    });
    const double scale = total > 0.0 ? surface_area(pose) / total : 1.0;
    for (float& area : moved.areas) area = static_cast<float>(area * scale);
    return moved;
}

}  // namespace frazil
