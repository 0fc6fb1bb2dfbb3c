#include "frazil/translucency/kernel_table.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace frazil {
namespace {

constexpr int kN = KernelTable::kCoefficients;
// Of the albedo: r² Rd where the table may end.
constexpr double kLeastShare = 1e-7;

// The power-basis polynomial in t - 1/2 for t in [0, 1] that comes nearest to f: weighted least squares over Chebyshev
// nodes, which is nearly the least greatest error of weight times f.
template <class Function, class Weight>
std::array<double, kN> fit(const Function& f, const Weight& weight) {
    constexpr int kSamples = 40;
    double matrix[kN][kN + 1] = {};
    for (int i = 0; i < kSamples; ++i) {
        const double x = -0.5 * std::cos(3.14159265358979323846 * (i + 0.5) / kSamples);
        const double w = weight(x + 0.5), value = f(x + 0.5);
        double power[kN] = {1.0};
        for (int k = 1; k < kN; ++k) power[k] = power[k - 1] * x;
        for (int row = 0; row < kN; ++row) {
            for (int k = 0; k < kN; ++k) matrix[row][k] += w * w * power[row] * power[k];
            matrix[row][kN] += w * w * power[row] * value;
        }
    }
    // The normal equations are positive definite: eliminate without pivots.
    for (int i = 0; i < kN; ++i) {
        for (int row = i + 1; row < kN; ++row) {
            const double factor = matrix[row][i] / matrix[i][i];
            for (int k = i; k <= kN; ++k) matrix[row][k] -= factor * matrix[i][k];
        }
    }
    std::array<double, kN> power{};
    for (int i = kN - 1; i >= 0; --i) {
        double value = matrix[i][kN];
        for (int k = i + 1; k < kN; ++k) value -= matrix[i][k] * power[k];
        power[i] = value / matrix[i][i];
    }
    return power;
}

// The distance beyond which r² Rd is less than kLeastShare of the albedo in every channel, at most 2^15 z0.
double reach_of(const Profile& profile, double z0) {
    double reach = z0;
    for (; reach < 32768.0 * z0; reach *= 1.1) {
        bool is_dark = true;
        for (int c = 0; c < 3; ++c) {
            is_dark = is_dark && reach * reach * reflectance(profile, c, reach) <= kLeastShare * albedo(profile, c);
        }
        if (is_dark) break;
    }
    return reach;
}

}  // namespace

KernelTable tabulate(const Profile& profile) {
    KernelTable table;
    double z0 = bend_length(profile, 0);
    for (int c = 1; c < 3; ++c) z0 = std::min(z0, bend_length(profile, c));
    const double wanted = reach_of(profile, z0);
    const double octaves = std::log2(1.0 + wanted * wanted / (z0 * z0));
    table.split = 2.0 * octaves <= KernelTable::kSegments - 1 ? 1 : 0;
    const int pieces = 1 << table.split;
    const int used = std::min(KernelTable::kSegments - 1, static_cast<int>(std::ceil(octaves * pieces)));
    table.inverse_z0_squared = static_cast<float>(1.0 / (z0 * z0));
    for (int s = 0; s < used; ++s) {
        const double octave = std::ldexp(1.0, s / pieces);
        const double begin = octave * (1.0 + double(s % pieces) / pieces), width = octave / pieces;
        for (int c = 0; c < 3; ++c) {
            const auto f = [&](double t) {
                return reflectance(profile, c, z0 * std::sqrt(std::max(0.0, begin + t * width - 1.0)));
            };
            // Relative errors, down to what a ring as faint as kLeastShare has; less so about r = 0, where rings are small.
            const auto power = fit(f, [&](double t) {
                const double squared = begin + t * width - 0.97,
                             least = kLeastShare * albedo(profile, c) / (z0 * z0 * squared);
                return std::sqrt(squared) / (f(t) + least + 1e-300);
            });
            for (int k = 0; k < kN; ++k) table.coefficient[c][k][s] = static_cast<float>(power[k]);
        }
    }
    const double last = std::ldexp(1.0 + double(used % pieces) / pieces, used / pieces);
    table.last_u = static_cast<float>(last);
    table.reach = static_cast<float>(z0 * std::sqrt(last - 1.0));
    return table;
}

KernelTable::Jet KernelTable::eval(int channel, float q) const {
    const float u = 1.0f + q * inverse_z0_squared;
    if (!(u < last_u)) return {0.0f, 0.0f, 0.0f};
    const auto bits = std::bit_cast<std::uint32_t>(u) - std::bit_cast<std::uint32_t>(1.0f);
    const std::uint32_t segment = bits >> (23 - split);
    const std::uint32_t below = bits & ((1u << (23 - split)) - 1u);
    const float t = static_cast<float>(below) * std::ldexp(1.0f, split - 23) - 0.5f;
    const float t_per_q = inverse_z0_squared * std::ldexp(1.0f, split - static_cast<int>(bits >> 23));
    const auto& c = coefficient[channel];
    float value = c[kN - 1][segment], slope = 0.0f, curvature = 0.0f;
    for (int k = kN - 2; k >= 0; --k) {
        curvature = curvature * t + slope;
        slope = slope * t + value;
        value = value * t + c[k][segment];
    }
    return {value, slope * t_per_q, 2.0f * curvature * t_per_q * t_per_q};
}

}  // namespace frazil
