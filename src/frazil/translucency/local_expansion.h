// Sums over sources as a polynomial of the place: what shading points that lie close together share.
// Model: the sums are known at kNodes places of a box, eight corners, six on its axes, two in its middle, and between
//   them are the least-squares polynomial of total degree two. The far side of [GreengardRokhlin1987]'s expansions, by
//   values instead of derivatives, so that it holds for any kernel.
// Units: metres.
// Valid: error of third order in the box's size over the kernel's bend, as that of a cluster is; linear in the values.
// Not: how large the box may be: gather.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/translucency/gather_kernel.h"

namespace frazil {

class LocalExpansion {
  public:
    static constexpr std::size_t kNodes = 16, kTerms = 10;

    // Put the nodes into a box that holds the shading points; they become the block's lanes.
    void place(const Box3f& box, BlockSums& nodes);
    // Take the nodes' sums, and to them add those of an expansion `above`, of a box that holds this one, or null.
    void fit(const BlockSums& nodes, std::size_t groups, const LocalExpansion* above = nullptr);
    // The sums at places, as many as `sums` has rows.
    void eval(std::span<const V3f> positions, SumRows& sums) const;

  private:
    V3f middle_{0.0f}, per_half_{0.0f};  // 1 over half the box's sides
    std::array<V3f, kNodes> nodes_;
    SumRows values_, coefficients_;  // kNodes, kTerms
};

}  // namespace frazil
