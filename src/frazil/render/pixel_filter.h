// Where in and around a pixel its samples go: distributed as the filter, so that every pixel is an independent average.
// Model: inverse of the tabulated cumulative Blackman-Harris window, 3 pixels wide; or a box of one pixel.
// Units: pixels.
#pragma once

#include <array>
#include <cstdint>

namespace frazil {

enum class PixelFilter { box, blackman_harris };

class FilterSampler {
  public:
    explicit FilterSampler(PixelFilter filter);

    // The offset from the pixel's centre along one axis, for u in [0, 1).
    float offset(float u) const;

  private:
    static constexpr int kSize = 256;
    // The bin that u falls into, which is `bin` or comes after it.
    int bin_from(int bin, float u) const;

    PixelFilter filter_;
    std::array<float, kSize + 1> cdf_{};
    std::array<std::uint8_t, kSize> first_bin_{};  // of u in each of as many equal intervals
};

}  // namespace frazil
