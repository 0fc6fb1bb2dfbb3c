// Light that drifts on before it is scattered, and how much of it leaves again by angle.
#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/parallel.h"
#include "frazil/base/quadrature.h"
#include "frazil/points/poisson.h"
#include "frazil/render/drift.h"
#include "frazil/translucency/half_space.h"
#include "shapes.h"

namespace frazil {
namespace {

using test::floor_square;
using test::sphere;

double power(const PointSet& points, const std::vector<Rgb>& irradiance, int channel) {
    double sum = 0.0;
    for (std::size_t k = 0; k < points.size(); ++k) sum += double(points.areas[k]) * irradiance[k][channel];
    return sum;
}

// Where the light of a channel is centred.
V3d centre(const PointSet& points, const std::vector<Rgb>& irradiance, int channel) {
    V3d sum(0.0);
    for (std::size_t k = 0; k < points.size(); ++k) {
        sum += V3d(points.positions[k]) * (double(points.areas[k]) * irradiance[k][channel]);
    }
    return sum / power(points, irradiance, channel);
}

// A spot of light on a floor, that travels along x.
struct Spot {
    PointSet points = poisson_points(floor_square(1.0f, 0.0f), 0.03, {3, true, 0});
    std::vector<Rgb> irradiance;
    std::vector<Flow> flows;

