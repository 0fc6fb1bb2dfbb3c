// Look-ups and draws in a lat-long image, many at once, by SIMD.
// Model: environment.h; this is its arithmetic, without a fused multiply-add, so that every processor gives the same bits,
//   for one look-up as for many.
// Units: as environment.h.
// Valid: tables of at most 2^31 entries. Memory is asked for ahead of its use, which is what large images wait for.
#pragma once

#include <cstdint>
#include <span>

#include "frazil/base/vec.h"

namespace frazil {

// A search begins in one of so many equal intervals of u, whose first bin is known.
inline constexpr int kEnvironmentGuides = 256;

struct EnvironmentTables {
    int width = 0, height = 0;
    const Rgb* pixels = nullptr;
    // Cumulative distributions of rows of cells (height + 2) and, row after row, of their columns (width + 1); where a search
    // in each column distribution, then in that of the rows, begins.
    const float* marginal_cdf = nullptr;
    const float* conditional_cdf = nullptr;
    const std::uint32_t* guides = nullptr;
    const float* row_cosine = nullptr;  // cos(theta) at the upper edge of each row of cells; height + 2
    float integral = 0.0f;              // of the absolute luminance over the sphere; 0 = black, uniform density
};

// Radiance and density in each direction.
void eval_environment(const EnvironmentTables& tables, std::span<const V3f> directions, std::span<float> pdfs,
                      std::span<Rgb> radiances);

// A direction for each u, with its density and radiance; a density of 0 and no direction where the cell that u falls into
// lies wholly behind the plane of `normal` (zero: there is none).
void sample_environment(const EnvironmentTables& tables, const V3f& normal, std::span<const V2f> u,
                        std::span<V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances);

}  // namespace frazil
