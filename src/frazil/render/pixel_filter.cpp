#include "frazil/render/pixel_filter.h"

#include <algorithm>
#include <cmath>

namespace frazil {
namespace {

constexpr float kBlackmanHarrisWidth = 3.0f;

}  // namespace

FilterSampler::FilterSampler(PixelFilter filter) : filter_(filter) {
    double total = 0.0;
    for (int i = 0; i < kSize; ++i) {
        const double x = 2.0 * M_PI * (i + 0.5) / kSize;
        total += 0.35875 - 0.48829 * std::cos(x) + 0.14128 * std::cos(2.0 * x) - 0.01168 * std::cos(3.0 * x);
        cdf_[i + 1] = static_cast<float>(total);
    }
    for (float& value : cdf_) value /= static_cast<float>(total);
}

float FilterSampler::offset(float u) const {
    if (filter_ == PixelFilter::box) return u - 0.5f;
    const auto above = std::upper_bound(cdf_.begin() + 1, cdf_.end() - 1, u);
    const auto bin = static_cast<int>(above - cdf_.begin()) - 1;
    const float inside = (u - cdf_[bin]) / (cdf_[bin + 1] - cdf_[bin]);
    return kBlackmanHarrisWidth * ((static_cast<float>(bin) + inside) / kSize - 0.5f);
}

}  // namespace frazil
