// How the light that leaves a light depends on its direction: cone, focus and a luminaire's profile.
// Model: UsdLuxShapingAPI. Beyond the cone's angle nothing; a smooth step from (1 - softness) angle to angle. Focus
//   multiplies by mix(focus_tint, 1, |cos|^focus). A profile (ies_profile.h) multiplies by its intensity, or by that over
//   its mean.
// Units: degrees.
// Valid: angle in 0..180, 180 = no cone; softness >= 0 (more than 1 is 1) and focus >= 0. Angles are those from the light's
//   axis (-z) for every shape.
#pragma once

#include <memory>

#include "frazil/base/vec.h"
#include "frazil/lighting/ies_profile.h"

namespace frazil {

struct Shaping {
    float cone_angle = 180.0f;
    float cone_softness = 0.0f;
    float focus = 0.0f;
    Rgb focus_tint = Rgb(0.0f);
    std::shared_ptr<const IesProfile> ies;  // none = shines alike
    float ies_angle_scale = 0.0f;
    bool ies_normalize = false;

    bool is_neutral() const { return !has_cone() && !has_focus() && !ies; }
    bool has_cone() const { return cone_angle < 180.0f || cone_softness > 0.0f; }
    bool has_focus() const { return focus > 0.0f && focus_tint != Rgb(1.0f); }
};

// The factor for light that arrives from the unit direction `towards` the light, in the light's frame.
Rgb eval(const Shaping& shaping, const V3f& towards);

}  // namespace frazil
