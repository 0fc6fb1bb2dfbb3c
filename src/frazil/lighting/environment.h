// A lat-long image of radiance from all around, with importance sampling.
// Model: bilinear between pixel centres; directions are drawn in proportion to that very function of luminance, cell by
//   cell between four centres [PBRT4, Section 12.5], and uniform in solid angle down to the slope within a cell.
// Units: radiance; directions in the light's own frame: row 0 is +y, the centre of the image +z, and +x lies left of the
//   centre (OpenEXR's latitude-longitude map, which UsdLuxDomeLight follows).
// Valid: any image of finite pixels, 1 x 1 to kMostPixels; negative ones subtract; a black one samples uniformly. pdf()
//   is exact for sample() and nowhere 0 where there is light. Memory: 16 bytes a pixel, 1 KiB a row.
// Not: mip-maps.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/environment_kernel.h"

namespace frazil {

class Environment {
  public:
    static constexpr std::size_t kMostPixels = std::size_t(1) << 29;  // 32768 x 16384

    // Row-major pixels, row 0 on top. ValueError (beginning with `path`) where the size is wrong or a pixel is not
    // finite.
    Environment(int width, int height, std::vector<Rgb> pixels, const std::string& path);

    // A direction and its solid-angle pdf; its radiance on the way.
    V3f sample(const V2f& u, float& pdf, Rgb& radiance) const;
    V3f sample(const V2f& u, float& pdf) const {
        Rgb radiance;
        return sample(u, pdf, radiance);
    }
    // Radiance and density of a direction.
    Rgb eval(const V3f& direction, float& pdf) const;
    Rgb eval(const V3f& direction) const {
        float pdf;
        return eval(direction, pdf);
    }
    float pdf(const V3f& direction) const {
        float pdf;
        eval(direction, pdf);
        return pdf;
    }
    // Many of either at once, several times faster; the same bits. Directions that certainly lie behind the plane of
    // `normal` (zero: none do) are left out, with a pdf of 0.
    void eval_many(std::span<const V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances) const;
    void sample_many(const V3f& normal, std::span<const V2f> u, std::span<V3f> directions, std::span<float> pdfs,
                     std::span<Rgb> radiances) const;
    int width() const { return width_; }
    int height() const { return height_; }
    const std::vector<Rgb>& pixels() const { return pixels_; }
    // Mean absolute luminance over the sphere.
    float brightness() const { return 0.25f * kInvPi * integral_; }
    // An estimate of the irradiance on a plane of that normal, over brightness(): spherical harmonics up to degree 2
    // [Ramamoorthi2001] of the absolute luminance. Errors of a tenth are usual; below 0 beside a lone sun.
    float irradiance(const V3f& normal) const;

  private:
    void set_moments();
    EnvironmentTables tables() const;

    int width_, height_;
    std::vector<Rgb> pixels_;
    std::vector<float> marginal_cdf_, conditional_cdf_;  // height + 2; height + 1 rows of width + 1
    std::vector<std::uint32_t> guides_;  // where a search in each conditional row, then the marginal, begins
    std::vector<float> row_cosine_;      // cos(theta) at the upper edge of each row of cells; height + 2
    float integral_ = 0.0f;              // of the absolute luminance over the sphere
    // Moments of the absolute luminance over the sphere, over brightness(): directions, and their products xx yy zz xy xz yz.
    V3f first_moment_ = V3f(0.0f);
    std::array<float, 6> second_moment_{};
};

}  // namespace frazil
