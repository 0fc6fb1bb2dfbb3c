// Light samplers: density, agreement of sample() and intersect(), choice among lights, refusals.
#include <doctest/doctest.h>

#include <array>
#include <cmath>

#include "chi_square.h"
#include "frazil/base/error.h"
#include "frazil/lighting/light_sampling.h"

using namespace frazil;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Light make_light(LightShape shape, const M44f& matrix = M44f()) {
    Light light;
    light.path = "/light";
    light.shape = std::move(shape);
    light.light_to_world = matrix;
    return light;
}

// A frame away from the origin, turned, scaled unevenly and sheared.
M44f awkward(bool is_even) {
    M44f scale, shear, turn, move;
    if (!is_even) {
        scale.setScale(V3f(1.3f, 0.7f, 2.0f));
        shear[1][0] = 0.4f, shear[2][1] = -0.3f;
    }
    turn.setAxisAngle(V3f(1, 2, 3).normalized(), 0.9f);
    move.setTranslation(V3f(0.4f, -0.3f, 1.1f));
    return scale * shear * turn * move;
}

std::shared_ptr<const Environment> sky_with_sun() {
    std::vector<Rgb> pixels(48 * 24, Rgb(0.2f, 0.3f, 0.5f));
    for (int y = 5; y < 8; ++y) {
        for (int x = 30; x < 34; ++x) pixels[std::size_t(y * 48 + x)] = Rgb(60.0f, 50.0f, 40.0f);
    }
    std::fill(pixels.begin() + 14 * 48, pixels.end(), Rgb(0.0f));
    return std::make_shared<Environment>(48, 24, pixels, "/sky");
}

// Two openings that light comes through to the origin's side, overlapping from there, and one that looks away.
std::vector<M44f> openings() {
    M44f wide, turned, away;
    wide.setScale(V3f(1.2f, 0.8f, 1.0f));
    turned.setAxisAngle(V3f(1, 2, 0).normalized(), 0.5f);
    away.setAxisAngle(V3f(1, 0, 0), kPi);
    const auto moved = [](const M44f& m, const V3f& to) {
        M44f move;
        move.setTranslation(to);
        return m * move;
    };
    M44f shear;
    shear[1][0] = 0.4f;
    return {moved(wide, {0.2f, 0.1f, 1.0f}), moved(shear * turned, {-0.5f, 0.3f, 0.7f}),
            moved(away, {0.0f, 0.0f, 2.0f})};
}

std::shared_ptr<const LightImage> stripes() {
    std::vector<Rgb> pixels;
    for (const float value : {0.2f, 3.0f, 0.5f, 1.0f, 0.0f, -2.0f}) pixels.emplace_back(value);
    return std::make_shared<LightImage>(3, 2, pixels, "/stripes");
}

struct Case {
    std::string name;
    Light light;
    V3f position;
};

std::vector<Case> cases() {
    const V3f near(0.1f, 0.2f, -0.9f), far(3.0f, -7.0f, -20.0f);
    std::vector<Case> result;
    for (const bool is_even : {true, false}) {
        for (const V3f& p : {near, far}) {
            const M44f m = awkward(is_even);
            result.push_back({"rect", make_light(RectLight{1.5f, 0.8f}, m), p});
            result.push_back({"rect with an image", make_light(RectLight{1.5f, 0.8f, stripes()}, m), p});
            result.push_back({"disk", make_light(DiskLight{0.6f}, m), p});
            result.push_back({"sphere", make_light(SphereLight{0.5f}, m), p});
            result.push_back({"cylinder", make_light(CylinderLight{1.5f, 0.4f}, m), p});
        }
        result.push_back({"dome", make_light(DomeLight{sky_with_sun()}, awkward(is_even)), near});
        result.push_back({"distant", make_light(DistantLight{40.0f}, awkward(is_even)), near});
    }
    result.push_back({"wide distant", make_light(DistantLight{260.0f}), near});
    result.push_back({"uniform dome", make_light(DomeLight{}), near});
    result.push_back({"uniform dome with portals", make_light(DomeLight{nullptr, openings()}), near});
    result.push_back({"dome", make_light(DomeLight{sky_with_sun(), openings()}, awkward(true)), near});
    return result;
}

}  // namespace

