// Shaping, images on rects and mesh lights against closed forms; mesh sampling against its density.
#include <doctest/doctest.h>

#include <array>

#include "chi_square.h"
#include "frazil/base/error.h"
#include "lights.h"
#include "shapes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// A small disk at height 1 that shines down.
Light spot(const Shaping& shaping) {
    Light light = make_light(DiskLight{0.001f}, translated({0, 0, 1}));
    light.shaping = shaping;
    light.normalize = true;
    return light;
}

// E under an unshaped spot at this angle from its axis.
double unshaped(double angle) {
    return std::pow(std::cos(angle), 4);
}

double radians(double degrees) {
    return degrees * kPiD / 180.0;
}

// A bulging mesh whose triangles differ in brightness.
MeshLight lantern(bool is_two_sided) {
    MeshLight light;
    light.mesh = std::make_shared<Mesh>(sphere(0.6f, 2));
    std::vector<Rgb> factors;
    for (std::size_t i = 0; i < light.mesh->triangle_count(); ++i) factors.emplace_back(float(i % 5) * 0.5f);
    light.triangle_factors = std::make_shared<const std::vector<Rgb>>(factors);
    light.is_two_sided = is_two_sided;
    return light;
}

}  // namespace

TEST_CASE("shaping: a cone cuts off at its angle, softly where it is soft") {
    Shaping cone;
    cone.cone_angle = 30.0f;
    for (const double degrees : {0.0, 20.0, 29.5, 30.5, 50.0}) {
        const double expected = degrees < 30.0 ? unshaped(radians(degrees)) : 0.0;
        CAPTURE(degrees);
        CHECK(irradiance_at({spot(cone)}, float(std::tan(radians(degrees)))).x ==
              doctest::Approx(expected).epsilon(2e-3));
    }
    cone.cone_softness = 0.5f;  // fades from 15 to 30 degrees
    for (const auto& [degrees, share] : {std::pair(10.0, 1.0), {22.5, 0.5}, {18.75, 0.84375}, {31.0, 0.0}}) {
        CAPTURE(degrees);
        CHECK(irradiance_at({spot(cone)}, float(std::tan(radians(degrees)))).x ==
              doctest::Approx(share * unshaped(radians(degrees))).epsilon(5e-3));
    }
}

TEST_CASE("shaping: the power that a cone lets out of a spot is sin² of its angle") {
    Shaping cone;
    cone.cone_angle = 25.0f;
    // ∫ E 2 pi x dx over the floor, per pi: substitution by the angle.
    double power = 0.0;
    constexpr int kRings = 200;
    for (int i = 0; i < kRings; ++i) {
        const double angle = radians(60.0) * (i + 0.5) / kRings, x = std::tan(angle);
        IrradianceOptions few;
        few.samples = 63;
        power += double(irradiance_at({spot(cone)}, float(x), RayScene({}, {}), few).x) * 2.0 * x /
                 std::pow(std::cos(angle), 2) * radians(60.0) / kRings;
    }
    CHECK(power == doctest::Approx(std::pow(std::sin(radians(25.0)), 2)).epsilon(0.02));
}

TEST_CASE("shaping: focus is a power of the cosine, tinted") {
    Shaping focus;
    focus.focus = 6.0f;
    focus.focus_tint = Rgb(0.0f, 0.5f, 1.0f);
    for (const double degrees : {0.0, 30.0, 60.0}) {
        const Rgb found = irradiance_at({spot(focus)}, float(std::tan(radians(degrees))));
        const double plain = unshaped(radians(degrees)), share = std::pow(std::cos(radians(degrees)), 6);
        CHECK(found.x == doctest::Approx(plain * share).epsilon(5e-3));
        CHECK(found.y == doctest::Approx(plain * (0.5 + 0.5 * share)).epsilon(5e-3));
        CHECK(found.z == doctest::Approx(plain).epsilon(5e-3));
    }
}

TEST_CASE("shaping: focus has the absolute cosine: a sphere shines backwards too") {
    Shaping focus;
    focus.focus = 2.0f;
    CHECK(eval(focus, V3f(0.0f, 0.6f, 0.8f)).x == doctest::Approx(0.64));
    CHECK(eval(focus, V3f(0.0f, 0.6f, -0.8f)).x == doctest::Approx(0.64));
}

