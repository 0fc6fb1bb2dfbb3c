#include "frazil/translucency/photon_beam.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "frazil/base/quadrature.h"
#include "frazil/translucency/fresnel.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

constexpr double kPiExact = 3.14159265358979323846;
constexpr int kNodes = 256;
constexpr double kNearest = 1e-4, kFarthest = 1e4, kDark = 1e-14;
// Where the table of a gather begins to bend, in mean free paths: kappa leaves a logarithm at r = 0.
constexpr double kBend = 0.036;
// Of MultipleScattering, in mean free paths; what comes nearest to the walks of bench/profiles.py.
constexpr double kSoftening = 0.15;

// The integral over the beam's depth, by panels that double from below the distance r to where the beam is spent.
class BeamIntegral {
  public:
    BeamIntegral(double alpha, double eta) {
        const double twice_c1 = fresnel_average_exact(1.0 / eta), thrice_c2 = fresnel_second_moment(1.0 / eta);
        diffusion_ = (2.0 - alpha) / 3.0;  // (2 sigma_a + sigma_s')/(3 sigma_t'²)
        sigma_tr_ = std::sqrt((1.0 - alpha) / diffusion_);
        mirror_ = 4.0 * diffusion_ * (1.0 + thrice_c2) / (1.0 - twice_c1);
        by_fluence_ = 0.25 * (1.0 - twice_c1) / diffusion_;
        by_flux_ = 0.5 * (1.0 - thrice_c2);
        strength_ = alpha * alpha / (4.0 * kPiExact);
    }

    double operator()(double r) const {
        const auto at_depth = [&](double t) {
            const double v = t + mirror_, d_r = std::hypot(r, t), d_v = std::hypot(r, v);
            const double near = std::exp(-sigma_tr_ * d_r) / d_r, far = std::exp(-sigma_tr_ * d_v) / d_v;
            const double flux =
                t * (1.0 + sigma_tr_ * d_r) * near / (d_r * d_r) + v * (1.0 + sigma_tr_ * d_v) * far / (d_v * d_v);
            const double kappa = -std::expm1(-2.0 * (d_r + t));
            return std::exp(-t) * kappa * (by_fluence_ * (near - far) + by_flux_ * flux);
        };
        double sum = 0.0, begin = 0.0;
        for (double end = std::min(0.5 * r, 0.5); begin < 40.0; end *= 2.0) {
            sum += integrate_gauss32(at_depth, begin, end);
            begin = end;
        }
        return strength_ * sum;
    }

  private:
    double diffusion_, sigma_tr_, mirror_, by_fluence_, by_flux_, strength_;
};

}  // namespace

// ln Rd over ln r, by cubic Hermite pieces; F at the nodes. All in mean free paths.
struct PhotonBeamDiffusion::Curve {
    Curve(double alpha, double eta) {
        const BeamIntegral integral(alpha, eta);
        // Tabulate as far as there is light.
        double farthest = 1.0;
        while (farthest < kFarthest && farthest * farthest * integral(farthest) > kDark * alpha * alpha)
            farthest *= 1.25;
        step_ = std::log(farthest / kNearest) / (kNodes - 1);
        for (int i = 0; i < kNodes; ++i) value_[i] = std::log(std::max(1e-300, integral(radius(i))));
        for (int i = 0; i < kNodes; ++i) {
            const int left = std::max(0, i - 1), right = std::min(kNodes - 1, i + 1);
            slope_[i] = (value_[right] - value_[left]) / (right - left);
        }
        within_[0] = kPiExact * kNearest * kNearest * std::exp(value_[0]);
        for (int i = 1; i < kNodes; ++i) within_[i] = within_[i - 1] + ring(radius(i - 1), radius(i));
        // Beyond, a power law: exact where nothing is absorbed, nothing elsewhere.
        const double power = slope_.back() / step_ + 2.0;
        total_ =
            within_.back() + 2.0 * kPiExact * farthest * farthest * std::exp(value_.back()) / std::max(1.0, -power);
    }

