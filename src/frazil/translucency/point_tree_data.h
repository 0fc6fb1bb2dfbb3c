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

struct TreeNode {
    V3f center{0.0f};                   // of area
    std::array<float, 6> covariance{};  // of area: xx, yy, zz, xy, xz, yz
    V3f power_offset{0.0f};             // centre of power (summed over groups and channels) - center
    float area = 0.0f;
    float footprint = 0.0f;                          // variance along each tangent that the points' own footprints add
    float radius = 0.0f;                             // of the sphere about center that holds all points
    std::uint32_t first_child = 0, child_count = 0;  // no children: a leaf
    std::uint32_t first_point = 0, point_count = 0;
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

    std::vector<TreeNode> nodes;     // root first, level by level
    std::vector<float> node_powers;  // (nodes, 3 groups): Σ E A
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
