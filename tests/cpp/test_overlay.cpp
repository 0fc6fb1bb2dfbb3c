#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/random.h"
#include "frazil/base/sampler.h"
#include "frazil/material/overlay.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

Pattern pattern_of(PatternKind kind) {
    Pattern pattern;
    pattern.kind = kind;
    return pattern;
}

constexpr PatternKind kAll[] = {PatternKind::fracture, PatternKind::cells, PatternKind::frost,
                                PatternKind::bubbles,  PatternKind::snow,  PatternKind::bands};

// Mean of the mask over a square metre of the plane y = 0.37, by `n`² points of the given footprint.
double mean_mask(const Pattern& pattern, int n, float footprint) {
    double sum = 0.0;
    for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
            const V3f p((float(i) + 0.5f) / float(n), 0.37f, (float(j) + 0.5f) / float(n));
            sum += double(eval_pattern(pattern, {p, V3f(0, 1, 0), footprint}));
        }
    }
    return sum / (double(n) * n);
}

Overlay solid(float scattering) {
    Overlay overlay;
    overlay.color = Rgb(1.0f);
    overlay.opacity = 0.6f;
    overlay.scattering = scattering;
    overlay.age_end = 0.0f;
    return overlay;
}

}  // namespace

TEST_CASE("masks are in 0..1, depend on the seed, and have no seam at lattice borders") {
    for (const PatternKind kind : kAll) {
        Pattern pattern = pattern_of(kind);
        pattern.size = 0.25f;
        if (kind == PatternKind::bubbles) pattern.width = 0.2f;
        CAPTURE(int(kind));
        double difference = 0.0;
        for (std::uint32_t i = 0; i < 2000; ++i) {
            const V3f p(to_unit_float(hash(i)), to_unit_float(hash(i, 1)), to_unit_float(hash(i, 2)));
            const float a = eval_pattern(pattern, {p, V3f(0, 1, 0), 0.002f});
            CHECK((a >= 0.0f && a <= 1.0f));
            // At x = 0.25 cells begin: both sides must agree.
            const V3f border(0.25f, p.y, p.z);
            const float left = eval_pattern(pattern, {border - V3f(2e-6f, 0, 0), V3f(0, 1, 0), 0.002f});
            const float right = eval_pattern(pattern, {border + V3f(2e-6f, 0, 0), V3f(0, 1, 0), 0.002f});
            CHECK(std::abs(left - right) < 0.02f);
            Pattern other = pattern;
            other.seed = 9;
            difference += std::abs(double(a - eval_pattern(other, {p, V3f(0, 1, 0), 0.002f})));
        }
        if (kind != PatternKind::snow) CHECK(difference > 1.0);
    }
}

TEST_CASE("a wide footprint sees the mean of what a fine one sees") {
    for (const PatternKind kind : {PatternKind::fracture, PatternKind::cells, PatternKind::bubbles}) {
        Pattern pattern = pattern_of(kind);
        pattern.size = kind == PatternKind::bubbles ? 0.05f : 0.2f;
        pattern.width = kind == PatternKind::bubbles ? 0.04f : 0.006f;
        pattern.feather = 0.002f;
        pattern.amount = 1.0f;
        CAPTURE(int(kind));
        const double fine = mean_mask(pattern, 900, 0.0f);
        REQUIRE(fine > 0.005);
        CHECK(mean_mask(pattern, 200, 0.005f) == doctest::Approx(fine).epsilon(0.12));
    }
}

TEST_CASE("lines have the width that is asked for, in metres, on surfaces at any angle to them") {
    // A single family of walls: measure the length of the mask along random lines against its count of crossings.
    Pattern pattern = pattern_of(PatternKind::bands);
    pattern.warp = 0.0f;
    pattern.amount = 1.0f;
    pattern.feather = 0.0f;
    pattern.size = 0.2f;
    pattern.width = 0.01f;
    for (const V3f& normal : {V3f(1, 0, 0), V3f(0.8f, 0.6f, 0)}) {
        // Walk down the surface, across the bands: a band of height w is w long on a steep face and w on a slope too.
        const V3f down = V3f(normal.y, -normal.x, 0.0f);
        double covered = 0.0;
        int bands = 0;
        bool was_in = false;
        constexpr int kSteps = 400000;
        const float length = 40.0f;
        for (int i = 0; i < kSteps; ++i) {
            const V3f p = down * (length * float(i) / kSteps);
            const bool is_in = eval_pattern(pattern, {p, normal, 0.0f}) > 0.0f;
            covered += is_in;
            bands += is_in && !was_in;
            was_in = is_in;
        }
        // Mean width 0.3 .. 1.7 of the one asked for.
        CHECK(covered * length / kSteps / bands == doctest::Approx(0.01).epsilon(0.08));
    }
    CHECK(line_mask(0.0f, 0.01f, 0.0f, 0.0f) == 1.0f);
    CHECK(line_mask(0.0f, 0.01f, 0.0f, 0.05f) == doctest::Approx(0.1));
    double area = 0.0;
    for (int i = -1000; i < 1000; ++i) area += double(line_mask(std::abs(i * 1e-4f), 0.01f, 0.02f, 0.01f)) * 1e-4;
    CHECK(area == doctest::Approx(0.01).epsilon(0.01));
}

