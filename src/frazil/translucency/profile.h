// Radially symmetric diffuse reflectance profiles behind three functions: reflectance(r), albedo, within(R).
// Model: Dipole [Jensen2001] Eq. 4; all are per channel.
// Units: reflectance in 1/m²; within and albedo are fractions.
// Valid: r, R >= 0.
// Not: single scattering, angular dependence.
#pragma once

#include <variant>

#include "frazil/base/vec.h"
#include "frazil/translucency/medium.h"

namespace frazil {

struct Dipole {
    explicit Dipole(const Medium& medium);
    Medium medium;
    Rgb alpha_prime, sigma_tr, z_r, z_v;
};

using Profile = std::variant<Dipole>;

// Rd(r): exitance per unit of area and of irradiance times area that enters at distance r.
Rgb reflectance(const Profile& profile, float r);
// F(R): the fraction that leaves within R of where it entered.
Rgb within(const Profile& profile, float radius);
// F(inf): the total diffuse reflectance, Rd_total.
Rgb albedo(const Profile& profile);

}  // namespace frazil
