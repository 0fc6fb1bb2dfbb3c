// Points as an octree of clusters: all of a point tree that does not depend on the light on it.
// Model: an octree over points in Morton order; a node stands for its points by area, centroid and second moments of its
//   area. Bodies that place the same points share one, and every light and every bounce is a PointTree on it.
// Units: metres.
// Valid: children of a node are contiguous and come after it; its points are contiguous. Read only once it is made.
// Not: the light (point_tree.h).
#pragma once

#include <Imath/half.h>

#include <array>
#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/points/cells.h"
#include "frazil/points/point_set.h"

namespace frazil {

// What a traversal looks at.
struct TreeNode {
    V3f center{0.0f};         // of area
    float radius = 0.0f;      // of a sphere about center that holds all points
    float trace = 0.0f;       // of the covariance of area: mean squared distance from center
    float footprint = 0.0f;   // variance along each tangent that the points' own footprints add
    std::uint32_t first = 0;  // child, or point of a leaf
    std::uint32_t count = 0;  // children, or points of a leaf with kLeafBit

    static constexpr std::uint32_t kLeafBit = 1u << 31;
    bool is_leaf() const { return (count & kLeafBit) != 0; }
    std::uint32_t size() const { return count & ~kLeafBit; }
};

// What an evaluation needs besides.
struct NodeArea {
    float area = 0.0f;
    std::array<float, 6> covariance{};  // of area: xx, yy, zz, and twice xy, xz, yz
};

// The second moments of a point's cell over its area, in half precision, and its normal as an octahedron's map.
struct Footprint {
    std::array<Imath::half, 6> covariance;
    std::array<std::int16_t, 2> normal;
};

struct PointClusters {
    std::size_t source_count = 0;  // points that it was made of, those left out included
    float spacing = 0.0f;
    Box3f bounds;
    std::vector<TreeNode> nodes;             // root first, level by level
    std::vector<NodeArea> areas_of_nodes;    // of each node
    std::vector<std::uint32_t> level_begin;  // first node of each level, and the end of the last

    // Points in Morton order; positions are the centroids of cells where these are known.
    std::vector<std::uint32_t> order;  // which of the source points each is
    std::vector<V3f> positions;
    std::vector<float> areas;
    std::vector<Footprint> footprints;

    std::size_t size() const { return positions.size(); }
};

// Cluster the points; with `cells` they stand for these, else for discs of their area. `is_left_out`, one per point or
// empty, tells which are no part of it.
// ValueError for no points, arrays of unequal length, positions that are not finite or negative areas.
PointClusters cluster_points(const PointSet& points, const Cells* cells = nullptr,
                             const std::vector<char>& is_left_out = {});

// A point's normal, unpacked.
V3f footprint_normal(const Footprint& footprint);

}  // namespace frazil
