#include "frazil/translucency/ramp.h"

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/quadrature.h"

namespace frazil {
namespace {

constexpr float kLargestColor = 1e6f;  // so that slopes between near knots stay in float's range

}  // namespace

void check_ramp(const Ramp& ramp, const std::string& path) {
    if (ramp.colors.size() != ramp.distances.size()) {
        throw ValueError(str(path, ": colors must have one row per distance (", ramp.distances.size(), "), got ",
                             ramp.colors.size(), ". Each knot has one."));
    }
    for (std::size_t k = 0; k < ramp.distances.size(); ++k) {
        const float distance = ramp.distances[k];
        if (!(distance >= 0.0f && std::isfinite(distance))) {
            throw ValueError(str(path, ": distances must be >= 0 and finite, got ", distance, " at knot ", k,
                                 ". It is how far light goes, in metres."));
        }
        if (k > 0 && !(distance > ramp.distances[k - 1])) {
            throw ValueError(str(path, ": distances must increase from knot to knot, got ", distance, " after ",
                                 ramp.distances[k - 1], ". Sort the knots."));
        }
        for (int c = 0; c < 3; ++c) {
            if (!(ramp.colors[k][c] >= 0.0f && std::isfinite(ramp.colors[k][c]))) {
                throw ValueError(str(path, ": colors must be >= 0 and finite, got ", ramp.colors[k][c], " at knot ", k,
                                     ". It is a factor of the light."));
            }
            if (ramp.colors[k][c] > kLargestColor) {
                throw ValueError(str(path, ": colors must be at most ", kLargestColor, ", got ", ramp.colors[k][c],
                                     " at knot ", k, ". It is a factor of the light; brighten the light instead."));
            }
        }
    }
}

Rgb eval(const Ramp& ramp, float r) {
    if (ramp.is_empty()) return Rgb(1.0f);
    if (r <= ramp.distances.front()) return ramp.colors.front();
    if (r >= ramp.distances.back()) return ramp.colors.back();
    const std::size_t k = std::upper_bound(ramp.distances.begin(), ramp.distances.end(), r) - ramp.distances.begin();
    const float t = (r - ramp.distances[k - 1]) / (ramp.distances[k] - ramp.distances[k - 1]);
    return ramp.colors[k - 1] * (1.0f - t) + ramp.colors[k] * t;
}

Rgb energy_scale(const Ramp& ramp, const Profile& profile) {
    if (ramp.is_empty() || !ramp.preserve_energy) return Rgb(1.0f);
    Rgb scale(1.0f);
    for (int c = 0; c < 3; ++c) {
        // ∫ ramp dF by parts: ramp(inf) F(inf) - Σ slope ∫ F dr over the pieces.
        const double total = albedo(profile, c);
        double shaded = ramp.colors.back()[c] * total;
        for (std::size_t k = 1; k < ramp.distances.size(); ++k) {
            const double begin = ramp.distances[k - 1], end = ramp.distances[k];
            const double slope = (double(ramp.colors[k][c]) - ramp.colors[k - 1][c]) / (end - begin);
            // Halves toward the near end, where F bends over a mean free path.
            double right = end, area = 0.0;
            for (int half = 0; half < 12; ++half) {
                const double left = half == 11 ? begin : 0.5 * (begin + right);
                area += integrate_gauss32([&](double r) { return within(profile, c, r); }, left, right);
                right = left;
            }
            shaded -= slope * area;
        }
        if (total > 0.0 && !(shaded > 1e-9 * total)) {
            throw ValueError(str("Ramp: colors must leave some energy to preserve in channel ", c,
                                 ", got none. Give a knot inside the medium's reach a colour above 0."));
        }
        scale[c] = total > 0.0 ? static_cast<float>(total / shaded) : 1.0f;
    }
    return scale;
}

Ramp hat(const Ramp& ramp, std::size_t k) {
    Ramp only{ramp.distances, std::vector<Rgb>(ramp.distances.size(), Rgb(0.0f)), false};
    only.colors[k] = Rgb(1.0f);
    return only;
}

Ramp in_metres(const Ramp& ramp, double mean_free_path) {
    Ramp scaled = ramp;
    for (float& distance : scaled.distances) distance = static_cast<float>(distance * mean_free_path);
    return scaled;
}

}  // namespace frazil
