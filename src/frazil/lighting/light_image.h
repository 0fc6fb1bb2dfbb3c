// A flat image that a light shines through, with importance sampling.
// Model: bilinear between pixel centres, the edge repeated; positions are drawn pixel by pixel in proportion to absolute
//   luminance, evenly within each.
// Units: factors on radiance; positions in [0, 1]², x to the right and y down from the upper left corner.
// Valid: finite pixels, at least 1 x 1; negative ones subtract; a black image samples evenly. The density can be 0 where
//   a bright pixel reaches into its black neighbour: mix it with another technique.
// Not: mip-maps, repetition.
#pragma once

#include <string>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

class LightImage {
  public:
    // Row-major pixels, row 0 on top. ValueError (beginning with `path`) where the size is wrong or a pixel not finite.
    LightImage(int width, int height, std::vector<Rgb> pixels, const std::string& path);

    Rgb eval(const V2f& position) const;
    // A position and its density over the unit square.
    V2f sample(const V2f& u, float& pdf) const;
    float pdf(const V2f& position) const;
    int width() const { return width_; }
    int height() const { return height_; }
    const std::vector<Rgb>& pixels() const { return pixels_; }
    // Mean absolute luminance.
    float brightness() const { return brightness_; }

  private:
    int width_, height_;
    std::vector<Rgb> pixels_;
    std::vector<float> row_cdf_, column_cdf_;  // height + 1; height rows of width + 1
    float brightness_ = 0.0f;
};

}  // namespace frazil
