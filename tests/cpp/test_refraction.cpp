#include <doctest/doctest.h>

#include <cmath>

#include "chi_square.h"
#include "frazil/base/quadrature.h"
#include "frazil/material/transmission.h"
#include "frazil/render/interior.h"
#include "frazil/render/render.h"
#include "frazil/translucency/fresnel.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

V3f direction(float cosine, float azimuth = 0.0f) {
    const float sine = std::sqrt(1.0f - cosine * cosine);
    return {sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
}

// Clear ice: no scattering, `sigma_a` absorption.
Material clear_ice(const Rgb& sigma_a, float eta, float roughness) {
    Material material = ice(sigma_a, eta, roughness, CompensationMode::conserve);
    std::get<IceMaterial>(material.model).medium.sigma_s_prime = Rgb(1e-6f);
    return material;
}

IceMaterial& model(Scene& scene, std::size_t material = 0) {
    return std::get<IceMaterial>(scene.materials[material].model);
}

}  // namespace

TEST_CASE("refraction sampler: directions follow its density, from both sides") {
    for (const float eta : {1.31f, 1.0f / 1.31f}) {
        for (const float roughness : {0.35f, 0.7f}) {
            for (const float cosine : {0.95f, 0.6f}) {
                CAPTURE(eta);
                CAPTURE(roughness);
                CAPTURE(cosine);
                const float alpha = alpha_from_roughness(roughness);
                const V3f wo = direction(cosine, 0.4f);
                V3f axis;
                if (!refract(wo, V3f(0, 0, 1), eta, axis)) axis = V3f(0, 0, -1);
                const ChiSquare result = chi_square(
                    [&](const V2f& u, V3f& wi) {
                        return refract(wo, ggx_sample_normal(wo, alpha, u), eta, wi) && wi.z < 0.0f;
                    },
                    [&](const V3f& wi) { return double(transmission_pdf(wo, wi, alpha, eta)); }, axis,
                    roughness < 0.5f ? 0.15 : 1.0);
                CHECK(result.p_value > 1e-3);
                CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.01));
            }
        }
    }
}

TEST_CASE("the sampler of the inner boundary: what goes through follows inner_transmission") {
    const float eta = 1.0f / 1.31f, alpha = alpha_from_roughness(0.5f);
    const V3f wo = direction(0.85f);
    V3f axis;
    REQUIRE(refract(wo, V3f(0, 0, 1), eta, axis));
    std::uint32_t count = 0;
    const ChiSquare result = chi_square(
        [&](const V2f& u, V3f& wi) {
            Sampler lobe(77, count++, 0);
            const BoundarySample sample = sample_inner(wo, alpha, eta, lobe.next_1d(), u);
            wi = sample.wi;
            CHECK(sample.weight == 1.0f);
            CHECK(wi.length() == doctest::Approx(1.0).epsilon(1e-3));
            return !sample.is_reflection;
        },
        [&](const V3f& wi) { return double(inner_transmission(wo, wi, alpha, eta)); }, axis, 0.5);
    CHECK(result.p_value > 1e-3);
    CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.01));
}

TEST_CASE("refraction is reciprocal: f / eta² is the same from both sides") {
    const float alpha = alpha_from_roughness(0.6f), eta = 1.31f;
    for (std::uint32_t i = 0; i < 64; ++i) {
        const V3f wo = direction(0.1f + 0.014f * float(i), 0.1f * float(i));
        V3f wi;
        if (!refract(wo, ggx_sample_normal(wo, alpha, Sampler(5, i, 0).next_2d()), eta, wi) || wi.z > -0.05f) continue;
        // Values are f * cos(wi) for radiance over squared index; as seen from the other side up is down.
        const float there = transmission_eval(wo, wi, alpha, eta) / -wi.z;
        const float back = transmission_eval(-wi, -wo, alpha, 1.0f / eta) / wo.z;
        REQUIRE(there > 0.0f);
        CHECK(there / (eta * eta) == doctest::Approx(back).epsilon(2e-3));
    }
}

