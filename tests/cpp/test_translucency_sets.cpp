#include <doctest/doctest.h>

#include "frazil/render/translucency_sets.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// Rings first to last of the 60 that a unit sphere has from pole to pole, closed by a disc where it is cut.
Mesh part_of_sphere(int first, int last) {
    constexpr int kRings = 60, kAround = 96;
    Mesh mesh;
    for (int i = first; i <= last; ++i) {
        const double polar = double(kPi) * i / kRings;
        for (int k = 0; k < kAround; ++k) {
            const double around = 2.0 * double(kPi) * k / kAround;
            mesh.positions.emplace_back(float(std::sin(polar) * std::cos(around)), float(std::cos(polar)),
                                        float(std::sin(polar) * std::sin(around)));
        }
    }
    const auto at = [&](int ring, int k) { return (ring - first) * kAround + k % kAround; };
    for (int i = first; i < last; ++i) {
        for (int k = 0; k < kAround; ++k) {
            mesh.triangles.push_back({at(i, k), at(i, k + 1), at(i + 1, k)});
            mesh.triangles.push_back({at(i + 1, k), at(i, k + 1), at(i + 1, k + 1)});
        }
    }
    const auto close = [&](int ring, bool is_below) {
        const int center = int(mesh.positions.size());
        mesh.positions.emplace_back(0.0f, float(std::cos(double(kPi) * ring / kRings)), 0.0f);
        for (int k = 0; k < kAround; ++k) {
            const int a = at(ring, k), b = at(ring, k + 1);
            mesh.triangles.push_back(is_below ? V3i(center, a, b) : V3i(center, b, a));
        }
    };
    if (first > 0) close(first, false);
    if (last < kRings) close(last, true);
    return mesh;
}

Scene halves(const std::string& set, float refraction) {
    Scene scene = scene_of(part_of_sphere(0, 34), ice(Rgb(0.4f, 0.2f, 0.1f), 1.31f, 0.4f, CompensationMode::depth));
    auto& model = std::get<IceMaterial>(scene.materials[0].model);
    model.medium.sigma_s_prime = Rgb(8.0f);
    model.refraction = refraction;
    scene.objects[0].translucency_set = set;
    scene.meshes.push_back(part_of_sphere(26, 60));
    scene.mesh_paths.push_back("/below");
    scene.objects.push_back({"/below", 1, 0, M44f(), "", set});
    scene.lights = {rect_above(4.0f, ""), dome(Rgb(0.3f))};
    return scene;
}

Scene whole(float refraction) {
    Scene scene = halves("", refraction);
    scene.objects.resize(1);
    scene.meshes = {part_of_sphere(0, 60)};
    scene.mesh_paths = {"/shape"};
    return scene;
}

double difference(const Film& a, const Film& b, const char* layer) {
    double square = 0.0, mean = 0.0;
    int count = 0;
    for (int y = 0; y < a.height; ++y) {
        for (int x = 0; x < a.width; ++x) {
            if (pixel(a, "beauty", x, y)[3] < 1.0f || pixel(b, "beauty", x, y)[3] < 1.0f) continue;
            for (int c = 0; c < 3; ++c) {
                const double value = pixel(a, layer, x, y)[c], other = pixel(b, layer, x, y)[c];
                square += (value - other) * (value - other), mean += value, ++count;
            }
        }
    }
    REQUIRE(count > 300);
    return std::sqrt(square / count) / (mean / count);
}

}  // namespace

TEST_CASE("a sphere cut into two overlapping parts of one translucency set is one sphere") {
    RenderOptions options = small();
    options.bake_samples = 128;
    const RenderResult one = render(whole(0.0f), options);
    const RenderResult two = render(halves("sphere", 0.0f), options);
    const RenderResult apart = render(halves("", 0.0f), options);
    CHECK(two.stats.warnings.empty());
    // Points inside are left out: those of both parts together are as many as the sphere's, not a half more.
    CHECK(double(two.stats.points) == doctest::Approx(double(one.stats.points)).epsilon(0.03));
    CHECK(double(apart.stats.points) > 1.3 * double(one.stats.points));
    CHECK(difference(one.film, two.film, "translucency") < 0.02);
    CHECK(difference(one.film, apart.film, "translucency") > 0.04);

    SUBCASE("seen into, too: the inner boundaries are invisible") {
        options.samples = 256;
        const Film seen = render(whole(1.0f), options).film, seen_two = render(halves("sphere", 1.0f), options).film;
        CHECK(difference(seen, seen_two, "beauty") < 0.03);
    }
    SUBCASE("one thread gives the same bits") {
        options.threads = 1;
        const Film again = render(halves("sphere", 0.0f), options).film;
        CHECK(again.layers.at("beauty").pixels == two.film.layers.at("beauty").pixels);
    }
}

TEST_CASE("members that cannot share their light stand for themselves, with a warning") {
    Scene scene = halves("sphere", 0.0f);
    SUBCASE("another medium") {
        scene.materials.push_back(scene.materials[0]);
        std::get<IceMaterial>(scene.materials[1].model).medium.sigma_a = Rgb(2.0f);
        scene.objects[1].material = 1;
        const RenderResult result = render(scene, small());
        REQUIRE(result.stats.warnings.size() >= 1);
        CHECK(result.stats.warnings[0].find("/below: the medium must be that of /shape") == 0);
    }
    SUBCASE("an open mesh") {
        scene.meshes[1].triangles.resize(scene.meshes[1].triangles.size() / 2);
        const RenderResult result = render(scene, small());
        REQUIRE(result.stats.warnings.size() >= 1);
        CHECK(result.stats.warnings[0].find("/below: the mesh must be closed to share light") == 0);
    }
}
