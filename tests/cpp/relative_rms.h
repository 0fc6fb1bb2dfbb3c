// How far one list of colours is from another.
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/render/core_sums.h"

namespace frazil::test {

// RMS of the difference over that of `b`, all channels together.
inline double relative_rms(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    REQUIRE(a.size() == b.size());
    double difference = 0.0, whole = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        difference += double((a[i] - b[i]).length2());
        whole += double(b[i].length2());
    }
    return std::sqrt(difference / whole);
}

// Some columns of all rows.
inline std::vector<Rgb> columns(const CoreSums& sums, std::size_t first, std::size_t count) {
    std::vector<Rgb> values;
    for (std::size_t i = 0; i < sums.size(); ++i) {
        values.insert(values.end(), sums.row(i) + first, sums.row(i) + first + count);
    }
    return values;
}

}  // namespace frazil::test
