// The standard dipole: two point sources, one real and one mirrored, stand for light that scatters below a plane.
// Model: [Jensen2001] Eq. 4; A = (1 + Fdr)/(1 - Fdr) with the exact average Fdr of Fresnel's equations from inside.
// Units: metres, 1/m, 1/m² for the reflectance.
// Valid: the tests of test_profile.cpp: ∫ 2 pi r Rd dr = albedo to 1e-6; albedo 1 where nothing is absorbed.
// Not: single scattering; near r = 0 and at low albedo it is too bright or too dark (docs/translucency.md).
#pragma once

#include "frazil/base/vec.h"
#include "frazil/translucency/medium.h"

namespace frazil {

struct Dipole {
    explicit Dipole(const Medium& medium);
    Medium medium;
    Rgb alpha_prime, sigma_tr, z_r, z_v;

    double reflectance(int channel, double r) const;
    double within(int channel, double radius) const;
    double albedo(int channel) const;
    double bend_length(int channel) const { return 0.7 * z_r[channel]; }
};

// A: how much the boundary throws back, 1 for eta = 1.
double dipole_boundary(double eta);
// The total reflectance as a function of the reduced albedo alpha' alone.
double dipole_albedo(double alpha_prime, double boundary);

}  // namespace frazil
