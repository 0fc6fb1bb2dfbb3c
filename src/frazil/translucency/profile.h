// Radially symmetric diffuse reflectance profiles behind three functions: reflectance(r), albedo, within(R).
// Model: one struct a profile, each in its own header, joined in a variant; all are per channel.
// Units: reflectance in 1/m²; within and albedo are fractions.
// Valid: r, R >= 0.
// Not: single scattering, angular dependence.
#pragma once

#include <variant>

#include "frazil/base/vec.h"
#include "frazil/translucency/better_dipole.h"
#include "frazil/translucency/dipole.h"
#include "frazil/translucency/medium.h"

namespace frazil {

using Profile = std::variant<Dipole, BetterDipole>;

// Rd(r): exitance per unit of area and of irradiance times area that enters at distance r.
Rgb reflectance(const Profile& profile, float r);
// F(R): the fraction that leaves within R of where it entered.
Rgb within(const Profile& profile, float radius);
// F(inf): the total diffuse reflectance, Rd_total.
Rgb albedo(const Profile& profile);

// The same for one channel, in double precision.
double reflectance(const Profile& profile, int channel, double r);
double within(const Profile& profile, int channel, double radius);
double albedo(const Profile& profile, int channel);

// The medium that the profile was made from.
const Medium& medium(const Profile& profile);
// The distance over which the profile bends near r = 0: the transport mean free path.
double mean_free_path(const Profile& profile, int channel);

}  // namespace frazil
