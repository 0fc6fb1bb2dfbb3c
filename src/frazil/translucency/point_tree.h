// The octree of points with their irradiance, and the sum over it: where translucency comes from.
// Model: [JensenBuhler2002]; clusters carry area- and power-weighted centres, and one traversal gives both
//   S_g = Σ E_gk Rd(r_k) ramp(r_k) A_k per light group and W = Σ Rd(r_k) A_k over the very same cut.
// Units: metres; irradiance and exitance in W/m² (or whatever unit the lights have).
// Valid: thread-safe after construction; results do not depend on the number of threads, to the bit.
// Not: the lights. Points with non-finite irradiance are left out and counted.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/points/cells.h"
#include "frazil/points/point_set.h"
#include "frazil/translucency/point_clusters.h"
#include "frazil/translucency/profile.h"
#include "frazil/translucency/ramp.h"

namespace frazil {

enum class Estimator {
    noise_free,  // kernel averaged over the cell of each point, or over a disc of its area where cells are unknown
    sum,         // the plain sum of [JensenBuhler2002]
};

struct GatherOptions {
    float tolerance = 0.003f;  // relative error of a gather that clustering may make; > 0
    Estimator estimator = Estimator::noise_free;
    bool ramp_layers = false;  // keep S per knot of the ramp
};

struct Gathered {
    std::size_t groups = 1;
    std::vector<Rgb> exitance;  // S, (M, groups), without area compensation
    std::vector<Rgb> coverage;  // W, (M), without ramp
    // With ramp_layers, (M, knots, groups): S per hat function of the ramp, without preserve_energy. The sum of knot
    // colour times layer, times energy_scale, is the exitance that a ramp of these colours would give.
    std::size_t knots = 0;
    std::vector<Rgb> layers;
};

// What trees sum, made once for all that sum the same.
struct TreeKernel;
std::shared_ptr<const TreeKernel> make_tree_kernel(const Profile& profile, const Ramp& ramp = {});

class PointTree {
  public:
    struct Impl;

    // `irradiance` is (N, groups), row by row: irradiance[k * groups + g]. With `cells` it is a mean over each cell, and
    // `moments`, (N, groups) or empty, its covariance with the place in the cell, all channels together (Irradiance).
    // ValueError where sizes disagree.
    PointTree(const PointSet& points, std::vector<Rgb> irradiance, std::size_t groups, const Profile& profile,
              const Ramp& ramp = {}, const Cells* cells = nullptr, const std::vector<V3f>& moments = {});
    // The light on points that are clustered already, in the order of the points that these were made of. Values that are
    // not finite count as none here: the point's area stays.
    PointTree(std::shared_ptr<const PointClusters> clusters, std::shared_ptr<const TreeKernel> kernel,
              const std::vector<Rgb>& irradiance, std::size_t groups, const std::vector<V3f>& moments = {});
    ~PointTree();
    PointTree(PointTree&&) noexcept;
    PointTree& operator=(PointTree&&) noexcept;

    // Gather at M positions, in any order; nearby ones share a traversal.
    // ValueError for a tolerance <= 0 or positions that are not finite.
    Gathered gather(const V3f* positions, std::size_t count, const GatherOptions& options = {}) const;

    // The same without clusters and tables: every point, in double precision. Slow; what tests compare with.
    Gathered gather_exact(const V3f* positions, std::size_t count, Estimator estimator = Estimator::noise_free) const;

    const Profile& profile() const;
    std::size_t point_count() const;
    std::size_t node_count() const;
    std::size_t dropped_count() const;  // points left out for their non-finite irradiance

  private:
    std::unique_ptr<Impl> impl_;
};

}  // namespace frazil
