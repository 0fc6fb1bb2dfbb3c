#include <doctest/doctest.h>

#include <cmath>

#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// Almost in touch, under an even sky.
Scene two_white_spheres(float eta) {
    Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-6f), eta, 0.3f, CompensationMode::conserve));
    M44f beside;
    beside.translate(V3f(0.0f, 2.01f, 0.0f));
    scene.objects.push_back({"/other", 0, 0, beside});
    scene.lights = {dome(Rgb(1.0f))};
    return scene;
}

}  // namespace

TEST_CASE("furnace over a white floor: what the floor sends back takes the place of the sky that it hides") {
    Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-6f), 1.31f, 0.3f, CompensationMode::conserve));
    StandardMaterial white;
    white.diffuse_color.value = Rgb(1.0f);
    white.ior = 1.0f;
    scene.meshes.push_back(floor_square(400.0f, -10.0f));
    scene.mesh_paths.push_back("/floor");
    scene.materials.push_back({"/white", white});
    scene.objects.push_back({"/floor", 1, 1, M44f()});
    scene.lights = {dome(Rgb(1.0f))};
    // Only the sphere in view.
    scene.camera.focal_length = 100.0f;
    RenderOptions options = small();
    options.samples = 64;
    options.bake_bounces = 1;
    CHECK(mean_inside(render(scene, options).film, "translucency", 0) +
              mean_inside(render(scene, options).film, "specular", 0) ==
          doctest::Approx(1.0).epsilon(0.02));
    options.bake_bounces = 0;
    CHECK(mean_inside(render(scene, options).film, "translucency", 0) < 0.8);
}

TEST_CASE("furnace of two white spheres: ice lights ice until it cannot be told from the sky") {
    const Scene scene = two_white_spheres(1.0f);
    RenderOptions options = small();
    options.bake_bounces = 6;
    CHECK(mean_inside(render(scene, options).film, "translucency", 0) == doctest::Approx(1.0).epsilon(0.01));
    options.bake_bounces = 0;
    CHECK(mean_inside(render(scene, options).film, "translucency", 0) < 0.97);
}

TEST_CASE("furnace of two white spheres with a boundary: every point gets what an open sky would send") {
    const Scene scene = two_white_spheres(1.31f);
    RenderOptions options = small();
    options.bake_bounces = 8;
    options.bake_samples = 256;
    options.spacing = 0.08f;
    const auto bodies = make_bodies(scene);
    const float open = kPi * bodies[0]->transmittance_average(0.3f);
    const LitPoints lit = bake(scene, options).bake.bodies[0];
    const PointSet points = lit.points.in_world();
    double near = 0.0, all = 0.0;
    int count = 0;
    for (std::size_t k = 0; k < points.size(); ++k) {
        all += lit.irradiance[k].x / (open * double(points.size()));
        if (points.positions[k].y < 0.9f) continue;
        near += lit.irradiance[k].x / open;
        ++count;
    }
    CHECK(all == doctest::Approx(1.0).epsilon(0.003));
    CHECK(near / count == doctest::Approx(1.0).epsilon(0.01));  // between the two; 0.9 without what ice reflects
}

TEST_CASE("furnace of two white spheres: a ray gets from ice in its way what it does not get from the sky") {
    const Scene scene = two_white_spheres(1.0f);
    RenderOptions options = small();
    options.bake_samples = 8;
    options.spacing = 0.08f;
    const auto spread = [&](int bounces) {
        options.bake_bounces = bounces;
        const LitPoints lit = bake(scene, options).bake.bodies[0];
        double squares = 0.0;
        for (const Rgb& value : lit.irradiance) squares += std::pow(double(value.x) / kPi - 1.0, 2.0);
        return std::sqrt(squares / double(lit.irradiance.size()));
    };
    CHECK(spread(8) < 0.02);
    CHECK(spread(0) > 0.15);
}

TEST_CASE("a convex body alone sees no ice: bounces change no bit") {
    Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(0.2f), 1.31f, 0.3f, CompensationMode::ratio));
    scene.lights = {dome(Rgb(0.3f, 0.4f, 0.6f)), rect_above(5.0f, "key")};
    RenderOptions options = small();
    options.bake_bounces = 0;
    const Film without = render(scene, options).film;
    options.bake_bounces = 2;
    CHECK(render(scene, options).film.layers.at("beauty").pixels == without.layers.at("beauty").pixels);
}

TEST_CASE("light at the bottom of a well of white ice: what bounces are left after some is summed as one series") {
    Scene scene = scene_of(box_of(V3f(-1.0f, -4.0f, -1.0f), V3f(1.0f, -3.0f, 1.0f)),
                           ice(Rgb(1e-4f), 1.0f, 0.3f, CompensationMode::conserve));
    const auto add_wall = [&](const V3f& low, const V3f& high) {
        const auto mesh = static_cast<std::uint32_t>(scene.meshes.size());
        scene.meshes.push_back(box_of(low, high));
        scene.mesh_paths.push_back("/wall" + std::to_string(mesh));
        scene.objects.push_back({scene.mesh_paths.back(), mesh, 0, M44f()});
    };
    add_wall(V3f(1.01f, -4.0f, -1.0f), V3f(2.0f, 0.0f, 1.0f));
    add_wall(V3f(-2.0f, -4.0f, -1.0f), V3f(-1.01f, 0.0f, 1.0f));
    add_wall(V3f(-2.0f, -4.0f, 1.01f), V3f(2.0f, 0.0f, 2.0f));
    add_wall(V3f(-2.0f, -4.0f, -2.0f), V3f(2.0f, 0.0f, -1.01f));
    scene.lights = {dome(Rgb(1.0f, 0.5f, 0.0f))};
    RenderOptions options = small();
    options.bake_samples = 256;
    options.spacing = 0.12f;
    const auto light = [&](int bounces) {
        options.bake_bounces = bounces;
        Rgb sum(0.0f);
        for (const LitPoints& lit : bake(scene, options).bake.bodies) {
            for (const Rgb& value : lit.irradiance) sum += value / float(lit.irradiance.size());
        }
        return sum;
    };
    const Rgb all = light(40);
    CHECK(light(2).x < 0.65f * all.x);  // as they come
    CHECK(light(4).x == doctest::Approx(all.x).epsilon(0.1));
    CHECK(light(8).x == doctest::Approx(all.x).epsilon(0.03));
    // Linear in every channel.
    CHECK(all.y == doctest::Approx(0.5 * all.x).epsilon(1e-5));
    CHECK(all.z == 0.0f);
}
