// How far one list of colours is from another.
#pragma once

#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "frazil/base/vec.h"

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

}  // namespace frazil::test
