// A lat-long image of radiance from all around, with importance sampling.
// Model: piecewise-constant 2-D distribution over luminance times sin(theta) [PBRT4, Section 12.5], evaluated with
//   bilinear interpolation; pdf() is exact for sample().
// Units: radiance; directions in the light's own frame: row 0 is +y, the centre of the image +z, and +x lies left of
// the
//   centre (OpenEXR's latitude-longitude map, which UsdLuxDomeLight follows).
// Valid: any image of finite pixels >= 0, at least 1 x 1; a black one samples uniformly.
#pragma once

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
    int width_, height_;
    std::vector<Rgb> pixels_;
    std::vector<float> marginal_cdf_, conditional_cdf_;
    Rgb average_;
};

}  // namespace frazil
