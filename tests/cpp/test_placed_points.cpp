#include <doctest/doctest.h>

#include <cmath>

#include "frazil/points/poisson.h"
#include "frazil/render/placed_points.h"
#include "frazil/translucency/point_tree.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// A turn, a reflection and a move.
M44f somewhere() {
    M44f turned, matrix;
    turned.rotate(V3f(0.3f, 1.1f, -0.7f));
    matrix.scale(V3f(-1.0f, 1.0f, 1.0f));
    matrix = matrix * turned;
    matrix[3][0] = 1.5f, matrix[3][1] = -0.5f, matrix[3][2] = 0.25f;
    return matrix;
}

const Medium kMedium{Rgb(30.0f, 25.0f, 40.0f), Rgb(0.6f, 0.15f, 0.05f), 1.31f};

// A bright half and a dim one, cut across cells, in each of two groups.
std::vector<Rgb> light_at(const Cells& cells, const Mesh& mesh) {
    std::vector<Rgb> light;
    for (const CellPlace& place : cells.places) {
        const V3f p = position_of(place, mesh);
        light.push_back(p.x > 0.01f ? Rgb(2.0f, 1.5f, 1.0f) : Rgb(0.5f));
        light.push_back(p.y + p.z > 0.03f ? Rgb(1.0f, 2.0f, 3.0f) : Rgb(0.8f));
    }
    return light;
}

float largest_difference(const std::vector<Rgb>& a, const std::vector<Rgb>& b) {
    float largest = 0.0f;
    for (std::size_t i = 0; i < a.size(); ++i) {
        for (int c = 0; c < 3; ++c) largest = std::max(largest, std::abs(a[i][c] / b[i][c] - 1.0f));
    }
    return largest;
}

}  // namespace

TEST_CASE("placed points: sums where the cloud is are those of the points, cells and moments in the world") {
    const Mesh mesh = sphere(0.3f, 4), there = transformed(mesh, somewhere());
    const PlacedPoints placed(std::make_shared<PointCloud>(poisson_points(mesh, 0.03)), somewhere());
    Cells cells;
    placed.cloud().add_cells(true, [&](const PointSet& points) { return cells = cells_of(points, mesh, 64); });
    const CellMeans light = cell_means(cells, there, light_at(cells, there), 2);
    const auto kernel = make_tree_kernel(Dipole(kMedium));
    const PointTree tree(placed.cloud().clusters(), kernel, light.means, 2, placed.into_cloud(light.moments));

    const PointSet points = placed.in_world();
    const Cells in_world = placed.cells_in_world();
    const PointTree plain(points, light.means, 2, Dipole(kMedium), {}, &in_world, light.moments);
    std::vector<V3f> places, here;  // in the world, and where the cloud is
    for (std::size_t k = 0; k < points.size(); k += 16) {
        places.push_back(points.positions[k]);
        here.push_back(places.back() * placed.to_cloud());
    }
    const Gathered a = tree.gather_exact(here.data(), here.size());
    const Gathered b = plain.gather_exact(places.data(), places.size());
    CHECK(largest_difference(a.exitance, b.exitance) < 2e-4f);
    CHECK(largest_difference(a.coverage, b.coverage) < 2e-4f);
    // Their moments matter: without them sums differ by more.
    const PointTree blind(points, light.means, 2, Dipole(kMedium), {}, &in_world);
    const Gathered c = blind.gather_exact(places.data(), places.size());
    CHECK(largest_difference(c.exitance, b.exitance) > 2e-3f);
}

TEST_CASE("point tree: a group's sum is linear in its own light, whatever the others are") {
    const Mesh mesh = sphere(0.3f, 4);
    const PointSet points = poisson_points(mesh, 0.03);
    const Cells cells = cells_of(points, mesh, 64);
    CellMeans light = cell_means(cells, mesh, light_at(cells, mesh), 2);
    const auto gathered = [&] {
        return PointTree(points, light.means, 2, Dipole(kMedium), {}, &cells, light.moments)
            .gather(points.positions.data(), points.size())
            .exitance;
    };
    const std::vector<Rgb> before = gathered();
    for (std::size_t k = 0; k < points.size(); ++k) {
        light.means[2 * k] *= -0.25f;
        light.moments[2 * k] *= -0.25f;
    }
    const std::vector<Rgb> after = gathered();
    float first = 0.0f, second = 0.0f;
    for (std::size_t k = 0; k < points.size(); ++k) {
        for (int c = 0; c < 3; ++c) {
            first = std::max(first, std::abs(after[2 * k][c] / (-0.25f * before[2 * k][c]) - 1.0f));
            second = std::max(second, std::abs(after[2 * k + 1][c] / before[2 * k + 1][c] - 1.0f));
        }
    }
    CHECK(first < 1e-6f);
    CHECK(second < 1e-6f);
}