TEST_CASE("light: the density of sample() is the one it tells, and integrates to the share of samples not lost") {
    for (const Case& c : cases()) {
        const WorldLight light(c.light);
        const bool is_infinite =
            std::holds_alternative<DomeLight>(c.light.shape) || std::holds_alternative<DistantLight>(c.light.shape);
        // Cells over a cone about the light, so that a far one fills them too; the side that shines faces the point.
        V3f position = c.position;
        if (light.importance(position, V3f(0.0f)) == 0.0f)
            position = c.light.light_to_world.translation() * 2.0f - position;
        const auto sample = [&](const V2f& u, V3f& d) {
            LightSample s;
            light.sample(position, {&u, 1}, {&s, 1});
            d = s.direction;
            return s.pdf > 0.0f;
        };
        const auto pdf = [&](const V3f& d) {
            LightHit hit;
            return light.intersect(position, d, kInfinity, hit) ? double(hit.pdf) : 0.0;
        };
        V3f axis(0, 0, 1);
        double cap = 2.0;
        if (!is_infinite) {
            const auto reach = [&] {
                double result = 0.0;
                for (std::uint32_t i = 0; i < 4096; ++i) {
                    Sampler sampler(2, 0, i);
                    V3f d;
                    if (sample(sampler.next_2d(), d)) result = std::max(result, 0.5 * double((d - axis).length2()));
                }
                return result;
            };
            // Off centre, so that a round rim does not run along a ring of cells.
            axis = (c.light.light_to_world.translation() - position).normalized();
            axis = (axis + tangent_frame(axis).first * float(0.5 * std::sqrt(reach()))).normalized();
            cap = std::min(2.0, 1.1 * reach());
        }
        const auto result = test::chi_square(sample, pdf, axis, cap);
        CAPTURE(c.name);
        CAPTURE(position.x);
        CHECK(result.p_value > 1e-4);
        CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.02));
        CHECK(result.hit_rate == doctest::Approx(1.0));
    }
}

TEST_CASE("light: intersect() finds what sample() chose, with the same density, distance and radiance") {
    for (const Case& c : cases()) {
        const WorldLight light(c.light);
        V3f position = c.position;
        if (light.importance(position, V3f(0.0f)) == 0.0f)
            position = c.light.light_to_world.translation() * 2.0f - position;
        CAPTURE(c.name);
        int found = 0;
        for (std::uint32_t i = 0; i < 256; ++i) {
            Sampler sampler(5, 0, i);
            const V2f u = sampler.next_2d();
            LightSample s;
            light.sample(position, {&u, 1}, {&s, 1});
            REQUIRE(s.pdf > 0.0f);
            CHECK(s.direction.length() == doctest::Approx(1.0).epsilon(1e-5));
            LightHit hit;
            if (!light.intersect(position, s.direction, kInfinity, hit)) continue;  // a rounding at the rim
            ++found;
            // A sampler's density may jump at a pixel's edge: allow a few there.
            if (std::abs(hit.pdf - s.pdf) > 0.02f * s.pdf && c.name == "dome") continue;
            CHECK(hit.pdf == doctest::Approx(double(s.pdf)).epsilon(2e-2));
            if (s.distance < kInfinity) CHECK(hit.distance == doctest::Approx(double(s.distance)).epsilon(1e-3));
            CHECK(hit.radiance.x == doctest::Approx(double(s.radiance.x)).epsilon(2e-2).scale(0.1));
        }
        CHECK(found >= 240);
    }
}

TEST_CASE("light: a dome's portals take most samples, none where they look away or are behind") {
    M44f up;
    up.setTranslation(V3f(0.0f, 0.0f, 1.0f));
    const WorldLight light(make_light(DomeLight{nullptr, {up}}));
    const auto share = [&](const V3f& position) {
        int through = 0;
        for (std::uint32_t i = 0; i < 1024; ++i) {
            Sampler sampler(3, 0, i);
            const V2f u = sampler.next_2d();
            LightSample s;
            light.sample(position, {&u, 1}, {&s, 1});
            const V3f at = position + s.direction * ((1.0f - position.z) / s.direction.z);
            through += s.direction.z * (1.0f - position.z) > 0.0f && std::abs(at.x) < 0.5f && std::abs(at.y) < 0.5f;
        }
        return through / 1024.0;
    };
    CHECK(light.has_portal_before(V3f(0.0f)));
    CHECK(share(V3f(0.0f)) > 0.74);
    CHECK(!light.has_portal_before(V3f(0.0f, 0.0f, 2.0f)));
    CHECK(share(V3f(0.0f, 0.0f, 2.0f)) < 0.1);
    M44f flat;
    flat[0][0] = 0.0f;
    CHECK_THROWS_WITH_AS(WorldLight(make_light(DomeLight{nullptr, {flat}})),
                         doctest::Contains("/light: portals must be invertible"), ValueError);
}

