// Photon beam diffusion: a dipole for every depth at which a beam that enters straight down scatters first.
// Model: [Habel2013], multiple scattering: ∫ alpha' e^{-t} kappa (C_phi phi + C_E E) dt over depth t in mean free paths,
//   Grosjean's diffusion and the boundary of [DEon2012]; kappa = 1 - e^{-2(t + d)} for what diffusion overrates nearby.
//   MultipleScattering has its curve over sqrt(r² + (0.15 mean free paths)²), which takes the singularity at r = 0 away
//   and comes nearer to random walks, and the exact albedo of light of more than one scattering, from all around.
// Units: metres, 1/m, 1/m² for the reflectance.
// Valid: curves within 0.035 of F(inf) against random walks (MultipleScattering 0.02), albedo 4 to 20 % too high (exact);
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
    struct Curve;
    std::shared_ptr<const Curve> curve_[3];  // in mean free paths
    double sigma_t_[3];
};

struct MultipleScattering {
    // `single` is how much of the light of one scattering it stands for too, 0..1: 1 where none is added by other means.
    explicit MultipleScattering(const Medium& medium, double single = 0.0);
    Medium medium;

    double reflectance(int channel, double r) const;
    double within(int channel, double radius) const;
    double albedo(int channel) const { return albedo_[channel]; }
    double bend_length(int channel) const { return softening_[channel]; }

  private:
    PhotonBeamDiffusion curve_;
    double softening_[3], before_[3], scale_[3], albedo_[3];  // metres; F of the curve up to there
};

}  // namespace frazil
