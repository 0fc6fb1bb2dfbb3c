// Owen-scrambled Sobol points, as a pure function of (seed, sequence, sample, dimension).
// Model: [Burley2020] hash-based nested uniform scrambling of the first two Sobol dimensions; further pairs of
//   dimensions are the same two, shuffled against each other by Owen-scrambling the sample index.
// Units: values in [0, 1).
// Valid: up to 2^32 samples; the first 2^m samples of every pair are a (0,m,2)-net in base 2.
// Not: one sequence over all pixels; each pixel (or point) is a sequence of its own.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

// A stream of quasi-random numbers for one sample: next_1d/next_2d walk the dimensions in order.
class Sampler {
  public:
    // `sequence` tells pixels (or points) apart; `sample` is the index in the sequence.
    Sampler(std::uint32_t seed, std::uint32_t sequence, std::uint32_t sample);

    float next_1d();
    // Both numbers come from one pair of dimensions, so that they are stratified together.
    V2f next_2d();

    // Go to a given dimension, so that a later decision does not depend on how many numbers an earlier one took.
    void set_dimension(std::uint32_t dimension) { dimension_ = dimension; }

  private:
    std::uint32_t sequence_seed_;
    std::uint32_t reversed_sample_;  // the bits of its index
    std::uint32_t dimension_ = 0;
};

// All samples of a pair of dimensions at once, many times faster than one by one: a fixed (0,m,2)-net whose points are
// Owen-scrambled anew for every sequence. Points that follow one another lie near one another in the square, so that the
// rays made of them are coherent.
class ScrambledNet {
  public:
    explicit ScrambledNet(int count);
    std::size_t size() const { return x_.size(); }

    // Fill out[0 .. size()).
    void draw(std::uint32_t seed, std::uint32_t sequence, std::span<V2f> out) const;
    // The same of one long sequence's part: parts that follow one another (each of a power of two of points) fill the square
    // together, so that the mean over neighbours has less noise than that of as many sequences. Two seeds' parts of one number
    // are not independent of each other.
    void draw_part(std::uint32_t seed, std::uint32_t part, std::span<V2f> out) const;

  private:
    int bits_ = 0;                      // of the count, rounded up
    std::vector<std::uint32_t> x_, y_;  // unscrambled coordinates, bits reversed
};

}  // namespace frazil
