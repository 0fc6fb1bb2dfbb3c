#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/quadrature.h"
#include "frazil/base/sampler.h"
#include "frazil/material/density.h"
#include "frazil/render/volume.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// (3, 4, 5) voxels of any density, on a lattice that is turned, stretched and moved.
Density crooked_grid() {
    auto grid = std::make_shared<DensityGrid>();
    grid->size = V3i(3, 4, 5);
    for (std::uint32_t i = 0; i < 60; ++i) grid->values.push_back(3.0f * to_unit_float(hash(i, 7U)));
    grid->index_to_object.setEulerAngles(V3f(0.3f, -0.7f, 1.1f));
    grid->index_to_object = M44f().setScale(V3f(0.4f, 0.25f, 0.3f)) * grid->index_to_object;
    grid->index_to_object[3][0] = -0.5f, grid->index_to_object[3][1] = 0.2f;
    grid->outside = 0.25f;
    Density density;
    density.grid = grid;
    density.scale = 1.5f;
    return density;
}

Density noise(float contrast) {
    Density density;
    density.contrast = contrast;
    density.size = 0.4f;
    density.seed = 5;
    return density;
}

V3f random_place(std::uint32_t i, std::uint32_t seed) {
    Sampler sampler(seed, i, 0);
    const V2f xy = sampler.next_2d();
    return V3f(xy.x - 0.5f, xy.y - 0.5f, sampler.next_1d() - 0.5f) * 4.0f;
}

// The midpoint rule with steps far finer than anything there is.
double fine_depth(const DensityField& field, const V3f& from, const V3f& to) {
    constexpr int kParts = 20000;
    double sum = 0.0;
    for (int i = 0; i < kParts; ++i) sum += double(field.at(from + (to - from) * ((float(i) + 0.5f) / kParts)));
    return sum * double((to - from).length()) / kParts;
}

// From 2 at the front, z = 0.25, down to 0 at the back, z = -0.25, at three depths of voxels.
Density ramp() {
    auto grid = std::make_shared<DensityGrid>();
    grid->size = V3i(2, 2, 3);
    grid->values = {0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1, 2};
    grid->index_to_object = M44f().setScale(V3f(12.0f, 12.0f, 0.25f));
    grid->index_to_object[3][0] = grid->index_to_object[3][1] = -6.0f, grid->index_to_object[3][2] = -0.25f;
    Density density;
    density.grid = grid;
    return density;
}

// Index-matched ice without a core.
Scene ramped_slab(float absorption, float volume) {
    Scene scene = scene_of(box_of({-5, -5, -0.25f}, {5, 5, 0.25f}),
                           ice(Rgb(0.5f, 1.0f, 0.1f), 1.0f, 0.0f, CompensationMode::off));
    IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
    model.medium.sigma_s_prime = Rgb(4.0f, 2.0f, 1.0f);
    model.translucency = 0.0f;
    model.volume = volume;
    model.spacing.value = 2.0f;
    model.density = ramp();
    model.density.absorption = absorption;
    scene.camera.focal_length = 2000.0f;
    return scene;
}

}  // namespace

TEST_CASE("density: its depth is the integral along any ray, from inside and outside the grid") {
    const Density grid = crooked_grid(), clouds = noise(1.2f);
    for (const Density* density : {&grid, &clouds}) {
        const DensityField field(*density, M44f(), M44f());
        CAPTURE(bool(density->grid));
        for (std::uint32_t i = 0; i < 40; ++i) {
            const V3f a = random_place(i, 3), b = i % 4 ? random_place(i, 4) : a + V3f(0, 0, i % 8 ? 1.0f : -1.0f);
            const float length = (b - a).length();
            CHECK(field.depth(a, (b - a) / length, length) == doctest::Approx(fine_depth(field, a, b)).epsilon(1e-3));
        }
    }
}

TEST_CASE("density: place() is where depth() reaches a depth, and the way's end where it does not") {
    const Density grid = crooked_grid(), clouds = noise(1.2f);
    for (const Density* density : {&grid, &clouds}) {
        const DensityField field(*density, M44f(), M44f());
        for (std::uint32_t i = 0; i < 40; ++i) {
            const V3f a = random_place(i, 5), way = random_place(i, 6) - a;
            const V3f direction = way.normalized();
            const float all = field.depth(a, direction, way.length());
            for (const float part : {0.02f, 0.4f, 0.9f}) {
                const float t = field.place(a, direction, part * all, way.length());
                CHECK(field.depth(a, direction, t) == doctest::Approx(part * all).epsilon(1e-3));
            }
            CHECK(field.place(a, direction, 1.1f * all, way.length()) == way.length());
        }
    }
}

