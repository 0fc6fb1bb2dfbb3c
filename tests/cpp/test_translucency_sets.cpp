#include <doctest/doctest.h>

#include <algorithm>
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
    // Where both surfaces lie in one place, which of them a ray meets is the tracer's: of parts that stand apart it decides
    // how far off they are.
    const double off = difference(one.film, two.film, "translucency");
    CHECK(off < 0.006);
    CHECK(difference(one.film, apart.film, "translucency") > std::max(0.02, 5.0 * off));

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

namespace {

Overlay patches(const std::string& name, std::uint32_t seed) {
    Overlay overlay;
    overlay.name = name;
    overlay.color = Rgb(0.6f, 0.8f, 0.9f);
    overlay.opacity = 0.6f, overlay.scattering = 0.7f, overlay.roughness = 0.4f;
    overlay.pattern.kind = PatternKind::cells;
    overlay.pattern.size = 0.5f, overlay.pattern.width = 0.15f, overlay.pattern.feather = 0.1f;
    overlay.pattern.seed = seed;
    return overlay;
}

RenderOptions with_overlay_layers() {
    RenderOptions options = small();
    options.bake_samples = 128;
    options.bake_bounces = 0;
    options.gather.tolerance = 1e-3f;
    options.aovs = {"overlay"};
    return options;
}

}  // namespace

TEST_CASE("overlays of a set's members change its light and have their layers as on one sphere") {
    const auto with_patches = [](Scene scene) {
        auto& model = std::get<IceMaterial>(scene.materials[0].model);
        model.overlays = {patches("cracks", 1), patches("frost", 7)};
        model.age = 1.0f;
        return scene;
    };
    const Film one = render(with_patches(whole(0.0f)), with_overlay_layers()).film;
    const Film two = render(with_patches(halves("sphere", 0.0f)), with_overlay_layers()).film;
    const Film apart = render(with_patches(halves("", 0.0f)), with_overlay_layers()).film;
    CHECK(difference(one, two, "translucency") < 0.02);
    for (const char* layer : {"overlay_cracks_translucency", "overlay_frost_translucency"}) {
        REQUIRE(mean_inside(one, layer, 0) < -0.01);
        CHECK(std::abs(difference(one, two, layer)) < 0.025);
        CHECK(std::abs(difference(one, apart, layer)) > 0.04);
    }
    for (const char* layer : {"overlay_cracks_squared", "overlay_frost_diffuse"}) {
        CHECK(std::abs(difference(one, two, layer)) < 0.04);
    }
}

TEST_CASE("an overlay of one member has its layer on the others, as their light is its light too") {
    const auto lower_alone = [](float opacity) {
        Scene scene = halves("sphere", 0.0f);
        scene.materials.push_back(scene.materials[0]);
        auto& model = std::get<IceMaterial>(scene.materials[1].model);
        model.overlays = {patches("frost", 7)};
        model.overlays[0].opacity = opacity;
        model.age = 1.0f;
        scene.objects[1].material = 1;
        return scene;
    };
    const Film full = render(lower_alone(0.6f), with_overlay_layers()).film;
    const Film less = render(lower_alone(0.15f), with_overlay_layers()).film;
    double error2 = 0.0, change2 = 0.0;
    for (int y = 0; y < full.height; ++y) {
        for (int x = 0; x < full.width; ++x) {
            if (pixel(full, "object_id", x, y)[0] != 1.0f || pixel(full, "beauty", x, y)[3] < 1.0f) continue;
            // Not where the other member and its frost are seen in the pixel too.
            if (pixel(full, "overlay_frost_squared", x, y)[0] != 0.0f) continue;
            for (int c = 0; c < 3; ++c) {
                const double change = pixel(less, "translucency", x, y)[c] - pixel(full, "translucency", x, y)[c];
                const double told = (0.25 - 1.0) * pixel(full, "overlay_frost_translucency", x, y)[c];
                error2 += (change - told) * (change - told), change2 += change * change;
            }
        }
    }
    REQUIRE(change2 > 1e-4);
    CHECK(std::sqrt(error2 / change2) < 1e-3);
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
