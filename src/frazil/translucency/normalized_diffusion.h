// Normalized diffusion: two exponentials fitted to random walks of all orders, single scattering included.
// Model: [ChristensenBurley2015] Eq. 2 and the fit of s for diffuse light, A the exact albedo of the half space.
// Units: metres, 1/m, 1/m² for the reflectance.
// Valid: fitted to index-matched isotropic media; 0.06 of the albedo off in F(R) there, 0.2 at eta = 1.31
//   (docs/translucency.md). Singular as 1/r at r = 0: reflectance is held below r = 1e-4 of its length.
// Not: a single-scattering term on top: it would count that light twice.
#pragma once

#include "frazil/translucency/medium.h"

namespace frazil {

struct NormalizedDiffusion {
    explicit NormalizedDiffusion(const Medium& medium);
    Medium medium;

    double reflectance(int channel, double r) const;
    double within(int channel, double radius) const;
    double albedo(int channel) const { return channel_[channel].albedo; }
    double bend_length(int channel) const { return 0.0015 * channel_[channel].length; }

  private:
    struct Channel {
        double albedo, length;  // A, and 1/(s sigma_t')
    };
    Channel channel_[3];
};

}  // namespace frazil
