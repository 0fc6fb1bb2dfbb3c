// Poisson-disk points on any triangle soup.
// Model: greedy dart throwing in a random order that depends on (mesh, spacing, seed) alone, tile by tile in eight
//   colours, until no surface is left uncovered [Xie2014].
// Guarantees: no two points nearer than `spacing` where their normals agree (or anywhere, with thin_walls = false); no
//   surface farther than `spacing` from the nearest point on its side; areas are the surface nearest to each point and
//   sum to the mesh's; the same bits for any number of threads.
// Units: metres.
// Valid: to the resolution of the float32 positions, which is 6e-8 × the distance from the world's origin.
#pragma once

#include <cstdint>

#include "frazil/base/progress.h"
#include "frazil/geometry/mesh.h"
#include "frazil/points/point_set.h"

namespace frazil {

struct PoissonOptions {
    std::uint32_t seed = 0;
    bool thin_walls = true;  // both sides of a sheet thinner than `spacing` get their own points
    // Refuse, before any work, a spacing that would need more points than this. 0 = what fits into the memory that is
    // free.
    std::uint64_t max_points = 0;
};

// About 0.7 area / spacing² points. ValueError where spacing is not > 0, the mesh has no area, or the points would not
// fit (the message names the smallest spacing that would).
PointSet poisson_points(const Mesh& mesh, double spacing, const PoissonOptions& options = {},
                        Progress* progress = nullptr);

// With a spacing per vertex, linear over each triangle: two points are never nearer than the smaller of their spacings,
// and no surface is farther from the nearest point on its side than the spacing there.
PointSet poisson_points(const Mesh& mesh, const std::vector<float>& vertex_spacing, const PoissonOptions& options = {},
                        Progress* progress = nullptr);

// `count` points within 0.5 %, by the constant spacing that makes so many. ValueError where none does: a closed surface
// needs a few points, one for each side that it has.
PointSet poisson_points_by_count(const Mesh& mesh, std::uint64_t count, const PoissonOptions& options = {},
                                 Progress* progress = nullptr);

}  // namespace frazil
