// The medium that a profile needs to return a given part of the light: what people have is an albedo and a length.
// Model: albedos depend on alpha' and eta alone, and fall smoothly with sqrt(1 - alpha'): false position.
// Units: metres.
// Valid: round trip 1e-4 for every profile (test_albedo_inversion_round_trip).
// Not: the shape of the body; the albedo is a half space's.
#pragma once

#include "frazil/translucency/profile.h"

namespace frazil {

// The medium whose profile of this kind, with light of one scattering where it can hold it, has total reflectance `albedo`
// (>= 0 and less than that without absorption) and transport mean free path `mean_free_path` per channel, in metres.
// ValueError for others.
Medium medium_for_profile(ProfileKind kind, const Rgb& albedo, const Rgb& mean_free_path, float eta);

}  // namespace frazil
