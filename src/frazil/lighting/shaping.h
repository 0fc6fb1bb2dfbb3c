// How the light that leaves a light depends on the angle from its axis (-z): cone and focus.
// Model: UsdLuxShapingAPI. Beyond the cone's angle nothing; a smooth step from (1 - softness) angle to angle. Focus
//   multiplies by mix(focus_tint, 1, cos^focus).
// Units: degrees.
// Valid: angle in 0..180, 180 = no cone; softness and focus >= 0. The cosine of focus is that from the light's axis for
//   every shape, and 0 behind it.
// Not: IES profiles.
#pragma once

#include "frazil/base/vec.h"

namespace frazil {

struct Shaping {
    float cone_angle = 180.0f;
    float cone_softness = 0.0f;
    float focus = 0.0f;
    Rgb focus_tint = Rgb(0.0f);

    bool is_neutral() const { return !has_cone() && !has_focus(); }
    bool has_cone() const { return cone_angle < 180.0f || cone_softness > 0.0f; }
    bool has_focus() const { return focus > 0.0f && focus_tint != Rgb(1.0f); }
};

// The factor for light that leaves at an angle of this cosine from the axis.
Rgb eval(const Shaping& shaping, float cosine);

}  // namespace frazil
