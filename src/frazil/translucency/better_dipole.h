// d'Eon's better dipole: Grosjean's diffusion, boundary conditions and exitance from the moments of Fresnel's equations.
// Model: [DEon2012]; D = (2 sigma_a + sigma_s')/(3 (sigma_a + sigma_s')²), exitance from fluence and flux together.
// Units: metres, 1/m, 1/m² for the reflectance.
// Valid: albedo 1 where nothing is absorbed (test_translucency.py, with the random walk it is measured against).
// Not: single scattering; the depth of the source is one mean free path for all light.
#pragma once

#include "frazil/base/vec.h"
#include "frazil/translucency/medium.h"

namespace frazil {

struct BetterDipole {
    explicit BetterDipole(const Medium& medium);
    Medium medium;

    double reflectance(int channel, double r) const;
    double within(int channel, double radius) const;
    double albedo(int channel) const;
    double bend_length(int channel) const { return 0.7 * channel_[channel].z_r; }

  private:
    struct Channel {
        double strength;  // alpha'²/(4 pi)
        double diffusion, sigma_tr, z_r, z_v;
    };
    Channel channel_[3];
    double by_fluence_, by_flux_;  // C_phi and C_E
};

}  // namespace frazil
