// A few hundred of the places where a picture asks for light: what the camera sees, and what is seen from there.
// Model: rays through a grid over the picture, stratified, then one by the cosine from each hit.
// Units: metres, world space.
// Valid: the same for any number of threads, samples and sizes of the picture of one aspect.
// Not: what is seen through ice or transparency.
#pragma once

#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_picker.h"
#include "frazil/render/camera.h"

namespace frazil {

std::vector<LightReceiver> receivers_in_view(const Camera& camera, float aspect, const RayScene& scene);

}  // namespace frazil