TEST_CASE("crack widths and patterns stay in metres when an object is scaled, and stay with it when it moves") {
    // The same sphere of radius 1 m: as it is, as a unit mesh of radius 0.01 under a scale of 100, and turned and moved with
    // its camera.
    Material material = ice(Rgb(0.2f), 1.31f, 0.2f, CompensationMode::off);
    Overlay cracks;
    cracks.age_end = 0.0f;
    cracks.pattern = pattern_of(PatternKind::cells);
    std::get<IceMaterial>(material.model).overlays = {cracks};
    const auto picture = [&](float radius, const M44f& matrix, const M44f& motion) {
        Scene scene = scene_of(sphere(radius, 4), material);
        scene.objects[0].local_to_world = matrix * motion;
        scene.camera.camera_to_world = scene.camera.camera_to_world * motion;
        const SurfaceResolver resolver(scene);
        std::vector<float> masks;
        for (std::uint32_t triangle = 0; triangle < 2048; triangle += 7) {
            Hit hit;
            hit.triangle = triangle;
            hit.uv = V2f(0.3f, 0.3f);
            const Mesh world = transformed(scene.meshes[0], scene.objects[0].local_to_world);
            hit.geometric_normal = V3f(triangle_cross(world, triangle)).normalized();
            masks.push_back(resolver.resolve(hit, -hit.geometric_normal, 0.001f).covering.covered);
        }
        return masks;
    };
    M44f scale, motion;
    scale.setScale(100.0f);
    motion.rotate(V3f(0.4f, 1.1f, -0.3f));
    motion[3][0] = 5.0f, motion[3][1] = -2.0f;
    const std::vector<float> plain = picture(1.0f, M44f(), M44f());
    const std::vector<float> scaled = picture(0.01f, scale, M44f());
    const std::vector<float> moved = picture(1.0f, M44f(), motion);
    double mean = 0.0;
    for (std::size_t i = 0; i < plain.size(); ++i) {
        CHECK(scaled[i] == doctest::Approx(plain[i]).epsilon(0.02));
        CHECK(moved[i] == doctest::Approx(plain[i]).epsilon(0.02));
        mean += double(plain[i]);
    }
    CHECK(mean / double(plain.size()) > 0.01);
}

TEST_CASE("white furnace: overlays share light with refraction and core, and lose none") {
    for (const float sigma_s : {1e-6f, 0.5f, 20.0f}) {
        for (const float scattering : {0.0f, 0.7f, 1.0f}) {
            // What is hidden has to be scattered by something.
            if (sigma_s < 0.1f && scattering < 1.0f) continue;
            CAPTURE(sigma_s);
            CAPTURE(scattering);
            Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-7f), 1.31f, 0.3f, CompensationMode::conserve));
            IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
            model.medium.sigma_s_prime = Rgb(sigma_s);
            model.overlays = {solid(scattering)};
            scene.lights = {dome(Rgb(1.0f))};
            RenderOptions options = small();
            options.samples = 128;
            const Film film = render(scene, options).film;
            // Light that meets an overlay from inside is the core's, which has none where nothing scatters: <= 1 there.
            CHECK(mean_inside(film, "beauty", 0) < 1.02);
            // Half-covered cloudy ice loses up to a tenth where overlays are seen from inside.
            if (sigma_s > 0.1f) CHECK(mean_inside(film, "beauty", 0) > (sigma_s > 1.0f ? 0.98 : 0.9));
        }
    }
}

TEST_CASE("overlays keep light out of the points below, and age brings them out") {
    Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(0.3f), 1.31f, 0.3f, CompensationMode::off));
    IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
    scene.lights = {dome(Rgb(1.0f))};
    const double bare = mean_inside(render(scene, small()).film, "translucency", 0);
    model.overlays = {solid(0.5f)};
    model.overlays[0].age_begin = 0.2f, model.overlays[0].age_end = 0.8f;
    double last = 1e9;
    for (const float age : {0.1f, 0.5f, 0.9f}) {
        model.age = age;
        const Film film = render(scene, small()).film;
        const double translucency = mean_inside(film, "translucency", 0);
        if (age < 0.2f) CHECK(translucency == doctest::Approx(bare));
        if (age > 0.8f) CHECK(translucency == doctest::Approx(bare * (1.0 - 0.6 * 0.5)).epsilon(0.01));
        CHECK(translucency < last);
        CHECK((age < 0.2f) == (mean_inside(film, "diffuse", 0) == 0.0));
        last = translucency;
    }
}

