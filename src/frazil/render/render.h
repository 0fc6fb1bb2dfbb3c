// From a scene to a film: points, irradiance, tree, camera rays, gathers, light.
// Model: for every translucent body points -> irradiance -> point tree, once; then tiles of pixels, each in two steps:
//   paths are traced and leave gather requests where they meet ice; the requests of a tile are gathered together.
// Valid: the same bits for any number of threads: random numbers depend on (seed, pixel, sample) alone.
// Not: reading and writing files.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/render/film.h"
#include "frazil/render/scene.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

enum class PixelFilter { box, blackman_harris };

struct RenderOptions {
    int width = 960, height = 540;
    int samples = 32;  // per pixel
    std::uint32_t seed = 0;
    int threads = 0;  // 0 = all cores
    PixelFilter filter = PixelFilter::blackman_harris;
    int max_bounces = 4;         // of diffuse and specular paths after the first hit
    float spacing = 0.0f;        // of all points, metres; 0 = by material
    float spacing_scale = 1.0f;  // multiplies every spacing
    int bake_samples = 64;       // shadow rays per point and light; a quarter as many look for bounced light
    int bake_bounces = 1;        // of light that reaches the points by way of ice and diffuse surfaces
    GatherOptions gather;
};

struct RenderStats {
    std::uint64_t points = 0, nodes = 0, camera_rays = 0, other_rays = 0, bake_rays = 0, gathers = 0;
    std::uint64_t dropped_samples = 0;      // NaN or infinite, left out of the film
    std::vector<std::string> warnings;      // each begins with an object's path
    std::map<std::string, double> seconds;  // per stage: scene, points, bake, tree, render
};

struct RenderResult {
    Film film;
    RenderStats stats;
};

// ValueError for a scene or options out of range; Cancelled where progress asked to stop.
RenderResult render(const Scene& scene, const RenderOptions& options, Progress* progress = nullptr);

}  // namespace frazil
