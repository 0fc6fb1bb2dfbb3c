// Irradiance of every light against its closed form, and the bake's promises.
#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/parallel.h"
#include "frazil/lighting/bounce.h"
#include "frazil/lighting/irradiance.h"

using namespace frazil;

namespace {

constexpr double kPiD = 3.14159265358979323846;

PointSet one_point(const V3f& position, const V3f& normal) {
    PointSet points;
    points.positions = {position};
    points.normals = {normal};
    return points;
}

Rgb full(float) {
    return Rgb(1.0f);
}

Light make_light(LightShape shape, const M44f& matrix = M44f()) {
    Light light;
    light.path = "/light";
    light.shape = std::move(shape);
    light.light_to_world = matrix;
    return light;
}

M44f translated(const V3f& t) {
    M44f m;
    m.setTranslation(t);
    return m;
}

// E at a point with nothing in the way.
double irradiance(const std::vector<Light>& lights, const V3f& position, const V3f& normal, int samples = 4096) {
    const RayScene empty({}, {});
    IrradianceOptions options;
    options.samples = samples;
    options.seed = 3;
    const LightSampler sampler(lights);
    return bake_irradiance(one_point(position, normal), empty, sampler, full, options).values[0].x;
}

// Configuration factor from a differential patch to a parallel rectangle with one corner above it.
double corner_factor(double a, double b, double c) {
    const double x = a / c, y = b / c;
    return (x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)) +
            y / std::sqrt(1 + y * y) * std::atan(x / std::sqrt(1 + y * y))) /
           (2 * kPiD);
}

// Irradiance under a disk of radius r at height h, at lateral distance x, the patch parallel to it.
double disk_irradiance(double r, double h, double x) {
    const double z = h * h + x * x - r * r;
    return 0.5 * kPiD * (1.0 - z / std::sqrt((h * h + x * x + r * r) * (h * h + x * x + r * r) - 4 * x * x * r * r));
}

}  // namespace

TEST_CASE("irradiance: a uniform dome of radiance L gives pi L, whatever its rotation") {
    Light dome = make_light(DomeLight{});
    dome.radiance = Rgb(2.5f);
    CHECK(irradiance({dome}, V3f(1, 2, 3), V3f(0, 0.6f, 0.8f), 64) == doctest::Approx(2.5 * kPiD).epsilon(1e-5));
}

TEST_CASE("irradiance: a dome whose upper half shines gives the same on any slope as the tilted hemisphere") {
    // Rows above the horizon are 1: a patch tilted by t sees pi (1 + cos t) / 2.
    std::vector<Rgb> pixels(64 * 512, Rgb(0.0f));
    std::fill(pixels.begin(), pixels.begin() + 64 * 256, Rgb(1.0f));
    DomeLight dome{std::make_shared<Environment>(64, 512, pixels, "/dome")};
    for (const double tilt : {0.0, 0.7, 1.5, 2.5}) {
        const V3f normal(float(std::sin(tilt)), float(std::cos(tilt)), 0.0f);
        const double expected = kPiD * (1.0 + std::cos(tilt)) / 2.0;
        CHECK(irradiance({make_light(dome)}, V3f(0.0f), normal) == doctest::Approx(expected).epsilon(5e-3));
    }
}

TEST_CASE("irradiance: distant light, parallel and with an angle, normalized and not") {
    Light sun = make_light(DistantLight{0.0f});
    const V3f tilted(0.0f, 0.6f, 0.8f);  // the light comes from +z
    CHECK(irradiance({sun}, V3f(0.0f), tilted, 16) == doctest::Approx(0.8).epsilon(1e-5));
    CHECK(irradiance({sun}, V3f(0.0f), -tilted, 16) == 0.0);
    sun.shape = DistantLight{20.0f};
    const double size = kPiD * std::pow(std::sin(10.0 * kPiD / 180.0), 2);
    CHECK(irradiance({sun}, V3f(0.0f), tilted) == doctest::Approx(0.8 * size).epsilon(1e-4));
    sun.normalize = true;
    CHECK(irradiance({sun}, V3f(0.0f), tilted) == doctest::Approx(0.8).epsilon(1e-4));
    // Beyond a hemisphere: everything but a cone about -z; the patch facing +z sees all of it.
    sun.shape = DistantLight{300.0f};
    sun.normalize = false;
    CHECK(irradiance({sun}, V3f(0.0f), V3f(0, 0, 1)) == doctest::Approx(kPiD).epsilon(2e-3));
}