TEST_CASE("ies: a profile multiplies the light by its intensity, angle by angle") {
    // 100 - degrees candela, by 10 degrees to 80; nothing beyond.
    std::vector<float> vertical, values;
    for (int v = 0; v <= 80; v += 10) {
        vertical.push_back(float(v));
        values.push_back(100.0f - float(v));
    }
    Shaping shaping;
    shaping.ies = std::make_shared<const IesProfile>(vertical, std::vector<float>{0.0f}, values, "/profile");
    for (const double degrees : {0.0, 15.0, 44.0, 70.0}) {
        CAPTURE(degrees);
        CHECK(irradiance_at({spot(shaping)}, float(std::tan(radians(degrees)))).x ==
              doctest::Approx((100.0 - degrees) * unshaped(radians(degrees))).epsilon(2e-3));
    }
    CHECK(irradiance_at({spot(shaping)}, float(std::tan(radians(83.0)))).x == 0.0f);
    // Scaled about straight down: at 30 degrees it gives what it had at 60; negative scales go about straight up.
    shaping.ies_angle_scale = 0.5f;
    CHECK(irradiance_at({spot(shaping)}, float(std::tan(radians(30.0)))).x ==
          doctest::Approx(40.0 * unshaped(radians(30.0))).epsilon(2e-3));
    shaping.ies_angle_scale = -2.0f;
    CHECK(shaping.ies->eval(V3f(0.0f, 0.0f, -1.0f), -2.0f) == 0.0f);
    CHECK(shaping.ies->eval(V3f(0.0f, 0.0f, 1.0f), -2.0f) == doctest::Approx(0.0));  // 90 degrees
}

TEST_CASE("ies: normalised, a profile has a mean of one over what it covers") {
    // 1 + h/180 over half a turn, mirrored: 1.5 on the mean; a hemisphere, and a sphere with nothing above.
    for (const float last : {90.0f, 180.0f}) {
        std::vector<float> vertical{0.0f, 30.0f, 90.0f}, values;
        if (last > 90.0f) vertical.push_back(last);
        const std::vector<float> horizontal{0.0f, 45.0f, 180.0f};
        for (const float h : horizontal) {
            for (const float v : vertical) values.push_back((1.0f + h / 180.0f) * (1.0f + v / 90.0f));
        }
        Shaping shaping;
        shaping.ies = std::make_shared<const IesProfile>(vertical, horizontal, values, "/profile");
        shaping.ies_normalize = true;
        double sum = 0.0;
        constexpr int kCount = 1 << 15;
        for (std::uint32_t i = 0; i < kCount; ++i) {
            Sampler random(3, 4, i);
            const V2f u = random.next_2d();
            const float z = last > 90.0f ? 1.0f - 2.0f * u.x : 1.0f - u.x, r = std::sqrt(1.0f - z * z);
            sum += double(eval(shaping, {r * std::cos(2 * kPi * u.y), r * std::sin(2 * kPi * u.y), z}).x) / kCount;
        }
        CHECK(sum == doctest::Approx(1.0).epsilon(1e-3));
        if (last == 90.0f) {
            // ∫ (1 + 2v/pi) sin v dv = 1 + 2/pi.
            CHECK(double(shaping.ies->mean()) == doctest::Approx(1.5 * (1.0 + 2.0 / kPiD)));
        }
    }
}

TEST_CASE("ies: less than a turn of horizontal angles is mirrored") {
    const auto at = [](const IesProfile& profile, double degrees) {
        const double h = radians(degrees);
        return double(profile.eval({float(std::cos(h)), float(std::sin(h)), 0.0f}));
    };
    const auto profile = [](std::vector<float> horizontal) {
        std::vector<float> values;
        for (const float h : horizontal) values.insert(values.end(), {h, h});
        return IesProfile({0.0f, 90.0f}, std::move(horizontal), values, "/profile");
    };
    const IesProfile quarter = profile({0, 90}), half = profile({0, 180}), turn = profile({0, 120, 360}),
                     other = profile({90, 180, 270});
    for (const auto& [angle, q, h, o] :
         {std::array<double, 4>{20, 20, 20, 160}, {110, 70, 110, 110}, {200, 20, 160, 200}, {330, 30, 30, 210}}) {
        CAPTURE(angle);
        CHECK(at(quarter, angle) == doctest::Approx(q));
        CHECK(at(half, angle) == doctest::Approx(h));
        CHECK(at(turn, angle) == doctest::Approx(angle));
        CHECK(at(other, angle) == doctest::Approx(o));
    }
}

