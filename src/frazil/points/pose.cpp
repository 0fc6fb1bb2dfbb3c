#include "frazil/points/pose.h"

#include <oneapi/tbb/enumerable_thread_specific.h>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/exact_shares.h"
#include "frazil/points/fixed_point_sums.h"
#include "frazil/points/patch.h"
#include "frazil/points/point_kd_tree.h"

namespace frazil {
namespace {

constexpr std::size_t kGrain = 1024;
constexpr std::size_t kMostCandidates = 12;  // that a part is split among; with more it is halved
constexpr int kMostHalvings = 48;            // where points coincide there is no end

// Shares out triangles among the points nearest to their parts; one per thread, which keeps its memory.
class PartSharer {
  public:
    PartSharer(const PointSet& points, const PointKdTree& tree, bool thin_walls, FixedPointSums& areas)
        : points_(points), tree_(tree), thin_walls_(thin_walls), areas_(areas) {}

    void share(const V3d& a, const V3d& b, const V3d& c, const V3f& normal, double area, int halvings = 0) {
        if (area == 0.0) return;
        const V3d centroid = (a + b + c) / 3.0;
        const double extent =
            std::sqrt(std::max((a - centroid).length2(), std::max((b - centroid).length2(), (c - centroid).length2())));
        bool with_sides = thin_walls_;
        PointKdTree::Nearest nearest = tree_.nearest(centroid, normal, with_sides);
        if (nearest.point == PointKdTree::kNone) {
            with_sides = false;
            nearest = tree_.nearest(centroid, normal, with_sides);
        }
        // Whoever is nearest to some part is no farther from the centroid than this.
        const double reach = (std::sqrt(nearest.distance2) + 2.0 * extent) * (1.0 + 1e-6);
        const bool is_last = halvings == kMostHalvings;
        const std::size_t most = is_last ? points_.size() : kMostCandidates;
        if (!tree_.within(centroid, normal, with_sides, reach * reach, most, found_)) {
            const double ab = (b - a).length2(), bc = (c - b).length2(), ca = (a - c).length2();
            if (ab >= bc && ab >= ca) return halve(a, b, c, normal, area, halvings);
            return bc >= ca ? halve(b, c, a, normal, area, halvings) : halve(c, a, b, normal, area, halvings);
        }
        split(a, b, c, normal, area);
    }

  private:
    // At the middle of ab.
    void halve(const V3d& a, const V3d& b, const V3d& c, const V3f& normal, double area, int halvings) {
        const V3d middle = (a + b) * 0.5;
        share(a, middle, c, normal, 0.5 * area, halvings + 1);
        share(middle, b, c, normal, 0.5 * area, halvings + 1);
    }

    void split(const V3d& a, const V3d& b, const V3d& c, const V3f& normal, double area) {
        std::sort(found_.begin(), found_.end());
        if (found_.size() == 1) return areas_.add(found_[0], area);
        const V3d along = (b - a).normalized(), across = V3d(normal).cross(along);
        PlanePart part;
        for (const V3d& corner : {a, b, c}) part.push({(corner - a).dot(along), (corner - a).dot(across), 0.0});
        seen_.clear();
        for (const std::uint32_t p : found_) {
            const V3d d = V3d(points_.positions[p]) - a;
            seen_.push_back({d.dot(along), d.dot(across), d.length2()});
        }
        shares_.clear();
        double total = 0.0;
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            shares_.push_back(twice_area(nearest_part(part, seen_, i)));
            total += shares_.back();
        }
        // Too thin for double: the first has it.
        if (!(total > 0.0)) return areas_.add(found_[0], area);
        for (std::size_t i = 0; i < seen_.size(); ++i) {
            if (shares_[i] > 0.0) areas_.add(found_[i], area * shares_[i] / total);
        }
    }

    const PointSet& points_;
    const PointKdTree& tree_;
    bool thin_walls_;
    FixedPointSums& areas_;
    std::vector<std::uint32_t> found_;
    std::vector<PlanePoint> seen_;
    std::vector<double> shares_;
};

}  // namespace

std::vector<float> areas_on(const PointSet& points, const Mesh& mesh, bool thin_walls) {
    std::vector<float> areas(points.size());
    const double total = surface_area(mesh);
    if (points.size() == 0 || !(total > 0.0)) return areas;
    const PointKdTree tree(points);
    FixedPointSums sums(points.size(), total);
    oneapi::tbb::enumerable_thread_specific<PartSharer> sharers(
        [&] { return PartSharer(points, tree, thin_walls, sums); });
    parallel_for(mesh.triangle_count(), kGrain, [&](std::size_t begin, std::size_t end) {
        PartSharer& sharer = sharers.local();
        for (std::size_t i = begin; i < end; ++i) {
            const V3f normal = unit_normal(mesh, i);
            if (normal == V3f(0.0f)) continue;
            const V3i& t = mesh.triangles[i];
            sharer.share(V3d(mesh.positions[t.x]), V3d(mesh.positions[t.y]), V3d(mesh.positions[t.z]), normal,
                         0.5 * triangle_cross(mesh, i).length());
        }
    });
    for (std::size_t i = 0; i < areas.size(); ++i) areas[i] = static_cast<float>(sums.at(i));
    return areas;
}

PointSet points_on(const PointSet& points, const Mesh& pose, bool thin_walls) {
    check_mesh(pose, "Mesh");
    const auto triangles = static_cast<std::int64_t>(pose.triangle_count());
    for (const std::int32_t triangle : points.triangles) {
        if (triangle < 0 || triangle >= triangles) {
            throw ValueError(str("Mesh: triangles must be those of the mesh that the points were made on, got ",
                                 triangles, " triangles for a point on triangle ", triangle,
                                 ". Give a pose of the same mesh."));
        }
    }
    PointSet moved = points;
    double area_before = 0.0;
    for (const float area : points.areas) area_before += area;
    parallel_for(points.size(), kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::int32_t triangle = points.triangles[i];
            const V3i& t = pose.triangles[triangle];
            const V2f& uv = points.barycentrics[i];
            moved.positions[i] = V3f(V3d(pose.positions[t.x]) * (1.0 - uv.x - uv.y) +
                                     V3d(pose.positions[t.y]) * double(uv.x) + V3d(pose.positions[t.z]) * double(uv.y));
            const V3f normal = unit_normal(pose, triangle);
            // A triangle that has collapsed has no normal: the point keeps the one it had.
            if (normal != V3f(0.0f)) moved.normals[i] = normal;
        }
    });
    moved.areas = areas_on(moved, pose, thin_walls);
    if (area_before > 0.0) moved.spacing = points.spacing * std::sqrt(surface_area(pose) / area_before);
    return moved;
}

}  // namespace frazil
