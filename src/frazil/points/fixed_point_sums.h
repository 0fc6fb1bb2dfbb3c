// Sums that do not depend on the order of their terms, for areas that many threads share out.
// Model: 64-bit fixed point, scaled so that the total of all terms just fits.
// Valid: terms whose sum is at most `total`; the rounding of each is total / 2^61.
// Not: terms of unknown total.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

namespace frazil {

class FixedPointSums {
  public:
    FixedPointSums(std::size_t count, double total)
        : quantum_(std::ldexp(total, -61)), inverse_(1.0 / quantum_), sums_(count, 0) {}

    // Thread-safe.
    void add(std::size_t index, double value) {
        std::atomic_ref<std::int64_t>(sums_[index])
            .fetch_add(static_cast<std::int64_t>(value * inverse_), std::memory_order_relaxed);
    }
    double at(std::size_t index) const { return static_cast<double>(sums_[index]) * quantum_; }

  private:
    double quantum_, inverse_;
    std::vector<std::int64_t> sums_;
};

}  // namespace frazil
