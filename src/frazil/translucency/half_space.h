// The exact albedo of a half space that scatters isotropically: what profiles are scaled to and measured against.
// Model: [Chandrasekhar1960]: reflection α/2 mu'/(mu + mu') H(mu) H(mu') from the H-function, solved by iteration; the
//   boundary's inner reflection by Fresnel's equations, summed over all its orders.
// Units: fractions of the light that has entered.
// Valid: 0 <= albedo <= 1, 1 <= eta <= 4; 1e-4 against random walks (test_profiles.py).
// Not: where light leaves (profile.h), anisotropic scattering.
#pragma once

#include <array>
#include <vector>

namespace frazil {

struct HalfSpaceAlbedo {
    double single;    // left after one scattering, straight
    double multiple;  // left after more, or after reflection inside
    double all() const { return single + multiple; }
};

// For light from all around, cosine-distributed outside and refracted at the boundary.
HalfSpaceAlbedo half_space_albedo(double alpha, double eta);

// What an index-matched half space under a uniform sky lacks of its radiance in the light that it scatters at a depth: by depths, in equal steps
// of their logarithms from where it is as at the surface to where next to nothing leaves. 0 < alpha < 1.
struct HalfSpaceDepths {
    std::vector<double> depths;    // optical
    std::vector<double> absorbed;  // 0..1
};
HalfSpaceDepths half_space_absorbed(double alpha);

// How much of the light that enters at an angle leaves again, over the mean of light from all around; by reciprocity also
// how the radiance that leaves under light from all around depends on the angle. 1 where nothing is absorbed. Tabulated, 1e-3.
// The part `less_once` of the light that is scattered once does not count: what is left has its own angles, white or not.
class DirectionalAlbedo {
  public:
    DirectionalAlbedo() { values_.fill(1.0f); }
    DirectionalAlbedo(double alpha, double eta, double less_once = 0.0);
    // mu: the cosine inside, 0..1.
    float operator()(float mu) const;

  private:
    static constexpr int kSteps = 64;  // in the root of mu
    std::array<float, kSteps + 1> values_;
};

}  // namespace frazil