TEST_CASE("fracture planes inside are seen through refraction, along a ray where the mask has them") {
    Pattern pattern = pattern_of(PatternKind::fracture);
    pattern.amount = 1.0f;
    pattern.warp = 0.3f;
    const V3f origin(0.1f, 0.2f, 0.3f), direction = V3f(0.3f, -0.6f, 0.7f).normalized();
    FractureRay ray{origin, direction, 1e-3f, 3.0f};
    Sampler coins(1, 0, 0);
    float t = 0.0f;
    V3f normal;
    int found = 0;
    while (find_fracture(pattern, 1.0f, ray, coins, t, normal)) {
        REQUIRE(t > ray.t_min);
        // In space, across the sheet, the pattern has a line there.
        CHECK(eval_pattern(pattern, {origin + direction * t, V3f(0.0f), 0.0f}) > 0.5f);
        ray.t_min = t + 1e-4f;
        ++found;
    }
    CHECK(found >= 4);

    Material material = ice(Rgb(0.1f), 1.31f, 0.05f, CompensationMode::conserve);
    std::get<IceMaterial>(material.model).medium.sigma_s_prime = Rgb(0.01f);
    Scene scene = scene_of(sphere(1.0f, 4), material);
    scene.lights = {dome(Rgb(1.0f))};
    const double clear = mean_inside(render(scene, small()).film, "refraction", 0);
    Overlay sheets;
    sheets.color = Rgb(0.0f);
    sheets.opacity = 0.0f;
    sheets.internal = 1.0f;
    sheets.age_end = 0.0f;
    sheets.pattern = pattern;
    std::get<IceMaterial>(scene.materials[0].model).overlays = {sheets};
    CHECK(mean_inside(render(scene, small()).film, "refraction", 0) < 0.3 * clear);
}

TEST_CASE("each fracture plane along a ray stops it by the chance of its mask and the opacity") {
    Pattern pattern = pattern_of(PatternKind::fracture);
    pattern.warp = 0.3f;
    pattern.width = 0.02f;  // lines that are full where a bent plane is met, but for a millimetre
    constexpr float kOpacity = 0.4f;
    constexpr int kDraws = 4096;
    FractureRay ray{V3f(0.1f, 0.2f, 0.3f), V3f(0.3f, -0.6f, 0.7f).normalized(), 1e-3f, 3.0f};
    for (const float amount : {1.0f, 0.5f}) {
        pattern.amount = amount;
        // Where there are planes, from the mask in space.
        std::vector<double> places, masks;
        Pattern whole = pattern;
        whole.amount = 1.0f;
        Sampler any(1, 0, 0);
        float t = 0.0f;
        V3f normal;
        for (FractureRay rest = ray; find_fracture(whole, 1.0f, rest, any, t, normal); rest.t_min = t + 1e-4f) {
            places.push_back(t);
            masks.push_back(eval_pattern(pattern, {ray.origin + ray.direction * t, V3f(0.0f), 0.0f}));
        }
        std::vector<double> stopped(places.size(), 0.0);
        for (int draw = 0; draw < kDraws; ++draw) {
            Sampler coins(7, 0, std::uint32_t(draw));
            if (!find_fracture(pattern, kOpacity, ray, coins, t, normal)) continue;
            const auto nearest = std::min_element(places.begin(), places.end(), [&](double a, double b) {
                return std::abs(a - double(t)) < std::abs(b - double(t));
            });
            stopped[std::size_t(nearest - places.begin())] += 1.0 / kDraws;
        }
        double left = 1.0;
        for (std::size_t k = 0; k < places.size(); ++k) {
            CAPTURE(amount);
            CAPTURE(k);
            CHECK(stopped[k] == doctest::Approx(left * masks[k] * double(kOpacity)).epsilon(0.02).scale(1.0));
            left *= 1.0 - masks[k] * double(kOpacity);
        }
        CHECK(left < (amount < 1.0f ? 0.95 : 0.5));
    }
}

