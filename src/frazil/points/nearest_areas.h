// The surface nearest to each point, on its side.
// Model: every fragment is split exactly among the points that are nearest to parts of it (see nearest_piece.h).
// Units: m².
// Valid: points that cover the mesh within their spacing, as poisson_points makes them. The areas sum to the mesh's within
//   float rounding, and are the same bits for any number of threads, as they are summed in fixed point.
// Not: geodesic: nearest is through the air.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/points/tile_filler.h"
#include "frazil/points/tile_grid.h"

namespace frazil {

// darts[tile] are the points of each tile; the result is in that order, tile after tile. `unit` is the reference spacing.
std::vector<float> nearest_areas(const Mesh& mesh, const SpacingField& spacing, const TileGrid& grid, double unit,
                                 bool thin_walls, const std::vector<std::vector<Dart>>& darts, Progress* progress);

}  // namespace frazil
