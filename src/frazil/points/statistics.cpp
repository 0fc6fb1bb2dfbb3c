#include "frazil/points/statistics.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/points/patch.h"
#include "frazil/points/point_kd_tree.h"

namespace frazil {
namespace {

constexpr std::size_t kGrain = 1024;
double spread(double sum, double sum2, double count) {
    const double mean = sum / count;
    return mean > 0.0 ? std::sqrt(std::max(0.0, sum2 / count - mean * mean)) / mean : 0.0;
}

}  // namespace

PointStatistics point_statistics(const PointSet& points, const Mesh& mesh, bool thin_walls, std::size_t samples) {
    if (points.size() == 0) throw ValueError("PointSet: points must be 1 or more, got 0. There is nothing to measure.");
    check_mesh(mesh, "Mesh");
    const PointKdTree tree(points);
    PointStatistics result;
    result.count = points.size();

    std::vector<double> distances(points.size());
    parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const V3d place(points.positions[i]);
            distances[i] = std::sqrt(tree.nearest(place, points.normals[i], thin_walls, std::uint32_t(i)).distance2);
        }
    });
    result.min_distance = PointKdTree::kInfinity;
    double sum = 0.0, sum2 = 0.0, with_neighbour = 0.0, area2 = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        result.area_sum += points.areas[i];
        area2 += double(points.areas[i]) * points.areas[i];
        if (distances[i] == PointKdTree::kInfinity) continue;
        result.min_distance = std::min(result.min_distance, distances[i]);
        sum += distances[i];
        sum2 += distances[i] * distances[i];
        with_neighbour += 1.0;
    }
    if (with_neighbour > 0.0) {
        result.mean_distance = sum / with_neighbour;
        result.distance_spread = spread(sum, sum2, with_neighbour);
    }
    result.mean_area = result.area_sum / double(points.size());
    result.area_spread = spread(result.area_sum, area2, double(points.size()));

    // One random place in each of `samples` equal shares of the surface.
    std::vector<double> cumulative(mesh.triangle_count());
    double area = 0.0;
    for (std::size_t i = 0; i < cumulative.size(); ++i) cumulative[i] = area += 0.5 * triangle_cross(mesh, i).length();
    if (!(area > 0.0)) throw ValueError("Mesh: area must be > 0, got 0. Give the mesh that the points are on.");
    if (samples == 0) samples = std::max<std::size_t>(100000, 10 * points.size());
    std::vector<double> gaps((samples + kGrain - 1) / kGrain, 0.0);
    parallel_for(samples, kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const auto id = static_cast<std::uint32_t>(i);
            const double at = (double(i) + to_unit_float(hash(id, 1))) / double(samples) * area;
            const auto triangle = std::min<std::size_t>(
                std::upper_bound(cumulative.begin(), cumulative.end(), at) - cumulative.begin(), cumulative.size() - 1);
            const V3f normal = unit_normal(mesh, triangle);
            if (normal == V3f(0.0f)) continue;
            double u = to_unit_float(hash(id, 2)), v = to_unit_float(hash(id, 3));
            if (u + v > 1.0) {
                u = 1.0 - u;
                v = 1.0 - v;
            }
            const V3i& t = mesh.triangles[triangle];
            const V3d place =
                V3d(mesh.positions[t.x]) * (1.0 - u - v) + V3d(mesh.positions[t.y]) * u + V3d(mesh.positions[t.z]) * v;
            gaps[begin / kGrain] =
                std::max(gaps[begin / kGrain], std::sqrt(tree.nearest(place, normal, thin_walls).distance2));
        }
    });
    for (const double gap : gaps) result.gap = std::max(result.gap, gap);
    return result;
}

}  // namespace frazil
