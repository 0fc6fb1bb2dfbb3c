// From a scene to a film: points, irradiance, tree, camera rays, gathers, light.
// Model: for every translucent body points -> irradiance -> point tree, once; then tiles of pixels, each in two steps:
//   paths are traced and leave gather requests where they meet ice; the requests of a tile are gathered together. Tiles
//   are rendered in passes of a fixed number of samples; with a noise target only pixels above it take part in the next.
// Valid: the same bits for any number of threads: random numbers depend on (seed, pixel, sample) alone.
// Not: reading and writing files.
#pragma once

#include "frazil/base/progress.h"
#include "frazil/render/bake.h"
#include "frazil/render/checkpoint.h"
#include "frazil/render/film.h"
#include "frazil/render/options.h"
#include "frazil/render/scene.h"

namespace frazil {

struct RenderResult {
    Film film;
    RenderStats stats;
};

struct BakeResult {
    Bake bake;
    RenderStats stats;
};

// What a render would bake first; what is `known` is taken over (make_bake). Errors as for render().
BakeResult bake(const Scene& scene, const RenderOptions& options, Bake known = {}, Progress* progress = nullptr);

// ValueError for a scene or options out of range; Cancelled where progress asked to stop. With a `baked` no point is made
// and no light is baked: it must be of this scene.
RenderResult render(const Scene& scene, const RenderOptions& options, Progress* progress = nullptr,
                    const Bake* baked = nullptr, const Checkpoints* checkpoints = nullptr);

}  // namespace frazil