    double radius(int i) const { return kNearest * std::exp(step_ * i); }

    double reflectance(double r) const {
        const double x = std::max(0.0, std::log(std::max(r, kNearest) / kNearest) / step_);
        if (x >= kNodes - 1) return std::exp(value_.back() + slope_.back() * (x - (kNodes - 1)));
        const int i = static_cast<int>(x);
        const double t = x - i, u = 1.0 - t;
        return std::exp(u * u * ((1.0 + 2.0 * t) * value_[i] + t * slope_[i]) +
                        t * t * ((1.0 + 2.0 * u) * value_[i + 1] - u * slope_[i + 1]));
    }

    double within(double r) const {
        if (r <= kNearest) return within_[0] * r * r / (kNearest * kNearest);
        const double x = std::log(r / kNearest) / step_;
        if (x >= kNodes - 1) {
            const double left = total_ - within_.back(), power = slope_.back() / step_ + 2.0;
            return total_ - left * std::exp(power * (x - (kNodes - 1)) * step_);
        }
        const int i = static_cast<int>(x);
        return within_[i] + ring(radius(i), r);
    }

    double total() const { return total_; }

  private:
    double ring(double begin, double end) const {
        const auto in_log = [&](double y) { return 2.0 * kPiExact * std::exp(2.0 * y) * reflectance(std::exp(y)); };
        return integrate_gauss32(in_log, std::log(begin), std::log(end));
    }

    double step_, total_;
    std::array<double, kNodes> value_, slope_, within_;
};

PhotonBeamDiffusion::PhotonBeamDiffusion(const Medium& made_of) : medium(made_of) {
    check_medium(medium, "Medium");
    for (int c = 0; c < 3; ++c) {
        const double scatter = medium.sigma_s_prime[c];
        sigma_t_[c] = scatter + medium.sigma_a[c];
        const auto alike = [&](int b) {
            return scatter / sigma_t_[c] == double(medium.sigma_s_prime[b]) / sigma_t_[b];
        };
        for (int b = 0; b < c && !curve_[c]; ++b) {
            if (alike(b)) curve_[c] = curve_[b];
        }
        if (!curve_[c]) curve_[c] = std::make_shared<const Curve>(scatter / sigma_t_[c], medium.eta);
    }
}

double PhotonBeamDiffusion::reflectance(int c, double r) const {
    return sigma_t_[c] * sigma_t_[c] * curve_[c]->reflectance(sigma_t_[c] * r);
}

double PhotonBeamDiffusion::within(int c, double radius) const {
    return std::isinf(radius) ? albedo(c) : curve_[c]->within(sigma_t_[c] * radius);
}

double PhotonBeamDiffusion::albedo(int c) const {
    return curve_[c]->total();
}

double PhotonBeamDiffusion::bend_length(int c) const {
    return kBend / sigma_t_[c];
}

MultipleScattering::MultipleScattering(const Medium& made_of, double single) : medium(made_of), curve_(made_of) {
    for (int c = 0; c < 3; ++c) {
        const double scatter = medium.sigma_s_prime[c], total = scatter + medium.sigma_a[c];
        const HalfSpaceAlbedo exact = half_space_albedo(scatter / total, medium.eta);
        albedo_[c] = exact.multiple + single * exact.single;
        softening_[c] = kSoftening / total;
        before_[c] = curve_.within(c, softening_[c]);
        const double beyond = curve_.albedo(c) - before_[c];
        scale_[c] = beyond > 0.0 ? albedo_[c] / beyond : 0.0;
    }
}

double MultipleScattering::reflectance(int c, double r) const {
    return scale_[c] * curve_.reflectance(c, std::hypot(r, softening_[c]));
}

double MultipleScattering::within(int c, double radius) const {
    if (std::isinf(radius)) return albedo_[c];
    return scale_[c] * (curve_.within(c, std::hypot(radius, softening_[c])) - before_[c]);
}

}  // namespace frazil
