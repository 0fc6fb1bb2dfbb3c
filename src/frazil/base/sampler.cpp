#include "frazil/base/sampler.h"

#include <algorithm>

#include "frazil/base/random.h"

namespace frazil {
namespace {

std::uint32_t reverse_bits(std::uint32_t x) {
    x = ((x >> 1) & 0x55555555U) | ((x & 0x55555555U) << 1);
    x = ((x >> 2) & 0x33333333U) | ((x & 0x33333333U) << 2);
    x = ((x >> 4) & 0x0f0f0f0fU) | ((x & 0x0f0f0f0fU) << 4);
    return __builtin_bswap32(x);
}

// Nested uniform scramble of a bit-reversed integer: a Laine-Karras permutation, constants after [Burley2020] and
// N. Vegdahl's improved set.
std::uint32_t laine_karras(std::uint32_t x, std::uint32_t seed) {
    x ^= x * 0x3d20adeaU;
    x += seed;
    x *= (seed >> 16) | 1U;
    x ^= x * 0x05526c56U;
    x ^= x * 0x53a22864U;
    return x;
}

std::uint32_t owen_scramble(std::uint32_t x, std::uint32_t seed) {
    return reverse_bits(laine_karras(reverse_bits(x), seed));
}

// The second Sobol dimension of an index whose bits are reversed, which are the first dimension. Its generator matrix,
// Pascal's triangle modulo 2, is a Kronecker power, so that it takes one step per doubling of the bits.
std::uint32_t sobol_second_of_reversed(std::uint32_t x) {
    x ^= x << 16;
    x ^= (x & 0x00ff00ffU) << 8;
    x ^= (x & 0x0f0f0f0fU) << 4;
    x ^= (x & 0x33333333U) << 2;
    x ^= (x & 0x55555555U) << 1;
    return x;
}

std::uint32_t sobol_second(std::uint32_t index) {
    return sobol_second_of_reversed(reverse_bits(index));
}

// The first Sobol dimension, bits reversed, is the index itself.
float first_of_pair(std::uint32_t index, std::uint32_t pair_seed) {
    return to_unit_float(reverse_bits(laine_karras(index, hash(pair_seed, 1U))));
}

}  // namespace

Sampler::Sampler(std::uint32_t seed, std::uint32_t sequence, std::uint32_t sample)
    : sequence_seed_(hash(seed, sequence)), reversed_sample_(reverse_bits(sample)) {}

float Sampler::next_1d() {
    const std::uint32_t pair_seed = hash(sequence_seed_, dimension_++);
    return first_of_pair(reverse_bits(laine_karras(reversed_sample_, pair_seed)), pair_seed);
}

V2f Sampler::next_2d() {
    const std::uint32_t pair_seed = hash(sequence_seed_, dimension_++);
    const std::uint32_t reversed = laine_karras(reversed_sample_, pair_seed);  // the scrambled index
    const std::uint32_t y = owen_scramble(sobol_second_of_reversed(reversed), hash(pair_seed, 2U));
    return {first_of_pair(reverse_bits(reversed), pair_seed), to_unit_float(y)};
}

ScrambledNet::ScrambledNet(int count) {
    // Order the points along the curve that visits the square's quarters, and within each its quarters. Nested scrambling
    // permutes quarters at every level but takes none apart.
    struct Point {
        std::uint64_t key;
        std::uint32_t x, y;
    };
    std::vector<Point> points(static_cast<std::size_t>(count));
    for (std::uint32_t i = 0; i < points.size(); ++i) {
        Point& point = points[i];
        point.x = reverse_bits(i), point.y = sobol_second(i);
        point.key = 0;
        for (int bit = 31; bit >= 0; --bit) {
            point.key = (point.key << 2) | (((point.x >> bit) & 1U) << 1) | ((point.y >> bit) & 1U);
        }
    }
    std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.key < b.key; });
    for (const Point& point : points) {
        x_.push_back(reverse_bits(point.x));
        y_.push_back(reverse_bits(point.y));
    }
    while ((1 << bits_) < count) ++bits_;
}

void ScrambledNet::draw(std::uint32_t seed, std::uint32_t sequence, std::span<V2f> out) const {
    const std::uint32_t key = hash(seed, sequence), key_x = hash(key, 1U), key_y = hash(key, 2U);
    for (std::size_t i = 0; i < x_.size(); ++i) {
        out[i] = {to_unit_float(reverse_bits(laine_karras(x_[i], key_x))),
                  to_unit_float(reverse_bits(laine_karras(y_[i], key_y)))};
    }
}

void ScrambledNet::draw_part(std::uint32_t seed, std::uint32_t part, std::span<V2f> out) const {
    // The sequence's coordinates are linear in the index: a part's points are the first ones, moved by exclusive or.
    const std::uint32_t start = owen_scramble(part, hash(seed, 3U)) << bits_;
    const std::uint32_t start_y = reverse_bits(sobol_second(start));
    const std::uint32_t key_x = hash(seed, 1U), key_y = hash(seed, 2U);
    for (std::size_t i = 0; i < x_.size(); ++i) {
        out[i] = {to_unit_float(reverse_bits(laine_karras(x_[i] ^ start, key_x))),
                  to_unit_float(reverse_bits(laine_karras(y_[i] ^ start_y, key_y)))};
    }
}

}  // namespace frazil
