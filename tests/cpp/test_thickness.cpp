#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/quadrature.h"
#include "frazil/render/rays_each.h"
#include "frazil/render/thickness.h"
#include "frazil/translucency/half_space.h"
#include "shapes.h"

namespace frazil {
namespace {

// A flat box about the origin, so wide that its sides do not matter in the middle.
Mesh slab(float thickness, bool has_bottom = true) {
    Mesh mesh;
    const float half = 1000.0f * thickness;
    for (const float y : {0.0f, -thickness}) {
        for (const V2f& c : {V2f(-half, half), V2f(half, half), V2f(half, -half), V2f(-half, -half)}) {
            mesh.positions.push_back({c.x, y, c.y});
        }
    }
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    if (has_bottom) mesh.triangles.insert(mesh.triangles.end(), {{4, 6, 5}, {4, 7, 6}});
    return mesh;
}

PointSet middle() {
    PointSet points;
    for (int k = 0; k < 64; ++k) {
        points.positions.push_back({0.01f * k, 0.0f, 0.0f});
        points.normals.push_back({0.0f, 1.0f, 0.0f});
        points.areas.push_back(1.0f);
    }
    return points;
}

std::vector<Rgb> gains_of(const RayScene& scene, const Medium& medium, float traced = 0.0f, float seen_through = 0.0f,
                          PlacementMask mask = nullptr) {
    return thinness(middle(), {}, scene, ThinMedium::of(medium, traced), seen_through, nullptr, mask).gain;
}

Rgb mean_gain(const Mesh& mesh, const Medium& medium, float traced = 0.0f, float seen_through = 0.0f) {
    const RayScene scene({mesh}, {Placement{}});
    Rgb sum(0.0f);
    for (const Rgb& gain : gains_of(scene, medium, traced, seen_through)) sum += gain / 64.0f;
    return sum;
}

}  // namespace

TEST_CASE("rays each: as many to an area however close the points, a power of two") {
    PointSet points;
    CHECK(rays_each(points, 1.0f, 64, 4) == 64);  // of points without a spacing
    for (const auto& [spacing, rays] :
         {std::pair(0.8f, 64), {0.5f, 64}, {0.25f, 16}, {0.2f, 16}, {0.1f, 4}, {0.01f, 4}}) {
        points.spacing = 0.02f * spacing;
        CHECK(rays_each(points, 0.02f, 64, 4) == rays);
    }
}

TEST_CASE("thickness: points that share their chords gain as much as points by themselves") {
    const Mesh mesh = slab(0.1f);
    const RayScene scene({mesh}, {Placement{}});
    const Medium medium{Rgb(10.0f, 20.0f, 30.0f), Rgb(3.0f, 1.0f, 0.5f), 1.31f};
    const ThinMedium thin = ThinMedium::of(medium, 0.0f);
    PointSet alone = middle(), close = middle();
    close.spacing = 0.001f;
    for (const float seen_through : {0.0f, 1.0f}) {
        Rgb gain[2] = {Rgb(0.0f), Rgb(0.0f)}, exponent[2] = {Rgb(0.0f), Rgb(0.0f)};
        for (int i = 0; i < 2; ++i) {
            const Thinness found = thinness(i == 0 ? alone : close, {}, scene, thin, seen_through);
            for (std::size_t k = 0; k < 64; ++k) {
                gain[i] += found.gain[k] / 64.0f;
                exponent[i] += found.exponent[k] / 64.0f;
            }
        }
        for (int c = 0; c < 3; ++c) {
            CHECK(std::abs(gain[1][c] / gain[0][c] - 1.0f) < 0.015f);
            CHECK(std::abs(exponent[1][c] / exponent[0][c] - 1.0f) < 0.015f);
        }
    }
}

TEST_CASE("thickness: a thin slab absorbs sigma_a times its mean chord, twice its thickness") {
    // What it absorbs over that. Exact where next to nothing is absorbed, as light is then even inside too; the model comes
    // near to it in slabs that scatter little.
    const Medium medium{Rgb(5.0f), Rgb(0.2f, 0.02f, 0.0f), 1.0f};
    const auto ratio = [&](float thickness, int c) {
        const double alpha = 5.0 / (5.0 + medium.sigma_a[c]), plane = half_space_albedo(alpha, 1.0).all();
        return (1.0 - mean_gain(slab(thickness), medium)[c] * plane) / (medium.sigma_a[c] * 2.0 * thickness);
    };
    for (const int c : {0, 1}) CHECK(std::abs(ratio(0.003f, c) - 1.0) < 0.02);
    // Half a free path thick.
    CHECK(ratio(0.1f, 1) > 1.0);
    CHECK(ratio(0.1f, 1) < 1.3);
    CHECK(mean_gain(slab(0.1f), medium).z == 1.0f);
}

TEST_CASE("thickness: chords of a closed body end at its own other side, whatever stands in it") {
    const Medium medium{Rgb(5.0f), Rgb(0.02f, 0.005f, 0.001f), 1.0f};
    Mesh sheet = slab(0.05f, false);
    for (V3f& p : sheet.positions) p.y -= 0.03f;
    const RayScene scene({slab(0.1f), sheet}, {Placement{0, M44f()}, Placement{1, M44f()}});
    const std::vector<std::uint8_t> itself = {1, 0};
    const auto mean = [&](PlacementMask mask) {
        Rgb sum(0.0f);
        for (const Rgb& gain : gains_of(scene, medium, 0.0f, 0.0f, mask)) sum += gain / 64.0f;
        return sum;
    };
    CHECK(mean(&itself) == mean_gain(slab(0.1f), medium));
    CHECK(mean(nullptr).x > 1.002f * mean(&itself).x);
}

TEST_CASE("thickness: what is thick against its absorption, or has no other side, returns what a plane does") {
    const Medium medium{Rgb(50.0f), Rgb(1.0f, 5.0f, 25.0f), 1.31f};
    for (const Mesh& mesh : {slab(30.0f), slab(0.01f, false)}) {
        const Rgb gain = mean_gain(mesh, medium);
        for (int c = 0; c < 3; ++c) CHECK(std::abs(gain[c] - 1.0f) < 0.003f);  // rays sample directions
    }
}

TEST_CASE("thickness: gains grow as the slab gets thinner and never bring more than all light back") {
    const Medium medium{Rgb(50.0f), Rgb(1.0f, 5.0f, 25.0f), 1.31f};
    Rgb last(1.0f);
    for (const float thickness : {1.0f, 0.1f, 0.01f, 0.001f}) {
        const Rgb gain = mean_gain(slab(thickness), medium);
        for (int c = 0; c < 3; ++c) {
            const double alpha = 50.0 / (50.0 + medium.sigma_a[c]);
            CHECK(gain[c] >= last[c] * 0.999f);
            CHECK(gain[c] * half_space_albedo(alpha, medium.eta).all() <= 1.0001);
        }
        last = gain;
    }
    CHECK(last.z > 1.5f);
}

TEST_CASE(
    "thickness: a slab of light that rays trace, scattered once or not, and of the core returns what it did before") {
    const float thickness = 0.02f;
    const Medium medium{Rgb(50.0f), Rgb(1.0f, 5.0f, 25.0f), 1.0f};
    const Mesh mesh = slab(thickness);
    const Rgb all = mean_gain(mesh, medium), core = mean_gain(mesh, medium, 1.0f, 1.0f);
    const auto straight = [&](double sigma) {
        return integrate_gauss32([&](double mu) { return 2.0 * mu * std::exp(-sigma * thickness / mu); }, 0.0, 1.0);
    };
    // Light from all around that is scattered once and leaves on either side.
    const auto once = [&](double sigma) {
        const auto leaves = [&](double depth) {
            return integrate_gauss32([&](double mu) { return 0.5 * std::exp(-sigma * depth / mu); }, 0.0, 1.0);
        };
        const auto at = [&](double z) {
            const double arrives =
                integrate_gauss32([&](double mu) { return 2.0 * std::exp(-sigma * z / mu); }, 0.0, 1.0);
            return 50.0 * arrives * (leaves(z) + leaves(thickness - z));
        };
        return integrate_gauss32(at, 0.0, thickness);
    };
    const double white = half_space_albedo(1.0, 1.0).single;
    for (int c = 0; c < 3; ++c) {
        const double sigma = 50.0 + medium.sigma_a[c];
        const HalfSpaceAlbedo plane = half_space_albedo(50.0 / sigma, 1.0);
        const double seen = (1.0 - straight(sigma) - once(50.0)) / (1.0 - white);
        const double sum = core[c] * plane.multiple * seen + straight(sigma) + once(sigma);
        CHECK(std::abs(sum / (all[c] * plane.all()) - 1.0) < 0.035);
    }
}

TEST_CASE("thickness: what is seen straight through is not the core's, which keeps a white slab white") {
    const float thickness = 0.02f;
    const Medium medium{Rgb(50.0f), Rgb(0.0f, 5.0f, 25.0f), 1.0f};
    const RayScene scene({slab(thickness)}, {Placement{}});
    Rgb all(0.0f), core(0.0f);
    for (const Rgb& gain : gains_of(scene, medium)) all += gain / 64.0f;
    for (const Rgb& gain : gains_of(scene, medium, 0.0f, 1.0f)) core += gain / 64.0f;
    CHECK(std::abs(core.x - 1.0f) < 1e-5f);
    const auto straight = [&](double sigma) {  // 2 E3(sigma thickness): what crosses the slab unscattered
        return integrate_gauss32([&](double mu) { return 2.0 * mu * std::exp(-sigma * thickness / mu); }, 0.0, 1.0);
    };
    for (int c = 1; c < 3; ++c) {
        const double sigma_a = medium.sigma_a[c], plane = half_space_albedo(50.0 / (50.0 + sigma_a), 1.0).all();
        const double left = (all[c] * plane - straight(50.0 + sigma_a)) / (1.0 - straight(50.0 + sigma_a));
        CHECK(std::abs(core[c] * plane / left - 1.0) < 0.002);
    }
}

TEST_CASE(
    "thickness: the exponent of a slab is what its other side has there, and changes with the depth as that does") {
    const float depths = 2.0f;  // free paths
    const Medium medium{Rgb(9.43f), Rgb(0.57f), 1.0f};
    const ThinMedium thin = ThinMedium::of(medium, 0.0f);
    const RayScene scene({slab(depths / 10.0f)}, {Placement{}});
    const std::vector<Rgb> exponent = thinness(middle(), {}, scene, thin).exponent;
    Rgb at_surface(0.0f), slope(0.0f);
    for (std::size_t k = 0; k < 64; ++k) {
        at_surface += exponent[2 * k] / 64.0f;
        slope += exponent[2 * k + 1] / 64.0f;
    }
    const EvenLight::Exponent there = thin.even_light[0].half_space(depths);
    CHECK(std::abs(at_surface.x / there.value - 1.0f) < 0.2f);  // it stands for a mean along the chords
    CHECK(std::abs(slope.x / -there.slope - 1.0f) < 0.02f);
}

TEST_CASE("thickness: slabs of ice return what random walks do that its boundary reflects inside") {
    // Walks from outside at cosines inside of 1, 0.8 and 0.66, averaged; alpha 0.99, 0.943 and 0.7; eta 1.31.
    const Medium medium{Rgb(0.99f, 0.943f, 0.7f), Rgb(0.01f, 0.057f, 0.3f), 1.31f};
    const ThinMedium thin = ThinMedium::of(medium, 0.0f);
    for (const auto& [thickness, walked] :
         {std::pair{0.5f, Rgb(0.981f, 0.904f, 0.686f)}, std::pair{2.0f, Rgb(0.931f, 0.701f, 0.292f)},
          std::pair{5.0f, Rgb(0.847f, 0.497f, 0.146f)}}) {
        const Rgb gain = mean_gain(slab(thickness), medium);
        for (int c = 0; c < 3; ++c) CHECK(std::abs(gain[c] * thin.plane[c] - walked[c]) < 0.03f);
    }
}

TEST_CASE("thickness: of places below points, those that lie outside of a body tell nothing") {
    // The place below the one point is in the slab, that below the other beyond its other side.
    const Mesh mesh = test::box_of(V3f(-1.0f, -0.1f, -1.0f), V3f(1.0f, 0.0f, 1.0f));
    const RayScene scene({mesh}, {Placement{}});
    const std::vector<std::uint8_t> itself = {1};
    const Medium medium{Rgb(9.0f), Rgb(1.0f), 1.0f};
    PointSet points;
    points.positions = {V3f(0.0f), V3f(0.3f, 0.0f, 0.0f)};
    points.normals = {V3f(0.0f, 1.0f, 0.0f), V3f(0.0f, 1.0f, 0.0f)};
    points.areas = {0.01f, 0.01f};
    points.spacing = 0.1;
    FirstScattering below{{V3f(0.0f, -0.05f, 0.0f), V3f(0.3f, -0.15f, 0.0f)}, {0.05f, 0.15f}, {}};
    below.axes.assign(2, {V3f(0.02f, 0.0f, 0.0f), V3f(0.0f, 0.0f, 0.02f)});
    const Thinness found = thinness(points, below, scene, ThinMedium::of(medium, 0.0f), 0.0f, nullptr, &itself);
    CHECK(found.known[0] == 1.0f);
    CHECK(found.exponent[0].x > 0.0f);
    CHECK(found.known[1] == 0.0f);
    CHECK(found.exponent[2].x == 0.0f);
    CHECK(found.gain[1].x == 1.0f);
}

}  // namespace frazil