TEST_CASE(
    "entering loses nothing: the lobe integrates to one, and single scattering to no more than the transmittance") {
    const float eta = 1.31f;
    const TransmissionAlbedo single(eta);
    const DielectricAlbedo reflection(eta);
    for (const float roughness : {0.0f, 0.3f, 0.8f}) {
        for (const float cosine : {1.0f, 0.7f, 0.3f}) {
            CAPTURE(roughness);
            CAPTURE(cosine);
            const float alpha = alpha_from_roughness(roughness);
            double sum = 0.0;
            constexpr int kCount = 4096;
            for (int i = 0; i < kCount; ++i) {
                Sampler sampler(3, 0, std::uint32_t(i));
                sum += double(sample_entering(direction(cosine), alpha, eta, single, sampler.next_2d()).weight);
            }
            CHECK(sum / kCount == doctest::Approx(1.0).epsilon(5e-3));
            CHECK(single.eval(cosine, alpha) <= 1.0f - reflection.eval(cosine, alpha) + 5e-3f);
        }
    }
    CHECK(single.eval(1.0f, 1e-4f) == doctest::Approx(1.0f - fresnel_dielectric(1.0f, eta)).epsilon(1e-3));
}

TEST_CASE("white furnace: clear, cloudy and bubbly ice without absorption is invisible in uniform light") {
    for (const float sigma_s : {1e-6f, 0.5f, 20.0f}) {
        for (const float eta : {1.0f, 1.31f}) {
            for (const float refraction : {0.5f, 1.0f}) {
                CAPTURE(sigma_s);
                CAPTURE(eta);
                CAPTURE(refraction);
                // What is not seen through has to be scattered by something.
                if (refraction < 1.0f && sigma_s < 1.0f) continue;
                Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-7f), eta, 0.3f, CompensationMode::conserve));
                model(scene).medium.sigma_s_prime = Rgb(sigma_s);
                model(scene).refraction = refraction;
                model(scene).volume = 1.0f;
                scene.lights = {dome(Rgb(1.0f))};
                RenderOptions options = small();
                options.samples = 64;
                const Film film = render(scene, options).film;
                CHECK(mean_inside(film, "beauty", 0) == doctest::Approx(1.0).epsilon(0.02));
                CHECK(mean_inside(film, "beauty", 2) == doctest::Approx(1.0).epsilon(0.02));
            }
        }
    }
}

TEST_CASE("boundaries that reflect nothing: what is seen through several bodies has no noise") {
    const float sigma_a = 1.0f;
    Scene scene = scene_of(box_of({-9, -9, -0.2f}, {9, 9, 0.2f}), clear_ice(Rgb(sigma_a), 1.0f, 0.3f));
    model(scene).translucency = 0.0f;
    for (const float z : {-1.0f, -2.0f}) {
        M44f behind;
        behind.translate(V3f(0.0f, 0.0f, z));
        scene.objects.push_back({"/behind", 0, 0, behind});
    }
    scene.lights = {dome(Rgb(1.0f))};
    scene.camera.focal_length = 2000.0f;
    RenderOptions options = small();
    options.samples = 4;
    const Film film = render(scene, options).film;
    for (int x = 0; x < film.width; ++x) {
        CHECK(pixel(film, "beauty", x, x)[1] == doctest::Approx(std::exp(-3.0f * 0.4f * sigma_a)).epsilon(1e-3));
    }
}