TEST_CASE("irradiance: a dome through a window of a closed room, with a portal there, without and with another one") {
    // A roof at height 1.5 with a window of 0.4 x 0.6 m above the point.
    Mesh roof;
    const auto add = [&](float x0, float x1, float y0, float y1) {
        const int first = int(roof.positions.size());
        roof.positions.insert(roof.positions.end(), {{x0, y0, 1.5f}, {x1, y0, 1.5f}, {x1, y1, 1.5f}, {x0, y1, 1.5f}});
        roof.triangles.push_back({first, first + 1, first + 2});
        roof.triangles.push_back({first, first + 2, first + 3});
    };
    add(-500.0f, -0.2f, -500.0f, 500.0f), add(0.2f, 500.0f, -500.0f, 500.0f);
    add(-0.2f, 0.2f, -500.0f, -0.3f), add(-0.2f, 0.2f, 0.3f, 500.0f);
    const RayScene room({roof}, {{0, M44f()}});
    M44f window, elsewhere;
    window.setScale(V3f(0.4f, 0.6f, 1.0f));
    elsewhere = window * translated({1.0f, 0.0f, 1.5f});
    window = window * translated({0.0f, 0.0f, 1.5f});
    const double expected = kPiD * 4 * corner_factor(0.2, 0.3, 1.5);
    const auto white = std::make_shared<Environment>(8, 4, std::vector<Rgb>(32, Rgb(1.0f)), "/white");
    IrradianceOptions options;
    for (const auto& image : {std::shared_ptr<const Environment>(), std::shared_ptr<const Environment>(white)}) {
        const auto error = [&](std::vector<M44f> portals, int samples) {
            options.samples = samples;
            double squares = 0.0;
            for (options.seed = 0; options.seed < 16; ++options.seed) {
                const LightSampler sampler({make_light(DomeLight{image, portals})});
                const double e =
                    bake_irradiance(one_point(V3f(0.0f), V3f(0, 0, 1)), room, sampler, full, options).values[0].x;
                squares += (e / expected - 1.0) * (e / expected - 1.0) / 16.0;
            }
            return std::sqrt(squares);
        };
        const double without = error({}, 256), with = error({window}, 256);
        CAPTURE(without);
        CAPTURE(with);
        CHECK(with < 0.15 * without);
        CHECK(error({window}, 1 << 14) < 3e-3);
        CHECK(error({elsewhere, window}, 1 << 14) < 5e-3);
        CHECK(error({elsewhere}, 1 << 16) < 0.02);  // a portal where nothing comes in loses no light elsewhere
    }
}

TEST_CASE("irradiance: rect light against the configuration factor, on and off its axis, scaled and turned") {
    // A rect of 2 x 3 m at height 1.5 above the origin shining down (-z).
    const Light rect = make_light(RectLight{2.0f, 3.0f}, translated({0.0f, 0.0f, 1.5f}));
    CHECK(irradiance({rect}, V3f(0.0f), V3f(0, 0, 1)) ==
          doctest::Approx(kPiD * 4 * corner_factor(1.0, 1.5, 1.5)).epsilon(1e-4));
    CHECK(irradiance({rect}, V3f(-1.0f, -1.5f, 0.0f), V3f(0, 0, 1)) ==
          doctest::Approx(kPiD * corner_factor(2.0, 3.0, 1.5)).epsilon(1e-4));
    CHECK(irradiance({rect}, V3f(0.0f, 0.0f, 3.0f), V3f(0, 0, -1)) == 0.0);  // behind
    // The same rect out of scale; turned by a quarter about y it shines along -x.
    M44f scale;
    scale.setScale(V3f(2.0f, 3.0f, 7.0f));
    const M44f moved = scale * translated({0.0f, 0.0f, 1.5f});
    CHECK(irradiance({make_light(RectLight{}, moved)}, V3f(0.0f), V3f(0, 0, 1)) ==
          doctest::Approx(kPiD * 4 * corner_factor(1.0, 1.5, 1.5)).epsilon(1e-4));
    M44f turn;
    turn.setAxisAngle(V3f(0, 1, 0), float(kPiD / 2));
    CHECK(irradiance({make_light(RectLight{}, moved * turn)}, V3f(0.0f), V3f(1, 0, 0)) ==
          doctest::Approx(kPiD * 4 * corner_factor(1.0, 1.5, 1.5)).epsilon(1e-4));
    // Far away it is a point: E = A / d².
    const Light far = make_light(RectLight{1e-3f, 1e-3f}, translated({0.0f, 0.0f, 100.0f}));
    CHECK(irradiance({far}, V3f(0.0f), V3f(0, 0, 1), 64) == doctest::Approx(1e-10).epsilon(1e-4));
}