TEST_CASE("fine and faint fracture planes stop a ray wherever they are along it") {
    Pattern pattern = pattern_of(PatternKind::fracture);
    pattern.size = 0.02f;
    pattern.warp = 0.0f;
    pattern.width = 0.002f;
    pattern.amount = 1.0f;
    constexpr float kOpacity = 0.02f;
    const FractureRay ray{V3f(0.1f, 0.2f, 0.3f), V3f(0.3f, -0.6f, 0.7f).normalized(), 1e-3f, 3.0f};
    Sampler any(1, 0, 0);
    float t = 0.0f;
    V3f normal;
    int planes = 0;
    for (FractureRay rest = ray; find_fracture(pattern, 1.0f, rest, any, t, normal); rest.t_min = t + 1e-5f) ++planes;
    CHECK(planes > 50);
    constexpr int kDraws = 4096;
    int stopped = 0;
    for (int draw = 0; draw < kDraws; ++draw) {
        Sampler coins(7, 0, std::uint32_t(draw));
        stopped += find_fracture(pattern, kOpacity, ray, coins, t, normal) ? 1 : 0;
    }
    CAPTURE(planes);
    CHECK(stopped / double(kDraws) == doctest::Approx(1.0 - std::pow(1.0 - double(kOpacity), planes)).epsilon(0.02));
}

TEST_CASE("overlays out of range are refused by name") {
    Scene scene = scene_of(sphere(1.0f, 1), ice(Rgb(0.1f), 1.31f, 0.3f, CompensationMode::ratio));
    IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
    model.overlays = {solid(0.5f), solid(0.5f)};
    model.overlays[1].opacity = 1.5f;
    CHECK_THROWS_WITH_AS(render(scene, small()), doctest::Contains("/ice: overlay 1: opacity must be in 0..1, got 1.5"),
                         ValueError);
    model.overlays[1].opacity = 0.5f;
    model.overlays[1].pattern.size = 0.0f;
    CHECK_THROWS_WITH_AS(render(scene, small()), doctest::Contains("overlay 1: size must be > 0"), ValueError);
}

TEST_CASE("one and two threads give the same bits with overlays, sheets and volume") {
    Scene scene = scene_of(sphere(1.0f, 3), ice(Rgb(0.5f, 0.1f, 0.02f), 1.31f, 0.3f, CompensationMode::ratio));
    IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
    model.medium.sigma_s_prime = Rgb(2.0f);
    model.volume = 1.0f;
    for (const PatternKind kind : kAll) {
        Overlay overlay = solid(0.6f);
        overlay.pattern = pattern_of(kind);
        overlay.internal = 0.5f;
        overlay.bump = 0.002f;
        model.overlays.push_back(overlay);
    }
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

TEST_CASE("cells keep their mean cover under any footprint") {
    Pattern pattern = pattern_of(PatternKind::cells);
    pattern.size = 0.1f, pattern.width = 0.004f, pattern.feather = 0.001f, pattern.scales = 1, pattern.warp = 0.0f;
    for (const float amount : {0.3f, 0.5f, 1.0f}) {
        pattern.amount = amount;
        const double fine = mean_mask(pattern, 1000, 0.0f);
        for (const float footprint : {0.003f, 0.01f, 0.02f, 0.03f, 0.1f, 1.0f}) {
            CAPTURE(footprint);
            // Walls beside the nearest one go missing while cells are still told apart.
            CHECK(mean_mask(pattern, 300, footprint) == doctest::Approx(fine).epsilon(0.15));
        }
    }
}

TEST_CASE("snow and frost keep their mean cover under any footprint, on walls of any slope") {
    for (const PatternKind kind : {PatternKind::snow, PatternKind::frost}) {
        Pattern pattern = pattern_of(kind);
        for (const float amount : {0.3f, 0.5f, 0.7f}) {
            pattern.amount = amount;
            for (const float up : {-0.2f, 0.2f, 0.4f, 0.6f, 0.9f}) {
                const auto mean = [&](float footprint) {
                    double sum = 0.0;
                    for (std::uint32_t i = 0; i < 4000; ++i) {
                        Sampler sampler(3, i, 0);
                        const V2f xy = sampler.next_2d();
                        const V3f place(8.0f * xy.x, 8.0f * xy.y, 8.0f * sampler.next_1d());
                        sum += eval_pattern(pattern, {place, V3f(std::sqrt(1.0f - up * up), up, 0.0f), footprint});
                    }
                    return sum / 4000.0;
                };
                const double fine = mean(0.0f);
                for (const float footprint : {0.02f, 0.05f, 0.1f, 0.5f, 3.0f}) {
                    CAPTURE(int(kind));
                    CAPTURE(amount);
                    CAPTURE(up);
                    CAPTURE(footprint);
                    CHECK(std::abs(mean(footprint) - fine) < 0.04);
                }
            }
        }
    }
}