TEST_CASE("Beer-Lambert: a clear slab dims what is behind by exp(-sigma_a d) between two boundaries") {
    // A box 0.4 m thick; the camera looks along its normal at a white sky.
    const Mesh box = box_of({-9, -9, -0.2f}, {9, 9, 0.2f});
    const Rgb sigma_a(3.0f, 1.0f, 0.1f);
    Scene scene = scene_of(box, clear_ice(sigma_a, 1.31f, 0.0f));
    model(scene).translucency = 0.0f;
    scene.lights = {dome(Rgb(1.0f))};
    scene.camera.focal_length = 2000.0f;
    RenderOptions options = small();
    options.width = options.height = 8;
    options.samples = 256;
    options.spacing = 2.0f;
    const auto check = [&](const Scene& seen) {
        const Film film = render(seen, options).film;
        const double f = fresnel_dielectric(1.0f, 1.31f);
        for (int c = 0; c < 3; ++c) {
            // Both boundaries and all reflections between them.
            const double t = std::exp(-0.4 * double(sigma_a[c]));
            const double through = (1 - f) * (1 - f) * t / (1 - f * f * t * t);
            const double back = (1 - f) * (1 - f) * f * t * t / (1 - f * f * t * t);
            CHECK(mean_inside(film, "refraction", c) == doctest::Approx(through + back).epsilon(0.01));
        }
    };
    check(scene);
    SUBCASE("with flipped winding") {
        for (V3i& t : scene.meshes[0].triangles) std::swap(t.y, t.z);
        check(scene);
    }
    SUBCASE("mirrored") {
        scene.objects[0].local_to_world[0][0] = -1.0f;
        check(scene);
    }
    SUBCASE("with normals that point inwards") {
        for (const V3f& p : scene.meshes[0].positions) scene.meshes[0].normals.values.push_back(V3f(0, 0, -p.z) * 5.0f);
        scene.meshes[0].normals.interpolation = Interpolation::vertex;
        check(scene);
    }
    SUBCASE("with an edge that four triangles share, a triangle twice and one without area") {
        Mesh& mesh = scene.meshes[0];
        const Mesh other = box_of({9, -9, 0.2f}, {20, 9, 0.6f});  // touches the slab along an edge
        const int first = int(mesh.positions.size());
        mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
        for (const V3i& t : other.triangles) mesh.triangles.push_back(t + V3i(first));
        mesh.triangles.push_back({0, 1, 1});
        const V3i twice = mesh.triangles[0];
        mesh.triangles.push_back(twice);
        mesh.triangles.push_back({twice.x, twice.z, twice.y});  // and back, so that it encloses nothing
        CHECK(is_closed(mesh));
        check(scene);
    }
    SUBCASE("cut in two overlapping bodies") {
        scene.meshes.push_back(scene.meshes[0]);
        for (V3f& p : scene.meshes[0].positions) p.z = p.z > 0.0f ? 0.2f : -0.1f;
        for (V3f& p : scene.meshes[1].positions) p.z = p.z > 0.0f ? 0.1f : -0.2f;
        scene.mesh_paths.push_back("/other");
        scene.objects.push_back({"/other", 1, 0, M44f()});
        check(scene);
    }
}

TEST_CASE("faint light along a shadow ray goes on by chance: as much as Beer-Lambert lets through, on average") {
    for (const float depth : {0.5f, 3.0f, 5.0f}) {
        Scene scene =
            scene_of(box_of(V3f(-1.0f), V3f(1.0f)), clear_ice(Rgb(0.25f * depth, 0.5f * depth, depth), 1.0f, 0.3f));
        const RayScene ray_scene(scene.meshes, {Placement{}});
        const std::vector<std::unique_ptr<Body>> bodies = make_bodies(scene);
        const SurfaceResolver resolver(scene);
        const Interiors interiors(scene, ray_scene, resolver, bodies);
        constexpr int kRays = 400;
        Rgb sum(0.0f);
        std::uint64_t rays = 0;
        for (int j = 0; j < kRays; ++j) {
            for (int i = 0; i < kRays; ++i) {
                const V3f origin((float(i) + 0.5f) / kRays - 0.5f, 2.0f, (float(j) + 0.5f) / kRays - 0.5f);
                sum += interiors.visibility({origin, V3f(0.0f, -1.0f, 0.0f)}, {}, rays);
            }
        }
        for (int c = 0; c < 3; ++c) {
            const double left = std::exp(-2.0 * double(depth) * (c == 2 ? 1.0 : c == 1 ? 0.5 : 0.25));
            CAPTURE(depth);
            CAPTURE(c);
            CHECK(double(sum[c]) / (double(kRays) * kRays) == doctest::Approx(left).epsilon(0.04));
        }
    }
}

TEST_CASE("a camera inside ice sees the sky through its boundary") {
    Scene scene = scene_of(sphere(1.0f, 5), clear_ice(Rgb(0.5f), 1.31f, 0.05f));
    model(scene).translucency = 0.0f;
    scene.lights = {dome(Rgb(1.0f))};
    scene.camera.camera_to_world = M44f();
    const Film film = render(scene, small()).film;
    // From the centre every ray meets the boundary at normal incidence.
    const double f = fresnel_dielectric(1.0f, 1.31f), t = std::exp(-0.5);
    CHECK(mean_inside(film, "refraction", 0) == doctest::Approx((1 - f) * t / (1 - f * t * t)).epsilon(0.02));
}

TEST_CASE("open ice is rendered as before, with a warning that names it") {
    Scene scene = scene_of(floor_square(5.0f, 0.0f), clear_ice(Rgb(0.5f), 1.31f, 0.3f));
    scene.lights = {dome(Rgb(1.0f))};
    scene.camera.camera_to_world = M44f();
    scene.camera.camera_to_world.rotate(V3f(-kPi / 2.0f, 0.0f, 0.0f));
    scene.camera.camera_to_world[3][1] = 2.5f;
    RenderOptions options = small();
    options.spacing = 0.2f;
    const RenderResult result = render(scene, options);
    bool is_named = false;
    for (const std::string& warning : result.stats.warnings) {
        is_named = is_named || warning.find("/shape: the mesh must be closed to be seen into") == 0;
    }
    CHECK(is_named);
    CHECK(mean_inside(result.film, "refraction", 0) == 0.0);
}

