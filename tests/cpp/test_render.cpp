#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/render/render.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

TEST_CASE("white furnace: ice that absorbs nothing is invisible in uniform light") {
    for (const float eta : {1.0f, 1.31f}) {
        for (const float roughness : {0.2f, 0.7f}) {
            CAPTURE(eta);
            CAPTURE(roughness);
            Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-6f), eta, roughness, CompensationMode::conserve));
            scene.lights = {dome(Rgb(1.0f))};
            RenderOptions options = small();
            options.samples = 64;
            const Film film = render(scene, options).film;
            for (int channel = 0; channel < 3; ++channel) {
                CHECK(mean_inside(film, "beauty", channel) == doctest::Approx(1.0).epsilon(0.02));
            }
        }
    }
}

TEST_CASE("white furnace: a white diffuse sphere without reflection is invisible in uniform light") {
    StandardMaterial model;
    model.diffuse_color.value = Rgb(1.0f);
    model.ior = 1.0f;
    Scene scene = scene_of(sphere(1.0f, 4), {"/white", model});
    scene.lights = {dome(Rgb(1.0f))};
    const Film film = render(scene, small()).film;
    CHECK(mean_inside(film, "beauty", 0) == doctest::Approx(1.0).epsilon(0.01));
    CHECK(pixel(film, "background", 0, 0)[1] == doctest::Approx(1.0));
}

TEST_CASE("a diffuse floor under a rect light has radiance albedo E / pi by the closed form") {
    StandardMaterial model;
    model.diffuse_color.value = Rgb(0.5f);
    model.ior = 1.0f;
    Scene scene = scene_of(floor_square(5.0f, 0.0f), {"/grey", model});
    scene.lights = {rect_above(2.0f, "")};
    // Look straight down at the point under the light's centre, from below the light.
    scene.camera.camera_to_world = M44f();
    scene.camera.camera_to_world.rotate(V3f(-kPi / 2.0f, 0.0f, 0.0f));
    scene.camera.camera_to_world[3][1] = 2.5f;
    scene.camera.focal_length = 2000.0f;
    RenderOptions options = small();
    options.samples = 128;
    const Film film = render(scene, options).film;
    // Four corner rectangles of a x b = 1 x 1 at height 3 [configuration factor of a parallel rectangle].
    const double k = 1.0 / std::sqrt(1.0 + 9.0);
    const double irradiance = 2.0 * 4.0 * 0.5 * 2.0 * k * std::atan(k);
    CHECK(mean_inside(film, "diffuse", 0) == doctest::Approx(0.5 * irradiance / kPi).epsilon(0.01));
}

TEST_CASE("the additive layers sum to the beauty, and light groups to their layers, exactly") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.5f, 0.1f, 0.02f), 1.31f, 0.3f, CompensationMode::ratio));
    scene.meshes.push_back(floor_square(4.0f, -1.0f));
    scene.mesh_paths.push_back("/floor");
    scene.materials.push_back({"/grey", StandardMaterial{}});
    scene.objects.push_back({"/floor", 1, 1, M44f()});
    scene.lights = {dome(Rgb(0.3f, 0.4f, 0.6f), "sky"), rect_above(5.0f, "key"), rect_above(-1.0f, "negative")};
    const Film film = render(scene, small()).film;
    for (int y = 0; y < film.height; ++y) {
        for (int x = 0; x < film.width; ++x) {
            for (int channel = 0; channel < 3; ++channel) {
                float sum = 0.0f;
                for (const Aov& aov : aov_table()) {
                    if (!aov.is_additive) continue;
                    const std::string name(aov.name);
                    const float value = pixel(film, name.c_str(), x, y)[channel];
                    sum += value;
                    float groups = 0.0f;
                    for (const char* group : {"_sky", "_key", "_negative"}) {
                        groups += pixel(film, (name + group).c_str(), x, y)[channel];
                    }
                    CHECK(groups == value);
                }
                CHECK(sum == pixel(film, "beauty", x, y)[channel]);
            }
        }
    }
}

TEST_CASE("one and two threads give the same bits") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.5f, 0.1f, 0.02f), 1.31f, 0.3f, CompensationMode::ratio));
    scene.lights = {dome(Rgb(0.3f, 0.4f, 0.6f)), rect_above(5.0f, "")};
    RenderOptions options = small();
    options.threads = 1;
    const Film one = render(scene, options).film;
    options.threads = 2;
    const Film two = render(scene, options).film;
    for (const auto& [name, layer] : one.layers) {
        CAPTURE(name);
        CHECK(layer.pixels == two.layers.at(name).pixels);
    }
}

