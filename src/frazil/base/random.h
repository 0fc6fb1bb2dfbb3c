// Hashes that stand in for random numbers: pure functions of integers, never a global or per-thread state.
// Model: the lowbias32 finaliser of C. Wellons; combine() chains it.
// Valid: any integers; bits pass the usual avalanche checks, not a cryptographic hash.
#pragma once

#include <cstdint>

namespace frazil {

inline std::uint32_t hash(std::uint32_t x) {
    x ^= x >> 16;
    x *= 0x7feb352dU;
    x ^= x >> 15;
    x *= 0x846ca68bU;
    x ^= x >> 16;
    return x;
}

inline std::uint32_t hash(std::uint32_t a, std::uint32_t b) {
    return hash(a ^ (hash(b) + 0x9e3779b9U));
}
inline std::uint32_t hash(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return hash(hash(a, b), c);
}

// The float in [0, 1) that the upper 24 bits make.
inline float to_unit_float(std::uint32_t bits) {
    return static_cast<float>(bits >> 8) * 0x1p-24f;
}

}  // namespace frazil
