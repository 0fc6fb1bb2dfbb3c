// Light and shadow linking, UsdLux shadows and light that passes through ice: in the bake and in the render.
#include <doctest/doctest.h>

#include "frazil/base/sampler.h"
#include "frazil/lighting/bounce.h"
#include "frazil/lighting/shadow.h"
#include "frazil/translucency/fresnel.h"
#include "lights.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

std::shared_ptr<const ObjectSet> objects(std::vector<std::uint32_t> indices) {
    return std::make_shared<const ObjectSet>(ObjectSet{std::move(indices)});
}

// A sun from straight above (+z).
Light sun() {
    return make_light(DistantLight{0.0f});
}

// Roofs over the origin at heights 1 and 2: placements 0 and 1.
RayScene two_roofs() {
    return RayScene({square(1.0f, 1.0f), square(1.0f, 2.0f)}, {{0, M44f()}, {1, M44f()}});
}

}  // namespace

TEST_CASE("linking: a bake's points receive only the lights linked to their object") {
    Light first = sun(), second = sun();
    first.lit = objects({0, 2});
    second.lit = objects({1, 2});
    second.radiance = Rgb(10.0f);
    const LightSampler lights({first, second});
    const RayScene empty({}, {});
    const auto on = [&](std::vector<std::uint32_t> where) {
        IrradianceOptions options;
        options.objects = std::move(where);
        return bake_irradiance(one_point(V3f(0.0f), V3f(0, 0, 1)), empty, lights, full, options).values[0].x;
    };
    CHECK(on({0}) == 1.0f);
    CHECK(on({1}) == 10.0f);
    CHECK(on({2}) == 11.0f);
    CHECK(on({3}) == 0.0f);
    CHECK(on({99}) == 0.0f);
    CHECK(on({}) == 11.0f);  // a place on no object
}

TEST_CASE("linking: the pick gives no light that is not linked, and all of its probability to those that are") {
    std::vector<Light> all;
    for (int i = 0; i < 300; ++i) {
        Light light = make_light(SphereLight{0.05f}, translated({float(i % 20) - 10.0f, float(i / 20), 3.0f}));
        if (i % 3 == 1) light.lit = objects({1, 5});
        if (i % 3 == 2) light.lit = objects({});
        all.push_back(light);
    }
    const LightSampler lights(all);
    for (const std::uint32_t object : {1u, 2u}) {
        const LightReceiver receiver{V3f(0.0f), V3f(0, 0, 1), object};
        for (std::uint32_t i = 0; i < 1000; ++i) {
            Sampler random(1, 0, i);
            const float u = random.next_1d();
            const LightSample sample = lights.sample(receiver, u, random.next_2d());
            REQUIRE(sample.light >= 0);
            CHECK(sample.light % 3 <= (object == 1 ? 1 : 0));
            std::vector<LightHit> hits;
            lights.intersect(receiver, receiver.position, sample.direction, 1e30f, hits);
            for (const LightHit& hit : hits) {
                CHECK(hit.light % 3 <= (object == 1 ? 1 : 0));
                if (hit.light == sample.light) CHECK(hit.pdf == doctest::Approx(double(sample.pdf)).epsilon(2e-3));
            }
        }
    }
}

TEST_CASE("shadow linking: only casters stop the light; others' lights they stop as ever") {
    const RayScene scene = two_roofs();
    Light light = sun();
    const auto arriving = [&](std::shared_ptr<const ObjectSet> casters) {
        light.shadow.casters = std::move(casters);
        return irradiance_at({light, sun()}, 0.0f, scene).x;
    };
    CHECK(arriving(nullptr) == 0.0f);
    CHECK(arriving(objects({0})) == 0.0f);
    CHECK(arriving(objects({1})) == 0.0f);
    CHECK(arriving(objects({})) == 1.0f);
    CHECK(arriving(objects({7})) == 1.0f);
    // Instances are told apart.
    const RayScene instances({square(1.0f, 0.0f)}, {{0, translated({0, 0, 1})}, {0, translated({9, 0, 1})}});
    light.shadow.casters = objects({1});
    CHECK(irradiance_at({light}, 0.0f, instances).x == 1.0f);
    CHECK(irradiance_at({light}, 9.0f, instances).x == 0.0f);
}

TEST_CASE("shadow rules: off, coloured, within a distance, fading") {
    const RayScene scene({square(1.0f, 1.0f)}, {{0, M44f()}});
    const auto arriving = [&](const ShadowRules& rules) {
        Light light = sun();
        light.shadow = rules;
        return irradiance_at({light}, 0.0f, scene);
    };
    ShadowRules rules;
    CHECK(arriving(rules) == Rgb(0.0f));
    rules.is_enabled = false;
    CHECK(arriving(rules) == Rgb(1.0f));
    rules = {};
    rules.color = Rgb(0.25f, 0.5f, -1.0f);
    CHECK(arriving(rules) == rules.color);
    rules = {};
    rules.distance = 0.9f;
    CHECK(arriving(rules) == Rgb(1.0f));
    rules.distance = 1.1f;
    CHECK(arriving(rules) == Rgb(0.0f));
    rules.distance = 1.5f;
    rules.falloff = 1.0f;  // fades from 0.5 m to 1.5 m: a half at 1 m
    CHECK(arriving(rules).x == doctest::Approx(0.5).epsilon(1e-3));
    rules.falloff_gamma = 2.0f;
    CHECK(arriving(rules).x == doctest::Approx(0.75).epsilon(1e-3));
}

