// Occlusion against closed forms, by rays and by points alone.
#include <doctest/doctest.h>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/lighting/occlusion.h"
#include "lights.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// Points of a square roof at height 1 of half side `s` that faces down, and one on the floor below its middle, last.
PointSet roof_points(float s, int n) {
    PointSet points;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            points.positions.emplace_back(s * (2.0f * (float(i) + 0.5f) / float(n) - 1.0f),
                                          s * (2.0f * (float(j) + 0.5f) / float(n) - 1.0f), 1.0f);
            points.normals.emplace_back(0.0f, 0.0f, -1.0f);
            points.areas.push_back(4.0f * s * s / float(n * n));
        }
    }
    points.positions.emplace_back(0.0f);
    points.normals.emplace_back(0.0f, 0.0f, 1.0f);
    points.areas.push_back(1e-6f);
    return points;
}

}  // namespace

TEST_CASE("occlusion: what a roof leaves open is one less its configuration factor") {
    const RayScene scene({square(0.7f, 1.0f)}, {{0, M44f()}});
    const PointSet below = one_point(V3f(0.0f), V3f(0, 0, 1));
    OcclusionOptions options;
    options.samples = 1 << 14;
    const double expected = 1.0 - 4 * corner_factor(0.7, 0.7, 1.0);
    const Occlusion found = bake_occlusion(below, scene, options);
    CHECK(found.openness[0] == doctest::Approx(expected).epsilon(2e-3));
    CHECK(found.bent_normals[0].z == doctest::Approx(1.0).epsilon(1e-3));
    options.distance = 0.9f;
    CHECK(bake_occlusion(below, scene, options).openness[0] == 1.0f);
    // Beside a wall that fills half the sky the open direction leans away from it: (4/3, 0, 2 pi/3... ) by quadrature.
    const RayScene wall({square(1e4f, 0.0f)}, {{0, [] {
                                                    M44f m;
                                                    m.setAxisAngle(V3f(0, 1, 0), kPi / 2);
                                                    return m;
                                                }()}});
    options.distance = 1e30f;
    const Occlusion beside = bake_occlusion(one_point(V3f(1.0f, 0, 0), V3f(0, 0, 1)), wall, options);
    CHECK(beside.openness[0] == doctest::Approx(0.5).epsilon(2e-3));
    // ∫ over the open half of w cos dw: x = 2/3, z = pi/3.
    CHECK(beside.bent_normals[0].x == doctest::Approx(2.0 / std::sqrt(4.0 + kPiD * kPiD)).epsilon(0.01));
}

TEST_CASE("point occlusion: the roof's points hide what the roof hides, and bits do not depend on threads") {
    const PointSet points = roof_points(0.7f, 40);
    const double expected = 1.0 - 4 * corner_factor(0.7, 0.7, 1.0);
    const auto bake = [&](int threads) { return with_threads(threads, [&] { return point_occlusion(points); }); };
    const Occlusion one = bake(1), two = bake(2);
    CHECK(one.openness.back() == doctest::Approx(expected).epsilon(0.02));
    CHECK(one.bent_normals.back().z == doctest::Approx(1.0).epsilon(0.01));
    CHECK(one.openness == two.openness);
    CHECK(one.bent_normals == two.bent_normals);
    CHECK(point_occlusion(points, 0.5f).openness.back() == 1.0f);
    // Points of one plane do not hide one another, but for those that share a cluster with the floor.
    CHECK(one.openness[0] == doctest::Approx(1.0).epsilon(5e-3));
}

TEST_CASE("occlusion: options out of range are refused") {
    const PointSet point = one_point(V3f(0.0f), V3f(0, 0, 1));
    const RayScene empty({}, {});
    OcclusionOptions options;
    options.samples = 0;
    CHECK_THROWS_WITH_AS(bake_occlusion(point, empty, options), doctest::Contains("samples must be in"), ValueError);
    options = {};
    options.distance = 0.0f;
    CHECK_THROWS_WITH_AS(bake_occlusion(point, empty, options), doctest::Contains("distance must be > 0"), ValueError);
    CHECK_THROWS_WITH_AS(point_occlusion(point), doctest::Contains("areas must be one per point"), ValueError);
}