TEST_CASE("density: noise has mean 1 and the spread that is asked for, whatever its octaves") {
    for (const int octaves : {1, 4}) {
        for (const float contrast : {0.5f, 1.5f}) {
            CAPTURE(octaves);
            CAPTURE(contrast);
            Density density = noise(contrast);
            density.octaves = octaves;
            const DensityField field(density, M44f(), M44f());
            double mean = 0.0, log_mean = 0.0, log2 = 0.0;
            constexpr int kCount = 40000;
            for (std::uint32_t i = 0; i < kCount; ++i) {
                const double value = double(field.at(random_place(i, 9) * 20.0f)), log = std::log(value);
                CHECK(value > 0.0);
                mean += value / kCount, log_mean += log / kCount, log2 += log * log / kCount;
            }
            CHECK(mean == doctest::Approx(1.0).epsilon(0.03));
            CHECK(std::sqrt(log2 - log_mean * log_mean) == doctest::Approx(double(contrast)).epsilon(0.03));
        }
    }
}

TEST_CASE("a slab whose density is a ramp: what is seen through it and what it scatters once have closed forms") {
    for (const float absorption : {0.0f, 1.0f}) {
        CAPTURE(absorption);
        RenderOptions options = small();
        options.width = options.height = 6;
        options.samples = 2048;
        {
            Scene scene = ramped_slab(absorption, 0.0f);
            scene.lights = {dome(Rgb(1.0f))};
            options.samples = 16;
            const Film film = render(scene, options).film;
            // Both the ramp's integral and the thickness are 0.5, so that either kind of absorption is seen alike.
            for (int c = 0; c < 3; ++c) {
                const Medium& medium = std::get<IceMaterial>(scene.materials[0].model).medium;
                CHECK(mean_inside(film, "refraction", c) ==
                      doctest::Approx(std::exp(-0.5 * double(medium.sigma_s_prime[c] + medium.sigma_a[c])))
                          .epsilon(2e-3));
            }
        }
        Scene scene = ramped_slab(absorption, 1.0f);
        Light sun;
        sun.path = "/sun";
        sun.shape = DistantLight{0.0f};
        sun.radiance = Rgb(3.0f);
        const V3f z = V3f(0.6f, 0.0f, 0.8f);
        const auto [x, y] = tangent_frame(z);
        sun.light_to_world = M44f(x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, 0, 0, 0, 1);
        scene.lights = {sun};
        options.samples = 2048;
        const Film film = render(scene, options).film;
        const Medium& medium = std::get<IceMaterial>(scene.materials[0].model).medium;
        for (int c = 0; c < 3; ++c) {
            // ∫ sigma_s ρ p E e^{-(1 + 1/0.8) tau} dt, tau the optical depth down to t below the front.
            const double expected = integrate_gauss32(
                [&](double t) {
                    const double depth = 2.0 * t - 2.0 * t * t;  // of the density 2 - 4 t
                    const double absorbed = absorption == 1.0f ? depth : t;
                    const double tau = double(medium.sigma_s_prime[c]) * depth + double(medium.sigma_a[c]) * absorbed;
                    return double(medium.sigma_s_prime[c]) * (2.0 - 4.0 * t) * double(henyey_greenstein(-0.8f, 0.0f)) *
                           3.0 * std::exp(-2.25 * tau);
                },
                0.0, 0.5);
            CHECK(mean_inside(film, "volume", c) == doctest::Approx(expected).epsilon(0.01));
        }
    }
}

TEST_CASE("a grid goes with its object, noise stays in metres") {
    // A box of one metre, scaled by 2 along its rays: a grid of the same box is twice as long as well.
    M44f object_to_world = M44f().setScale(V3f(1.0f, 1.0f, 2.0f));
    object_to_world *= M44f().setEulerAngles(V3f(0.4f, 0.9f, -0.2f));
    const Density grid = crooked_grid();
    const DensityField placed(grid, object_to_world.inverse(), M44f()), own(grid, M44f(), M44f());
    V3f way;
    object_to_world.multDirMatrix(V3f(0, 0, 1), way);
    const V3f from = V3f(0.1f, 0.4f, -0.2f);
    CHECK(way.length() == doctest::Approx(2.0));
    CHECK(placed.depth(from * object_to_world, way.normalized(), 2.0f) ==
          doctest::Approx(2.0f * own.depth(from, V3f(0, 0, 1), 1.0f)).epsilon(1e-4));
    CHECK(placed.at(from * object_to_world) == doctest::Approx(own.at(from)).epsilon(1e-4));
}

