// What a render is asked for, and what it tells about itself.
// Units: metres, seconds.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frazil/render/pixel_filter.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

constexpr int kBakeSamples = 32;  // where points are half a free path apart or more

struct RenderOptions {
    int width = 960, height = 540;
    int samples = 32;  // per pixel; the most, where `noise` may end earlier
    // Of a pixel's samples, about how many are shaded, each for those that see alike; the others tell what is seen. 0 = all.
    int shading_samples = 0;
    float noise = 0.0f;    // standard error at which a pixel needs no more samples, relative (FilmSums); 0 = off
    int min_samples = 16;  // per pixel, before `noise` is asked
    std::uint32_t seed = 0;
    int threads = 0;  // 0 = all cores
    PixelFilter filter = PixelFilter::blackman_harris;
    int max_bounces = 4;         // of diffuse and specular paths after the first hit
    float spacing = 0.0f;        // of all points, metres; 0 = by material
    float spacing_scale = 1.0f;  // multiplies every spacing
    // No finer than so many pixels where a surface is: coarse points far from the camera. 0 = off.
    float spacing_pixels = 0.0f;
    // Shadow rays per point and light, and as many that look for bounced light. 0 = kBakeSamples, fewer where points
    // are closer (rays_each.h).
    int bake_samples = 0;
    float bake_error = 0.0f;  // relative error at each point to which the bake takes more samples; 0 = none
    // Shadow rays of the bake go on through ice, dimmed. Off: light that enters ice is counted as diffused there, and what
    // also went straight on would be counted twice; on for thin clear ice, whose light that is.
    bool translucent_shadows = false;
    // Of light that reaches the points by way of ice and diffuse surfaces; from 3 on, all that is left is added (bounces.h).
    int bake_bounces = 4;
    GatherOptions gather;
    std::vector<std::pair<std::string, std::string>> lpes;  // light path expressions: a layer's name, and what it keeps
    std::vector<std::string> aovs;                          // of the table, beside those that are made anyway
    // Sets of objects, by name and index: each gets a layer `matte.NAME` and one `refracted_matte.NAME`.
    std::vector<std::pair<std::string, std::vector<std::uint32_t>>> mattes;
};

struct RenderStats {
    std::uint64_t points = 0, nodes = 0, camera_rays = 0, other_rays = 0, bake_rays = 0, gathers = 0;
    std::uint64_t dropped_samples = 0;      // NaN or infinite, left out of the film
    std::vector<std::string> warnings;      // each begins with an object's path
    std::map<std::string, double> seconds;  // per stage: scene, points, bake, tree, render
};

// ValueError for options out of range.
void check_options(const RenderOptions& options);

}  // namespace frazil
