// Poisson points with a spacing that is a function of the place on the mesh: a texture's, or a camera's.
// Model: triangles are halved until their edges are at most two of the spacings there; on each piece the spacing is linear
//   between its corners. Points are placed on the pieces, and then named by the triangles these were cut from.
// Units: metres.
// Valid: what varies over more than two spacings is found wherever it is; for what was sampled poisson.h's guarantees hold.
// Not: detail of a texture that is finer than that.
#pragma once

#include <functional>

#include "frazil/points/poisson.h"

namespace frazil {

// The spacing, > 0, at barycentrics of a triangle's second and third corner. Called by many threads at once.
using SpacingFunction = std::function<float(std::uint32_t triangle, const V2f& barycentrics)>;

// ValueError as from poisson_points, and where more pieces would be needed than points are allowed.
PointSet poisson_points(const Mesh& mesh, const SpacingFunction& spacing, const PoissonOptions& options = {},
                        Progress* progress = nullptr);

}  // namespace frazil
