// Names as numbers for mattes: which object, material or asset each pixel shows, and how much of it.
// Model: [Friedman2015], the published specification: MurmurHash3_32 of the name's UTF-8, turned into a float32 that is
//   neither denormal, infinite nor NaN; ranks of (id, coverage) sorted by coverage.
// Units: coverage is the share of a pixel's samples, so filter-weighted.
// Valid: exact for pixels that show up to kIdSlots names; of more, the rarest of a pass are forgotten.
// Not: the file's metadata and manifest (frazil/cryptomatte.py).
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

namespace frazil {

inline constexpr int kIdRanks = 6;  // in the picture: three layers of two
inline constexpr int kIdSlots = 8;  // while it is rendered

// MurmurHash3_x86_32 with seed 0.
std::uint32_t murmur3_32(std::string_view text);

// The id that stands for a name in a picture's channels.
float cryptomatte_id(std::string_view name);

// How many samples of a pixel showed which object.
using IdCounts = std::vector<std::pair<std::uint32_t, float>>;
void count_id(IdCounts& counts, std::uint32_t object, float samples = 1.0f);

// Add a pass's counts to a pixel's slots: kIdSlots pairs of id and number of samples, 0 and 0 where empty.
void add_ids(const IdCounts& counts, std::span<const float> id_of_object, float* slots);

// Write the ranks of a pixel, (id, coverage) pairs by falling coverage, kIdRanks of them.
void write_ranks(const float* slots, float scale, float* ranks);

}  // namespace frazil
