// frazil:ice: a translucent core under a glossy dielectric boundary.
// Model: translucency M/pi * T(wo)/T_avg + GGX reflection [Xie2014]; energy of the two sums to <= 1 (furnace).
// Units: see Medium; roughness is the user's (alpha = roughness²).
// Valid: roughness in [0,1], eta in [1,4].
#pragma once

#include "frazil/material/texture.h"
#include "frazil/translucency/compensation.h"
#include "frazil/translucency/medium.h"
#include "frazil/translucency/ramp.h"

namespace frazil {

struct IceMaterial {
    Medium medium;
    MaterialInput<float> roughness{0.1f, {}};
    float specular = 1.0f;                   // weight of the reflection, 0..1
    float translucency = 1.0f;               // weight of the core, 0..1
    MaterialInput<Rgb> tint{Rgb(1.0f), {}};  // multiplies what leaves the core
    Ramp ramp;
    Compensation compensation;
    float spacing = 0.0f;  // of the points, metres; 0 = from the mean free path
};

}  // namespace frazil
