#include <doctest/doctest.h>

#include "frazil/geometry/self_intersections.h"
#include "shapes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// Both in one mesh, `b` moved.
Mesh together(Mesh a, const Mesh& b, const V3f& by) {
    const int first = static_cast<int>(a.positions.size());
    for (const V3f& p : b.positions) a.positions.push_back(p + by);
    for (const V3i& t : b.triangles) a.triangles.push_back(t + V3i(first));
    a.normals = {};
    return a;
}

}  // namespace

TEST_CASE("triangles that cross are found, both of them, and no other") {
    // A needle through one triangle of a square; it meets the plane of the square in two of its three sides.
    Mesh needle;
    needle.positions = {{0.4f, -1, -0.2f}, {0.5f, 1, -0.3f}, {0.6f, -1, -0.2f}};
    needle.triangles = {{0, 1, 2}};
    CHECK(self_intersections(together(floor_square(1, 0), needle, V3f(0))) == std::vector<std::int32_t>{0, 2});
    CHECK(self_intersections(together(floor_square(1, 0), needle, {0, 1.5f, 0})).empty());
}

TEST_CASE("closed shapes do not cross themselves, nor those beside or inside each other") {
    CHECK(self_intersections(Mesh{}).empty());
    CHECK(self_intersections(sphere(1, 5)).empty());
    const Mesh box = box_of({-1, -1, -1}, {1, 1, 1});
    CHECK(self_intersections(together(box, box, {2.01f, 0.3f, 0.1f})).empty());
    CHECK(self_intersections(together(box, box_of({-0.5f, -0.5f, -0.5f}, {0.5f, 0.5f, 0.5f}), V3f(0))).empty());
}

TEST_CASE("spheres that overlap cross along the circle where they meet") {
    // At a level of 5 the circle of radius sqrt(3)/2 is 5.44 long and edges are about 0.05: some 2 x 200 triangles.
    const Mesh ball = sphere(1, 5);
    const Mesh both = together(ball, ball, {1, 0, 0});
    const std::vector<std::int32_t> found = self_intersections(both);
    CHECK(found.size() > 300);
    CHECK(found.size() < 800);
    for (const std::int32_t i : found) {
        const V3i& t = both.triangles[i];
        const V3f middle = (both.positions[t.x] + both.positions[t.y] + both.positions[t.z]) / 3.0f;
        CHECK(middle.x == doctest::Approx(0.5).epsilon(0.1));
        CHECK(std::hypot(middle.y, middle.z) == doctest::Approx(0.866).epsilon(0.06));
    }
}

TEST_CASE("a mesh folded over its own edge crosses itself though its triangles share a vertex") {
    Mesh fold;  // the second triangle leaves vertex 0 and comes back through the first
    fold.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.3f, 0.3f, 1}, {0.4f, 0.3f, -1}};
    fold.triangles = {{0, 1, 2}, {0, 3, 4}};
    CHECK(self_intersections(fold) == std::vector<std::int32_t>{0, 1});
}
