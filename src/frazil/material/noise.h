// Noise in space: the raw matter of patterns. Pure functions of place and seed, without seams or period.
// Model: gradient noise on a hashed lattice; cells about one jittered point each, with the exact distance to their walls.
// Units: of the lattice: one cell is 1 wide.
// Valid: |place| < 1e6; the same bits everywhere.
// Not: derivatives.
#pragma once

#include <cstdint>

#include "frazil/base/random.h"
#include "frazil/base/vec.h"

namespace frazil {

// Smooth, about -0.8..0.8, mean 0.
float gradient_noise(const V3f& place, std::uint32_t seed);

inline constexpr float kLacunarity = 2.03f;

// How much of an octave is seen: a footprint wider than half a cell sees its mean, which is 0.
inline float octave_seen(float footprint, float frequency) {
    const float seen = 2.0f - 4.0f * footprint * frequency;
    return seen < 0.0f ? 0.0f : seen > 1.0f ? 1.0f : seen;
}

// Three independent ones at once.
V3f vector_noise(const V3f& place, std::uint32_t seed);

// Octaves of it, each half as strong and kLacunarity times as fine; those finer than the footprint (radius) fade out.
float fractal_noise(const V3f& place, int octaves, float footprint, std::uint32_t seed);
// The variance of what the footprint leaves out of it.
float fractal_variance_left_out(int octaves, float footprint);

// Where the place lies in the cells about one random point per lattice cell.
struct CellWall {
    float distance = 1e30f;  // to the nearest wall, where there is one within reach
    V3f normal = V3f(0.0f);  // of that wall
    std::uint32_t id = 0;    // of the wall: the same from both sides
};
CellWall nearest_cell_wall(const V3f& place, float reach, std::uint32_t seed);

// The random point of a lattice cell, and a hash of the cell.
inline constexpr float kTenBits = 1.0f / 1024.0f;
inline constexpr std::uint32_t kCellX = 0x8da6b343U, kCellY = 0xd8163841U, kCellZ = 0xcb1ab31fU,
                               kCellSeed = 0x9e3779b9U;
V3f cell_point(int x, int y, int z, std::uint32_t seed);
inline std::uint32_t cell_hash(int x, int y, int z, std::uint32_t seed) {
    return hash((std::uint32_t(x) * kCellX) ^ (std::uint32_t(y) * kCellY) ^ (std::uint32_t(z) * kCellZ) ^
                (seed * kCellSeed));
}

}  // namespace frazil
