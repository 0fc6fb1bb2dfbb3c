#include <doctest/doctest.h>

#include <cmath>
#include <cstring>

#include "frazil/base/parallel.h"
#include "frazil/points/cells.h"
#include "frazil/points/poisson.h"
#include "frazil/translucency/point_tree.h"
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

TEST_CASE("cells: a sliver, long and with no area to speak of, is gathered as what it is: nearly nothing") {
    PointSet points;
    points.positions = {V3f(0.0f)};
    points.normals = {V3f(0.0f, 1.0f, 0.0f)};
    points.areas = {1e-12f};
    points.spacing = 0.05;
    Cells cells;
    cells.areas = points.areas;
    cells.centroids = points.positions;
    cells.covariances = {{1e-3f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f}};
    Medium medium;
    medium.sigma_s_prime = Rgb(30.0f);
    medium.sigma_a = Rgb(0.1f);
    medium.eta = 1.31f;
    const PointTree tree(points, {Rgb(1.0f)}, 1, Profile(Dipole(medium)), {}, &cells, {V3f(1e-2f, 0.0f, 0.0f)});
    const auto out = tree.gather(points.positions.data(), 1, GatherOptions());
    CHECK(std::isfinite(out.exitance[0].x));
    CHECK(std::isfinite(out.coverage[0].x));
    CHECK(std::abs(out.coverage[0].x) < 1e-6f);
}

TEST_CASE("cells: moved along their normals they are those of a smaller sphere, and so is what varies along them") {
    const float radius = 1.0f, inwards = -0.3f;
    const Mesh mesh = test::sphere(radius, 6), smaller = test::sphere(radius + inwards, 6);
    const PointSet points = poisson_points(mesh, 0.2);
    PointSet moved = points;
    moved.spacing *= 1.0 + inwards;
    for (V3f& position : moved.positions) position *= 1.0f + inwards;
    const Cells cells = cells_of(points, mesh), expected = cells_of(moved, smaller);
    for (std::size_t k = 0; k < points.size(); ++k) {
        V3f centroid = cells.centroids[k];
        Covariance covariance = cells.covariances[k];
        move_along_normals(inwards, cells.normals[k], centroid, covariance);
        CHECK((centroid - expected.centroids[k]).length() < 0.004f);
        const float trace = covariance[0] + covariance[1] + covariance[2];
        const Covariance& c = expected.covariances[k];
        CHECK(trace == doctest::Approx(c[0] + c[1] + c[2]).epsilon(0.04));
        const CellBend bend(cells.normals[k], cells.covariances[k], inwards);
        const V3f along = tangent_frame(points.normals[k]).first, now = bend.moved(along);
        CHECK((now - along * (1.0f + inwards)).length() < 0.03f);
    }
}

TEST_CASE("cells: an ellipse, evenly filled, has the covariance of the cell it stands for") {
    const V3f normal = V3f(0.3f, 0.9f, -0.2f).normalized(), along = V3f(1.0f, 0.0f, 1.5f).cross(normal).normalized();
    const V3f across = normal.cross(along);
    // Of a disc twice as long as wide, askew to the axes that its half axes are told by.
    const V3f s = along * 0.06f, t = across * 0.03f;
    Covariance covariance;
    const int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    for (std::size_t i = 0; i < 6; ++i) {
        const auto [a, b] = pairs[i];
        covariance[i] = 0.25f * (s[a] * s[b] + t[a] * t[b]);
    }
    const std::array<V3f, 2> axes = ellipse_of(covariance, normal);
    for (std::size_t i = 0; i < 6; ++i) {
        const auto [a, b] = pairs[i];
        CHECK(0.25f * (axes[0][a] * axes[0][b] + axes[1][a] * axes[1][b]) ==
              doctest::Approx(covariance[i]).epsilon(1e-4));
    }
    CHECK(std::abs(axes[0].dot(normal)) < 1e-7f);
    CHECK(std::abs(axes[1].dot(normal)) < 1e-7f);
}

TEST_CASE("cells: flat ones move without a change") {
    const Mesh mesh = test::floor_square(1.0f, 0.0f);
    const PointSet points = poisson_points(mesh, 0.2);
    const Cells cells = cells_of(points, mesh);
    for (std::size_t k = 0; k < points.size(); ++k) {
        V3f centroid = cells.centroids[k];
        Covariance covariance = cells.covariances[k];
        move_along_normals(-0.5f, cells.normals[k], centroid, covariance);
        CHECK((centroid - cells.centroids[k] + points.normals[k] * 0.5f).length() < 1e-6f);
        for (int i = 0; i < 6; ++i) CHECK(covariance[i] == doctest::Approx(cells.covariances[k][i]).epsilon(1e-4));
        const V3f along(0.3f, 0.0f, -0.2f);
        CHECK((CellBend(cells.normals[k], cells.covariances[k], -0.5f).moved(along) - along).length() < 1e-5f);
    }
}

}  // namespace frazil
