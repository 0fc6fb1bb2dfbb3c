// The shadow terminator: smooth low-polygon shapes and bumps under grazing light.
#include <doctest/doctest.h>

#include <cmath>

#include "frazil/render/shading.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

Material white_diffuse() {
    StandardMaterial model;
    model.diffuse_color.value = Rgb(1.0f);
    model.ior = 1.0f;
    return {"/white", model};
}

Light sun_from_x() {
    Light light;
    light.path = "/sun";
    light.shape = DistantLight{0.0f};
    light.radiance = Rgb(1.0f);
    light.light_to_world.rotate(V3f(0.0f, kPi / 2.0f, 0.0f));
    return light;
}

}  // namespace

TEST_CASE(
    "terminator: a low-polygon sphere under grazing light is as its normals say: monotone, without a black band") {
    const Mesh low = sphere(1.0f, 1);
    Scene scene = scene_of(low, white_diffuse());
    scene.lights = {sun_from_x()};
    RenderOptions options = small();
    options.width = 97, options.height = 33, options.samples = 4;
    const Film film = render(scene, options).film;
    const StandardBsdf bsdf(std::get<StandardMaterial>(scene.materials[0].model), V2f(0.0f));
    double worst = 0.0;
    int seen = 0, grazing = 0;
    for (int y = 0; y < film.height; ++y) {
        float last = 0.0f;
        for (int x = 0; x < film.width; ++x) {
            if (pixel(film, "beauty", x, y)[3] < 1.0f) continue;
            // What a surface reflects that has this normal: nothing is lost to facets, none is dark in between.
            const float *n = pixel(film, "N", x, y), *p = pixel(film, "P", x, y);
            const V3f normal = V3f(n[0], n[1], n[2]).normalized();
            const V3f wo = (V3f(0, 0, 6) - V3f(p[0], p[1], p[2])).normalized();
            if (normal.dot(wo) < 0.2f) continue;  // normals are bent at the silhouette
            const auto [tangent, bitangent] = tangent_frame(normal);
            const auto to_local = [&, t = tangent, b = bitangent](const V3f& v) {
                return V3f(v.dot(t), v.dot(b), v.dot(normal));
            };
            const float expected = bsdf.eval(to_local(wo), to_local(V3f(1, 0, 0))).diffuse.x;
            const float value = pixel(film, "diffuse", x, y)[0];
            worst = std::max(worst, double(std::abs(value - expected)) * M_PI);
            if (n[0] < 0.5f) {
                CHECK(value >= last - 1e-3f);
                last = value;
            }
            ++seen, grazing += n[0] > 0.0f && n[0] < 0.3f;
        }
    }
    REQUIRE(seen > 300);
    CHECK(grazing > 30);
    MESSAGE("largest departure, of what white under this sun reflects at most: " << worst);
    CHECK(worst < 0.02);
}

TEST_CASE("terminator: with bump, light fades to nothing at the surface's own horizon and is never more than without") {
    Surface surface;
    const Material material = white_diffuse();
    surface.material = &material;
    surface.geometric_normal = surface.horizon = V3f(0, 0, 1);
    surface.normal = V3f(std::sin(0.6f), 0.0f, std::cos(0.6f));
    const Shader bumped(surface, nullptr);
    surface.horizon = surface.normal;
    const Shader tilted(surface, nullptr);  // a surface that stands so
    const V3f wo(0, 0, 1);
    float last = 1e9f;
    for (float degrees = 40.0f; degrees < 90.0f; degrees += 0.5f) {
        const float angle = degrees * kPi / 180.0f;
        const V3f wi(std::sin(angle), 0.0f, std::cos(angle));
        const float value = bumped.eval(wo, wi).diffuse.x, reference = tilted.eval(wo, wi).diffuse.x;
        CHECK(value <= reference + 1e-6f);
        CHECK(value >= 0.0f);
        CHECK(value <= last + 1e-6f);  // no edge
        last = value;
    }
    CHECK(last < 0.03f);
    CHECK(bumped.eval(wo, V3f(1.0f, 0.0f, -0.01f).normalized()).diffuse.x == 0.0f);
    // Away from the horizon nothing is lost.
    const V3f up(std::sin(0.3f), 0.0f, std::cos(0.3f));
    CHECK(bumped.eval(wo, up).diffuse.x == doctest::Approx(tilted.eval(wo, up).diffuse.x));
}

