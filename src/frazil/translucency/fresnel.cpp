#include "frazil/translucency/fresnel.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/quadrature.h"

namespace frazil {
namespace {

double reflected_fraction(double cos_theta, double eta) {
    const double cos_i = std::clamp(cos_theta, 0.0, 1.0);
    const double sin2_t = (1.0 - cos_i * cos_i) / (eta * eta);
    if (sin2_t >= 1.0) return 1.0;
    const double cos_t = std::sqrt(1.0 - sin2_t);
    const double parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    const double perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// ∫ F(cos) cos^power dcos.
double fresnel_moment(double eta, int power) {
    if (eta == 1.0) return 0.0;
    // Below the critical angle's cosine all is reflected; what is left is smooth but for a square root at that end,
    // which cos = c + (1 - c) s² removes.
    const double critical = eta < 1.0 ? std::sqrt(1.0 - eta * eta) : 0.0;
    const auto integrand = [&](double s) {
        const double mu = critical + (1.0 - critical) * s * s;
        return reflected_fraction(mu, eta) * std::pow(mu, power) * 2.0 * s * (1.0 - critical);
    };
    return std::pow(critical, power + 1) / (power + 1) + integrate_gauss32(integrand, 0.0, 1.0);
}

}  // namespace

float fresnel_dielectric(float cos_theta, float eta) {
    return static_cast<float>(reflected_fraction(cos_theta, eta));
}

float fresnel_average(float eta) {
    return static_cast<float>(fresnel_average_exact(eta));
}

double fresnel_average_exact(double eta) {
    return 2.0 * fresnel_moment(eta, 1);
}

double fresnel_second_moment(double eta) {
    return 3.0 * fresnel_moment(eta, 2);
}

}  // namespace frazil
