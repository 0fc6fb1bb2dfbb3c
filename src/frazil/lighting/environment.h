// A lat-long image of radiance from all around, with importance sampling.
// Model: piecewise-constant density per pixel, proportional to the mean luminance of the bilinear lookup over it and to
//   the solid angle that it covers [PBRT4, Section 12.5]; no direction that gives light has density 0; pdf() is exact
//   for sample().
// Units: radiance; directions in the light's own frame: row 0 is +y, the centre of the image +z, and +x lies left of the
//   centre (OpenEXR's latitude-longitude map, which UsdLuxDomeLight follows).
// Valid: any image of finite pixels, at least 1 x 1; negative ones subtract; a black one samples uniformly.
#pragma once

#include <string>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

class Environment {
  public:
    // Row-major pixels, row 0 on top. ValueError (beginning with `path`) where the size is wrong or a pixel is not
    // finite.
    Environment(int width, int height, std::vector<Rgb> pixels, const std::string& path);

    Rgb eval(const V3f& direction) const;
    // A direction and its solid-angle pdf.
    V3f sample(const V2f& u, float& pdf) const;
    float pdf(const V3f& direction) const;
    // Mean radiance over the sphere.
    Rgb average() const { return average_; }

  private:
    // Position of a direction in pixels: column in [0, width), row in [0, height).
    V2f pixel_of(const V3f& direction) const;
    float pdf_of_pixel(int column, int row) const;

    int width_, height_;
    std::vector<Rgb> pixels_;
    std::vector<float> marginal_cdf_, conditional_cdf_;  // height + 1; height rows of width + 1
    std::vector<float> row_cosine_;                      // cos(theta) at the upper edge of each row; height + 1
    Rgb average_;
};

}  // namespace frazil
