// Bodies in bodies: which of them fills a place, whatever their order and wherever the camera is.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "frazil/translucency/fresnel.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

constexpr float kEta = 1.31f;
// Slabs about z = 0, each inside the one before: half their thickness, and what they absorb per metre.
constexpr std::array<float, 3> kHalf = {0.5f, 0.3f, 0.1f};
constexpr std::array<float, 3> kAbsorption = {1.0f, 2.0f, 5.0f};

Material clear(float sigma_a, float eta, int priority) {
    IceMaterial model;
    model.medium = {Rgb(1e-6f), Rgb(sigma_a), eta};
    model.roughness.value = 0.0f;
    model.translucency = 0.0f;
    model.priority = priority;
    model.spacing.value = 2.0f;
    return {"/clear", model};
}

void add(Scene& scene, Mesh mesh, const Material& material) {
    const auto number = std::uint32_t(scene.meshes.size());
    scene.meshes.push_back(std::move(mesh));
    scene.materials.push_back(material);
    scene.mesh_paths.push_back(str("/mesh", number));
    scene.objects.push_back({str("/body", number), number, std::uint32_t(scene.materials.size() - 1), M44f()});
}

Scene three_slabs(const std::array<int, 3>& priorities, const std::array<int, 3>& order) {
    Scene scene;
    for (const int i : order) {
        add(scene, box_of({-9, -9, -kHalf[i]}, {9, 9, kHalf[i]}), clear(kAbsorption[i], kEta, priorities[i]));
    }
    scene.camera.path = "/camera";
    scene.camera.horizontal_aperture = scene.camera.vertical_aperture = 20.0f;
    scene.camera.focal_length = 2000.0f;
    scene.lights = {dome(Rgb(1.0f))};
    return scene;
}

// What absorbs half of the way through: of equal bodies the one that is entered first fills the place.
double half_depth(const std::array<int, 3>& priorities) {
    const std::array<float, 3> lengths = {kHalf[0] - kHalf[1], kHalf[1] - kHalf[2], kHalf[2]};
    double depth = 0.0;
    for (int layer = 0; layer < 3; ++layer) {
        int fills = 0;
        for (int body = 1; body <= layer; ++body) {
            if (priorities[body] > priorities[fills]) fills = body;
        }
        depth += double(lengths[layer]) * kAbsorption[fills];
    }
    return depth;
}

}  // namespace

TEST_CASE("of three bodies in one another the one of highest priority fills the place, else the outermost") {
    using Three = std::array<int, 3>;
    const double f = fresnel_dielectric(1.0f, kEta);
    RenderOptions options = small();
    options.width = options.height = 8;
    options.samples = 256;
    for (const Three& priorities : {Three{0, 1, 2}, Three{0, 0, 0}, Three{2, 1, 0}, Three{0, 5, 1}, Three{1, 0, 1}}) {
        for (const Three& order : {Three{0, 1, 2}, Three{2, 0, 1}}) {
            CAPTURE(priorities[0]);
            CAPTURE(priorities[1]);
            CAPTURE(priorities[2]);
            CAPTURE(order[0]);
            Scene scene = three_slabs(priorities, order);
            const double half = std::exp(-half_depth(priorities)), whole = half * half;
            // From outside, straight through, with all reflections between the two faces of the outermost.
            scene.camera.camera_to_world[3][2] = 6.0f;
            const double through = (1 - f) * (1 - f) * whole * (1 + f * whole) / (1 - f * f * whole * whole);
            CHECK(mean_inside(render(scene, options).film, "refraction", 0) == doctest::Approx(through).epsilon(0.015));
            // From the middle.
            scene.camera.camera_to_world[3][2] = 0.0f;
            const double out = (1 - f) * half * (1 + f * whole) / (1 - f * f * whole * whole);
            CHECK(mean_inside(render(scene, options).film, "refraction", 0) == doctest::Approx(out).epsilon(0.015));
        }
    }
}

TEST_CASE("white furnace: three clear bodies in one another are invisible, from outside and from within") {
    for (const std::array<int, 3>& priorities : {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 0, 0}}) {
        for (const float z : {6.0f, 0.3f}) {
            CAPTURE(priorities[2]);
            CAPTURE(z);
            Scene scene;
            add(scene, sphere(1.5f, 4), clear(0.0f, 1.33f, priorities[0]));
            add(scene, sphere(1.0f, 4), clear(0.0f, 1.31f, priorities[1]));
            add(scene, sphere(0.7f, 4), clear(0.0f, 1.36f, priorities[2]));
            scene.camera.path = "/camera";
            scene.camera.horizontal_aperture = scene.camera.vertical_aperture = 20.0f;
            scene.camera.camera_to_world.translate(V3f(0.0f, 0.0f, z));
            scene.lights = {dome(Rgb(1.0f))};
            RenderOptions options = small();
            options.samples = 64;
            CHECK(mean_inside(render(scene, options).film, "beauty", 0) == doctest::Approx(1.0).epsilon(0.02));
        }
    }
}