TEST_CASE("ice that is inside out is turned round, and named: its core has the same light") {
    Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(0.5f), 1.31f, 0.3f, CompensationMode::off));
    model(scene).medium.sigma_s_prime = Rgb(2.0f);  // some light goes straight through
    scene.lights = {dome(Rgb(1.0f))};
    // Images keep their places: a corner has what it had.
    Primvar<V2f>& uvs = scene.meshes[0].uvs;
    uvs.interpolation = Interpolation::corner;
    for (const V3i& t : scene.meshes[0].triangles) {
        for (int k = 0; k < 3; ++k) {
            const V3f& p = scene.meshes[0].positions[std::size_t(t[k])];
            uvs.values.push_back(V2f(0.5f + 0.5f * p.x, 0.5f + 0.5f * p.y));
        }
    }
    model(scene).roughness.lookup.texture = make_texture(2, 1, 1, {0.1f, 0.9f}, Wrap::clamp, Wrap::clamp);
    const RenderResult right = render(scene, small());
    Scene flipped = scene;
    for (V3i& t : flipped.meshes[0].triangles) std::swap(t.y, t.z);
    for (std::size_t i = 0; i < uvs.values.size(); i += 3) {
        std::swap(flipped.meshes[0].uvs.values[i + 1], flipped.meshes[0].uvs.values[i + 2]);
    }
    const RenderResult turned = render(flipped, small());
    for (const char* layer : {"translucency", "specular", "refraction"}) {
        CAPTURE(layer);
        const double expected = mean_inside(right.film, layer, 0);
        CHECK(expected > 0.0);
        CHECK(mean_inside(turned.film, layer, 0) == doctest::Approx(expected).epsilon(1e-3));
    }
    const auto names = [](const RenderResult& result) {
        int count = 0;
        for (const std::string& warning : result.stats.warnings) {
            count += warning.find("/shape: the faces of ice must wind outwards") == 0;
        }
        return count;
    };
    CHECK(names(right) == 0);
    CHECK(names(turned) == 1);
    CHECK(flipped.meshes[0].triangles[0].y == scene.meshes[0].triangles[0].z);  // the scene stays as it was
}

TEST_CASE("ice whose faces wind both ways is named with where they do") {
    Scene scene = scene_of(sphere(1.0f, 3), clear_ice(Rgb(0.5f), 1.31f, 0.3f));
    scene.lights = {dome(Rgb(1.0f))};
    for (std::size_t i = 0; i < scene.meshes[0].triangles.size(); i += 2) {
        std::swap(scene.meshes[0].triangles[i].y, scene.meshes[0].triangles[i].z);
    }
    const RenderResult result = render(scene, small());
    bool is_named = false;
    for (const std::string& warning : result.stats.warnings) {
        is_named = is_named || warning.find(
                                   "/shape: the faces of ice must all wind outwards, got faces that wind "
                                   "both ways along ") == 0;
    }
    CHECK(is_named);
    CHECK(mean_inside(result.film, "refraction", 0) == 0.0);
}

TEST_CASE("the refraction multiplier of a light acts on what is seen through ice alone") {
    Scene scene = scene_of(sphere(1.0f, 4), clear_ice(Rgb(0.1f), 1.31f, 0.2f));
    scene.lights = {dome(Rgb(1.0f))};
    const Film full = render(scene, small()).film;
    scene.lights[0].multipliers[int(LightComponent::refraction)] = 0.0f;
    const Film none = render(scene, small()).film;
    CHECK(mean_inside(full, "refraction", 0) > 0.5);
    CHECK(mean_inside(none, "refraction", 0) < 1e-6);
    CHECK(mean_inside(none, "specular", 0) == doctest::Approx(mean_inside(full, "specular", 0)).epsilon(1e-6));
}

