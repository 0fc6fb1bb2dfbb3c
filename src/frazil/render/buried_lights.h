// Lights that lie inside ice, where the points on its surface see none of them.
// Model: signed crossings of closed ice along one ray from the middle and the corners of a light's box.
// Units: metres.
// Valid: closed meshes; a light counts as buried where all nine places lie in the same body.
// Not: lights from infinity.
#pragma once

#include <string>
#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/render/scene.h"

namespace frazil {

// A warning for each, beginning with the light's path.
std::vector<std::string> warnings_of_buried_lights(const Scene& scene, const RayScene& ray_scene,
                                                   const LightSampler& lights);

}  // namespace frazil