TEST_CASE("passages: a slab of ice takes Fresnel's share twice and what it absorbs; opaque things all") {
    // A slab from z = 1 to z = 3 as one mesh, and a roof above it.
    Mesh slab = square(50.0f, 3.0f);
    const Mesh below = square(50.0f, 1.0f);
    for (const V3f& p : below.positions) slab.positions.push_back(p);
    slab.triangles.emplace_back(4, 6, 5);
    slab.triangles.emplace_back(4, 7, 6);
    RayScene scene({slab, square(1.0f, 5.0f)}, {{0, M44f()}, {1, translated({100, 0, 0})}});
    const Rgb absorption(0.1f, 0.5f, 2.0f);
    for (const float degrees : {0.0f, 40.0f, 75.0f}) {
        const float angle = degrees * kPi / 180.0f;
        const Ray ray{V3f(0.0f), V3f(std::sin(angle), 0.0f, std::cos(angle))};
        scene.set_passages({});
        CHECK(transmittance(scene, ray) == Rgb(0.0f));
        scene.set_passages({{1.0f, 1.31f, absorption}, {}});
        const Rgb found = transmittance(scene, ray);
        const double through = 1.0 - double(fresnel_dielectric(std::cos(angle), 1.31f));
        for (int c = 0; c < 3; ++c) {
            const double expected =
                through * through * std::exp(-double(absorption[c]) * 2.0 / std::cos(double(angle)));
            CHECK(found[c] == doctest::Approx(expected).epsilon(1e-3));
        }
    }
    // From inside, one boundary and what lies ahead; towards a light inside, the same.
    const double once = 1.0 - double(fresnel_dielectric(1.0f, 1.31f));
    CHECK(transmittance(scene, {V3f(0, 0, 2), V3f(0, 0, 1)}).x == doctest::Approx(once * std::exp(-0.1)).epsilon(1e-3));
    CHECK(transmittance(scene, {V3f(0, 0, 0), V3f(0, 0, 1), 0.0f, 1.5f}).x ==
          doctest::Approx(once * std::exp(-0.05)).epsilon(1e-3));
    // In the bake.
    CHECK(irradiance_at({sun()}, 0.0f, scene).x == doctest::Approx(once * once * std::exp(-0.2)).epsilon(1e-3));
    // A tint at both sides, and a medium that is denser the higher up.
    Passage veiled{1.0f, 1.31f, absorption, Rgb(0.5f, 0.9f, 1.0f)};
    veiled.dense_attenuation = Rgb(0.3f);
    veiled.depth = [](const V3f& origin, const V3f& direction, float length) {
        return length * (origin.z + 0.5f * length * direction.z);
    };
    scene.set_passages({veiled, {}});
    const Rgb through_veil = transmittance(scene, {V3f(0.0f), V3f(0, 0, 1)});
    CHECK(through_veil.x == doctest::Approx(once * once * 0.25 * std::exp(-0.2 - 0.3 * 4.0)).epsilon(1e-3));
    CHECK(through_veil.y == doctest::Approx(once * once * 0.81 * std::exp(-1.0 - 0.3 * 4.0)).epsilon(1e-3));
    CHECK(transmittance(scene, {V3f(0, 0, 2), V3f(0, 0, 1)}).z ==
          doctest::Approx(once * std::exp(-2.0 - 0.3 * 2.5)).epsilon(1e-3));
    scene.set_passages({{1.0f, 1.31f, absorption}, {}});
    CHECK(transmittance(scene, {V3f(100, 0, 4), V3f(0, 0, 1)}) == Rgb(0.0f));
}

TEST_CASE("passages: where bodies overlap one fills the place, and there is no boundary between them") {
    const auto slab_of = [](float from, float to) {
        Mesh slab = square(50.0f, to);
        const Mesh below = square(50.0f, from);
        for (const V3f& p : below.positions) slab.positions.push_back(p);
        slab.triangles.emplace_back(4, 6, 5);
        slab.triangles.emplace_back(4, 7, 6);
        return slab;
    };
    RayScene scene({slab_of(1.0f, 3.0f), slab_of(2.0f, 4.0f)}, {{0, M44f()}, {1, M44f()}});
    Passage thin{1.0f, 1.31f, Rgb(0.1f)}, thick{1.0f, 1.31f, Rgb(0.4f)};
    const double once = 1.0 - double(fresnel_dielectric(1.0f, 1.31f));
    const auto through = [&] { return double(transmittance(scene, {V3f(0.0f), V3f(0, 0, 1)}).x) / (once * once); };
    scene.set_passages({thin, thin});
    CHECK(through() == doctest::Approx(std::exp(-0.3)).epsilon(1e-3));
    scene.set_passages({thin, thick});  // the one entered first
    CHECK(through() == doctest::Approx(std::exp(-0.1 * 2.0 - 0.4)).epsilon(1e-3));
    thick.priority = 1;
    scene.set_passages({thin, thick});
    CHECK(through() == doctest::Approx(std::exp(-0.1 - 0.4 * 2.0)).epsilon(1e-3));
}

