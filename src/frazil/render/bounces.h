// Light that reaches the points of ice by way of other surfaces: ice lights ice, and diffuse surfaces light ice.
// Model: every point looks around once and keeps which points of ice it sees. Each bounce is one gather at the points
//   themselves, a plain sum (noise-free ones change pictures by a thousandth), compensated so that energy is kept, and one
//   pass along the lines of sight. Ice sends the exitance of the point that is seen, and reflects light as if it came there
//   evenly from all around. Opaque surfaces reflect, diffusely, what comes straight from lights.
//   After three or more, what is left is summed as a geometric series of the last two, per light group and channel.
// Units: W/m².
// Valid: the same bits for any number of threads.
// Not: light that ice throws on opaque surfaces and these throw back; mirror images in ice.
#pragma once

#include "frazil/render/bodies.h"

namespace frazil {

// Scale the light of points by the part that their overlays let enter (SurfaceResolver::entering).
void keep_entering(const std::vector<float>& entering, Irradiance& irradiance);

// Add options.bake_bounces bounces, and what is left after them, to the irradiance of every body's points; `lit` runs along
// with `bodies`.
void add_bounces(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                 const RenderOptions& options, const std::vector<std::unique_ptr<Body>>& bodies,
                 std::vector<LitPoints>& lit, RenderStats& stats, Progress* progress);

}  // namespace frazil
