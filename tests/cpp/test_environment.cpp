// The lat-long image: orientation, density, refusals.
#include <doctest/doctest.h>

#include <cmath>

#include "chi_square.h"
#include "frazil/base/error.h"
#include "frazil/lighting/environment.h"

using namespace frazil;

namespace {

constexpr double kPiD = 3.14159265358979323846;

Environment gradient(int width, int height) {
    std::vector<Rgb> pixels(std::size_t(width * height));
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            pixels[std::size_t(y * width + x)] =
                Rgb(float(x * x), float(y), 1.0f) * (x > width / 2 && y > height / 2 ? 0.0f : 1.0f);
        }
    }
    return Environment(width, height, pixels, "/env");
}

}  // namespace

TEST_CASE("environment: row 0 is +y, the centre +z, +x a quarter left of it, the edges -z") {
    // An image whose pixel holds its own column and row.
    constexpr int kWidth = 64, kHeight = 32;
    std::vector<Rgb> pixels;
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) pixels.emplace_back(float(x) + 0.5f, float(y) + 0.5f, 0.0f);
    }
    const Environment env(kWidth, kHeight, pixels, "/env");
    CHECK(env.eval(V3f(0, 0, 1)).x == doctest::Approx(32));
    CHECK(env.eval(V3f(0, 0, 1)).y == doctest::Approx(16));
    CHECK(env.eval(V3f(1, 0, 0)).x == doctest::Approx(16));
    CHECK(env.eval(V3f(-1, 0, 0)).x == doctest::Approx(48));
    CHECK(env.eval(V3f(0, 1, 0)).y == doctest::Approx(0.5));
    CHECK(env.eval(V3f(0, -1, 0)).y == doctest::Approx(31.5));
    CHECK(env.eval(V3f(0, 0.7071f, 0.7071f)).y == doctest::Approx(8));
    // The seam at -z is blended: half of the first and half of the last column.
    CHECK(env.eval(V3f(0, 0, -1)).x == doctest::Approx(32));
}

TEST_CASE("environment: pdf integrates to 1 and is the density of sample()") {
    for (const auto& [width, height] : {std::pair{48, 24}, {1, 1}, {5, 3}, {2, 40}}) {
        const Environment env = gradient(width, height);
        const auto sample = [&](const V2f& u, V3f& d) {
            float pdf;
            d = env.sample(u, pdf);
            return pdf > 0.0f;
        };
        const auto result = test::chi_square(
            sample, [&](const V3f& d) { return double(env.pdf(d)); }, V3f(0, 1, 0));
        CAPTURE(width);
        CHECK(result.mass == doctest::Approx(1.0).epsilon(5e-3));
        CHECK(result.hit_rate == 1.0);
        CHECK(result.p_value > 1e-4);
    }
}

TEST_CASE("environment: many at once are the same bits as one at a time, and none above a plane is left out") {
    for (const auto& [width, height] : {std::pair{64, 32}, {1, 1}, {5, 3}, {2, 40}, {40, 4}}) {
        const Environment env = gradient(width, height);
        std::vector<V2f> u;
        for (std::uint32_t i = 0; i < 77; ++i) u.push_back(Sampler(5, 6, i).next_2d());
        std::vector<V3f> directions(u.size());
        std::vector<float> pdfs(u.size()), found(u.size());
        std::vector<Rgb> radiances(u.size()), seen(u.size());
        env.sample_many(V3f(0.0f), u, directions, pdfs, radiances);
        env.eval_many(directions, found, seen);
        for (std::size_t i = 0; i < u.size(); ++i) {
            float pdf;
            Rgb radiance;
            CHECK(env.sample(u[i], pdf, radiance) == directions[i]);
            CHECK(pdf == pdfs[i]);
            CHECK(radiance == radiances[i]);
            CHECK(env.eval(directions[i], pdf) == seen[i]);
            CHECK(pdf == found[i]);
        }
        int left_out = 0;
        for (const V3f& n : {V3f(0, 1, 0), V3f(0, -1, 0), V3f(0.6f, 0, 0.8f), V3f(-0.48f, 0.64f, -0.6f)}) {
            std::vector<V3f> above(u.size(), V3f(0.0f));
            env.sample_many(n, u, above, found, seen);
            for (std::size_t i = 0; i < u.size(); ++i) {
                V3f alone;
                float pdf;
                Rgb radiance;
                env.sample_many(n, {&u[i], 1}, {&alone, 1}, {&pdf, 1}, {&radiance, 1});
                CHECK(pdf == found[i]);
                if (found[i] == 0.0f) {
                    ++left_out;
                    CHECK(directions[i].dot(n) < 0.0f);
                    continue;
                }
                CHECK(above[i] == directions[i]);
                CHECK(found[i] == pdfs[i]);
                CHECK(seen[i] == radiances[i]);
            }
        }
        if (width == 64) CHECK(left_out > 100);
    }
}