TEST_CASE("irradiance: a sheared rect gives what its parallelogram's two triangles give") {
    M44f shear;
    shear[1][0] = 0.8f;  // y leans towards x
    const Light skew = make_light(RectLight{2.0f, 2.0f}, shear * translated({0.2f, -0.1f, 1.0f}));
    // Brute force over the parallelogram.
    double expected = 0.0;
    constexpr int kSteps = 600;
    for (int i = 0; i < kSteps; ++i) {
        for (int j = 0; j < kSteps; ++j) {
            const double s = 2.0 * (i + 0.5) / kSteps - 1.0, t = 2.0 * (j + 0.5) / kSteps - 1.0;
            const double x = s + 0.8 * t + 0.2, y = t - 0.1, d2 = x * x + y * y + 1.0;
            expected += 4.0 / (kSteps * kSteps) / (d2 * d2);
        }
    }
    CHECK(irradiance({skew}, V3f(0.0f), V3f(0, 0, 1)) == doctest::Approx(expected).epsilon(2e-4));
}

TEST_CASE("irradiance: disk light on and off its axis") {
    const Light disk = make_light(DiskLight{1.2f}, translated({0.0f, 0.0f, 0.9f}));
    for (const double x : {0.0, 0.5, 1.2, 4.0}) {
        CHECK(irradiance({disk}, V3f(float(x), 0.0f, 0.0f), V3f(0, 0, 1)) ==
              doctest::Approx(disk_irradiance(1.2, 0.9, x)).epsilon(2e-3));
    }
}

TEST_CASE("irradiance: sphere light above the horizon is pi L (r/d)² cos, and nothing from inside") {
    const Light sphere = make_light(SphereLight{0.7f}, translated({0.0f, 0.0f, 2.0f}));
    CHECK(irradiance({sphere}, V3f(0.0f), V3f(0, 0, 1)) == doctest::Approx(kPiD * 0.49 / 4).epsilon(1e-4));
    CHECK(irradiance({sphere}, V3f(0.0f), V3f(0, 0.6f, 0.8f)) == doctest::Approx(0.8 * kPiD * 0.49 / 4).epsilon(1e-4));
    CHECK(irradiance({sphere}, V3f(0.0f, 0.0f, 2.1f), V3f(0, 0, 1)) == 0.0);
    // An ellipsoid's silhouette: seen from afar along z, E = pi a b / d².
    M44f scale;
    scale.setScale(V3f(2.0f, 0.5f, 3.0f));
    const Light ellipsoid = make_light(SphereLight{0.1f}, scale * translated({0.0f, 0.0f, 500.0f}));
    CHECK(irradiance({ellipsoid}, V3f(0.0f), V3f(0, 0, 1)) == doctest::Approx(kPiD * 0.2 * 0.05 / 25e4).epsilon(2e-3));
}

TEST_CASE("irradiance: cylinder light, very long and very far") {
    // Infinite cylinder of radius r whose axis is at distance d above a patch facing it: E = pi L r / d.
    const Light tube = make_light(CylinderLight{4000.0f, 0.5f}, translated({0.0f, 0.0f, 2.0f}));
    CHECK(irradiance({tube}, V3f(0.0f), V3f(0, 0, 1), 1 << 17) == doctest::Approx(kPiD * 0.25).epsilon(5e-2));
    // Far from a short one: seen side on, E = 2 r length / d².
    const Light rod = make_light(CylinderLight{0.2f, 0.05f}, translated({0.0f, 0.0f, 200.0f}));
    CHECK(irradiance({rod}, V3f(0.0f), V3f(0, 0, 1)) == doctest::Approx(0.02 / 4e4).epsilon(1e-3));
}

