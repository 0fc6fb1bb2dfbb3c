// How much denser a body is than its medium from place to place: clouds of bubbles in clear ice, or a grid.
// Model: coefficients at a place are the medium's times the density there: sigma_s' by all of it, sigma_a by the part
//   `absorption` of it (0 = bubbles, which scatter and leave the ice between them as it is). Light crosses a way by
//   exp(-sigma_s' D) and exp(-sigma_a ((1 - absorption) d + absorption D)), D the density's integral over its d metres.
//   Noise: the density's logarithm is fractal gradient noise, so that it is positive; its mean over space is 1. Grid:
//   trilinear between voxels.
// Units: densities have none; lengths in metres.
// Valid: grids are integrated exactly but for rounding (a trilinear cell is a cubic along a ray, two Gauss points do);
//   noise within 1e-3 over its first 1024 steps of a quarter of its finest feature, beyond which it counts as its mean.
//   Thread-safe.
// Not: how light spreads by diffusion from place to place: there a body is of one medium, that of its mean density
//   (mean_medium); motion of a deforming mesh.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/geometry/mesh.h"
#include "frazil/translucency/medium.h"

namespace frazil {

// Densities at the corners of a lattice of cells; z runs fastest.
struct DensityGrid {
    V3i size = V3i(0);
    std::vector<float> values;
    M44f index_to_object;  // voxel (i, j, k) lies at (i, j, k) * this, in the object's own frame
    float outside = 0.0f;  // the density beyond the lattice
};

struct Density {
    std::shared_ptr<const DensityGrid> grid;  // null = noise
    float contrast = 0.0f;                    // standard deviation of the noise's logarithm; 0 = the same everywhere
    float size = 0.3f;                        // of its widest features, metres in rest space
    int octaves = 3;
    std::uint32_t seed = 0;
    float scale = 1.0f;       // of noise or grid
    float absorption = 1.0f;  // how much of the density counts for sigma_a

    bool is_even() const { return !grid && contrast == 0.0f && scale == 1.0f; }
};

// Refuse what is out of range: ValueError beginning with `path`.
void check_density(const Density& density, const std::string& path);

// The mean over a body: of noise its scale, of a grid that over the mesh's volume in its own frame; over its surface where
// it encloses none.
float mean_density(const Density& density, const Mesh& mesh);
// The medium of a body of such a mean density.
Medium mean_medium(const Medium& medium, const Density& density, float mean);

// The density of one object, ready to be read along rays in world space.
class DensityField {
  public:
    // `density` must outlive this.
    DensityField(const Density& density, const M44f& world_to_object, const M44f& world_to_rest);

    float at(const V3f& position) const;
    // The integral of the density along a unit direction, metres; `length` may be infinite.
    float depth(const V3f& origin, const V3f& direction, float length) const;
    // The length at which depth() reaches `depth`; `most` where it never does.
    float place(const V3f& origin, const V3f& direction, float depth, float most) const;

  private:
    float grid_at(const V3f& index, const V3i& cell) const;
    float noise_at(const V3f& rest) const;
    // Call visit(begin, end, density(t)) for pieces from 0 on in turn, over each of which the density is smooth, until it
    // returns false.
    template <class Visit>
    void march(const V3f& origin, const V3f& direction, float length, const Visit& visit) const;
    template <class Visit>
    void march_grid(const V3f& origin, const V3f& direction, float length, const Visit& visit) const;

    const Density& density_;
    M44f world_to_field_;                // of grids to indices, of noise to its lattice
    float step_ = 0.0f;                  // of noise, metres
    float gain_ = 0.0f, offset_ = 0.0f;  // of noise: density = exp(gain n + offset)
};

}  // namespace frazil
