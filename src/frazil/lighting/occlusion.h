// Occlusion at points: how much of the sky each sees, and where the open sky lies.
// Model: ray-traced: the cosine-weighted share of the hemisphere without a hit within a distance, and the mean open
//   direction. Point-based, without rays: every other point is a disk that hides the solid angle under which it is seen
//   [Bunnell2005], summed over an octree; a second pass weighs each disk by its own openness.
// Units: openness 0 (all hidden) to 1 (nothing in the way); metres.
// Valid: the same bits for any number of threads. Point-based occlusion is too open by 0.08 on the mean of a
//   creviced body, RMS 0.14 to 0.18 (bench/occlusion.py): rays are better at the same cost.
// Not: light.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

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

// ValueError for options out of range or points without normals.
Occlusion bake_occlusion(const PointSet& points, const RayScene& scene, const OcclusionOptions& options = {});

// The same from the points alone: areas stand for the surface. `tolerance` is the solid angle (steradian) below which a
// cluster of points counts as one disk.
Occlusion point_occlusion(const PointSet& points, float distance = std::numeric_limits<float>::infinity(),
                          float tolerance = 0.05f);

}  // namespace frazil
