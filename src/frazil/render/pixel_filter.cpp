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
    for (int i = 0; i < kSize; ++i) first_bin_[i] = static_cast<std::uint8_t>(bin_from(0, float(i) / kSize));
}

int FilterSampler::bin_from(int bin, float u) const {
    while (bin + 1 < kSize && !(u < cdf_[bin + 1])) ++bin;
    return bin;
}

float FilterSampler::offset(float u) const {
    if (filter_ == PixelFilter::box) return u - 0.5f;
    const int bin = bin_from(first_bin_[static_cast<std::size_t>(u * kSize)], u);
    const float inside = (u - cdf_[bin]) / (cdf_[bin + 1] - cdf_[bin]);
    return kBlackmanHarrisWidth * ((static_cast<float>(bin) + inside) / kSize - 0.5f);
}

}  // namespace frazil
