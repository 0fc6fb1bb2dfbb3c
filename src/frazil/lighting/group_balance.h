// How often each light group is asked, once for a scene: more often where what it gives is uncertain.
// Model: of a group with mean irradiance m over the receivers and visible share v of it, one pick of light has the second
//   moment m² / v; picks by its square root, over m, make all groups alike noisy beside their own light. Groups are
//   compared by that and by what they can give the receiver at hand (group_picker.h): a group's intensity drops out.
// Units: none.
// Valid: the same for any number of threads; with no receiver, or one group, groups are picked evenly.
#pragma once

#include <span>

#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"

namespace frazil {

// Measure the groups from these places and set the scales of the sampler's pickers, before it is used.
void balance_groups(LightSampler& lights, const RayScene& scene, std::span<const LightReceiver> receivers);

}  // namespace frazil
