// Photon beam diffusion: a dipole for every depth at which a beam that enters straight down scatters first.
// Model: [Habel2013], multiple scattering: ∫ alpha' e^{-t} kappa (C_phi phi + C_E E) dt over depth t in mean free paths,
//   Grosjean's diffusion and the boundary of [DEon2012]; kappa = 1 - e^{-2(t + d)} for what diffusion overrates nearby.
//   MultipleScattering has its curve and the exact albedo of light of more than one scattering, from all around.
// Units: metres, 1/m, 1/m² for the reflectance.
// Valid: curves within 0.07 of F(inf) against random walks, albedo 4 to 20 % too high (exact for MultipleScattering);
//   docs/translucency.md, test_profiles.py. The integral is tabulated over ln r, 1e-5.
// Not: single scattering (render/single_scattering.h); oblique beams.
#pragma once

#include <memory>

#include "frazil/translucency/medium.h"

namespace frazil {

struct PhotonBeamDiffusion {
    explicit PhotonBeamDiffusion(const Medium& medium);
    Medium medium;

    double reflectance(int channel, double r) const;
    double within(int channel, double radius) const;
    double albedo(int channel) const;
    double bend_length(int channel) const;

  private:
    friend struct MultipleScattering;
    struct Curve;
    std::shared_ptr<const Curve> curve_[3];  // in mean free paths
    double sigma_t_[3];
    double scale_[3] = {1.0, 1.0, 1.0};
};

struct MultipleScattering : PhotonBeamDiffusion {
    explicit MultipleScattering(const Medium& medium);
};

}  // namespace frazil