TEST_CASE("irradiance: normalize divides by the world-space area") {
    M44f m;
    m.setScale(3.0f);
    m = m * translated({0.0f, 0.0f, 1000.0f});
    const struct {
        LightShape shape;
        double area, projected;
    } cases[] = {
        {RectLight{2.0f, 0.5f}, 9.0, 9.0},
        {DiskLight{0.5f}, 9 * 0.25 * kPiD, 9 * 0.25 * kPiD},
        {SphereLight{0.5f}, 9 * kPiD, 9 * 0.25 * kPiD},
        {CylinderLight{2.0f, 0.5f}, 9 * 2 * kPiD, 9 * 2.0},
    };
    for (const auto& c : cases) {
        Light light = make_light(c.shape, m);
        CHECK(size_factor(light) == doctest::Approx(c.area).epsilon(1e-5));
        light.normalize = true;
        CHECK(irradiance({light}, V3f(0.0f), V3f(0, 0, 1), 1024) ==
              doctest::Approx(c.projected / c.area * 1e-6).epsilon(1e-2));
    }
    CHECK(size_factor(make_light(DomeLight{}, m)) == 1.0);
    CHECK(size_factor(make_light(DistantLight{0.0f}, m)) == 1.0);
    CHECK(size_factor(make_light(DistantLight{360.0f}, m)) == doctest::Approx(2 * kPiD));
}

TEST_CASE("irradiance: transmittance weighs the angle of entry") {
    // T = cos under a uniform dome: ∫ cos² dw = 2 pi / 3.
    const RayScene empty({}, {});
    IrradianceOptions options;
    options.samples = 1024;
    const LightSampler dome({make_light(DomeLight{})});
    const auto baked = bake_irradiance(
        one_point(V3f(0.0f), V3f(0, 1, 0)), empty, dome, [](float c) { return Rgb(c); }, options);
    CHECK(baked.values[0].x == doctest::Approx(2 * kPiD / 3).epsilon(1e-4));
}

namespace {

// Two triangles of a square of side 2s in the plane z = height.
Mesh square(float s, float height) {
    Mesh mesh;
    mesh.positions = {{-s, -s, height}, {s, -s, height}, {s, s, height}, {-s, s, height}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

PointSet grid_of_points(int n) {
    PointSet points;
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) {
            points.positions.emplace_back(float(i) / float(n) - 0.5f, float(j) / float(n) - 0.5f, 0.0f);
            points.normals.emplace_back(0.0f, 0.0f, 1.0f);
        }
    }
    return points;
}

}  // namespace

TEST_CASE("irradiance: an occluder takes away exactly its configuration factor from a dome") {
    const RayScene scene({square(0.5f, 0.4f)}, {{0, M44f()}});
    IrradianceOptions options;
    options.samples = 1 << 14;
    const LightSampler dome({make_light(DomeLight{})});
    const auto baked = bake_irradiance(one_point(V3f(0.0f), V3f(0, 0, 1)), scene, dome, full, options);
    CHECK(baked.values[0].x == doctest::Approx(kPiD * (1 - 4 * corner_factor(0.5, 0.5, 0.4))).epsilon(2e-3));
    CHECK(baked.rays == 1 << 14);
}

TEST_CASE("irradiance: a point on the surface itself is not in its own shadow, at any scale") {
    for (const float scale : {1e-3f, 1.0f, 500.0f}) {
        Mesh mesh = square(scale, 0.0f);
        for (V3f& p : mesh.positions) p += V3f(3.0f, 7.0f, 11.0f) * scale;
        const RayScene scene({mesh}, {{0, M44f()}});
        const LightSampler dome({make_light(DomeLight{})});
        const auto baked = bake_irradiance(one_point(V3f(3.1f, 7.2f, 11.0f) * scale, V3f(0, 0, 1)), scene, dome, full);
        CHECK(baked.values[0].x == doctest::Approx(kPiD).epsilon(1e-4));
    }
}

