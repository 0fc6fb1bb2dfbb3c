#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <random>

#include "frazil/translucency/even_light.h"

namespace frazil {
namespace {

struct Place {
    double x, y, z;
};

// How far it is from a place along a direction to where a body ends, in optical depths.
using Body = std::function<double(const Place&, const Place&)>;

const Body half_space = [](const Place& p, const Place& w) { return w.y < 0.0 ? -p.y / w.y : 1e9; };

Body slab(double thickness) {
    return [thickness](const Place& p, const Place& w) {
        return w.y < 0.0 ? -p.y / w.y : w.y > 0.0 ? (thickness - p.y) / w.y : 1e9;
    };
}

// Of a quarter of space: its edge is the z axis.
const Body edge = [](const Place& p, const Place& w) {
    return std::min(w.x < 0.0 ? -p.x / w.x : 1e9, w.y < 0.0 ? -p.y / w.y : 1e9);
};

// Touching the plane y = 0 at the origin.
Body ball(double radius) {
    return [radius](const Place& p, const Place& w) {
        const double y = p.y - radius, along = p.x * w.x + y * w.y + p.z * w.z;
        return -along + std::sqrt(std::max(0.0, along * along - (p.x * p.x + y * y + p.z * p.z - radius * radius)));
    };
}

Place any_direction(std::mt19937& random) {
    std::uniform_real_distribution<double> uniform;
    const double z = 2.0 * uniform(random) - 1.0, r = std::sqrt(1.0 - z * z), phi = 6.283185307179586 * uniform(random);
    return {r * std::cos(phi), z, r * std::sin(phi)};
}

// The light that a place scatters, by random walks to where they leave into light of radiance 1.
double walked(const Body& body, Place p, double alpha, int walks) {
    std::mt19937 random(7);
    std::exponential_distribution<double> free_path;
    std::uniform_real_distribution<double> uniform;
    const Place start = p;
    int left = 0;
    for (int i = 0; i < walks; ++i) {
        for (p = start; uniform(random) < alpha;) {
            const Place w = any_direction(random);
            const double way = free_path(random);
            if (way >= body(p, w)) {
                ++left;
                break;
            }
            p = {p.x + way * w.x, p.y + way * w.y, p.z + way * w.z};
        }
    }
    return double(left) / walks;
}

// <y>, and how it changes along +y.
struct Mean {
    double exponent = 0.0, slope = 0.0;
};

Mean mean_of(const EvenLight& light, const Body& body, const Place& p, int rays) {
    std::mt19937 random(11);
    Mean mean;
    for (int i = 0; i < rays; ++i) {
        const Place w = any_direction(random);
        const EvenLight::Exponent there = light.along(static_cast<float>(std::min(body(p, w), 1e9)));
        mean.exponent += there.value / rays;
        mean.slope += there.slope * w.y / rays;
    }
    return mean;
}

double predicted(const EvenLight& light, const Body& body, const Place& p) {
    return 1.0 - std::exp(-mean_of(light, body, p, 20000).exponent);
}

}  // namespace

TEST_CASE("even light: a half space absorbs sqrt(1 - alpha) of what its surface scatters, all of it deep inside") {
    for (const double alpha : {0.3, 0.9, 0.999, 0.99999}) {
        const EvenLight light(alpha, 1.0);
        CHECK(std::exp(-light.half_space(0.0f).value) == doctest::Approx(std::sqrt(1.0 - alpha)).epsilon(0.01));
        CHECK(light.half_space(1e6f).value == 0.0f);
        CHECK(light.along(0.0f).value == doctest::Approx(2.0f * light.half_space(0.0f).value).epsilon(0.01));
        // What it sends is the mean of what it scatters over the ray's free paths.
        for (const double mu : {0.1, 1.0}) {
            double sum = 0.0;
            const int steps = 4000;
            for (int i = 0; i < steps; ++i) {
                const double depth = -std::log((i + 0.5) / steps) * mu;
                sum -= std::expm1(-light.half_space(static_cast<float>(depth)).value) / steps;
            }
            CHECK(sum == doctest::Approx(light.returned(static_cast<float>(mu))).epsilon(0.01));
        }
    }
    CHECK(EvenLight(1.0, 1.31).half_space(0.0f).value == 0.0f);  // nothing is absorbed: there is no use for it
    CHECK(EvenLight(0.0, 1.31).along(1.0f).value == 0.0f);
}

TEST_CASE("even light: what a place scatters is a product over directions, in slabs, at edges and in balls") {
    struct Case {
        const char* name;
        Body body;
        Place place;
    };
    const Case cases[] = {{"half space", half_space, {0.0, 1.0, 0.0}},   {"edge", edge, {1e-4, 1e-4, 0.0}},
                          {"face by an edge", edge, {1e-4, 1.0, 0.0}},   {"inside an edge", edge, {1.0, 1.0, 0.0}},
                          {"thin slab", slab(0.5), {0.0, 1e-4, 0.0}},    {"slab", slab(2.0), {0.0, 1e-4, 0.0}},
                          {"inside a slab", slab(2.0), {0.0, 1.0, 0.0}}, {"thick slab", slab(5.0), {0.0, 1.0, 0.0}},
                          {"small ball", ball(0.5), {0.0, 0.5, 0.0}},    {"ball", ball(2.0), {0.0, 0.7, 0.0}},
                          {"large ball", ball(5.0), {0.0, 1e-4, 0.0}}};
    for (const double alpha : {0.3, 0.7, 0.943, 0.99}) {
        const EvenLight light(alpha, 1.0);
        for (const Case& one : cases) {
            CAPTURE(alpha);
            CAPTURE(one.name);
            CHECK(std::abs(predicted(light, one.body, one.place) - walked(one.body, one.place, alpha, 20000)) < 0.045);
        }
    }
}

TEST_CASE("even light: directions tell how what a place scatters changes, in bodies of any shape") {
    const auto check = [](const EvenLight& light, const Body& body, Place p) {
        const int rays = 200000;
        const double step = 0.1, slope = mean_of(light, body, p, rays).slope;
        p.y += step;
        const double after = mean_of(light, body, p, rays).exponent;
        p.y -= 2.0 * step;
        const double before = mean_of(light, body, p, rays).exponent;
        CHECK(std::abs(slope - (after - before) / (2.0 * step)) < 0.02);
    };
    for (const double alpha : {0.3, 0.943, 0.99}) {
        const EvenLight light(alpha, 1.0);
        CAPTURE(alpha);
        check(light, half_space, {0.0, 0.667, 0.0});
        check(light, slab(2.0), {0.0, 0.667, 0.0});
        check(light, edge, {1.0, 0.667, 0.0});
        check(light, ball(1.0), {0.0, 0.5, 0.0});
        check(light, ball(8.0), {0.0, 0.667, 0.0});
        for (const float depth : {0.1f, 0.667f, 2.0f}) {
            const double slope =
                (double(light.half_space(1.1f * depth).value) - light.half_space(0.9f * depth).value) / (0.2 * depth);
            CHECK(light.half_space(depth).slope == doctest::Approx(slope).epsilon(0.02));
        }
    }
}

TEST_CASE("even light: how deep a half space absorbs what it does not send, by its sources and by what it sends") {
    for (const double alpha : {0.3, 0.7, 0.943, 0.99}) {
        const EvenLight light(alpha, 1.0);
        for (const double mu : {0.1, 0.5, 1.0}) {
            CAPTURE(alpha);
            CAPTURE(mu);
            double all = 0.0, deep = 0.0;
            const int steps = 4000;
            for (int i = 0; i < steps; ++i) {
                const double depth = -std::log((i + 0.5) / steps) * mu;
                const double absorbed = std::exp(-double(light.half_space(static_cast<float>(depth)).value));
                all += absorbed;
                deep += absorbed * depth;
            }
            CHECK(light.absorbed_at(static_cast<float>(mu)) == doctest::Approx(deep / all).epsilon(0.02));
        }
    }
    // Where all is absorbed it is on the mean a free path along; it goes on smoothly to where nothing is.
    CHECK(EvenLight(0.0, 1.31).absorbed_at(0.5f) == doctest::Approx(0.5f).epsilon(1e-3));
    CHECK(EvenLight(1.0, 1.0).absorbed_at(1.0f) ==
          doctest::Approx(EvenLight(0.9999, 1.0).absorbed_at(1.0f)).epsilon(1e-3));
    CHECK(EvenLight(1.0 - 1e-9, 1.0).absorbed_at(1.0f) ==
          doctest::Approx(EvenLight(0.9999, 1.0).absorbed_at(1.0f)).epsilon(1e-3));
}

}  // namespace frazil