TEST_CASE("light: nothing shines backwards, nor out of the inside of a sphere or cylinder") {
    M44f m;
    const V2f u(0.3f, 0.6f);
    const auto is_dark = [&](const LightShape& shape, const V3f& position, const V3f& direction) {
        const WorldLight light(make_light(shape, m));
        LightSample s;
        light.sample(position, {&u, 1}, {&s, 1});
        LightHit hit;
        return s.pdf == 0.0f && !light.intersect(position, direction, kInfinity, hit);
    };
    // At the origin, shining down -z: dark from above.
    CHECK(is_dark(RectLight{}, V3f(0, 0, 1), V3f(0, 0, -1)));
    CHECK(!is_dark(RectLight{}, V3f(0, 0, -1), V3f(0, 0, 1)));
    CHECK(is_dark(DiskLight{}, V3f(0, 0, 1), V3f(0, 0, -1)));
    CHECK(!is_dark(DiskLight{}, V3f(0, 0, -1), V3f(0, 0, 1)));
    CHECK(is_dark(SphereLight{}, V3f(0.1f), V3f(0, 0, 1)));
    CHECK(is_dark(CylinderLight{}, V3f(0.1f), V3f(0, 0, 1)));
    // Through the open end of a cylinder one sees its inner side, which is dark.
    CHECK(!WorldLight(make_light(CylinderLight{2.0f, 0.5f}, m))
               .intersect(V3f(3, 0.1f, 0), V3f(-1, 0, 0), kInfinity, *std::make_unique<LightHit>()));
    // A mirrored transform does not turn the shining side: it follows -z.
    m.setScale(V3f(-1, 1, 1));
    CHECK(!is_dark(RectLight{}, V3f(0, 0, -1), V3f(0, 0, 1)));
    m.setScale(V3f(1, 1, -1));
    CHECK(is_dark(RectLight{}, V3f(0, 0, -1), V3f(0, 0, 1)));
}

TEST_CASE("light sampler: pdf holds the pick, unbiased over lights of all kinds; sample and intersect agree") {
    M44f up;
    up.setTranslation(V3f(0, 0, 2));
    std::vector<Light> lights{make_light(RectLight{}, up), make_light(SphereLight{0.2f}, up),
                              make_light(DomeLight{sky_with_sun()}), make_light(DistantLight{30.0f})};
    lights[1].radiance = Rgb(-4.0f);
    const LightSampler sampler(lights);
    const V3f position(0.3f, 0.1f, 0.0f), normal(0, 0, 1);
    double picked = 0.0, expected = 0.0;
    constexpr std::uint32_t kCount = 1 << 16;
    for (std::uint32_t i = 0; i < kCount; ++i) {
        Sampler random(9, 1, i);
        const float u_pick = random.next_1d();
        const V2f u = random.next_2d();
        const LightSample s = sampler.sample(position, u_pick, u);
        const float cosine = std::max(0.0f, s.direction.dot(normal));
        if (s.pdf > 0.0f) picked += double(s.radiance.x * cosine / s.pdf);
        for (int light = 0; light < 4; ++light) {
            const LightSample one = sampler.sample_one(light, position, u);
            CHECK_UNARY(one.light == light);
            expected += double(one.radiance.x * std::max(0.0f, one.direction.dot(normal)) / one.pdf);
        }
        if (i < 256) {
            std::vector<LightHit> hits;
            sampler.intersect(position, s.direction, kInfinity, hits);
            for (const LightHit& hit : hits) {
                if (hit.light == s.light && hit.light != 2)
                    CHECK(hit.pdf == doctest::Approx(double(s.pdf)).epsilon(0.01));
            }
        }
    }
    CHECK(picked / kCount == doctest::Approx(expected / kCount).epsilon(0.01));
}