    Spot() {
        for (const V3f& p : points.positions) {
            irradiance.push_back(Rgb(1.0f, 2.0f, 0.5f) * std::exp(-p.length2() / 0.08f));
            Flow flow;
            for (int c = 0; c < 3; ++c) flow[std::size_t(c)] = V3f(0.8f, 0.0f, 0.0f) * irradiance.back()[c];
            flows.push_back(flow);
        }
    }
};

}  // namespace

TEST_CASE("drift: a spot of light moves on by the way of its flow, and keeps its power") {
    const Spot spot;
    std::vector<Rgb> moved = spot.irradiance;
    const Rgb length(0.05f, 0.02f, 0.0f);
    carry_on(spot.points, spot.flows, length, moved);
    for (int c = 0; c < 3; ++c) {
        CHECK(power(spot.points, moved, c) == doctest::Approx(power(spot.points, spot.irradiance, c)).epsilon(1e-4));
        const V3d way = centre(spot.points, moved, c) - centre(spot.points, spot.irradiance, c);
        CHECK(way.x == doctest::Approx(0.8 * length[c]).epsilon(0.02));
        CHECK(std::abs(way.z) < 1e-3);
    }
}

TEST_CASE("drift: even light stays as it is, but for where it has an end") {
    const Spot spot;
    const std::vector<Rgb> even(spot.points.size(), Rgb(1.0f));
    std::vector<Flow> flows(even.size());
    std::vector<Rgb> still = even;
    carry_on(spot.points, flows, Rgb(0.05f), still);
    CHECK(still == even);
    for (Flow& flow : flows) flow[0] = V3f(0.7f, 0.0f, 0.0f);
    std::vector<Rgb> moved = even;
    carry_on(spot.points, flows, Rgb(0.05f), moved);
    double squares = 0.0;
    int inner = 0;
    for (std::size_t k = 0; k < even.size(); ++k) {
        const V3f& p = spot.points.positions[k];
        if (std::max(std::abs(p.x), std::abs(p.z)) > 0.8f) continue;
        squares += std::pow(double(moved[k].x) - 1.0, 2);
        ++inner;
    }
    CHECK(std::sqrt(squares / inner) < 0.03);  // points lie unevenly
}

TEST_CASE("drift: light on a sphere gathers beyond where it grazes") {
    const PointSet points = poisson_points(sphere(1.0f, 5), 0.05, {1, true, 0});
    std::vector<Rgb> irradiance;
    std::vector<Flow> flows;
    for (const V3f& n : points.normals) {
        const V3f sun(0.0f, 0.0f, 1.0f);
        const Rgb value(std::max(0.0f, n.dot(sun)));
        irradiance.push_back(value);
        flows.emplace_back();
        add_flow(flows.back(), value, along_surface(sun, n));
    }
    std::vector<Rgb> moved = irradiance;
    carry_on(points, flows, Rgb(0.1f), moved);
    // -div(l F) = l (2 cos² - sin²) taken off where the sun is up.
    double by_day = 0.0, wanted = 0.0, by_night = 0.0;
    for (std::size_t k = 0; k < points.size(); ++k) {
        const double z = points.normals[k].z, added = double(points.areas[k]) * (moved[k].x - irradiance[k].x);
        if (z > 0.3) by_day += added, wanted -= double(points.areas[k]) * 0.1 * (2.0 * z * z - (1.0 - z * z));
        if (z < 0.0) by_night += added;
    }
    CHECK(by_day == doctest::Approx(wanted).epsilon(0.1));
    CHECK(by_night > 0.0);
}

TEST_CASE("drift: linear in the light, and the same bits for one thread and four") {
    const Spot spot;
    const auto carried = [&](float scale, int threads) {
        return with_threads(threads, [&] {
            std::vector<Rgb> light = spot.irradiance;
            std::vector<Flow> flows = spot.flows;
            for (Rgb& value : light) value *= scale;
            for (Flow& flow : flows) {
                for (V3f& along : flow.channel) along *= scale;
            }
            carry_on(spot.points, flows, Rgb(0.05f), light);
            return light;
        });
    };
    const std::vector<Rgb> one = carried(1.0f, 1), twice = carried(2.0f, 4), negative = carried(-1.0f, 4);
    CHECK(one == carried(1.0f, 4));
    for (std::size_t k = 0; k < one.size(); ++k) {
        CHECK(twice[k] == one[k] * 2.0f);
        CHECK(negative[k] == -one[k]);
    }
}

TEST_CASE("half space: the albedo by angle averages to one, and meets its limits") {
    for (const double eta : {1.0, 1.31}) {
        for (const double alpha : {0.3, 0.7, 0.99}) {
            const DirectionalAlbedo share(alpha, eta);
            const double critical = std::sqrt(1.0 - 1.0 / (eta * eta));
            const auto entering = [&](double mu) {  // outside cosine mu, all of it let in
                return 2.0 * mu * share(float(std::sqrt(critical * critical + mu * mu / (eta * eta))));
            };
            const double mean = integrate_gauss32(entering, 0.0, 0.1) + integrate_gauss32(entering, 0.1, 1.0);
            CHECK(mean == doctest::Approx(1.0).epsilon(eta == 1.0 ? 1e-3 : 2e-2));
            CHECK(share(0.1f) > share(1.0f));
        }
        const DirectionalAlbedo white(1.0, eta);
        for (const float mu : {0.0f, 0.2f, 0.7f, 1.0f}) CHECK(white(mu) == doctest::Approx(1.0).epsilon(2e-4));
    }
    // H(0) = 1; one scattering alone where next to nothing is scattered.
    CHECK(DirectionalAlbedo(0.5, 1.0)(0.0f) ==
          doctest::Approx((1.0 - std::sqrt(0.5)) / half_space_albedo(0.5, 1.0).all()).epsilon(1e-3));
    const DirectionalAlbedo faint(1e-4, 1.0);
    for (const double mu : {0.1, 0.5, 1.0}) {
        const double once = (1.0 - mu * std::log1p(1.0 / mu)) / (4.0 / 3.0 * (1.0 - std::log(2.0)));
        CHECK(faint(float(mu)) == doctest::Approx(once).epsilon(2e-3));
    }
}

TEST_CASE("half space: by angle without what is scattered once") {
    for (const double alpha : {0.5, 0.9, 1.0}) {
        const DirectionalAlbedo rest(alpha, 1.0, 1.0), all(alpha, 1.0);
        const HalfSpaceAlbedo plane = half_space_albedo(alpha, 1.0);
        for (const double mu : {0.1, 0.5, 1.0}) {
            const double once = 0.5 * alpha * (1.0 - mu * std::log1p(1.0 / mu));
            CHECK(rest(float(mu)) * plane.multiple + once ==
                  doctest::Approx(all(float(mu)) * plane.all()).epsilon(2e-3));
        }
        // At a slant light is scattered near the surface and leaves at once.
        CHECK(rest(0.1f) * all(1.0f) < 0.95f * all(0.1f) * rest(1.0f));
    }
}

TEST_CASE("drift: a slab has room for the part of the first scattering that takes place in it") {
    const float sigma_t = 20.0f;
    for (const float thickness : {1e-3f, 0.03f, 0.2f, 20.0f}) {
        Mesh mesh;
        for (const float y : {0.0f, -thickness}) {
            for (const V2f& p : {V2f(-1.0f, -1.0f), V2f(1.0f, -1.0f), V2f(1.0f, 1.0f), V2f(-1.0f, 1.0f)}) {
                mesh.positions.emplace_back(1e4f * p.x, y, 1e4f * p.y);
            }
        }
        mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}};
        const RayScene scene({mesh}, {Placement{}});
        PointSet points;
        for (int k = 0; k < 256; ++k) {
            points.positions.push_back({0.01f * k, 0.0f, 0.0f});
            points.normals.push_back({0.0f, 1.0f, 0.0f});
            points.areas.push_back(1.0f);
        }
        const Room room = room_of(points, ChordFinder(scene, nullptr, nullptr), sigma_t);
        double inwards = 0.0, along = 0.0;
        for (int k = 0; k < 256; ++k) {
            inwards += room.inwards[k] / 256.0;
            along += room.along[k] / 256.0;
        }
        // (1/sigma_t)(1 - x/(e^x - 1)) is the mean of a free path that is cut off at x.
        const auto mean_of = [&](double share, double power) {
            const auto weight = [&](double mu) { return 2.0 * mu * (power == 1.0 ? mu : 1.0 - mu * mu); };
            const auto within = [&](double mu) {
                return weight(mu) * first_scattering_within(float(share * sigma_t * thickness / mu));
            };
            return integrate_gauss32(within, 0.0, 1.0) / integrate_gauss32(weight, 0.0, 1.0);
        };
        CHECK(inwards == doctest::Approx(mean_of(0.5, 1.0)).epsilon(0.02));
        CHECK(along == doctest::Approx(mean_of(1.0, 2.0)).epsilon(0.02));
    }
    CHECK(first_scattering_within(1e3f) == 1.0f);
    CHECK(first_scattering_within(0.01f) == doctest::Approx(0.005).epsilon(0.01));
}

TEST_CASE("drift: points with less room hand their light less far on") {
    const Spot spot;
    const std::size_t n = spot.points.size();
    std::vector<Flow> flows(n), halved(n);
    for (std::size_t k = 0; k < n; ++k) {
        for (std::size_t c = 0; c < 3; ++c) {
            flows[k][c] = V3f(0.3f * float(k % 7), 0.0f, 0.1f);
            halved[k][c] = flows[k][c] * 0.5f;
        }
    }
    std::vector<Rgb> roomy(n, Rgb(0.0f)), half(n, Rgb(0.0f)), tight(n, Rgb(0.0f));
    carry_on(spot.points, flows, Rgb(0.05f), roomy);
    carry_on(spot.points, halved, Rgb(0.05f), half);
    carry_on(spot.points, flows, Rgb(0.05f), tight, std::vector<float>(n, 0.5f));
    CHECK(tight == half);
    CHECK(tight != roomy);
}

}  // namespace frazil