TEST_CASE("environment: wherever there is light there is density, beside a bright pixel too") {
    std::vector<Rgb> pixels(16 * 8, Rgb(0.0f));
    pixels[3 * 16 + 15] = Rgb(0.0f, 0.0f, 1000.0f);
    const Environment env(16, 8, pixels, "/env");
    double integral = 0.0, estimate = 0.0;
    constexpr int kSteps = 512;
    for (int i = 0; i < kSteps; ++i) {
        for (int j = 0; j < 2 * kSteps; ++j) {
            const double y = 1.0 - (i + 0.5) * 2.0 / kSteps, phi = kPiD * (j + 0.5) / kSteps, s = std::sqrt(1 - y * y);
            const V3f d(float(s * std::sin(phi)), float(y), float(s * std::cos(phi)));
            const double value = env.eval(d).z;
            if (value > 0.0) REQUIRE(env.pdf(d) > 0.0f);
            integral += value * 4.0 * kPiD / (2.0 * kSteps * kSteps);
        }
    }
    constexpr std::uint32_t kCount = 1 << 14;
    for (std::uint32_t i = 0; i < kCount; ++i) {
        float pdf;
        Sampler sampler(1, 2, i);
        const V3f d = env.sample(sampler.next_2d(), pdf);
        estimate += double(env.eval(d).z) / double(pdf) / kCount;
    }
    CHECK(estimate == doctest::Approx(integral).epsilon(5e-3));
    CHECK(double(env.brightness()) * 4 * kPiD == doctest::Approx(0.0722 * integral).epsilon(0.02));
}

TEST_CASE("environment: the estimate of irradiance is exact up to degree 2, for a smooth sky of any orientation") {
    // L = 1 + a.d + (b.d)², whose irradiance is known.
    const V3f a(0.2f, 0.3f, -0.4f), b(0.5f, -0.7f, 0.3f);
    constexpr int kHeight = 128;
    std::vector<Rgb> pixels(2 * kHeight * kHeight);
    double mean = 0.0;
    for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < 2 * kHeight; ++x) {
            const double theta = kPiD * (y + 0.5) / kHeight, phi = kPiD * (x + 0.5) / kHeight;
            const V3f d(float(std::sin(theta) * std::sin(phi)), float(std::cos(theta)),
                        float(-std::sin(theta) * std::cos(phi)));
            const float value = 1.0f + a.dot(d) + b.dot(d) * b.dot(d);
            pixels[std::size_t(y) * 2 * kHeight + std::size_t(x)] = Rgb(value);
            mean += double(value) * std::sin(theta) * kPiD / (4.0 * kHeight * kHeight);
        }
    }
    const Environment env(2 * kHeight, kHeight, pixels, "/env");
    CHECK(double(env.brightness()) == doctest::Approx(mean).epsilon(1e-3));
    for (const V3f& n : {V3f(1, 0, 0), V3f(0, 1, 0), V3f(0, 0, -1), V3f(0.48f, 0.6f, 0.64f)}) {
        // (b.d)² = |b|²/3 + (b.d)² - |b|²/3: degrees 0 and 2, scaled by pi and pi/4.
        const double square = double(b.dot(b)) / 3.0, along = double(b.dot(n)) * double(b.dot(n));
        const double expected =
            kPiD * (1.0 + square) + 2.0 * kPiD / 3.0 * double(a.dot(n)) + kPiD / 4.0 * (along - square);
        CHECK(double(env.irradiance(n) * env.brightness()) == doctest::Approx(expected).epsilon(2e-3));
    }
}

TEST_CASE("environment: a black image samples uniformly, a negative one as its positive does") {
    const Environment black(8, 4, std::vector<Rgb>(32, Rgb(0.0f)), "/env");
    const auto result = test::chi_square(
        [&](const V2f& u, V3f& d) {
            float pdf;
            d = black.sample(u, pdf);
            return std::abs(pdf * 4.0 * kPiD - 1.0) < 1e-5;
        },
        [](const V3f&) { return 0.25 / kPiD; }, V3f(0, 1, 0));
    CHECK(result.hit_rate == 1.0);
    CHECK(result.p_value > 1e-4);

    const Environment positive = gradient(8, 4);
    std::vector<Rgb> pixels = positive.pixels();
    for (Rgb& pixel : pixels) pixel = -pixel;
    const Environment negative(8, 4, pixels, "/env");
    CHECK(negative.brightness() == positive.brightness());
    // The last numbers below 1 too.
    std::vector<V2f> u = {V2f(0.0f), V2f(0.0f, 0.99999994f), V2f(0.99999994f, 0.0f), V2f(0.99999994f)};
    for (std::uint32_t i = 0; i < 1000; ++i) u.push_back(Sampler(7, 8, i).next_2d());
    for (const V2f& at : u) {
        float pdf, positive_pdf;
        Rgb radiance, positive_radiance;
        const V3f direction = negative.sample(at, pdf, radiance);
        CHECK(direction == positive.sample(at, positive_pdf, positive_radiance));
        CHECK(pdf == positive_pdf);
        CHECK(pdf > 0.0f);
        CHECK(radiance == -positive_radiance);
    }
}

TEST_CASE("environment: broken images are refused") {
    std::vector<Rgb> broken(32, Rgb(1.0f));
    broken[9].y = NAN;
    CHECK_THROWS_WITH_AS(Environment(8, 4, broken, "/sky"), doctest::Contains("/sky: pixels must be finite"),
                         ValueError);
    CHECK_THROWS_WITH_AS(Environment(8, 4, broken, "/sky"), doctest::Contains("column 1, row 1"), ValueError);
    CHECK_THROWS_WITH_AS(Environment(8, 5, broken, "/sky"), doctest::Contains("got 8 x 5 with 32 pixels"), ValueError);
    CHECK_THROWS_AS(Environment(0, 0, {}, "/sky"), ValueError);
}