TEST_CASE(
    "irradiance: groups in order of first appearance, each its own sum; a light's twin of opposite sign removes it") {
    Light key = make_light(RectLight{}, translated({0, 0, 1}));
    Light rim = make_light(SphereLight{0.3f}, translated({1, 0, 1}));
    Light sky = make_light(DomeLight{});
    key.group = "key", rim.group = "rim";
    Light anti = key;
    anti.radiance = -key.radiance;
    CHECK(light_groups({sky, key, rim, key}) == std::vector<std::string>{"", "key", "rim"});
    CHECK(light_groups({}) == std::vector<std::string>{""});

    const RayScene scene({square(0.2f, 0.3f)}, {{0, M44f()}});
    const PointSet points = grid_of_points(6);
    const auto all = bake_irradiance(points, scene, LightSampler({sky, key, rim}), full);
    REQUIRE(all.groups == 3);
    REQUIRE(all.values.size() == 36 * 3);
    // Each group is what its light gives alone, to the bit: the other lights do not change a light's samples.
    const auto key_alone = bake_irradiance(points, scene, LightSampler({key}), full);
    const auto rim_alone = bake_irradiance(points, scene, LightSampler({rim}), full);
    for (std::size_t i = 0; i < 36; ++i) {
        CHECK(all.values[3 * i + 1] == key_alone.values[i]);
        CHECK(all.values[3 * i + 2] == rim_alone.values[i]);
    }
    CHECK(all.values[1] != all.values[2]);

    for (const Rgb& value : bake_irradiance(points, scene, LightSampler({key, anti}), full).values) {
        CHECK(value == Rgb(0.0f));
    }
}

TEST_CASE("irradiance: a zero translucency multiplier traces no ray; others scale") {
    Light light = make_light(DomeLight{});
    light.multipliers[int(LightComponent::translucency)] = 0.0f;
    const RayScene empty({}, {});
    const PointSet points = grid_of_points(4);
    auto baked = bake_irradiance(points, empty, LightSampler({light}), full);
    CHECK(baked.rays == 0);
    CHECK(baked.values[5] == Rgb(0.0f));
    light.multipliers[int(LightComponent::translucency)] = -2.0f;
    baked = bake_irradiance(points, empty, LightSampler({light}), full);
    CHECK(baked.values[5].x == doctest::Approx(-2 * kPiD).epsilon(1e-4));
}

TEST_CASE("irradiance: the same bits for one thread and two") {
    std::vector<Rgb> pixels(32 * 16);
    for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = Rgb(float(i % 7), float(i % 5), 1.0f);
    const std::vector<Light> lights{make_light(DomeLight{std::make_shared<Environment>(32, 16, pixels, "/dome")}),
                                    make_light(RectLight{}, translated({0, 0, 1})),
                                    make_light(SphereLight{}, translated({2, 0, 1}))};
    const RayScene scene({square(0.2f, 0.3f)}, {{0, M44f()}});
    const PointSet points = grid_of_points(20);
    const LightSampler sampler(lights);
    const auto bake = [&](int threads) {
        return with_threads(threads, [&] { return bake_irradiance(points, scene, sampler, full); });
    };
    const auto one = bake(1), two = bake(2);
    REQUIRE(one.values.size() == two.values.size());
    bool is_equal = true;
    for (std::size_t i = 0; i < one.values.size(); ++i) is_equal = is_equal && one.values[i] == two.values[i];
    CHECK(is_equal);
    CHECK(one.rays == two.rays);
}

TEST_CASE("irradiance: bad options and points are refused") {
    const RayScene empty({}, {});
    const LightSampler none({});
    IrradianceOptions options;
    options.samples = 0;
    CHECK_THROWS_WITH_AS(bake_irradiance(PointSet(), empty, none, full, options),
                         doctest::Contains("samples must be in [1, 2^20], got 0"), ValueError);
    PointSet points;
    points.positions = {V3f(0.0f)};
    CHECK_THROWS_WITH_AS(bake_irradiance(points, empty, none, full), doctest::Contains("normals must be one per point"),
                         ValueError);
    points.normals = {V3f(0, 0, 1)};
    CHECK(bake_irradiance(points, empty, none, full).values == std::vector<Rgb>{Rgb(0.0f)});
}