TEST_CASE("white furnace: density takes and makes no light") {
    for (const float volume : {0.0f, 1.0f}) {
        CAPTURE(volume);
        Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-7f), 1.31f, 0.3f, CompensationMode::conserve));
        IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
        model.medium.sigma_s_prime = Rgb(1.0f);
        model.volume = volume;
        model.density = noise(1.5f);
        scene.lights = {dome(Rgb(1.0f))};
        RenderOptions options = small();
        options.samples = 64;
        CHECK(mean_inside(render(scene, options).film, "beauty", 1) == doctest::Approx(1.0).epsilon(0.02));
    }
}

TEST_CASE("densities out of range are refused by name") {
    Scene scene = ramped_slab(1.0f, 0.0f);
    IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
    const auto message = [&] {
        try {
            check_scene(scene);
        } catch (const ValueError& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    CHECK(message() == "");
    model.density.contrast = 1.0f;
    CHECK(message() == "/ice: density contrast must be 0 beside a grid, got 1. Mend the density's input.");
    model.density = noise(1.0f);
    model.density.octaves = 0;
    CHECK(message() == "/ice: density octaves must be in 1..8, got 0. Mend the density's input.");
    model.density = noise(1.0f);
    model.density.absorption = 2.0f;
    CHECK(message() == "/ice: density absorption must be in 0..1, got 2. Mend the density's input.");
    auto grid = std::make_shared<DensityGrid>(*ramp().grid);
    grid->values[3] = -1.0f;
    model.density = ramp();
    model.density.grid = grid;
    CHECK(message() == "/ice: density grid must be >= 0 and finite, got -1. Mend the density's input.");
    grid = std::make_shared<DensityGrid>(*ramp().grid);
    grid->index_to_object[2][2] = 0.0f;
    model.density.grid = grid;
    CHECK(message().find("density grid's matrix must have a finite determinant") != std::string::npos);
}

TEST_CASE("density: the mean of a grid over a body, whatever its winding, and of noise its scale") {
    Density linear = ramp();  // 4 z + 1
    Mesh ball = sphere(0.1f, 3);
    for (V3f& p : ball.positions) p = p * V3f(0.7f, 1.0f, 0.5f) + V3f(1.0f, -2.0f, 0.1f);
    CHECK(mean_density(linear, ball) == doctest::Approx(1.4).epsilon(2e-3));
    linear.scale = 3.0f;
    for (V3i& t : ball.triangles) std::swap(t.x, t.y);
    CHECK(mean_density(linear, ball) == doctest::Approx(4.2).epsilon(2e-3));
    ball.triangles.clear();
    CHECK(mean_density(linear, ball) == 3.0f);
    Density clouds = noise(1.0f);
    clouds.scale = 0.5f;
    CHECK(mean_density(clouds, sphere(0.1f, 2)) == 0.5f);
}

TEST_CASE("density: the core of a body that is so much denser all over is that of its medium times that") {
    const auto core_of = [](const Density& density, const Rgb& sigma_s_prime, const Rgb& sigma_a) {
        Scene scene = scene_of(sphere(1.0f, 3), ice(sigma_a, 1.31f, 0.2f, CompensationMode::depth));
        auto& model = std::get<IceMaterial>(scene.materials[0].model);
        model.medium.sigma_s_prime = sigma_s_prime;
        model.density = density;
        model.refraction = 0.0f;
        scene.lights = {rect_above(3.0f, "")};
        return render(scene, small()).film.layers.at("translucency").pixels;
    };
    const Rgb scattering(10.0f), absorption(0.5f, 0.25f, 1.0f);
    Density twice;
    twice.scale = 2.0f;
    CHECK(core_of(twice, scattering, absorption) == core_of({}, scattering * 2.0f, absorption * 2.0f));
    CHECK(core_of(twice, scattering, absorption) != core_of({}, scattering, absorption));
    twice.absorption = 0.0f;
    CHECK(core_of(twice, scattering, absorption) == core_of({}, scattering * 2.0f, absorption));
}
