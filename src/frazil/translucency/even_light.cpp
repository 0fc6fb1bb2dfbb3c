#include "frazil/translucency/even_light.h"

#include <algorithm>
#include <cmath>

namespace frazil {
namespace {

constexpr double kMostScattered = 1.0 - 1e-4;

}  // namespace

EvenLight::EvenLight(double alpha, double eta)
    : albedo_(static_cast<float>(half_space_albedo(alpha, eta).all())), by_angle_(alpha, eta) {
    fill_absorbed_at(alpha, eta);
    if (!(alpha < 1.0) || !(alpha > 0.0)) return;
    const HalfSpaceDepths source = half_space_absorbed(alpha);
    // Where the boundary reflects, the surface of a half space scatters less, but a body that is thin absorbs as little: the
    // exponent has further to go from the one to the other.
    const double none = -std::log1p(-alpha);  // of a body without any extent
    const double scale = 2.0 * (1.0 + std::log1p(-double(returned(0.0f))) / none);
    // There what is absorbed changes less with the depth: as what a half space does not send changes with mu, straight on.
    const double slope_scale =
        eta == 1.0 ? 1.0 : (absorbed_at(1.0f) - 1.0) / (EvenLight(alpha, 1.0).absorbed_at(1.0f) - 1.0);
    const std::size_t n = source.depths.size();
    first_ = static_cast<float>(std::log(source.depths.front()));
    steps_ = static_cast<float>(double(n - 1) / std::log(source.depths.back() / source.depths.front()));
    std::vector<double> exponent(n);
    for (std::size_t i = 0; i < n; ++i) exponent[i] = -std::log(source.absorbed[i]);
    // By logarithms of the depth.
    const auto derivative = [&](const std::vector<double>& values) {
        std::vector<double> slopes(n);
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t before = i > 0 ? i - 1 : i, after = std::min(i + 1, n - 1);
            slopes[i] = (values[after] - values[before]) * double(steps_) / double(after - before);
        }
        return slopes;
    };
    const std::vector<double> first = derivative(exponent), second = derivative(first);
    for (std::size_t i = 0; i < n; ++i) {
        const double depth = source.depths[i];
        const auto add = [&](std::vector<Exponent>& table, double value, double slope) {
            table.push_back({static_cast<float>(scale * value), static_cast<float>(slope_scale * slope)});
        };
        add(half_space_, exponent[i], first[i] / depth);
        add(along_, 2.0 * (exponent[i] - first[i]), (2.0 * second[i] - 6.0 * first[i]) / depth);
    }
}

void EvenLight::fill_absorbed_at(double alpha, double eta) {
    // Where next to nothing is absorbed it is as deep, but lost in rounding.
    alpha = std::clamp(alpha, 0.0, kMostScattered);
    const double albedo = half_space_albedo(alpha, eta).all();
    const DirectionalAlbedo by_angle(alpha, eta);
    const auto absorbed = [&](int i) { return 1.0 - albedo * double(by_angle(float(i * i) / float(kSteps * kSteps))); };
    for (int i = 1; i <= kSteps; ++i) {
        const int after = std::min(i + 1, kSteps);
        const double root = double(i) / kSteps;
        const double slope = (absorbed(after) - absorbed(i - 1)) * kSteps / double(after - i + 1);  // by the root of mu
        absorbed_at_[std::size_t(i)] = static_cast<float>(root * root * (1.0 + 0.5 * root * slope / absorbed(i)));
    }
}

float EvenLight::absorbed_at(float mu) const {
    const float x = std::sqrt(std::clamp(mu, 0.0f, 1.0f)) * kSteps;
    const int i = std::min(static_cast<int>(x), kSteps - 1);
    const float f = x - static_cast<float>(i);
    return absorbed_at_[std::size_t(i)] * (1.0f - f) + absorbed_at_[std::size_t(i) + 1] * f;
}

EvenLight::Exponent EvenLight::look_up(const std::vector<Exponent>& table, float depth) const {
    if (table.empty()) return {};
    const float at = depth > 0.0f ? (std::log(depth) - first_) * steps_ : 0.0f;
    if (!(at > 0.0f)) return table.front();
    if (at >= static_cast<float>(table.size() - 1)) return {};
    const auto i = static_cast<std::size_t>(at);
    const float f = at - static_cast<float>(i);
    const Exponent &low = table[i], &high = table[i + 1];
    return {low.value + f * (high.value - low.value), low.slope + f * (high.slope - low.slope)};
}

}  // namespace frazil
