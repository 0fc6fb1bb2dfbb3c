// Chi-square test of a direction sampler against its pdf, on the sphere cut into cells of equal solid angle.
// Model: counts of sample() per cell against the integral of pdf() over the cell by `kPerCell`² midpoints; cells whose
//   expectation is small are pooled; the statistic's p-value by the Wilson-Hilferty approximation.
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/base/vec.h"

namespace frazil::test {

struct ChiSquare {
    double p_value = 0.0;
    double mass = 0.0;      // integral of the pdf over the cells
    double hit_rate = 0.0;  // fraction of samples that fell into the cells
};

// `sample(u, direction)` returns false for a lost sample. The `axis` is the pole of the cells: put it where the density
// peaks. `cap` restricts the cells to 1 - cos < cap about it (2 = the whole sphere); samples beyond are left out.
inline ChiSquare chi_square(const std::function<bool(const V2f&, V3f&)>& sample,
                            const std::function<double(const V3f&)>& pdf, const V3f& axis, double cap = 2.0,
                            std::uint32_t seed = 1, int count = 100000) {
    constexpr int kRings = 32, kSectors = 32, kPerCell = 24;
    const auto [s, t] = tangent_frame(axis);
    std::vector<double> expected(kRings * kSectors, 0.0), counted(kRings * kSectors, 0.0);
    const double cell = cap * 2.0 * 3.14159265358979323846 / (kRings * kSectors * kPerCell * kPerCell);
    for (int i = 0; i < kRings * kPerCell; ++i) {
        const double one_minus_z = cap * (i + 0.5) / (kRings * kPerCell);
        const double sine = std::sqrt(one_minus_z * (2.0 - one_minus_z));
        for (int j = 0; j < kSectors * kPerCell; ++j) {
            const double phi = 2.0 * 3.14159265358979323846 * (j + 0.5) / (kSectors * kPerCell);
            const V3f d =
                s * float(sine * std::cos(phi)) + t * float(sine * std::sin(phi)) + axis * float(1 - one_minus_z);
            expected[std::size_t((i / kPerCell) * kSectors + j / kPerCell)] += pdf(d) * cell;
        }
    }
    ChiSquare result;
    for (const double e : expected) result.mass += e;
    int hits = 0;
    for (int i = 0; i < count; ++i) {
        // Independent points: a sequence each, as quasi-random ones would pass too easily.
        Sampler sampler(seed, std::uint32_t(i), 0);
        V3f d;
        if (!sample(sampler.next_2d(), d)) continue;
        const double one_minus_z = 0.5 * double((d - axis).length2()) / cap;
        double phi = std::atan2(double(d.dot(t)), double(d.dot(s))) / (2.0 * 3.14159265358979323846);
        if (phi < 0.0) phi += 1.0;
        if (one_minus_z >= 1.0) continue;
        ++hits;
        const int ring = int(one_minus_z * kRings), sector = std::min(int(phi * kSectors), kSectors - 1);
        counted[std::size_t(ring * kSectors + sector)] += 1.0;
    }
    result.hit_rate = double(hits) / count;
    double statistic = 0.0, pooled_expected = 0.0, pooled_counted = 0.0;
    int cells = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        const double e = expected[i] * count;
        if (e < 20.0) {
            pooled_expected += e, pooled_counted += counted[i];
            continue;
        }
        statistic += (counted[i] - e) * (counted[i] - e) / e;
        ++cells;
    }
    // Samples where the density is nothing show here.
    if (pooled_expected > 5.0 || pooled_counted > 25.0) {
        const double e = std::max(pooled_expected, 1.0);
        statistic += (pooled_counted - e) * (pooled_counted - e) / e;
        ++cells;
    }
    const double dof = std::max(cells - 1, 1);
    const double z = (std::cbrt(statistic / dof) - (1 - 2 / (9 * dof))) / std::sqrt(2 / (9 * dof));
    result.p_value = 0.5 * std::erfc(z / std::sqrt(2.0));
    return result;
}

}  // namespace frazil::test