TEST_CASE("terminator: a white sphere of few polygons keeps its energy in uniform light") {
    const Mesh low = sphere(1.0f, 1);
    Scene scene = scene_of(low, white_diffuse());
    scene.lights = {dome(Rgb(1.0f))};
    RenderOptions options = small();
    options.samples = 64;
    const double mean = mean_inside(render(scene, options).film, "beauty", 0);
    MESSAGE("furnace: " << mean);
    CHECK(mean == doctest::Approx(1.0).epsilon(0.02));
}

TEST_CASE("normals that turn within the footprint make a sphere as rough as their slopes over it") {
    const float radius = 2.0f, footprint = 0.05f;
    Scene scene = scene_of(sphere(radius, 5), white_diffuse());
    const RayScene rays(scene.meshes, {{0, M44f()}});
    const SurfaceResolver resolver(scene);
    for (const float x : {0.0f, 0.9f, 1.6f, 1.85f}) {
        CAPTURE(x);
        const Ray ray{V3f(x, 0.13f, 6.0f), V3f(0, 0, -1)};
        Hit hit;
        REQUIRE(rays.intersect(ray, hit));
        // The footprint's half axes turn the normal by themselves over the radius.
        const float cosine = hit.geometric_normal.z;
        const float expected = footprint / radius * std::sqrt(0.5f + 0.5f / (cosine * cosine));
        CHECK(resolver.resolve(hit, ray.direction, footprint).normal_spread == doctest::Approx(expected).epsilon(0.03));
        CHECK(resolver.resolve(hit, ray.direction, 0.0f).normal_spread == 0.0f);
    }
    scene.meshes[0].normals = {};
    Hit hit;
    REQUIRE(rays.intersect({V3f(0.9f, 0.13f, 6.0f), V3f(0, 0, -1)}, hit));
    CHECK(SurfaceResolver(scene).resolve(hit, V3f(0, 0, -1), footprint).normal_spread == 0.0f);
}

TEST_CASE("a shiny bumpy surface seen from afar has no sparks: few samples agree with many") {
    // Ripples of a few triangles each, much finer than a pixel, under a lamp.
    Mesh mesh;
    constexpr int kSide = 120;
    for (int j = 0; j <= kSide; ++j) {
        for (int i = 0; i <= kSide; ++i) {
            const float x = 4.0f * (float(i) / kSide - 0.5f), y = 4.0f * (float(j) / kSide - 0.5f);
            mesh.positions.emplace_back(x, y, 0.02f * std::sin(40.0f * x) * std::sin(37.0f * y));
        }
    }
    for (int j = 0; j < kSide; ++j) {
        for (int i = 0; i < kSide; ++i) {
            const int a = j * (kSide + 1) + i;
            mesh.triangles.insert(mesh.triangles.end(), {{a, a + 1, a + kSide + 2}, {a, a + kSide + 2, a + kSide + 1}});
        }
    }
    std::vector<V3f> normals(mesh.positions.size(), V3f(0.0f));
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        const V3f cross(triangle_cross(mesh, t));
        for (int k = 0; k < 3; ++k) normals[std::size_t(mesh.triangles[t][k])] += cross;
    }
    for (V3f& n : normals) n.normalize();
    mesh.normals = {normals, Interpolation::vertex};
    Material shiny = white_diffuse();
    std::get<StandardMaterial>(shiny.model).metallic.value = 1.0f;
    std::get<StandardMaterial>(shiny.model).roughness.value = 0.05f;
    Scene scene = scene_of(mesh, shiny);
    scene.lights = {sun_from_x()};
    scene.lights[0].light_to_world = M44f();
    scene.lights[0].light_to_world.rotate(V3f(0.0f, 0.4f, 0.0f));
    const auto spread = [&](const Scene& seen) {
        RenderOptions options = small();
        options.samples = 4;
        const Film film = render(seen, options).film;
        double sum = 0.0, sum2 = 0.0;
        int count = 0;
        for (int y = 6; y < 18; ++y) {
            for (int x = 6; x < 18; ++x, ++count) {
                const double value = double(pixel(film, "specular", x, y)[0]);
                sum += value, sum2 += value * value;
            }
        }
        return std::sqrt(sum2 / count - sum * sum / count / count) / (sum / count);
    };
    CHECK(spread(scene) < 0.4);  // 5.6 without
}
