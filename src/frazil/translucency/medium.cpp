#include "frazil/translucency/medium.h"

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/translucency/dipole.h"
#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

// 1/m; a free path of 10 nm is shorter than light. What is computed from it stays in float's range.
constexpr float kLargestCoefficient = 1e8f;

}  // namespace

void check_medium(const Medium& medium, const std::string& path) {
    for (int c = 0; c < 3; ++c) {
        const float scatter = medium.sigma_s_prime[c], absorb = medium.sigma_a[c];
        if (!std::isfinite(scatter) || scatter < 0.0f) {
            throw ValueError(str(path, ": sigma_s_prime must be >= 0 and finite, got ", scatter,
                                 ". It is a coefficient per metre."));
        }
        if (!std::isfinite(absorb) || absorb < 0.0f) {
            throw ValueError(
                str(path, ": sigma_a must be >= 0 and finite, got ", absorb, ". Absorption is per metre."));
        }
        if (scatter + absorb > kLargestCoefficient) {
            throw ValueError(str(path, ": sigma_s_prime + sigma_a must be at most ", kLargestCoefficient, ", got ",
                                 scatter + absorb, ". Coefficients are per metre."));
        }
        if (!(scatter + absorb > 0.0f)) {
            throw ValueError(
                str(path, ": sigma_s_prime + sigma_a must be > 0 in every channel, got 0. Light would never stop."));
        }
    }
    if (!(medium.eta >= 1.0f && medium.eta <= 4.0f)) {
        throw ValueError(str(path, ": eta must be in [1, 4], got ", medium.eta, ". Ice is 1.31."));
    }
}

Medium medium_from_albedo(const Rgb& albedo, const Rgb& mean_free_path, float eta) {
    Medium medium{Rgb(1.0f), Rgb(0.0f), eta};
    check_medium(medium, "Medium");
    const double boundary = dipole_boundary(eta);
    for (int c = 0; c < 3; ++c) {
        if (!(albedo[c] >= 0.0f && albedo[c] < 1.0f)) {
            throw ValueError(
                str("Medium: albedo must be in [0, 1), got ", albedo[c], ". Use less than 1, e.g. 0.999."));
        }
        if (!(mean_free_path[c] > 0.0f && std::isfinite(mean_free_path[c]))) {
            throw ValueError(
                str("Medium: mean_free_path must be > 0 and finite, got ", mean_free_path[c], ". It is in metres."));
        }
        if (1.0f / mean_free_path[c] > kLargestCoefficient) {
            throw ValueError(str("Medium: mean_free_path must be at least ", 1.0f / kLargestCoefficient, ", got ",
                                 mean_free_path[c], ". It is in metres."));
        }
        // Bisect on x = sqrt(1 - alpha'), in which the albedo falls smoothly from 1 to 0.
        double low = 0.0, high = 1.0;
        for (int step = 0; step < 200 && high - low > 1e-15 * high; ++step) {
            const double x = 0.5 * (low + high);
            (dipole_albedo(1.0 - x * x, boundary) > albedo[c] ? low : high) = x;
        }
        const double absorbed = albedo[c] == 0.0f ? 1.0 : 0.25 * (low + high) * (low + high);
        medium.sigma_s_prime[c] = static_cast<float>((1.0 - absorbed) / mean_free_path[c]);
        medium.sigma_a[c] = static_cast<float>(absorbed / mean_free_path[c]);
    }
    return medium;
}

}  // namespace frazil
