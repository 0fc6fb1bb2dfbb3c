#include <doctest/doctest.h>

#include <cstring>

#include "frazil/base/parallel.h"
#include "frazil/points/cells.h"
#include "frazil/points/poisson.h"
#include "shapes.h"

namespace frazil {

TEST_CASE("cells: the same bits for one thread and for four, and the mesh's area") {
    const Mesh mesh = test::sphere(0.4f, 5);
    const PointSet points = poisson_points(mesh, 0.02);
    const auto made = [&](int threads) { return with_threads(threads, [&] { return cells_of(points, mesh, 32, 5); }); };
    const Cells one = made(1), four = made(4);
    REQUIRE(one.places.size() == four.places.size());
    CHECK(std::memcmp(one.areas.data(), four.areas.data(), one.size() * sizeof(float)) == 0);
    CHECK(std::memcmp(one.centroids.data(), four.centroids.data(), one.size() * sizeof(V3f)) == 0);
    CHECK(std::memcmp(one.covariances.data(), four.covariances.data(), one.size() * sizeof(Covariance)) == 0);
    CHECK(std::memcmp(one.places.data(), four.places.data(), one.places.size() * sizeof(CellPlace)) == 0);
    double area = 0.0;
    for (const float a : one.areas) area += a;
    CHECK(area == doctest::Approx(surface_area(mesh)).epsilon(1e-6));
}

}  // namespace frazil
