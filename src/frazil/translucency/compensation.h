// Area compensation: what a shading point lacks because the surface around it is not the plane that the profile
// assumes. Model: [Xie2014]; factor = 1 - W/Rd_total per channel, W the coverage of the gather. Units: none. Valid:
// exact W on closed forms: sphere F(2R)/F(inf), cone apex sin(beta), polyhedron vertex (sum of face angles)/2pi.
#pragma once

#include <string>

#include "frazil/base/vec.h"
#include "frazil/translucency/profile.h"

namespace frazil {

enum class CompensationMode {
    off,       // M
    ratio,     // M / (1 - factor) where factor > 0, capped: only brightens
    conserve,  // M Rd_total / W in both directions, capped: keeps energy when light bounces
    depth,     // as conserve, towards what a part as thin as here returns, where that is known (render/thickness.h)
    fill,      // M + factor Rd_total E(x) where factor > 0
    linear,    // M (1 + factor) where factor > 0
};

// As users write it: "off", "ratio" ...
const char* compensation_name(CompensationMode mode);

// Whether M is divided by the coverage whatever that is, so that it does not matter where the sums stand.
bool keeps_energy(CompensationMode mode);

struct Compensation {
    CompensationMode mode = CompensationMode::depth;
    float limit = 100.0f;       // largest gain, >= 1
    float strength = 1.0f;      // 0 = off, 1 = full
    bool by_luminance = false;  // one factor for all channels, from luminances
};

// Refuse limit < 1 and strength outside 0..1: ValueError beginning with `path`.
void check_compensation(const Compensation& compensation, const std::string& path);

// The gain of M for one shading point. `fill` adds instead of multiplying: see fill_amount.
Rgb compensation_gain(const Compensation& compensation, const Rgb& coverage, const Rgb& albedo);

// What `fill` adds per unit of irradiance at the shading point; zero for the other modes.
Rgb fill_amount(const Compensation& compensation, const Rgb& coverage, const Rgb& albedo);

}  // namespace frazil
