// Which of a pixel's camera samples are shaded, and how many samples each of them stands for.
// Model: decoupled shading. Every camera sample finds what it sees first; samples that see alike (one object, normals and
//   place as on one smooth surface) form a group, and of each run of a group's samples one, chosen at random, is shaded for
//   all of the run. The expectation is that of shading every sample.
// Units: metres, world space.
// Valid: a pure function of the hits and the seed; thread-safe.
// Not: how a sample is shaded (path.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frazil/geometry/ray_scene.h"

namespace frazil {

// What a camera sample sees first.
struct FirstHit {
    Ray ray;  // of the camera
    Hit hit;
    bool is_hit = false;
    bool is_noted = false;  // its object, depth and place are in the tile; only such hits may stand for others
    V3f position = V3f(0.0f), normal = V3f(0.0f);
    float footprint = 0.0f;  // radius of what the pixel sees there
};

struct ShadedSample {
    std::uint32_t sample = 0;  // index into the hits
    float weight = 1.0f;       // samples that it stands for
};

// About `wanted` samples to shade, at least one of each group, and all that no other can stand for. `seed` chooses.
void choose_shaded(std::span<const FirstHit> hits, int wanted, std::uint32_t seed, std::vector<ShadedSample>& shaded);

}  // namespace frazil
