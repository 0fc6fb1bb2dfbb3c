#include "frazil/translucency/better_dipole.h"

#include <cmath>

#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

constexpr double kPiExact = 3.14159265358979323846;

// (e^{-s a} - e^{-s b})/s for a <= b, b - a where s = 0.
double decay_between(double s, double a, double b) {
    if (s == 0.0) return b - a;
    return std::exp(-s * a) * -std::expm1(-s * (b - a)) / s;
}

}  // namespace

BetterDipole::BetterDipole(const Medium& made_of) : medium(made_of) {
    check_medium(medium, "Medium");
    // Moments of the reflectance from inside: 2 C1 = 2 ∫ F cos, 3 C2 = 3 ∫ F cos².
    const double eta = 1.0 / medium.eta;
    const double twice_c1 = fresnel_average_exact(eta), thrice_c2 = fresnel_second_moment(eta);
    const double boundary = (1.0 + thrice_c2) / (1.0 - twice_c1);
    by_fluence_ = 0.25 * (1.0 - twice_c1);
    by_flux_ = 0.5 * (1.0 - thrice_c2);
    for (int c = 0; c < 3; ++c) {
        const double absorb = medium.sigma_a[c], scatter = medium.sigma_s_prime[c], total = absorb + scatter;
        Channel& ch = channel_[c];
        ch.strength = scatter / total * scatter / total / (4.0 * kPiExact);
        ch.diffusion = (2.0 * absorb + scatter) / (3.0 * total * total);
        ch.sigma_tr = std::sqrt(absorb / ch.diffusion);
        ch.z_r = 1.0 / total;
        ch.z_v = ch.z_r + 4.0 * boundary * ch.diffusion;
    }
}

double BetterDipole::reflectance(int c, double r) const {
    const Channel& ch = channel_[c];
    const auto source = [&](double z, double sign) {
        const double d = std::hypot(r, z), flux = z * (1.0 + ch.sigma_tr * d) / (d * d);
        return (by_flux_ * flux + sign * by_fluence_ / ch.diffusion) * std::exp(-ch.sigma_tr * d) / d;
    };
    return ch.strength * (source(ch.z_r, 1.0) + source(ch.z_v, -1.0));
}

double BetterDipole::within(int c, double radius) const {
    if (std::isinf(radius)) return albedo(c);
    const Channel& ch = channel_[c];
    const auto flux = [&](double z, double d) {
        return std::exp(-ch.sigma_tr * z) - z * std::exp(-ch.sigma_tr * d) / d;
    };
    const double d_r = std::hypot(radius, ch.z_r), d_v = std::hypot(radius, ch.z_v);
    // Near minus far source: what lies between their depths less what lies between their distances.
    const double fluence = decay_between(ch.sigma_tr, ch.z_r, ch.z_v) - decay_between(ch.sigma_tr, d_r, d_v);
    return 2.0 * kPiExact * ch.strength *
           (by_flux_ * (flux(ch.z_r, d_r) + flux(ch.z_v, d_v)) + by_fluence_ / ch.diffusion * fluence);
}

double BetterDipole::albedo(int c) const {
    const Channel& ch = channel_[c];
    return 2.0 * kPiExact * ch.strength *
           (by_flux_ * (std::exp(-ch.sigma_tr * ch.z_r) + std::exp(-ch.sigma_tr * ch.z_v)) +
            by_fluence_ / ch.diffusion * decay_between(ch.sigma_tr, ch.z_r, ch.z_v));
}

}  // namespace frazil
