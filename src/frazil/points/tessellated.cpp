#include "frazil/points/tessellated.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/patch.h"
#include "frazil/points/point_budget.h"

namespace frazil {
namespace {

// Into how many parts the edges of a triangle are cut; 0 where it has no area.
double cuts(const Mesh& mesh, std::size_t triangle, double edge_length) {
    if (unit_normal(mesh, triangle) == V3f(0.0f)) return 0.0;
    const V3i& t = mesh.triangles[triangle];
    const V3d a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
    const double longest = std::max((b - a).length(), std::max((c - b).length(), (a - c).length()));
    return std::max(1.0, std::ceil(longest / edge_length));
}

}  // namespace

PointSet tessellated_points(const Mesh& mesh, double edge_length) {
    if (!(edge_length > 0.0) || !std::isfinite(edge_length)) {
        throw ValueError(
            str("tessellated_points: edge_length must be > 0 and finite, got ", edge_length, ". It is in metres."));
    }
    check_mesh(mesh, "Mesh");
    double predicted = 0.0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const double n = cuts(mesh, i, edge_length);
        predicted += n * n;
    }
    if (predicted == 0.0) {
        throw ValueError(str("Mesh: area must be > 0, got ", mesh.triangles.size(),
                             " triangles without area. Points need a surface."));
    }
    check_budget(predicted, 2, 0, "edge_length", edge_length);

    std::vector<std::size_t> first(mesh.triangles.size() + 1, 0);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const auto n = static_cast<std::size_t>(cuts(mesh, i, edge_length));
        first[i + 1] = first[i] + n * n;
    }
    PointSet points;
    points.spacing = edge_length;
    resize(points, first.back());
    parallel_for(mesh.triangles.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const auto n = static_cast<int>(cuts(mesh, i, edge_length));
            if (n == 0) continue;
            const V3i& t = mesh.triangles[i];
            const V3d a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
            const V3f normal = unit_normal(mesh, i);
            const double whole = 0.5 * triangle_cross(mesh, i).length();
            const auto area = static_cast<float>(whole / (double(n) * n));
            std::size_t at = first[i];
            const auto put = [&](double u, double v) {
                points.positions[at] = V3f(a * (1.0 - u - v) + b * u + c * v);
                points.normals[at] = normal;
                points.areas[at] = area;
                points.triangles[at] = static_cast<std::int32_t>(i);
                points.barycentrics[at++] = V2f(float(u), float(v));
            };
            // Row by row: the upright sub-triangles, and between them those on their heads.
            for (int row = 0; row < n; ++row) {
                for (int column = 0; column + row < n; ++column) {
                    put((column + 1.0 / 3.0) / n, (row + 1.0 / 3.0) / n);
                    if (column + row + 1 < n) put((column + 2.0 / 3.0) / n, (row + 2.0 / 3.0) / n);
                }
            }
        }
    });
    return points;
}

}  // namespace frazil