namespace {

Mesh box(float s) {
    Mesh mesh;
    for (int i = 0; i < 8; ++i) mesh.positions.emplace_back(i & 1 ? s : -s, i & 2 ? s : -s, i & 4 ? s : -s);
    mesh.triangles = {{0, 1, 3}, {0, 3, 2}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                      {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 3, 7}, {1, 7, 5}};
    return mesh;
}

}  // namespace

TEST_CASE("bounce: walls of radiance 1 all around give pi, per group, and T weighs the entry") {
    const RayScene scene({box(1.0f)}, {{0, M44f()}});
    const PointSet points = grid_of_points(3);
    const BounceRadiance walls = [](std::size_t, std::span<const BounceHit> hits, std::span<Rgb> radiance) {
        for (std::size_t i = 0; i < hits.size(); ++i) {
            const V3f p(std::abs(hits[i].position.x), std::abs(hits[i].position.y), std::abs(hits[i].position.z));
            CHECK_UNARY(max_component(p) == doctest::Approx(1.0));
            radiance[2 * i] = Rgb(1.0f), radiance[2 * i + 1] = Rgb(-3.0f);
        }
    };
    const auto bounced = bake_bounce(points, scene, 2, walls, full);
    REQUIRE(bounced.values.size() == 18);
    CHECK(bounced.values[8].x == doctest::Approx(kPiD).epsilon(1e-5));
    CHECK(bounced.values[9].x == doctest::Approx(-3 * kPiD).epsilon(1e-5));
    const auto weighed = bake_bounce(points, scene, 2, walls, [](float c) { return Rgb(c); }, {1024});
    CHECK(weighed.values[0].x == doctest::Approx(2 * kPiD / 3).epsilon(1e-3));
    CHECK_THROWS_WITH_AS(bake_bounce(points, scene, 1, walls, full, {0}), doctest::Contains("samples"), ValueError);
}

TEST_CASE("bounce: a wall above wide snow under a uniform sky receives albedo pi / 2 from below") {
    const RayScene scene({square(1000.0f, 0.0f)}, {{0, M44f()}});
    const LightSampler sky({make_light(DomeLight{})});
    const PointSet wall = one_point(V3f(0, 0, 1), V3f(1, 0, 0));
    const auto snow = reflected_light(scene, sky, [](const BounceHit&) { return Rgb(0.8f, 0.5f, 0.0f); });
    const auto bounced = bake_bounce(wall, scene, 1, snow, full, {4096});
    CHECK(bounced.values[0].x == doctest::Approx(0.8 * kPiD / 2).epsilon(5e-3));
    CHECK(bounced.values[0].y == doctest::Approx(0.5 * kPiD / 2).epsilon(5e-3));
    CHECK(bounced.values[0].z == 0.0f);
    // A light told not to act on diffuse surfaces does not come back from them.
    Light off = make_light(DomeLight{});
    off.multipliers[int(LightComponent::diffuse)] = 0.0f;
    const LightSampler none({off});
    const auto dark = reflected_light(scene, none, [](const BounceHit&) { return Rgb(0.8f); });
    CHECK(bake_bounce(wall, scene, 1, dark, full, {64}).values[0] == Rgb(0.0f));
}

TEST_CASE("bounce: the same bits for one thread and two") {
    const RayScene scene({square(5.0f, -0.5f), square(0.3f, 0.4f)}, {{0, M44f()}, {1, M44f()}});
    const LightSampler sky({make_light(DomeLight{}), make_light(SphereLight{}, translated({2, 0, 1}))});
    PointSet points = grid_of_points(20);
    for (V3f& normal : points.normals) normal = -normal;
    const auto bake = [&](int threads) {
        return with_threads(threads, [&] {
            return bake_bounce(points, scene, 1,
                               reflected_light(scene, sky, [](const BounceHit&) { return Rgb(0.7f); }), full, {16});
        });
    };
    const auto one = bake(1), two = bake(2);
    CHECK(one.values == two.values);
    CHECK(one.values[30].x > 0.0f);
}
