// The exact albedo of a half space that scatters isotropically: what profiles are scaled to and measured against.
// Model: [Chandrasekhar1960]: reflection α/2 mu'/(mu + mu') H(mu) H(mu') from the H-function, solved by iteration; the
//   boundary's inner reflection by Fresnel's equations, summed over all its orders.
// Units: fractions of the light that has entered.
// Valid: 0 <= albedo <= 1, 1 <= eta <= 4; 1e-4 against random walks (test_profiles.py).
// Not: where light leaves (profile.h), anisotropic scattering.
#pragma once

namespace frazil {

struct HalfSpaceAlbedo {
    double single;    // left after one scattering, straight
    double multiple;  // left after more, or after reflection inside
    double all() const { return single + multiple; }
};

// For light from all around, cosine-distributed outside and refracted at the boundary.
HalfSpaceAlbedo half_space_albedo(double alpha, double eta);

// For an index-matched half space that absorbs nothing: the fraction of light in direction mu (cosine inside) that is not
// lost to single scattering, over its mean: how multiple scattering depends on the angle of entry and of exit.
// (1 + mu ln(1 + 1/mu))/2 over its mean by 2 mu dmu.
float multiple_scattering_angle(float mu);

}  // namespace frazil
