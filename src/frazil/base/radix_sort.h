// Sorting indices by integer keys: stable, parallel, the same for any number of threads.
// Model: least significant digit first, 11 bits a pass; chunks of a fixed size count and scatter on their own.
// Units: none.
// Valid: up to 2^32 keys; equal keys keep their order.
// Not: for short lists in a hurry: under a few thousand keys one thread does it all.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "frazil/base/parallel.h"

namespace frazil {

struct KeyedIndex {
    std::uint64_t key;
    std::uint32_t index;
};

// Sort by the lower `bits` bits of the keys; `scratch` is room for the passes.
inline void radix_sort(std::vector<KeyedIndex>& keys, int bits, std::vector<KeyedIndex>& scratch) {
    constexpr int kDigit = 11;
    constexpr std::size_t kBuckets = std::size_t(1) << kDigit, kChunk = 1 << 16;
    const std::size_t count = keys.size(), chunks = (count + kChunk - 1) / kChunk;
    scratch.resize(count);
    std::vector<std::array<std::uint32_t, kBuckets>> offsets(chunks);
    for (int shift = 0; shift < bits; shift += kDigit) {
        const auto digit = [shift](const KeyedIndex& k) { return (k.key >> shift) & (kBuckets - 1); };
        parallel_for(count, kChunk, [&](std::size_t begin, std::size_t end) {
            auto& mine = offsets[begin / kChunk];
            mine.fill(0);
            for (std::size_t i = begin; i < end; ++i) ++mine[digit(keys[i])];
        });
        std::uint32_t sum = 0;
        for (std::size_t bucket = 0; bucket < kBuckets; ++bucket) {
            for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
                const std::uint32_t here = offsets[chunk][bucket];
                offsets[chunk][bucket] = sum;
                sum += here;
            }
        }
        parallel_for(count, kChunk, [&](std::size_t begin, std::size_t end) {
            auto& mine = offsets[begin / kChunk];
            for (std::size_t i = begin; i < end; ++i) scratch[mine[digit(keys[i])]++] = keys[i];
        });
        keys.swap(scratch);
    }
}

}  // namespace frazil
