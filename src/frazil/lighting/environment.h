// A lat-long image of radiance from all around, with importance sampling.
// Model: bilinear between pixel centres; directions are drawn in proportion to that very function of luminance, cell by
//   cell between four centres [PBRT4, Section 12.5], and uniform in solid angle down to the slope within a cell.
// Units: radiance; directions in the light's own frame: row 0 is +y, the centre of the image +z, and +x lies left of the
//   centre (OpenEXR's latitude-longitude map, which UsdLuxDomeLight follows).
// Valid: any image of finite pixels, at least 1 x 1; negative ones subtract; a black one samples uniformly. pdf() is
//   exact for sample() and nowhere 0 where there is light. Memory: 16 bytes a pixel,
//   1 KiB a row.
// Not: mip-maps.
#pragma once

#include <array>
#include <span>
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
    // A direction and its solid-angle pdf; its radiance on the way.
    V3f sample(const V2f& u, float& pdf, Rgb& radiance) const;
    V3f sample(const V2f& u, float& pdf) const {
        Rgb radiance;
        return sample(u, pdf, radiance);
    }
    float pdf(const V3f& direction) const;
    // Both at once, for the price of one.
    Rgb eval(const V3f& direction, float& pdf) const;
    // Many of either at once: memory is asked for ahead of its use, which is what large images wait for. The same bits.
    void eval_many(std::span<const V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances) const;
    void sample_many(std::span<const V2f> u, std::span<V3f> directions, std::span<float> pdfs,
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
    // The rectangle between four pixel centres: columns column, column + 1 (around the seam), rows row - 1, row (half a
    // cell at the poles). `across` and `down` in [0, 1] are the place in it, `down` linear in the angle.
    struct Cell {
        int column, row;
        float across, down;
        const Rgb* corner[4];  // upper left, upper right, lower left, lower right
    };
    Cell cell_of(const V3f& direction) const;
    Rgb eval_in(const Cell& cell, const V3f& direction, float& pdf) const;
    const std::uint32_t* guide_of(int row) const;
    // The steps of sample(): the row, the column, and the place in the cell with what is found there.
    int sample_row(float u) const;
    void sample_column(float u, Cell& cell) const;
    V3f sample_in(Cell& cell, const V2f& u, float& pdf, Rgb& radiance) const;
    void set_corners(Cell& cell) const;
    static Rgb radiance_in(const Cell& cell);
    // `down_cosine` is the place in the cell linear in the cosine.
    float pdf_in(const Cell& cell, float down_cosine) const;

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