TEST_CASE("light sampler: many receivers at once get what each gets alone") {
    M44f up;
    up.setTranslation(V3f(0, 0, 2));
    std::vector<Light> lights{make_light(RectLight{}, up), make_light(DomeLight{sky_with_sun()}),
                              make_light(DistantLight{30.0f})};
    lights[1].multipliers[int(LightComponent::translucency)] = 0.5f;
    const LightSampler sampler(lights);
    std::vector<LightReceiver> receivers;
    std::vector<float> u_pick;
    std::vector<V2f> u;
    for (std::uint32_t i = 0; i < 301; ++i) {
        Sampler random(3, 1, i);
        receivers.push_back({V3f(0.01f * float(i), 0.1f, 0.0f), V3f(0, 0, 1), 0});
        u_pick.push_back(random.next_1d());
        u.push_back(random.next_2d());
    }
    std::vector<LightSample> together(receivers.size());
    sampler.sample_many(receivers, u_pick, u, together, LightUse::translucency);
    std::array<int, 3> of_light{};
    for (std::size_t i = 0; i < receivers.size(); ++i) {
        const LightSample alone = sampler.sample(receivers[i], u_pick[i], u[i], LightUse::translucency);
        REQUIRE(together[i].light == alone.light);
        CHECK(together[i].direction == alone.direction);
        CHECK(together[i].radiance == alone.radiance);
        CHECK(together[i].pdf == alone.pdf);
        CHECK(together[i].distance == alone.distance);
        ++of_light[std::size_t(alone.light)];
    }
    for (const int count : of_light) CHECK(count > 10);
}

TEST_CASE("light sampler: lights without a share are never picked; parallel light is a delta") {
    M44f up;
    up.setTranslation(V3f(0, 0, 2));
    Light off = make_light(RectLight{}, up);
    off.multipliers[int(LightComponent::diffuse)] = off.multipliers[int(LightComponent::specular)] = 0.0f;
    const LightSampler sampler({off, make_light(DistantLight{0.0f})});
    for (std::uint32_t i = 0; i < 64; ++i) {
        const LightSample s = sampler.sample(V3f(0.0f), float(i) / 64.0f, V2f(0.5f));
        CHECK(s.light == 1);
        CHECK(s.is_delta);
        CHECK(s.pdf == 1.0f);
    }
    std::vector<LightHit> hits;
    sampler.intersect(V3f(0.0f), V3f(0, 0, 1), kInfinity, hits);
    REQUIRE(hits.size() == 1);  // the rect, still visible; a parallel light has no extent
    CHECK(hits[0].pdf == 0.0f);
    CHECK(LightSampler({}).sample(V3f(0.0f), 0.5f, V2f(0.5f)).pdf == 0.0f);
    CHECK(LightSampler({off}).sample(V3f(0.0f), 0.5f, V2f(0.5f)).pdf == 0.0f);
}

TEST_CASE("light sampler: t_max hides what lies beyond; background is the dome alone") {
    M44f up;
    up.setTranslation(V3f(0, 0, 2));
    Light dome = make_light(DomeLight{});
    dome.radiance = Rgb(0.25f, 0.5f, 1.0f);
    const LightSampler sampler({make_light(RectLight{}, up), dome});
    std::vector<LightHit> hits;
    sampler.intersect(V3f(0.0f), V3f(0, 0, 1), 1.9f, hits);
    CHECK(hits.empty());
    sampler.intersect(V3f(0.0f), V3f(0, 0, 1), 2.1f, hits);
    CHECK(hits.size() == 1);
    hits.clear();
    sampler.intersect(V3f(0.0f), V3f(0, 0, 1), kInfinity, hits);
    CHECK(hits.size() == 2);
    CHECK(sampler.background(V3f(0, 0, 1)) == Rgb(0.25f, 0.5f, 1.0f));
}

TEST_CASE("light: bad values are refused by path and field") {
    const auto refuses = [](Light light, const char* message) {
        CHECK_THROWS_WITH_AS(check_light(light), doctest::Contains(message), ValueError);
    };
    refuses(make_light(RectLight{0.0f, 1.0f}), "/light: width must be > 0 and finite, got 0");
    refuses(make_light(RectLight{1.0f, -2.0f}), "height");
    refuses(make_light(DiskLight{NAN}), "radius");
    refuses(make_light(SphereLight{kInfinity}), "radius");
    refuses(make_light(CylinderLight{0.0f, 1.0f}), "length");
    refuses(make_light(DistantLight{-1.0f}), "angle must be in [0, 360]");
    Light light = make_light(RectLight{});
    light.radiance.y = NAN;
    refuses(light, "radiance must be finite");
    light = make_light(RectLight{});
    light.multipliers[2] = kInfinity;
    refuses(light, "multipliers must be finite");
    light = make_light(SphereLight{});
    light.light_to_world.setScale(V3f(1, 0, 1));
    refuses(light, "transform must be invertible");
    light.light_to_world[3][0] = NAN;
    refuses(light, "transform must be finite");
    light = make_light(RectLight{});
    light.light_to_world.setScale(1e-4f);  // small is not singular
    CHECK_NOTHROW(check_light(light));
}
