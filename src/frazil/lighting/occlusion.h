// Occlusion at points: how much of the sky each sees, and where the open sky lies.
// Model: ray-traced: the cosine-weighted share of the hemisphere without a hit within a distance, and the mean open
//   direction. Point-based, without rays: every other point is a disk [Bunnell2005]; near ones are drawn into a raster of the
//   hemisphere, far ones add what clusters of them hide to its cells [Christensen2008].
// Units: openness 0 (all hidden) to 1 (nothing in the way); metres.
// Valid: the same bits for any number of threads. Point-based occlusion has an RMS error of
//   0.03 on a creviced body (bench/occlusion.py), that of 50 rays; a finer tolerance does not help, as disks are no surface.
// Not: light.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/points/point_set.h"

namespace frazil {

struct OcclusionOptions {
    int samples = 64;  // rays per point, >= 1
    std::uint32_t seed = 0;
    float distance = std::numeric_limits<float>::infinity();  // within which things occlude, metres
};

struct Occlusion {
    std::vector<float> openness;    // (N)
    std::vector<V3f> bent_normals;  // (N) unit length; the normal where nothing is open
};

// Traces a few points at a time. The scene must outlive it.
class OcclusionBaker {
  public:
    // ValueError for options out of range.
    OcclusionBaker(const RayScene& scene, const OcclusionOptions& options);

    // As many points of a run as keep their rays in the cache.
    std::size_t run_size() const;
    // Of a run of points in an order in which neighbours are near, the `first` in that order and on: openness[run[i]] and
    // bent_normals[run[i]].
    void bake(const PointSet& points, std::span<const std::uint32_t> run, std::size_t first, Occlusion& result) const;

  private:
    const RayScene& scene_;
    OcclusionOptions options_;
    ScrambledNet net_;
};

// ValueError for options out of range or points without normals.
Occlusion bake_occlusion(const PointSet& points, const RayScene& scene, const OcclusionOptions& options = {});

// The same from the points alone: areas stand for the surface. `tolerance` is the solid angle (steradian) below which a
// cluster of points counts as one disk.
Occlusion point_occlusion(const PointSet& points, float distance = std::numeric_limits<float>::infinity(),
                          float tolerance = 0.2f);

}  // namespace frazil
