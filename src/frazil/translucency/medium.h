// What a translucent body is made of, as diffusion theory sees it.
// Model: [Jensen2001] Section 2: sigma_s_prime and sigma_a per channel, eta relative to the outside.
// Units: 1/m.
// Valid: sigma_s_prime > 0, sigma_a >= 0, 1 <= eta <= 4.
// Not: spectra and phase functions; g is folded into sigma_s_prime.
#pragma once

#include <string>

#include "frazil/base/vec.h"

namespace frazil {

struct Medium {
    Rgb sigma_s_prime;
    Rgb sigma_a;
    float eta = 1.31f;  // ice
};

// Over the channels, 1/m.
inline float mean_sigma_t(const Medium& medium) {
    return mean_component(medium.sigma_s_prime + medium.sigma_a);
}

// Refuse coefficients out of range: ValueError beginning with `path`.
void check_medium(const Medium& medium, const std::string& path);

// The medium whose profile has total reflectance `albedo` (0 <= albedo < 1) and transport mean free path
// `mean_free_path` = 1/(sigma_s_prime + sigma_a) per channel, in metres.
Medium medium_from_albedo(const Rgb& albedo, const Rgb& mean_free_path, float eta);

}  // namespace frazil
