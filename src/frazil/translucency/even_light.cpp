#include "frazil/translucency/even_light.h"

#include <algorithm>
#include <cmath>

namespace frazil {

EvenLight::EvenLight(double alpha, double eta)
    : albedo_(static_cast<float>(half_space_albedo(alpha, eta).all())), by_angle_(alpha, eta) {
    if (!(alpha < 1.0) || !(alpha > 0.0)) return;
    const HalfSpaceDepths source = half_space_absorbed(alpha);
    // Where the boundary reflects, the surface of a half space scatters less, but a body that is thin absorbs as little: the
    // exponent has further to go from the one to the other.
    const double none = -std::log1p(-alpha);  // of a body without any extent
    const double scale = 2.0 * (1.0 + std::log1p(-double(returned(0.0f))) / none);
    const std::size_t n = source.depths.size();
    first_ = static_cast<float>(std::log(source.depths.front()));
    steps_ = static_cast<float>(double(n - 1) / std::log(source.depths.back() / source.depths.front()));
    std::vector<double> exponent(n);
    for (std::size_t i = 0; i < n; ++i) exponent[i] = -std::log(source.absorbed[i]);
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t before = i > 0 ? i - 1 : i, after = std::min(i + 1, n - 1);
        const double slope = (exponent[after] - exponent[before]) * double(steps_) / double(after - before);
        half_space_.push_back(static_cast<float>(scale * exponent[i]));
        along_.push_back(static_cast<float>(scale * 2.0 * (exponent[i] - slope)));
    }
}

float EvenLight::half_space(float depth) const {
    return look_up(half_space_, depth);
}

float EvenLight::along(float length) const {
    return look_up(along_, length);
}

float EvenLight::look_up(const std::vector<float>& table, float depth) const {
    if (table.empty()) return 0.0f;
    const float at = depth > 0.0f ? (std::log(depth) - first_) * steps_ : 0.0f;
    if (!(at > 0.0f)) return table.front();
    if (at >= static_cast<float>(table.size() - 1)) return 0.0f;
    const auto i = static_cast<std::size_t>(at);
    const float f = at - static_cast<float>(i);
    return table[i] * (1.0f - f) + table[i + 1] * f;
}

}  // namespace frazil
