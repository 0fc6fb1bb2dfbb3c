// A patch shared out among its nearest points in double: where floats are not enough to tell whether it is covered.
// Model: that of share_patch in patch_kernel.h, from the positions as they are stored.
// Units: the tile's own (see TileFrame).
// Valid: any number of corners and candidates; about 1e-12 spacings.
// Not: fast.
#pragma once

#include <vector>

#include "frazil/points/patch_kernel.h"

namespace frazil {

// A corner of a share, and by which part of the spacing it is farther than that from its point.
struct ExactGap {
    double x, y;
    double excess;
};

// `worlds` are the positions of the points that the candidates name; `gaps` become the corners that exceed the spacing by
// more than `tolerance`, the farthest first. Without candidates that is the middle of the patch.
void share_exactly(const Patch& patch, const TileFrame& frame, const Candidates& candidates,
                   const std::vector<V3f>& worlds, double tolerance, std::vector<Share>& shares,
                   std::vector<ExactGap>& gaps);

}  // namespace frazil
