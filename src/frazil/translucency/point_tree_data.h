// What a point tree is made of inside: shared by its builder (point_tree.cpp) and its evaluation (gather*.cpp).
// Model: an octree over points in Morton order; a node stands for its points by area, power, first moment of its power
//   and second moments of its area about the area's centroid.
// Units: metres.
// Valid: children of a node are contiguous and come after it; its points are contiguous.
// Not: part of the public interface.
#pragma once

#include <Imath/half.h>

#include <array>
#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/points/cells.h"
#include "frazil/translucency/kernel_table.h"
#include "frazil/translucency/point_tree.h"

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
struct NodeMoments {
    float area = 0.0f;
    std::array<float, 6> covariance{};    // of area: xx, yy, zz, and twice xy, xz, yz
    std::array<float, 3> power_offset{};  // twice the way from center to the centre of power over all groups
};

// The second moments of a point's cell over its area, in half precision, and its normal as an octahedron's map.
struct Footprint {
    std::array<Imath::half, 6> covariance;
    std::array<std::int16_t, 2> normal;
};
// From a cell's centroid to its centre of power, over the root of its area.
using PowerLean = std::array<Imath::half, 3>;

struct PointTree::Impl {
    explicit Impl(const Profile& made_of) : profile(made_of) {}

    Profile profile;
    Ramp ramp;
    Rgb ramp_scale;  // of preserve_energy
    KernelTable table;
    std::size_t groups = 1, dropped = 0;
    float spacing = 0.0f;
    Box3f bounds;

    std::vector<TreeNode> nodes;       // root first, level by level
    std::vector<NodeMoments> moments;  // of each node
    std::vector<float> node_powers;    // (nodes, 3 groups): Σ E A
    // Points in Morton order; positions are the centroids of cells where these are known.
    std::vector<V3f> positions;
    std::vector<float> areas;
    std::vector<Footprint> footprints;
    std::vector<PowerLean> leans;  // empty where light is known at points alone
    std::vector<Rgb> irradiance;   // (points, groups)
};

// What a source needs to know of the surface that a point stands for: an elliptic disc in the plane of its normal, of these
// second moments, a little thick where the surface is curved.
struct PointCell {
    Covariance covariance;
    float trace;
    V3f power_offset;  // from the position to the centre of power

    PointCell(const PointTree::Impl& tree, std::uint32_t point);
};

// The linear map from the unit frame to the cell: columns along two tangents and the normal; and how the cell's power
// changes along these, 1 + lean . z. A uniform disc of radius 2 in z's plane has the cell's moments.
struct CellFrame {
    std::array<V3f, 3> axes;
    V3f lean;

    CellFrame(const PointTree::Impl& tree, std::uint32_t point, const PointCell& cell);
    float power_at(const V2f& z) const { return std::max(0.0f, 1.0f + lean.x * z.x + lean.y * z.y); }
};

}  // namespace frazil
