#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/quadrature.h"
#include "frazil/render/volume.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

Light distant(const V3f& towards, float irradiance) {
    Light light;
    light.path = "/sun";
    light.shape = DistantLight{0.0f};
    light.radiance = Rgb(irradiance);
    const V3f z = towards.normalized();
    const auto [x, y] = tangent_frame(z);
    light.light_to_world = M44f(x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, 0, 0, 0, 1);
    return light;
}

Light small_sphere(const V3f& at, float radius, float radiance) {
    Light light;
    light.path = "/lamp";
    light.shape = SphereLight{radius};
    light.radiance = Rgb(radiance);
    light.light_to_world[3][0] = at.x, light.light_to_world[3][1] = at.y, light.light_to_world[3][2] = at.z;
    return light;
}

// Index-matched ice that scatters, without any light from its core.
Scene cloudy(const Mesh& mesh, const Rgb& sigma_s, const Rgb& sigma_a, float g) {
    Scene scene = scene_of(mesh, ice(sigma_a, 1.0f, 0.0f, CompensationMode::off));
    IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
    model.medium.sigma_s_prime = sigma_s;
    model.translucency = 0.0f;
    model.volume = 1.0f;
    model.anisotropy = g;
    scene.camera.focal_length = 2000.0f;
    return scene;
}

RenderOptions many_samples() {
    RenderOptions options = small();
    options.width = options.height = 6;
    options.samples = 2048;
    options.spacing = 2.0f;
    return options;
}

Mesh slab(float half_thickness) {
    Mesh box;
    for (const float z : {-half_thickness, half_thickness}) {
        box.positions.insert(box.positions.end(), {{-5, -5, z}, {5, -5, z}, {5, 5, z}, {-5, 5, z}});
    }
    box.triangles = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}, {0, 1, 5}, {0, 5, 4},
                     {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
    return box;
}

}  // namespace

TEST_CASE("phase function: normalised, its mean cosine is g, and its samples follow it") {
    for (const float g : {-0.6f, 0.0f, 0.4f, 0.85f}) {
        CAPTURE(g);
        double total = 0.0, mean = 0.0;
        for (int part = 0; part < 8; ++part) {
            const double a = -1.0 + 0.25 * part, b = a + 0.25;
            total += integrate_gauss32([&](double c) { return 2.0 * kPi * henyey_greenstein(float(c), g); }, a, b);
            mean += integrate_gauss32([&](double c) { return 2.0 * kPi * c * henyey_greenstein(float(c), g); }, a, b);
        }
        CHECK(total == doctest::Approx(1.0).epsilon(1e-3));
        CHECK(mean == doctest::Approx(double(g)).epsilon(1e-3));
        const V3f travel = V3f(0.3f, -0.5f, 0.8f).normalized();
        double sampled = 0.0;
        for (std::uint32_t i = 0; i < 4096; ++i) {
            sampled += double(sample_henyey_greenstein(travel, g, Sampler(1, 0, i).next_2d()).dot(travel));
        }
        CHECK(sampled / 4096 == doctest::Approx(double(g)).epsilon(0.01));
    }
}

TEST_CASE("single scattering of a slab under parallel light has its closed form") {
    const Rgb sigma_s(4.0f, 2.0f, 1.0f), sigma_a(0.5f, 1.0f, 0.1f);
    for (const float g : {0.0f, 0.6f}) {
        CAPTURE(g);
        Scene scene = cloudy(slab(0.25f), sigma_s, sigma_a, g);
        const V3f towards = V3f(0.6f, 0.0f, 0.8f);
        scene.lights = {distant(towards, 3.0f)};
        const Film film = render(scene, many_samples()).film;
        for (int c = 0; c < 3; ++c) {
            // ∫ sigma_s e^{-sigma_t s} p E e^{-sigma_t s / mu} ds over the thickness.
            const double sigma_t = double(sigma_s[c] + sigma_a[c]), rate = sigma_t * (1.0 + 1.0 / 0.8);
            const double expected =
                sigma_s[c] * henyey_greenstein(0.8f * -1.0f, g) * 3.0 * (1.0 - std::exp(-rate * 0.5)) / rate;
            CHECK(mean_inside(film, "volume", c) == doctest::Approx(expected).epsilon(0.01));
        }
    }
}

TEST_CASE("single scattering of a sphere by a lamp nearby agrees with quadrature, inside it and beside it") {
    const float sigma_s = 2.0f, sigma_a = 0.5f, sigma_t = sigma_s + sigma_a;
    for (const V3f& at : {V3f(0.0f, 1.6f, 0.3f), V3f(0.1f, 0.2f, 0.0f)}) {
        CAPTURE(at.y);
        Scene scene = cloudy(sphere(1.0f, 7), Rgb(sigma_s), Rgb(sigma_a), 0.3f);
        const float radius = 0.01f, radiance = 1000.0f;
        scene.lights = {small_sphere(at, radius, radiance)};
        RenderOptions options = many_samples();
        const Film film = render(scene, options).film;
        // Along the camera's axis; the lamp is a point of intensity pi r² L.
        double expected = 0.0;
        constexpr int kParts = 64;
        for (int part = 0; part < kParts; ++part) {
            const double a = -1.0 + 2.0 * part / kParts, b = a + 2.0 / kParts;
            expected += integrate_gauss32(
                [&](double z) {
                    const V3d place(0.0, 0.0, z), to = V3d(at) - place;
                    const double distance = to.length();
                    const V3d w = to / distance;
                    // The way inside: to the lamp, or to the surface.
                    const double along = place.dot(w);
                    const double out = -along + std::sqrt(along * along + 1.0 - place.length2());
                    return sigma_s * std::exp(-sigma_t * (1.0 - z)) *
                           henyey_greenstein(float(w.dot(V3d(0, 0, -1))), 0.3f) *
                           std::exp(-sigma_t * std::min(out, distance)) * kPi * radius * radius * radiance /
                           (distance * distance);
                },
                a, b);
        }
        CHECK(mean_inside(film, "volume", 1) == doctest::Approx(expected).epsilon(0.02));
    }
}

TEST_CASE("the volume multiplier of a light scales its single scattering, and nothing else") {
    Scene scene = cloudy(sphere(1.0f, 5), Rgb(2.0f), Rgb(0.5f), 0.0f);
    scene.lights = {distant(V3f(1.0f, 0.0f, 0.0f), 1.0f)};
    const double once = mean_inside(render(scene, many_samples()).film, "volume", 0);
    scene.lights[0].multipliers[int(LightComponent::volume)] = -2.0f;
    CHECK(mean_inside(render(scene, many_samples()).film, "volume", 0) == doctest::Approx(-2.0 * once).epsilon(1e-4));
}