TEST_CASE("light through clear ice makes no sparks: no place behind it gets more than without the ice") {
    // Broad lobes take light along straight lines, at grazing angles too.
    Scene scene = scene_of(sphere(1.0f, 4), clear_ice(Rgb(1e-6f), 1.31f, 0.3f));
    scene.meshes.push_back(floor_square(4.0f, -1.05f));
    scene.mesh_paths.push_back("/floor");
    StandardMaterial white;
    white.diffuse_color.value = Rgb(0.8f);
    white.use_specular_workflow = true;
    white.roughness.value = 1.0f;
    scene.materials.push_back({"/white", white});
    scene.objects.push_back({"/floor", 1, 1, M44f()});
    Light sun;
    sun.path = "/sun";
    sun.shape = DistantLight{0.5f};
    sun.normalize = true;
    sun.light_to_world.rotate(V3f(-0.6f, 0.0f, 0.0f));
    scene.lights = {sun};
    scene.camera.camera_to_world = M44f();
    scene.camera.camera_to_world.rotate(V3f(-1.2f, 0.0f, 0.0f));
    scene.camera.camera_to_world[3][1] = 7.0f, scene.camera.camera_to_world[3][2] = 2.0f;
    RenderOptions options = small();
    options.max_bounces = 0;  // direct light alone
    const Film with = render(scene, options).film;
    scene.objects.erase(scene.objects.begin());
    const Film without = render(scene, options).film;
    double most = 0.0, least = 1e9, bare = 0.0;
    for (int y = 0; y < with.height; ++y) {
        for (int x = 0; x < with.width; ++x) {
            if (pixel(with, "object_id", x, y)[0] != 2.0f || pixel(with, "beauty", x, y)[3] < 1.0f) continue;
            bare = std::max(bare, double(pixel(without, "diffuse", x, y)[0]));
            most = std::max(most, double(pixel(with, "diffuse", x, y)[0]));
            least = std::min(least, double(pixel(with, "diffuse", x, y)[0]));
        }
    }
    CHECK(bare > 0.05);
    CHECK(most <= bare * 1.001);
    CHECK(least > 0.3 * bare);
    CHECK(least < 0.97 * bare);
}

TEST_CASE(
    "mattes: a rock that half covers the view behind a clear slab has the slab's transmittance, and half directly") {
    // A slab 0.4 m thick before a dark wall that ends in the middle of the picture.
    Mesh slab = box_of({-9, -9, -0.2f}, {9, 9, 0.2f});
    Mesh wall;
    wall.positions = {{-9, -9, -1}, {0, -9, -1}, {0, 9, -1}, {-9, 9, -1}};
    wall.triangles = {{0, 1, 2}, {0, 2, 3}};
    Scene scene = scene_of(slab, clear_ice(Rgb(1.0f), 1.31f, 0.0f));
    model(scene).translucency = 0.0f;
    scene.meshes.push_back(wall);
    scene.mesh_paths.push_back("/wall");
    scene.materials.push_back({"/rock", StandardMaterial()});
    scene.objects.push_back({"/wall", 1, 1, M44f()});
    scene.lights = {dome(Rgb(1.0f))};
    scene.camera.focal_length = 2000.0f;
    RenderOptions options = small();
    options.width = options.height = 8;
    options.samples = 1024;
    options.spacing = 2.0f;
    options.mattes = {{"rock", {1}}, {"ice", {0}}, {"all", {0, 1}}, {"none", {}}};
    const Film film = render(scene, options).film;
    const auto mean = [&](const char* layer) {
        double sum = 0.0;
        for (const float value : film.layers.at(layer).pixels) sum += value;
        return sum / 64;
    };
    // Both boundaries and all reflections between them; an even number of which leads to the wall.
    const double f = fresnel_dielectric(1.0f, 1.31f), t = std::exp(-0.4);
    const double through = (1 - f) * (1 - f) * t / (1 - f * f * t * t);
    CHECK(mean("refracted_matte.rock") == doctest::Approx(0.5 * through).epsilon(0.02));
    CHECK(mean("matte.rock") == 0.0);
    CHECK(mean("matte.ice") == 1.0);
    CHECK(mean("matte.all") == 1.0);
    CHECK(mean("refracted_matte.all") == doctest::Approx(0.5 * through).epsilon(0.02));
    CHECK(mean("refracted_matte.none") == 0.0);
    // Each half for itself, and half directly without the slab.
    CHECK(double(pixel(film, "refracted_matte.rock", 0, 4)[0]) == doctest::Approx(through).epsilon(0.05));
    CHECK(pixel(film, "refracted_matte.rock", 7, 4)[0] == 0.0f);
    scene.objects[0].local_to_world[3][0] = 100.0f;
    const Film bare = render(scene, options).film;
    double direct = 0.0;
    for (const float value : bare.layers.at("matte.rock").pixels) direct += value;
    CHECK(direct / 64 == doctest::Approx(0.5).epsilon(0.02));
    options.mattes = {{"rock", {7}}};
    CHECK_THROWS_WITH_AS(render(scene, options), "matte rock: objects must be in 0..2 (exclusive), got 7.", ValueError);
}