TEST_CASE("fill adds what the coverage lacks: the flat floor stays, the mean of a sphere rises") {
    const Medium medium = {Rgb(2.0f), Rgb(0.2f), 1.31f};
    const auto mean_translucency = [&](CompensationMode mode) {
        Material material = ice(Rgb(0.2f), 1.31f, 0.3f, mode);
        std::get<IceMaterial>(material.model).medium = medium;
        Scene scene = scene_of(sphere(1.0f, 4), material);
        scene.lights = {dome(Rgb(1.0f))};
        RenderOptions options = small();
        options.samples = 64;
        return mean_inside(render(scene, options).film, "translucency", 0);
    };
    const Profile profile = Dipole(medium);
    // In uniform light every compensation that is exact gives the same: W -> Rd_total.
    const double expected = mean_translucency(CompensationMode::conserve);
    CHECK(mean_translucency(CompensationMode::fill) == doctest::Approx(expected).epsilon(0.02));
    CHECK(mean_translucency(CompensationMode::off) ==
          doctest::Approx(expected * within(profile, 2.0f).x / albedo(profile).x).epsilon(0.02));
}

TEST_CASE("depth, position, normal and object id are those of what is seen") {
    Scene scene = scene_of(sphere(1.0f, 5), {"/grey", StandardMaterial{}});
    RenderOptions options = small();
    options.width = options.height = 25;
    const Film film = render(scene, options).film;
    CHECK(pixel(film, "Z", 12, 12)[0] == doctest::Approx(5.0).epsilon(1e-3));
    CHECK(pixel(film, "P", 12, 12)[2] == doctest::Approx(1.0).epsilon(1e-3));
    CHECK(pixel(film, "N", 12, 12)[2] == doctest::Approx(1.0).epsilon(1e-2));
    CHECK(pixel(film, "object_id", 12, 12)[0] == 1.0f);
    CHECK(std::isinf(pixel(film, "Z", 0, 0)[0]));
    CHECK(pixel(film, "object_id", 0, 0)[0] == 0.0f);
    CHECK(pixel(film, "beauty", 0, 0)[3] == 0.0f);
}

TEST_CASE("options and scenes out of range are refused by name") {
    const Scene scene = scene_of(sphere(1.0f, 1), ice(Rgb(0.1f), 1.31f, 0.3f, CompensationMode::ratio));
    RenderOptions options = small();
    options.width = 0;
    CHECK_THROWS_WITH_AS(render(scene, options), doctest::Contains("width must be in 1..65536"), ValueError);

    Scene broken = scene;
    std::get<IceMaterial>(broken.materials[0].model).medium.sigma_a.y = -0.1f;
    CHECK_THROWS_WITH_AS(render(broken, small()), doctest::Contains("/ice: "), ValueError);
    broken = scene;
    broken.objects[0].local_to_world[0][0] = 0.0f;
    CHECK_THROWS_WITH_AS(render(broken, small()), doctest::Contains("/shape: "), ValueError);
    broken = scene;
    broken.meshes[0].positions[0].x = std::nanf("");
    CHECK_THROWS_WITH_AS(render(broken, small()), doctest::Contains("/shape: positions must be finite"), ValueError);
}

TEST_CASE("a stop that is asked for ends the render") {
    const Scene scene = scene_of(sphere(1.0f, 1), {"/grey", StandardMaterial{}});
    Progress progress({}, [] { return true; });
    CHECK_THROWS_AS(render(scene, small(), &progress), Cancelled);
}

TEST_CASE("default spacing gives a tiny body a thousand points, and a vast one is warned of") {
    Scene scene = scene_of(sphere(1e-3f, 3), ice(Rgb(0.1f), 1.31f, 0.3f, CompensationMode::ratio));
    std::get<IceMaterial>(scene.materials[0].model).spacing.value = 0.0f;
    scene.lights = {dome(Rgb(1.0f))};
    RenderOptions options = small();
    options.bake_samples = 1;
    const RenderStats tiny = render(scene, options).stats;
    CHECK(tiny.points > 700);
    CHECK(tiny.warnings.empty());

    std::get<IceMaterial>(scene.materials[0].model).medium.sigma_s_prime = Rgb(1e6f);
    options.spacing = 1e-4f;
    const RenderStats coarse = render(scene, options).stats;
    REQUIRE(coarse.warnings.size() == 1);
    CHECK(coarse.warnings[0].find("/shape: points are 0.0001 m apart") == 0);
}

TEST_CASE("places of a pixel that lie near to each other share a gather, without changing what is seen") {
    Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(3.0f, 1.0f, 0.2f), 1.31f, 0.3f, CompensationMode::ratio));
    scene.lights = {rect_above(4.0f, "")};
    RenderOptions options = small();
    options.samples = 64;
    const auto seen = [&](int side, int samples) {
        options.width = options.height = side;
        options.samples = samples;
        return render(scene, options);
    };
    // Pixels of a few centimetres share little, those of millimetres nearly all of their 64 samples.
    const RenderResult wide = seen(16, 64);
    CHECK(wide.stats.gathers > wide.stats.camera_rays / 8);
    scene.camera.focal_length *= 40.0f;
    const RenderResult near = seen(8, 64);
    CHECK(near.stats.gathers < near.stats.camera_rays / 16);
    const RenderResult apart = seen(64, 1);
    CHECK(apart.stats.gathers > apart.stats.camera_rays / 2);
    for (int c = 0; c < 3; ++c) {
        CHECK(mean_inside(near.film, "translucency", c) ==
              doctest::Approx(mean_inside(apart.film, "translucency", c)).epsilon(2e-3));
    }
}
