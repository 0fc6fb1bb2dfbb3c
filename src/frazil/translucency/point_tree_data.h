// What a point tree is made of inside: shared by its builder (point_tree.cpp) and its evaluation (gather*.cpp).
// Model: the light on clusters of points: per group power and where its centre lies. A group's centre does not depend on
//   the other groups, nor on the group's own brightness: sums are linear in every group's light.
// Units: metres.
// Not: part of the public interface.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/translucency/gather_kernel.h"
#include "frazil/translucency/kernel_table.h"
#include "frazil/translucency/opening_rule.h"
#include "frazil/translucency/point_clusters.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

// From a cell's centroid to a centre of power, in parts of 32767 of how far it can be.
using PowerLean = std::array<std::int16_t, 3>;

// How far from a cell's centroid the centre of a power can be.
inline float lean_reach(float cell_trace) {
    return 2.0f * std::sqrt(cell_trace);
}

// ValueError where one of them is not finite.
void check_positions(const V3f* positions, std::size_t count);

// What a tree sums: a profile and a ramp, tabulated.
struct TreeKernel {
    Profile profile;
    Ramp ramp;
    Rgb ramp_scale;  // of preserve_energy
    KernelTable table;

    TreeKernel(const Profile& profile, const Ramp& ramp);

    // Made when a tolerance is first asked for, by any thread. It stays where it is.
    const OpeningRule& rule(float tolerance) const;

  private:
    mutable std::mutex mutex_;
    mutable std::map<float, OpeningRule> rules_;  // by tolerance
};

struct PointTree::Impl {
    std::shared_ptr<const PointClusters> clusters;
    std::shared_ptr<const TreeKernel> kernel;
    std::size_t groups = 1, dropped = 0;

    std::vector<Rgb> irradiance;          // (points, groups), in the clusters' order
    std::vector<PowerLean> leans;         // (points, groups); empty where light is known at points alone
    std::vector<GroupPower> node_powers;  // (nodes, groups): Σ E A, and where it is centred

    // From the centroid of a point's cell to the centre of a group's power; `reach` is lean_reach() of that cell.
    V3f power_offset(std::uint32_t point, std::size_t group, float reach) const {
        if (leans.empty()) return V3f(0.0f);
        const PowerLean& lean = leans[point * groups + group];
        const float unit = reach * (1.0f / 32767.0f);
        return {lean[0] * unit, lean[1] * unit, lean[2] * unit};
    }
};

// What a source needs to know of the surface that a point stands for: an elliptic disc in the plane of its normal, of these
// second moments, a little thick where the surface is curved.
struct PointCell {
    Covariance covariance;
    float trace;

    PointCell(const PointClusters& clusters, std::uint32_t point);
};

// The linear map from the unit frame to the cell: columns along two tangents and the normal. A uniform disc of radius 2 in
// z's plane has the cell's moments.
class CellFrame {
  public:
    CellFrame(const PointClusters& clusters, std::uint32_t point, const PointCell& cell);

    std::array<V3f, 3> axes;
    // How a power with this offset of its centre changes along the two tangents: 1 + lean . z.
    V2f lean_of(const V3f& power_offset) const;

  private:
    std::array<V3f, 3> frame_;
    float factor_[3][3] = {};  // Cholesky's, in that frame
    float least_;              // pivots below are none
};

// A power with that lean at a place z of a cell, over its mean.
inline float power_at(const V2f& lean, const V2f& z) {
    return std::max(0.0f, 1.0f + lean.x * z.x + lean.y * z.y);
}

}  // namespace frazil
