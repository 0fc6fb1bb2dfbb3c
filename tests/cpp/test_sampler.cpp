// Stratification of the Owen-scrambled Sobol sampler.
#include <doctest/doctest.h>

#include <cmath>
#include <set>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"

using namespace frazil;

TEST_CASE("sampler: the first 2^m samples of every pair of dimensions are a (0,m,2)-net") {
    for (const std::uint32_t seed : {0U, 7U, 123456789U}) {
        for (std::uint32_t dimension = 0; dimension < 5; ++dimension) {
            for (int m = 0; m <= 10; ++m) {
                const std::uint32_t count = 1U << m;
                std::vector<V2f> points(count);
                for (std::uint32_t i = 0; i < count; ++i) {
                    Sampler sampler(seed, 42U, i);
                    sampler.set_dimension(dimension);
                    points[i] = sampler.next_2d();
                }
                // Every box of 2^a by 2^(m-a) intervals holds exactly one point.
                for (int a = 0; a <= m; ++a) {
                    std::set<std::pair<int, int>> boxes;
                    for (const V2f& p : points) {
                        boxes.insert({int(p.x * float(1 << a)), int(p.y * float(1 << (m - a)))});
                    }
                    REQUIRE(boxes.size() == count);
                }
            }
        }
    }
}

TEST_CASE("sampler: values are in [0, 1) and differ between sequences, dimensions and seeds") {
    const auto first = [](std::uint32_t seed, std::uint32_t sequence, std::uint32_t dimension) {
        Sampler sampler(seed, sequence, 0);
        sampler.set_dimension(dimension);
        return sampler.next_2d();
    };
    std::set<std::pair<float, float>> seen;
    for (std::uint32_t a = 0; a < 16; ++a) {
        for (std::uint32_t b = 0; b < 16; ++b) {
            for (std::uint32_t c = 0; c < 4; ++c) {
                const V2f p = first(a, b, c);
                CHECK((p.x >= 0.0f && p.x < 1.0f && p.y >= 0.0f && p.y < 1.0f));
                seen.insert({p.x, p.y});
            }
        }
    }
    CHECK(seen.size() == 16 * 16 * 4);
}

TEST_CASE("sampler: two pairs of dimensions are independent of each other") {
    // The mean of the product of two variates of different pairs is 1/4; of the same one, 1/3.
    constexpr std::uint32_t kSequences = 512, kSamples = 16;
    double product = 0.0;
    for (std::uint32_t s = 0; s < kSequences; ++s) {
        for (std::uint32_t i = 0; i < kSamples; ++i) {
            Sampler sampler(1, s, i);
            const float a = sampler.next_1d(), b = sampler.next_1d();
            product += double(a) * double(b);
        }
    }
    CHECK(product / (kSequences * kSamples) == doctest::Approx(0.25).epsilon(0.01));
}

TEST_CASE("sampler: a scrambled net is a (0,m,2)-net for every sequence, a new one each, its points in a local order") {
    for (const int m : {0, 3, 6, 9}) {
        const std::uint32_t count = 1U << m;
        const ScrambledNet net{int(count)};
        std::vector<V2f> points(count), other(count);
        double step = 0.0;
        for (const std::uint32_t sequence : {0U, 1U, 77U}) {
            net.draw(5U, sequence, points);
            for (int a = 0; a <= m; ++a) {
                std::set<std::pair<int, int>> boxes;
                for (const V2f& p : points) boxes.insert({int(p.x * float(1 << a)), int(p.y * float(1 << (m - a)))});
                REQUIRE(boxes.size() == count);
            }
            net.draw(5U, sequence + 1, other);
            CHECK(points != other);
            for (std::size_t i = 1; i < count; ++i)
                step += double((points[i] - points[i - 1]).length()) / (3.0 * count);
        }
        // In random order the mean step is 0.52 whatever the count; along the curve it shrinks with the spacing.
        if (m >= 6) CHECK(step < 2.5 / std::sqrt(double(count)));
    }
}

TEST_CASE("sampler: parts of a net's sequence that follow one another are one net together") {
    constexpr int kCount = 8, kLog = 3;
    const ScrambledNet net{kCount};
    for (const int log_parts : {0, 1, 2, 5}) {
        const std::uint32_t parts = 1U << log_parts;
        const int m = kLog + log_parts;
        for (const std::uint32_t first : {0U, 3U * parts, 40000U * parts}) {
            std::vector<V2f> points;
            for (std::uint32_t part = first; part < first + parts; ++part) {
                std::vector<V2f> drawn(kCount);
                net.draw_part(5U, part, drawn);
                points.insert(points.end(), drawn.begin(), drawn.end());
            }
            for (int a = 0; a <= m; ++a) {
                std::set<std::pair<int, int>> boxes;
                for (const V2f& p : points) boxes.insert({int(p.x * float(1 << a)), int(p.y * float(1 << (m - a)))});
                REQUIRE(boxes.size() == points.size());
            }
        }
    }
    std::vector<V2f> one(kCount), other(kCount);
    net.draw_part(5U, 7U, one), net.draw_part(6U, 7U, other);
    CHECK(one != other);
}

TEST_CASE("trigonometry: the polynomials are within their bounds") {
    double worst_circle = 0.0, worst_angle = 0.0;
    for (int i = 0; i <= 100000; ++i) {
        const float turns = float(i) / 100000.0f;
        const double angle = 2.0 * 3.14159265358979323846 * double(turns);
        const V2f p = cos_sin_turns(turns);
        worst_circle = std::max({worst_circle, std::abs(p.x - std::cos(angle)), std::abs(p.y - std::sin(angle))});
        const float y = float(std::sin(angle)), x = float(std::cos(angle));
        worst_angle = std::max(worst_angle, std::abs(double(fast_atan2(y, x)) - std::atan2(double(y), double(x))));
    }
    CHECK(worst_circle < 1e-6);
    CHECK(worst_angle < 3e-7);
    CHECK(fast_atan2(0.0f, 0.0f) == 0.0f);
}
