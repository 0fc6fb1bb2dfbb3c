#include "frazil/points/nearest_areas.h"

#include <oneapi/tbb/enumerable_thread_specific.h>

#include <atomic>

#include "frazil/base/parallel.h"
#include "frazil/points/fixed_point_sums.h"
#include "frazil/points/side.h"

namespace frazil {
namespace {

constexpr std::size_t kTileGrain = 8;
constexpr double kLongestEdge = 3.0;  // of a fragment, in spacings: larger ones share more of the work per point

// Shares out the fragments of one tile; one per thread, which keeps its memory.
class TileSharer {
  public:
    TileSharer(const Mesh& mesh, const SpacingField& spacing, bool thin_walls)
        : mesh_(mesh), spacing_(spacing), thin_walls_(thin_walls) {}

    void share(const TileFrame& frame, const TileGrid& grid, std::size_t tile,
               const std::vector<std::vector<Dart>>& darts, const std::vector<std::size_t>& first,
               FixedPointSums& areas) {
        fragments_.clear();
        for (std::uint64_t i = grid.starts[tile]; i < grid.starts[tile + 1]; ++i) {
            append_fragments(mesh_, spacing_, frame, grid.triangles[i], kLongestEdge, fragments_);
        }
        float reach = 0.0f;
        for (const Fragment& f : fragments_) reach = std::max(reach, fragment_reach(f));
        near_.reset(frame.size, kCellWidth * reach, reach, least_cosine(thin_walls_));
        for (const Fragment& f : fragments_) {
            const V3f centroid = centroid_of(f);
            near_.mark(centroid, centroid);
        }
        indices_.clear();
        const auto enter = [&](std::size_t from) {
            for_each_around(frame, reach, darts[from], [&](std::size_t i, const V3f& local) {
                near_.add(local, darts[from][i].normal, darts[from][i].position);
                indices_.push_back(first[from] + i);
            });
        };
        enter(tile);
        for (const std::uint32_t other : grid.neighbours(tile)) enter(other);
        for (const Fragment& f : fragments_) share_fragment(f, areas);
    }

  private:
    static V3f centroid_of(const Fragment& f) { return (f.corners[0] + f.corners[1] + f.corners[2]) * (1.0f / 3.0f); }

    void share_fragment(const Fragment& f, FixedPointSums& areas) {
        const V2d e1 = f.uv[1] - f.uv[0], e2 = f.uv[2] - f.uv[0];
        const double area = 0.5 * triangle_cross(mesh_, f.triangle).length() * std::abs(e1.x * e2.y - e1.y * e2.x);
        if (area == 0.0) return;

        const V3f centroid = centroid_of(f);
        float extent2 = 0.0f;
        for (const V3f& corner : f.corners) extent2 = std::max(extent2, (corner - centroid).length2());
        const float reach = fragment_reach(f);
        hits_.clear();
        float least2 = 1e30f;
        near_.any_near(centroid, f.normal, reach * reach, [&](std::uint32_t p) {
            const float d2 = (near_.locals[p] - centroid).length2();
            least2 = std::min(least2, d2);
            hits_.push_back({p, d2});
            return false;
        });
        // Leave out who is farther from any of the fragment than the centroid's nearest is from all of it.
        const float farthest = (std::sqrt(least2) + 2.0f * std::sqrt(extent2)) * 1.0001f;
        candidates_.clear();
        points_.clear();
        for (const Hit& hit : hits_) {
            if (hit.distance2 <= farthest * farthest) push_candidate(f, hit.point);
        }
        if (candidates_.empty()) {
            // Only where floats are too coarse to place a point: the nearest there is takes it.
            std::uint32_t best = 0;
            for (std::uint32_t p = 1; p < near_.count(); ++p) {
                if ((near_.locals[p] - centroid).length2() < (near_.locals[best] - centroid).length2()) best = p;
            }
            if (near_.count() > 0) areas.add(indices_[best], area);
            return;
        }

        if (candidates_.size() == 1) {
            areas.add(indices_[points_[0]], area);
            return;
        }
        const int count = static_cast<int>(candidates_.size());
        int nearest[3];
        find_nearest(candidates_.data(), count, nearest);
        // A region of nearest points is convex: where it has all corners it has the whole fragment.
        if (nearest[0] == nearest[1] && nearest[1] == nearest[2]) {
            areas.add(indices_[points_[nearest[0]]], area);
            return;
        }
        drop_dominated(candidates_.data(), count, nearest, kept_);
        // The nearest first: they cut most, and the parts of far ones are soon seen to be empty.
        std::sort(kept_.begin(), kept_.end(), [&](int a, int b) {
            const double *p = candidates_[a].d, *q = candidates_[b].d;
            const double near_a = p[0] + p[1] + p[2], near_b = q[0] + q[1] + q[2];
            return near_a != near_b ? near_a < near_b : a < b;
        });
        shares_.clear();
        double total = 0.0;
        for (std::size_t i = 0; i + 1 < kept_.size(); ++i) {
            shares_.push_back(share_of(candidates_.data(), kept_, kept_[i]));
            total += shares_.back();
        }
        // The last one has the rest.
        shares_.push_back(std::max(0.0, 1.0 - total));
        total += shares_.back();
        for (std::size_t i = 0; i < kept_.size(); ++i) {
            if (shares_[i] > 0.0) areas.add(indices_[points_[kept_[i]]], area * shares_[i] / total);
        }
    }

    void push_candidate(const Fragment& f, std::uint32_t p) {
        const V3f& place = near_.locals[p];
        candidates_.push_back(
            {{(f.corners[0] - place).length2(), (f.corners[1] - place).length2(), (f.corners[2] - place).length2()}});
        points_.push_back(p);
    }

    const Mesh& mesh_;
    const SpacingField& spacing_;
    bool thin_walls_;
    std::vector<Fragment> fragments_;
    Neighbourhood near_;
    std::vector<std::size_t> indices_;  // of each point in near_, in the whole set
    struct Hit {
        std::uint32_t point;
        float distance2;
    };
    std::vector<Hit> hits_;
    std::vector<CornerDistances> candidates_;
    std::vector<std::uint32_t> points_;
    std::vector<int> kept_;
    std::vector<double> shares_;
};

}  // namespace

std::vector<float> nearest_areas(const Mesh& mesh, const SpacingField& spacing, const TileGrid& grid, double unit,
                                 bool thin_walls, const std::vector<std::vector<Dart>>& darts, Progress* progress) {
    std::vector<std::size_t> first(grid.count() + 1, 0);
    for (std::size_t i = 0; i < grid.count(); ++i) first[i + 1] = first[i] + darts[i].size();
    FixedPointSums sums(first.back(), surface_area(mesh));

    oneapi::tbb::enumerable_thread_specific<TileSharer> sharers(mesh, spacing, thin_walls);
    std::atomic<std::size_t> done = 0;
    parallel_for(grid.count(), kTileGrain, [&](std::size_t begin, std::size_t end) {
        TileSharer& sharer = sharers.local();
        for (std::size_t tile = begin; tile < end; ++tile) {
            sharer.share({grid.tile_origin(tile), unit, grid.size / unit}, grid, tile, darts, first, sums);
        }
        if (progress) progress->update("areas", double(done += end - begin) / double(grid.count()));
    });

    std::vector<float> areas(first.back());
    for (std::size_t i = 0; i < areas.size(); ++i) areas[i] = static_cast<float>(sums.at(i));
    return areas;
}

}  // namespace frazil