TEST_CASE("ies: broken profiles are refused") {
    const auto make = [](std::vector<float> v, std::vector<float> h, std::vector<float> values) {
        return IesProfile(std::move(v), std::move(h), std::move(values), "/lamp.ies");
    };
    CHECK_THROWS_WITH_AS(make({}, {0}, {}), doctest::Contains("/lamp.ies: vertical angles must be"), ValueError);
    CHECK_THROWS_WITH_AS(make({0, 0}, {0}, {1, 1}), doctest::Contains("got 0 as number 2"), ValueError);
    CHECK_THROWS_WITH_AS(make({0, 200}, {0}, {1, 1}), doctest::Contains("within 0 to 180 degrees"), ValueError);
    CHECK_THROWS_WITH_AS(make({0, 90}, {0, 50}, {1, 1, 1, 1}), doctest::Contains("got 0 to 50"), ValueError);
    CHECK_THROWS_WITH_AS(make({0, 90}, {0}, {1}), doctest::Contains("one for each pair of angles (2), got 1"),
                         ValueError);
    CHECK_THROWS_WITH_AS(make({0, 90}, {0}, {1, -1}), doctest::Contains(">= 0 and finite, got -1"), ValueError);
}

TEST_CASE("shaping: a cone on a sphere lights one side of it") {
    Light bulb = make_light(SphereLight{0.001f}, translated({0, 0, 1}));
    bulb.shaping.cone_angle = 90.0f;
    CHECK(irradiance_at({bulb}).x > 0.0f);
    bulb.light_to_world[2][2] = bulb.light_to_world[0][0] = -1.0f;  // turned over: it shines upwards
    CHECK(irradiance_at({bulb}).x == 0.0f);
}

TEST_CASE("light image: a rect with one white half gives what that half gives, on the side that it lies on") {
    const auto half = [](bool is_left) {
        return std::make_shared<LightImage>(
            2, 1, std::vector<Rgb>{Rgb(is_left ? 1.0f : 0.0f), Rgb(is_left ? 0.0f : 1.0f)}, "/half");
    };
    // Bilinear: full to a quarter of the width, then a ramp over a half. By symmetry both together are even light.
    const Light left = make_light(RectLight{2.0f, 2.0f, half(true)}, translated({0, 0, 1}));
    const Light right = make_light(RectLight{2.0f, 2.0f, half(false)}, translated({0, 0, 1}));
    const double whole = kPiD * 4 * corner_factor(1, 1, 1);
    CHECK(irradiance_at({left, right}).x == doctest::Approx(whole).epsilon(3e-3));
    CHECK(irradiance_at({left}).x == doctest::Approx(whole / 2).epsilon(3e-3));
    // Seen from the side that shines with +y up, left is +x.
    CHECK(irradiance_at({left}, 1.0f).x > 1.5f * irradiance_at({left}, -1.0f).x);
    // A fine stripe is found by its image: the brute force over the rect.
    std::vector<Rgb> pixels(256, Rgb(0.0f));
    pixels[100] = Rgb(100.0f);
    const Light stripe = make_light(RectLight{2.0f, 2.0f, std::make_shared<LightImage>(256, 1, pixels, "/stripe")},
                                    translated({0, 0, 1}));
    const double x = 1.0 - 2.0 * 100.5 / 256.0;
    double expected = 0.0;
    for (int j = 0; j < 1000; ++j) {
        const double y = -1.0 + 2.0 * (j + 0.5) / 1000, d2 = x * x + y * y + 1.0;
        expected += 100.0 * (2.0 / 256.0) * (2.0 / 1000.0) / (d2 * d2);
    }
    CHECK(irradiance_at({stripe}).x == doctest::Approx(expected).epsilon(0.02));
}

TEST_CASE("light image: the density of sample() is the one that a ray finds") {
    std::vector<Rgb> pixels;
    for (int i = 0; i < 12; ++i) pixels.emplace_back(i % 5 == 1 ? -6.0f : float(i % 3));
    M44f scale;
    scale.setScale(V3f(1.0f, 0.5f, 2.0f));
    const WorldLight world(make_light(RectLight{1.5f, 2.0f, std::make_shared<LightImage>(4, 3, pixels, "/image")},
                                      scale * translated({0.2f, 0.1f, 0.9f})));
    const V3f position(0.0f);
    const auto sample = [&](const V2f& u, V3f& d) {
        LightSample s;
        world.sample(position, {&u, 1}, {&s, 1});
        d = s.direction;
        return s.pdf > 0.0f;
    };
    const auto pdf = [&](const V3f& d) {
        LightHit seen;
        return world.intersect(position, d, 1e9f, seen) ? double(seen.pdf) : 0.0;
    };
    const auto result = chi_square(sample, pdf, V3f(0, 0, 1), 1.0);
    CHECK(result.p_value > 1e-4);
    CHECK(result.mass == doctest::Approx(1.0).epsilon(0.02));
}