TEST_CASE("a matte of ice behind ice has what its core answers for") {
    // Cloudy ice that clear ice of the same index runs into: no boundary between them.
    Scene scene = scene_of(box_of({-9, -9, -0.3f}, {9, 9, 0.2f}), clear_ice(Rgb(1e-6f), 1.31f, 0.0f));
    model(scene).translucency = 0.0f;
    scene.meshes.push_back(box_of({-9, -9, -6.2f}, {9, 9, -0.2f}));
    scene.mesh_paths.push_back("/behind");
    scene.materials.push_back(ice(Rgb(1e-6f), 1.31f, 0.0f, CompensationMode::conserve));
    scene.objects.push_back({"/behind", 1, 1, M44f()});
    scene.lights = {dome(Rgb(1.0f))};
    scene.camera.focal_length = 2000.0f;
    RenderOptions options = small();
    options.width = options.height = 4;
    options.samples = 256;
    options.spacing = 2.0f;
    options.mattes = {{"behind", {1}}};
    const Film film = render(scene, options).film;
    const double f = fresnel_dielectric(1.0f, 1.31f);
    double sum = 0.0;
    for (const float value : film.layers.at("refracted_matte.behind").pixels) sum += value;
    CHECK(sum / 16 == doctest::Approx(1 - f).epsilon(0.01));
}

TEST_CASE("the boundary's tint colours what goes through it, each time, and nothing else") {
    const Rgb tint(0.9f, 0.6f, 0.3f);
    for (const float eta : {1.0f, 1.31f}) {
        CAPTURE(eta);
        Scene scene = scene_of(box_of({-9, -9, -0.2f}, {9, 9, 0.2f}), clear_ice(Rgb(1e-6f), eta, 0.0f));
        model(scene).translucency = 0.0f;
        model(scene).refraction_tint = tint;
        scene.lights = {dome(Rgb(1.0f))};
        scene.camera.focal_length = 2000.0f;
        RenderOptions options = small();
        options.width = options.height = 8;
        options.samples = 256;
        options.spacing = 2.0f;
        const Film film = render(scene, options).film;
        const double f = eta == 1.0f ? 0.0 : double(fresnel_dielectric(1.0f, eta));
        for (int c = 0; c < 3; ++c) {
            // In and out again, with all reflections between.
            const double through = (1 - f) * (1 - f) / (1 - f * f) * (1 + f);
            CHECK(mean_inside(film, "refraction", c) ==
                  doctest::Approx(through * double(tint[c]) * double(tint[c])).epsilon(0.01));
            CHECK(mean_inside(film, "specular", c) == doctest::Approx(f).epsilon(0.02));
        }
    }
    // Light that comes straight through to a floor is tinted twice as well.
    Scene scene = scene_of(box_of({-2, 0.5f, -2}, {2, 0.6f, 2}), clear_ice(Rgb(1e-6f), 1.0f, 0.0f));
    model(scene).translucency = 0.0f;
    model(scene).refraction_tint = tint;
    scene.meshes.push_back(floor_square(1.0f, 0.0f));
    scene.mesh_paths.push_back("/floor");
    scene.materials.push_back({"/floor", StandardMaterial()});
    scene.objects.push_back({"/floor", 1, 1, M44f()});
    scene.lights = {rect_above(1.0f, "")};
    scene.camera.camera_to_world = M44f();
    scene.camera.camera_to_world.rotate(V3f(-kPi / 2.0f, 0.0f, 0.0f));
    scene.camera.camera_to_world[3][1] = 0.3f;
    scene.camera.focal_length = 40.0f;
    RenderOptions options = small();
    options.spacing = 2.0f;
    options.max_bounces = 0;
    const Film film = render(scene, options).film;
    for (int c = 0; c < 2; ++c) {
        const double ratio = mean_inside(film, "diffuse", c) / mean_inside(film, "diffuse", 2);
        CHECK(ratio == doctest::Approx(double(tint[c] * tint[c] / (tint[2] * tint[2]))).epsilon(1e-3));
    }
}
