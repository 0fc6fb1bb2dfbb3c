// The sources that clusters and points of a tree are, as seen from a block of shading points.
// Model: a cluster is one source of its own moments; a point is its cell, an elliptic disc, which is cut into sevens of
//   equal area where it is large against the kernel, or the place alone for the plain sum.
// Units: metres.
// Not: which nodes stand for their points: gather.cpp.
#pragma once

#include <cmath>
#include <vector>

#include "frazil/translucency/gather_kernel.h"
#include "frazil/translucency/opening_rule.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {

// From a box to a place, without branches.
inline float squared_distance(const Box3f& box, const V3f& p) {
    const V3f middle = (box.min + box.max) * 0.5f, half = (box.max - box.min) * 0.5f;
    float sum = 0.0f;
    for (int i = 0; i < 3; ++i) {
        const float d = std::abs(p[i] - middle[i]) - half[i];
        const float outside = 0.5f * (d + std::abs(d));
        sum += outside * outside;
    }
    return sum;
}

class BlockSources {
  public:
    // `has_footprints`: points stand for their cells.
    BlockSources(const PointTree::Impl& tree, const OpeningRule& rule, bool has_footprints);

    void clear() { list_.clear(); }
    void add_cluster(std::uint32_t index);
    // A leaf's points, as seen from a box.
    void add_points(const TreeNode& leaf, const Box3f& box);
    // All that was added since clear().
    const SourceList& settled() {
        list_.settle(tree_.groups);
        return list_;
    }

  private:
    const PointClusters& clusters() const { return *tree_.clusters; }
    void add_point(std::uint32_t p);
    void add_part(std::uint32_t p, const PointCell& cell, V3f center, float share, float largest_squared);
    void add_whole(std::uint32_t p, const PointCell& cell, float largest_squared);
    void add_split(std::uint32_t p, const PointCell& cell, const CellFrame& frame, const V2f& z, float share,
                   float largest_squared);

    const PointTree::Impl& tree_;
    const OpeningRule& rule_;
    bool has_footprints_;
    float farthest_off_;  // metres
    SourceList list_;
    std::vector<V2f> leans_;  // of each group's power in the cell that is being cut
};

}  // namespace frazil