namespace {

// A grey floor (object 0) with a smaller roof (object 1) above it, seen from the side through the gap.
Scene roofed() {
    StandardMaterial grey;
    grey.diffuse_color.value = Rgb(0.5f);
    grey.ior = 1.0f;
    Scene scene = scene_of(floor_square(5.0f, 0.0f), {"/grey", grey});
    scene.meshes.push_back(floor_square(1.0f, 2.0f));
    scene.mesh_paths.push_back("/roof");
    grey.diffuse_color.value = Rgb(0.0f);  // nothing comes back from it
    scene.materials.push_back({"/black", grey});
    scene.objects.push_back({"/roof", 1, 1, M44f()});
    scene.camera.camera_to_world = M44f();
    scene.camera.camera_to_world.rotate(V3f(-kPi / 2.0f, 0.0f, 0.0f));
    scene.camera.camera_to_world[3][1] = 1.0f;
    scene.camera.focal_length = 2000.0f;
    return scene;
}

Light noon() {
    Light light = make_light(DistantLight{0.0f});
    light.light_to_world.rotate(V3f(-kPi / 2.0f, 0.0f, 0.0f));
    return light;
}

}  // namespace

TEST_CASE("render: linking and shadow rules hold for diffuse light") {
    Scene scene = roofed();
    // A little comes back from the roof at grazing angles.
    const auto floor_light = [&](const Light& light) {
        scene.lights = {light};
        return double(mean_inside(render(scene, small()).film, "diffuse", 0)) * kPiD / 0.5;
    };
    Light light = noon();
    CHECK(floor_light(light) < 1e-4);
    light.shadow.casters = objects({0});
    CHECK(floor_light(light) == doctest::Approx(1.0).epsilon(0.03));
    light.lit = objects({1});
    CHECK(floor_light(light) < 1e-4);
    light = noon();
    light.shadow.color = Rgb(0.25f);
    CHECK(floor_light(light) == doctest::Approx(0.25).epsilon(0.03));
    // An area light that shines through the roof: rays that run into it count as much as rays sent to it.
    light = rect_above(1.0f, "");
    light.shadow.is_enabled = false;
    CHECK(floor_light(light) == doctest::Approx(kPiD * 4 * corner_factor(1, 1, 3)).epsilon(0.03));
}

TEST_CASE("render: translucency receives only lights linked to its object") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.2f), 1.31f, 0.3f, CompensationMode::ratio));
    Light light = dome(Rgb(1.0f));
    scene.lights = {light};
    const double lit = mean_inside(render(scene, small()).film, "translucency", 0);
    light.lit = objects({0});
    scene.lights = {light};
    CHECK(mean_inside(render(scene, small()).film, "translucency", 0) == lit);
    light.lit = objects({});
    scene.lights = {light};
    const Film dark = render(scene, small()).film;
    CHECK(mean_inside(dark, "translucency", 0) == 0.0);
    CHECK(mean_inside(dark, "specular", 0) == 0.0);
    CHECK(pixel(dark, "background", 0, 0)[0] == doctest::Approx(1.0));  // the camera sees it all the same
}

TEST_CASE("render: a shining mesh is seen, lights the floor by the closed form, and needs no luck to be found") {
    Scene scene = roofed();
    Mesh lamp = floor_square(1.0f, 3.0f);
    for (V3i& t : lamp.triangles) std::swap(t.y, t.z);  // faces down
    scene.meshes[1] = lamp;
    MeshLight shape;
    shape.mesh = std::make_shared<Mesh>(lamp);
    shape.object = 1;
    scene.lights = {make_light(shape)};
    const double expected = kPiD * 4 * corner_factor(1, 1, 3);
    CHECK(mean_inside(render(scene, small()).film, "diffuse", 0) * kPiD / 0.5 ==
          doctest::Approx(expected).epsilon(0.03));
    scene.camera.camera_to_world.rotate(V3f(kPi, 0.0f, 0.0f));
    scene.camera.camera_to_world[3][1] = 1.0f;
    const Film up = render(scene, small()).film;
    CHECK(mean_inside(up, "emission", 0) == doctest::Approx(1.0).epsilon(1e-4));
}

TEST_CASE("render: a light inside ice lights none of its outside, and nothing breaks") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.2f), 1.31f, 0.3f, CompensationMode::ratio));
    scene.lights = {make_light(SphereLight{0.2f})};
    const Film film = render(scene, small()).film;
    CHECK(mean_inside(film, "translucency", 0) == 0.0);
    CHECK(std::isfinite(mean_inside(film, "beauty", 0)));
}
