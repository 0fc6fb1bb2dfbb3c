#include "frazil/translucency/normalized_diffusion.h"

#include <cmath>

#include "frazil/translucency/half_space.h"

namespace frazil {

NormalizedDiffusion::NormalizedDiffusion(const Medium& made_of) : medium(made_of) {
    check_medium(medium, "Medium");
    for (int c = 0; c < 3; ++c) {
        const double absorb = medium.sigma_a[c], scatter = medium.sigma_s_prime[c], total = absorb + scatter;
        const double a = half_space_albedo(scatter / total, medium.eta).all();
        // [ChristensenBurley2015] diffuse surface transmission, in mean free paths.
        const double s = 1.9 - a + 3.5 * (a - 0.8) * (a - 0.8);
        channel_[c] = {a, 1.0 / (s * total)};
    }
}

double NormalizedDiffusion::reflectance(int c, double r) const {
    const Channel& ch = channel_[c];
    const double x = std::max(r / ch.length, 1e-4);
    return ch.albedo * (std::exp(-x) + std::exp(-x / 3.0)) / (8.0 * 3.14159265358979323846 * x * ch.length * ch.length);
}

double NormalizedDiffusion::within(int c, double radius) const {
    const Channel& ch = channel_[c];
    const double x = radius / ch.length;
    return ch.albedo * (1.0 - 0.25 * std::exp(-x) - 0.75 * std::exp(-x / 3.0));
}

}  // namespace frazil
