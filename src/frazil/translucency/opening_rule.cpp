#include "frazil/translucency/opening_rule.h"

#include <cmath>

namespace frazil {
namespace {

// Calibrated on ten bodies (bench/gather.py): how a tolerance becomes a size, and the largest of a tolerance that bounds
// every error.
constexpr double kSizePerTolerance = 1000.0, kUsualCubed = 7.5, kRampCaution = 0.4;
// Beyond this tolerance it is the mean error that counts, not the largest.
constexpr double kCoarseTolerance = 0.01;
// What a distance's ring has of the albedo, below which errors need not be relative to it: clusters grow, so many times at
// most. Light that is this dark among its group's own is as exact as the rest.
constexpr double kFaintShare = 1e-6, kFaintest = 10.0;
// How far from r = 0 a profile is as steep as it ever is, over the length of its bend; at most a mean free path.
constexpr double kLengthPerBend = 1.5;
// A cluster is never seen from nearer than its radius over this.
constexpr double kWidest = 0.6;

double size_cubed(double tolerance) {
    if (tolerance > kCoarseTolerance) return kUsualCubed * tolerance / kCoarseTolerance;
    return std::min(kUsualCubed, kSizePerTolerance * tolerance);
}

}  // namespace

OpeningRule::OpeningRule(const Profile& profile, const KernelTable& table, bool has_ramp, float tolerance)
    : inverse_z0_squared_(table.inverse_z0_squared) {
    const double z0 = 1.0 / std::sqrt(double(inverse_z0_squared_)), shortest = shortest_mean_free_path(profile);
    for (int i = 0; i < kEntries; ++i) {
        const double u = std::ldexp(1.0 + (i % 4) / 4.0, i / 4), r = z0 * std::sqrt(u - 1.0);
        double limit = kWidest * (r + shortest);
        for (int c = 0; c < 3; ++c) {
            const double total = albedo(profile, c), f = reflectance(profile, c, r);
            if (!(total > 0.0 && f > 0.0)) continue;
            const double step = 0.01 * (r + shortest);
            const double decay = std::log(f / std::max(1e-300, reflectance(profile, c, r + step))) / step;
            const double length = std::min(mean_free_path(profile, c), kLengthPerBend * bend_length(profile, c));
            const double bend = 1.5 / std::hypot(r, length) + decay;
            const double share = 6.0 * (r * r + shortest * shortest) * f / total;
            const double cubed = size_cubed(tolerance) * (has_ramp ? kRampCaution : 1.0);
            limit = std::min(limit, std::cbrt(cubed * std::clamp(kFaintShare / share, 1.0, kFaintest)) / bend);
        }
        largest_[i] = static_cast<float>(limit * limit);
    }
}

}  // namespace frazil