TEST_CASE("mesh light: a square of two triangles is a rect") {
    MeshLight mesh;
    mesh.mesh = std::make_shared<Mesh>(square(1.0f, 0.0f));
    M44f flip;  // faces down, at height 1.5
    flip[1][1] = flip[2][2] = -1.0f;
    Light light = make_light(mesh, flip * translated({0, 0, 1.5f}));
    const double expected = kPiD * 4 * corner_factor(1, 1, 1.5);
    CHECK(size_factor(light) == doctest::Approx(4.0));
    CHECK(irradiance_at({light}).x == doctest::Approx(expected).epsilon(2e-3));
    light.light_to_world = translated({0, 0, 1.5f});  // faces up
    CHECK(irradiance_at({light}).x == 0.0f);
    std::get<MeshLight>(light.shape).is_two_sided = true;
    CHECK(irradiance_at({light}).x == doctest::Approx(expected).epsilon(2e-3));
    std::get<MeshLight>(light.shape).triangle_factors =
        std::make_shared<const std::vector<Rgb>>(std::vector<Rgb>{Rgb(2.0f), Rgb(0.0f)});
    CHECK(irradiance_at({light}).x == doctest::Approx(expected).epsilon(2e-3));  // half of it, twice as bright
}

TEST_CASE("mesh light: the density of sample() is the one that a ray finds") {
    M44f scale;
    scale.setScale(V3f(1.0f, 0.5f, 2.0f));
    const M44f matrix = scale * translated({0.2f, 0.1f, 1.5f});
    const Light light = make_light(lantern(false), matrix);
    const WorldLight world(light);
    const RayScene scene({sphere(0.6f, 2)}, {{0, matrix}});
    const V3f position(0.0f);
    const auto sample = [&](const V2f& u, V3f& d) {
        LightSample s;
        world.sample(position, {&u, 1}, {&s, 1});
        d = s.direction;
        return s.pdf > 0.0f;
    };
    const auto pdf = [&](const V3f& d) {
        Hit hit;
        LightHit seen;
        return scene.intersect({position, d}, hit) && world.hit_triangle(hit.triangle, d, hit.t, seen)
                   ? double(seen.pdf)
                   : 0.0;
    };
    const auto result = chi_square(sample, pdf, V3f(0.2f, 0.3f, 1.0f).normalized(), 1.0);
    CHECK(result.p_value > 1e-4);
    CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.02));
    CHECK(result.hit_rate < 0.9);  // what lies on the far side is lost
}

TEST_CASE("light: bad shaping, shadows and meshes are refused by path and field") {
    const auto refuses = [](const Light& light, const char* message) {
        CHECK_THROWS_WITH_AS(check_light(light), doctest::Contains(message), ValueError);
    };
    Light light = make_light(DiskLight{});
    light.shaping.cone_angle = 200.0f;
    refuses(light, "/light: shaping:cone:angle must be in [0, 180] degrees, got 200");
    light.shaping = {};
    light.shaping.focus = -1.0f;
    refuses(light, "shaping:focus must be >= 0");
    light.shaping = {};
    light.shadow.falloff_gamma = 0.0f;
    refuses(light, "shadow:falloffGamma must be > 0");
    MeshLight mesh;
    refuses(make_light(mesh), "mesh must be given");
    mesh.mesh = std::make_shared<Mesh>(square(1.0f, 0.0f));
    mesh.triangle_factors = std::make_shared<const std::vector<Rgb>>(std::vector<Rgb>{Rgb(1.0f)});
    refuses(make_light(mesh), "triangle_factors must be one per triangle (2), got 1");
    mesh.triangle_factors = nullptr;
    Mesh flat = square(0.0f, 0.0f);
    mesh.mesh = std::make_shared<Mesh>(flat);
    CHECK_THROWS_WITH_AS(LightSampler({make_light(mesh)}), doctest::Contains("/light: area must be > 0"), ValueError);
    CHECK_THROWS_WITH_AS(LightImage(1, 1, {Rgb(NAN)}, "/card"), doctest::Contains("/card: pixels must be finite"),
                         ValueError);
    CHECK_THROWS_WITH_AS(LightImage(0, 1, {}, "/card"), doctest::Contains("/card: pixels must be width * height"),
                         ValueError);
}