TEST_CASE("point tree: a group of its own gathers the same bits as among others") {
    const Mesh mesh = sphere(0.3f, 4);
    const PointSet points = poisson_points(mesh, 0.02);
    const Cells cells = cells_of(points, mesh, 64);
    const CellMeans light = cell_means(cells, mesh, light_at(cells, mesh), 2);
    const PointTree both(points, light.means, 2, Dipole(kMedium), {}, &cells, light.moments);
    const Gathered together = both.gather(points.positions.data(), points.size());
    for (std::size_t g = 0; g < 2; ++g) {
        std::vector<Rgb> means, sums;
        std::vector<V3f> moments;
        for (std::size_t k = 0; k < points.size(); ++k) {
            means.push_back(light.means[2 * k + g]);
            moments.push_back(light.moments[2 * k + g]);
            sums.push_back(together.exitance[2 * k + g]);
        }
        const PointTree one(points, means, 1, Dipole(kMedium), {}, &cells, moments);
        CHECK(one.gather(points.positions.data(), points.size()).exitance == sums);
    }
}

TEST_CASE("a bake shares the points of objects that place a mesh in one size, mirrored ones too") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.1f), 1.31f, 0.3f, CompensationMode::depth));
    M44f larger = somewhere(), moved = somewhere();
    larger.scale(V3f(1.25f));
    moved[3][0] = 9.0f, larger[3][0] = -9.0f;
    scene.objects.push_back({"/mirrored", 0, 0, moved});
    scene.objects.push_back({"/larger", 0, 0, larger});
    scene.lights = {dome(Rgb(1.0f))};
    RenderOptions options = small();
    options.spacing = 0.2f;
    const Bake baked = bake(scene, options).bake;
    CHECK(&baked.bodies[0].points.cloud() == &baked.bodies[1].points.cloud());
    CHECK(&baked.bodies[0].points.cloud() != &baked.bodies[2].points.cloud());
    // They stand on their own surface.
    const PointSet points = baked.bodies[1].points.in_world();
    for (std::size_t k = 0; k < points.size(); k += 7) {
        const V3f away = points.positions[k] - V3f(9.0f, moved[3][1], moved[3][2]);
        CHECK(away.length() == doctest::Approx(1.0f).epsilon(0.02));
        CHECK(away.normalized().dot(points.normals[k]) > 0.95f);
    }
}

TEST_CASE("a bake takes over what is known in memory, and bakes the lights that are new as if it had made all") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.1f), 1.31f, 0.3f, CompensationMode::depth));
    scene.lights = {dome(Rgb(1.0f))};
    RenderOptions options = small();
    options.spacing = 0.2f;
    options.bake_bounces = 1;
    const Bake known = bake(scene, options).bake;
    scene.lights.push_back(rect_above(5.0f, "key"));
    const Bake grown = bake(scene, options, known).bake, anew = bake(scene, options).bake;
    CHECK(grown.bodies[0].irradiance == anew.bodies[0].irradiance);
    CHECK(grown.bodies[0].moments == anew.bodies[0].moments);
}

TEST_CASE("placed points: clusters and sums stand as far below the surface as there is room") {
    PointSet points;
    for (int k = 0; k < 50; ++k) {
        points.positions.push_back({0.1f * float(k), 2.0f, 0.0f});
        points.normals.push_back({0.0f, 1.0f, 0.0f});
        points.areas.push_back(0.01f);
    }
    points.spacing = 0.1;
    PointCloud cloud(points);
    CHECK(cloud.clusters()->positions.front().y == 2.0f);
    CHECK(cloud.inward_positions() == points.positions);
    int made = 0;
    const auto make = [&] {
        ++made;
        return Room{std::vector<float>(50, 0.5f), std::vector<float>(50, 1.0f)};
    };
    cloud.add_room(10.0f, 0.2f, make);
    cloud.add_room(10.0f, 0.2f, make);
    CHECK(made == 1);
    for (const V3f& p : cloud.clusters()->positions) CHECK(p.y == doctest::Approx(1.9));
    for (const V3f& p : cloud.inward_positions()) CHECK(p.y == doctest::Approx(1.9));
    CHECK(cloud.points().positions.front().y == 2.0f);
    // Another medium has other room.
    cloud.add_room(10.0f, 0.4f, make);
    CHECK(made == 2);
    for (const V3f& p : cloud.clusters()->positions) CHECK(p.y == doctest::Approx(1.8));
}

TEST_CASE("placed points: what thin parts return is made once for a body, and forgotten where it is asked to") {
    PointCloud cloud(poisson_points(sphere(0.3f, 2), 0.1));
    int made = 0;
    const auto gain_of = [&](float absorption) {
        const auto known = cloud.thinness({1.0f, 1.0f, 1.0f, absorption}, [&] {
            ++made;
            return Thinness{std::vector<Rgb>(cloud.points().size(), Rgb(absorption)), {}};
        });
        return known->gain.front();
    };
    CHECK(gain_of(0.1f) == Rgb(0.1f));
    CHECK(gain_of(0.1f) == Rgb(0.1f));
    CHECK(made == 1);
    CHECK(gain_of(0.2f) == Rgb(0.2f));
    CHECK(made == 2);
    cloud.drop_thinness();
    CHECK(gain_of(0.2f) == Rgb(0.2f));
    CHECK(made == 3);
}
