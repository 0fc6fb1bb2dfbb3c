// Radially symmetric diffuse reflectance profiles behind three functions: reflectance(r), albedo, within(R).
// Model: one struct a profile, each in its own header, joined in a variant; all are per channel.
// Units: reflectance in 1/m²; within and albedo are fractions.
// Valid: r, R >= 0.
// Not: angular dependence. Dipole, BetterDipole and NormalizedDiffusion hold the energy of all orders of scattering,
//   PhotonBeamDiffusion and MultipleScattering leave single scattering out (render/single_scattering.h has it).
#pragma once

#include <string>
#include <variant>

#include "frazil/base/vec.h"
#include "frazil/translucency/better_dipole.h"
#include "frazil/translucency/dipole.h"
#include "frazil/translucency/medium.h"
#include "frazil/translucency/normalized_diffusion.h"
#include "frazil/translucency/photon_beam.h"

namespace frazil {

using Profile = std::variant<Dipole, BetterDipole, NormalizedDiffusion, PhotonBeamDiffusion, MultipleScattering>;

enum class ProfileKind { dipole, better_dipole, normalized_diffusion, photon_beam, multiple_scattering };

// ValueError beginning with `path` for a name that is none of the above.
ProfileKind profile_named(const std::string& name, const std::string& path);
std::string name_of(ProfileKind kind);
// `single`: how much of the light of one scattering MultipleScattering is to stand for too, 0..1.
Profile make_profile(ProfileKind kind, const Medium& medium, double single = 0.0);
// Whether the profile leaves light of one scattering to other means.
bool lacks_single_scattering(ProfileKind kind);

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
// The distance below which the profile is nearly flat: a transport mean free path for dipoles, less for others.
double bend_length(const Profile& profile, int channel);
// The transport mean free path, 1/(sigma_s' + sigma_a), and the shortest of the three.
double mean_free_path(const Profile& profile, int channel);
double shortest_mean_free_path(const Profile& profile);

}  // namespace frazil
