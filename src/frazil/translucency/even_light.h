// Light inside a body that stands in even light of radiance 1 from all around: what its medium scatters at a place.
// Model: J = 1 - exp(-<y>), <y> the mean of y(l) over all directions in which the body ends l optical depths away. In a half
//   space J(tau) is known: Milne's equation J = alpha/2 (E2(tau) + ∫ J(t) E1(|tau - t|) dt) [Chandrasekhar1960]. There
//   <y> = Y(tau) = -ln(1 - J(tau)), from which y(l) = 2 (Y(l) - l Y'(l)) follows, as <y> = 1/2 ∫_1^∞ y(tau s)/s² ds. What is
//   absorbed, 1 - J, is so a product over directions: sqrt(1 - alpha) at the surface of a half space, its square 1 - alpha
//   in a body so thin that light is scattered once at most, as it must be. Where the boundary reflects inside, y is so many times as
//   large that a half space's own J at its surface leaves as little. d<y>/dx is the mean of k(l) w, k = 2 l Y'' - 4 Y', from
//   1/2 ∫ k(tau s)/s³ ds = -Y'.
// Units: optical depths, that is lengths times sigma_s' + sigma_a.
// Valid: index-matched slabs, spheres and edges within 0.04 of J, albedo 0.3 to 0.99 (tests/cpp/test_even_light.cpp). What
//   slabs return at eta = 1.31, albedo 0.7 to 0.99, comes within 0.03 of random walks (tests/cpp/test_thickness.cpp).
// Not: light that is not even.
#pragma once

#include <array>
#include <vector>

#include "frazil/translucency/half_space.h"

namespace frazil {

class EvenLight {
  public:
    EvenLight(double alpha, double eta);

    // Zero where nothing is absorbed: J is 1 everywhere.
    struct Exponent {
        float value = 0.0f, slope = 0.0f;
    };
    // Y at a depth in a half space, and Y'.
    Exponent half_space(float depth) const { return look_up(half_space_, depth); }
    // What a direction in which the body ends after so long a way adds to the means over directions: y, and k, which counts by
    // its cosine to the way that the slope is asked along.
    Exponent along(float length) const { return look_up(along_, length); }
    // What a half space returns of it.
    float albedo() const { return albedo_; }
    // Radiance that a half space sends towards mu, the cosine inside; ∫ J(t mu) e^{-t} dt.
    float returned(float mu) const { return albedo_ * by_angle_(mu); }
    // How deep it is on the mean that a half space absorbs what it does not send there: ∫ t mu B(t mu) e^{-t} dt / ∫ B(t mu)
    // e^{-t} dt with B = 1 - J. The latter is 1 - returned(mu), whose derivative gives the former.
    float absorbed_at(float mu) const;

  private:
    void fill_absorbed_at(double alpha, double eta);
    Exponent look_up(const std::vector<Exponent>& table, float depth) const;

    float albedo_ = 1.0f;
    DirectionalAlbedo by_angle_;
    float first_ = 0.0f, steps_ = 0.0f;  // ln of the first depth of the tables, steps per unit of ln
    std::vector<Exponent> half_space_, along_;
    static constexpr int kSteps = 64;  // in the root of mu
    std::array<float, kSteps + 1> absorbed_at_{};
};

}  // namespace frazil
