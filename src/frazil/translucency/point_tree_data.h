// What a point tree is made of inside: shared by its builder (point_tree.cpp) and its evaluation (gather*.cpp).
// Model: an octree over points in Morton order; a node stands for its points by area, power, first moment of its power
//   and second moments of its area about the area's centroid.
// Units: metres.
// Valid: children of a node are contiguous and come after it; its points are contiguous.
// Not: part of the public interface.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"
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
    // Points in Morton order.
    std::vector<V3f> positions, normals;
    std::vector<float> areas;
    std::vector<Rgb> irradiance;  // (points, groups)
};

// The disc-shaped footprint of a point: its radius, given its area.
inline float footprint_radius(float area) {
    return std::sqrt(area * kInvPi);
}

}  // namespace frazil
