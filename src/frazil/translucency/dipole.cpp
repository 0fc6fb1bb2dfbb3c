#include "frazil/translucency/dipole.h"

#include <cmath>

#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

constexpr double kFourPi = 12.566370614359172954;

// Exitance of one source at depth z, per unit of its power [Jensen2001] Eq. 4.
double source_reflectance(double z, double sigma_tr, double r) {
    const double d = std::sqrt(r * r + z * z);
    return z * (1.0 + sigma_tr * d) * std::exp(-sigma_tr * d) / (kFourPi * d * d * d);
}

// Its integral over the disc of radius R.
double source_within(double z, double sigma_tr, double radius) {
    const double d = std::sqrt(radius * radius + z * z);
    return 0.5 * (std::exp(-sigma_tr * z) - z * std::exp(-sigma_tr * d) / d);
}

}  // namespace

double dipole_boundary(double eta) {
    const double reflected = fresnel_average_exact(1.0 / eta);  // seen from inside
    return (1.0 + reflected) / (1.0 - reflected);
}

double dipole_albedo(double alpha_prime, double boundary) {
    const double x = std::sqrt(3.0 * (1.0 - alpha_prime));  // sigma_tr z_r
    return 0.5 * alpha_prime * (std::exp(-x) + std::exp(-x * (1.0 + 4.0 / 3.0 * boundary)));
}

Dipole::Dipole(const Medium& made_of) : medium(made_of) {
    check_medium(medium, "Medium");
    const double boundary = dipole_boundary(medium.eta);
    for (int c = 0; c < 3; ++c) {
        const double absorb = medium.sigma_a[c], scatter = medium.sigma_s_prime[c], total = absorb + scatter;
        alpha_prime[c] = static_cast<float>(scatter / total);
        sigma_tr[c] = static_cast<float>(std::sqrt(3.0 * absorb * total));
        z_r[c] = static_cast<float>(1.0 / total);
        z_v[c] = static_cast<float>((1.0 + 4.0 / 3.0 * boundary) / total);
    }
}

double Dipole::reflectance(int c, double r) const {
    return alpha_prime[c] * (source_reflectance(z_r[c], sigma_tr[c], r) + source_reflectance(z_v[c], sigma_tr[c], r));
}

double Dipole::within(int c, double radius) const {
    return alpha_prime[c] * (source_within(z_r[c], sigma_tr[c], radius) + source_within(z_v[c], sigma_tr[c], radius));
}

double Dipole::albedo(int c) const {
    return 0.5 * alpha_prime[c] * (std::exp(-double(sigma_tr[c]) * z_r[c]) + std::exp(-double(sigma_tr[c]) * z_v[c]));
}

}  // namespace frazil
