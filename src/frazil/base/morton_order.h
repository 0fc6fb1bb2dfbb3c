// Positions in the order of a Morton curve through their box: neighbours in it are near in space.
// Model: morton.h.
// Units: none.
// Valid: up to 2^32 positions; those in one cell keep their order; the same for any number of threads.
// Not: a measure of distance.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frazil/base/morton.h"
#include "frazil/base/radix_sort.h"

namespace frazil {

inline std::vector<std::uint32_t> morton_order(std::span<const V3f> positions) {
    Box3f box;
    for (const V3f& p : positions) box.extendBy(p);
    const MortonGrid grid(box);
    std::vector<KeyedIndex> keys(positions.size()), scratch;
    for (std::uint32_t i = 0; i < keys.size(); ++i) keys[i] = {grid.code(positions[i]), i};
    radix_sort(keys, 3 * kMortonBits, scratch);
    std::vector<std::uint32_t> order(keys.size());
    for (std::size_t i = 0; i < keys.size(); ++i) order[i] = keys[i].index;
    return order;
}

}  // namespace frazil
