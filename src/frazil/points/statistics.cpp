#include "frazil/points/statistics.h"

#include <limits>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/points/patch.h"
#include "frazil/points/side.h"

namespace frazil {
namespace {

constexpr std::size_t kGrain = 1024;
constexpr double kNone = std::numeric_limits<double>::infinity();

// A k-d tree in an array: the middle of every range splits it along its longest axis.
class NearestPoint {
  public:
    NearestPoint(const PointSet& points, bool thin_walls)
        : points_(points), thin_walls_(thin_walls), order_(points.size()), axes_(points.size()) {
        for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::uint32_t>(i);
        build(0, order_.size());
    }

    // The distance to the nearest point on the side of `normal`, but for the point `self`.
    double distance(const V3d& place, const V3f& normal, std::size_t self = ~std::size_t(0)) const {
        double best2 = kNone;
        search(0, order_.size(), place, normal, self, best2);
        return std::sqrt(best2);
    }

  private:
    void build(std::size_t begin, std::size_t end) {
        if (end - begin < 2) return;
        Box3f box;
        for (std::size_t i = begin; i < end; ++i) box.extendBy(points_.positions[order_[i]]);
        const auto axis = static_cast<std::uint8_t>(box.majorAxis());
        const std::size_t middle = begin + (end - begin) / 2;
        std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                         [&](std::uint32_t a, std::uint32_t b) {
                             const float x = points_.positions[a][axis], y = points_.positions[b][axis];
                             return x != y ? x < y : a < b;
                         });
        axes_[middle] = axis;
        build(begin, middle);
        build(middle + 1, end);
    }

    void search(std::size_t begin, std::size_t end, const V3d& place, const V3f& normal, std::size_t self,
                double& best2) const {
        if (begin == end) return;
        const std::size_t middle = begin + (end - begin) / 2;
        const std::uint32_t point = order_[middle];
        const V3d offset = place - V3d(points_.positions[point]);
        if (point != self && offset.length2() < best2 && is_same_side(points_.normals[point], normal, thin_walls_)) {
            best2 = offset.length2();
        }
        if (end - begin == 1) return;
        const double side = offset[axes_[middle]];
        const bool is_below = side < 0.0;
        is_below ? search(begin, middle, place, normal, self, best2)
                 : search(middle + 1, end, place, normal, self, best2);
        if (side * side >= best2) return;
        is_below ? search(middle + 1, end, place, normal, self, best2)
                 : search(begin, middle, place, normal, self, best2);
    }

    const PointSet& points_;
    bool thin_walls_;
    std::vector<std::uint32_t> order_;
    std::vector<std::uint8_t> axes_;
};

double spread(double sum, double sum2, double count) {
    const double mean = sum / count;
    return mean > 0.0 ? std::sqrt(std::max(0.0, sum2 / count - mean * mean)) / mean : 0.0;
}

}  // namespace

PointStatistics point_statistics(const PointSet& points, const Mesh& mesh, bool thin_walls, std::size_t samples) {
    if (points.size() == 0) throw ValueError("PointSet: points must be 1 or more, got 0. There is nothing to measure.");
    check_mesh(mesh, "Mesh");
    const NearestPoint nearest(points, thin_walls);
    PointStatistics result;
    result.count = points.size();

    std::vector<double> distances(points.size());
    parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            distances[i] = nearest.distance(V3d(points.positions[i]), points.normals[i], i);
    });
    result.min_distance = kNone;
    double sum = 0.0, sum2 = 0.0, with_neighbour = 0.0, area2 = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        result.area_sum += points.areas[i];
        area2 += double(points.areas[i]) * points.areas[i];
        if (distances[i] == kNone) continue;
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
            gaps[begin / kGrain] = std::max(gaps[begin / kGrain], nearest.distance(place, normal));
        }
    });
    for (const double gap : gaps) result.gap = std::max(result.gap, gap);
    return result;
}

}  // namespace frazil
