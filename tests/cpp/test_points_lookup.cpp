#include <doctest/doctest.h>

#include "frazil/base/random.h"
#include "frazil/points/point_lookup.h"
#include "frazil/points/poisson.h"
#include "shapes.h"

using namespace frazil;

TEST_CASE("the lookup finds the point that a search through all finds") {
    const Mesh mesh = test::sphere(1.0f, 4);
    const PointSet points = poisson_points(mesh, 0.05);
    const PointLookup lookup(points);
    for (std::uint32_t k = 0; k < 2000; ++k) {
        const std::size_t triangle = hash(k, 1) % mesh.triangles.size();
        const V3i& t = mesh.triangles[triangle];
        float u = to_unit_float(hash(k, 2)), v = to_unit_float(hash(k, 3));
        if (u + v > 1.0f) u = 1.0f - u, v = 1.0f - v;
        const V3f place = mesh.positions[t.x] * (1.0f - u - v) + mesh.positions[t.y] * u + mesh.positions[t.z] * v;
        std::uint32_t best = 0;
        for (std::uint32_t i = 1; i < points.size(); ++i) {
            if ((points.positions[i] - place).length2() < (points.positions[best] - place).length2()) best = i;
        }
        CHECK(lookup.nearest(place, place) == best);
    }
}

TEST_CASE("the lookup keeps to the side that is asked for, and finds nothing where there is no point") {
    PointSet points;
    resize(points, 2);
    points.spacing = 1.0;
    points.positions = {V3f(0.0f, 0.0f, 0.0f), V3f(0.0f, -0.01f, 0.0f)};
    points.normals = {V3f(0.0f, 1.0f, 0.0f), V3f(0.0f, -1.0f, 0.0f)};
    const PointLookup lookup(points);
    CHECK(lookup.nearest(V3f(0.1f, 0.0f, 0.0f), V3f(0.0f, -1.0f, 0.0f)) == 1);
    CHECK(lookup.nearest(V3f(50.0f, 0.0f, 0.0f), V3f(0.0f, 1.0f, 0.0f)) == PointLookup::kNone);
}
