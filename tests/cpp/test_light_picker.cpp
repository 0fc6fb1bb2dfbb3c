// The choice among many lights: a distribution, the one that it tells, and quiet.
#include <doctest/doctest.h>

#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/base/sampler.h"
#include "frazil/lighting/group_balance.h"
#include "lights.h"

using namespace frazil;
using namespace frazil::test;

namespace {

float random_float(std::uint32_t i, std::uint32_t dimension) {
    return to_unit_float(hash(i, dimension));
}

// Small lights of all kinds, strewn over a slab above the floor, brightness varied; the same total power for any count.
std::vector<Light> swarm(std::uint32_t count) {
    std::vector<Light> lights;
    const float scale = 1.0f / std::sqrt(float(count));
    for (std::uint32_t i = 0; i < count; ++i) {
        M44f turn;
        turn.setAxisAngle(V3f(random_float(i, 7) - 0.5f, random_float(i, 8) - 0.5f, 0.1f).normalized(),
                          0.8f * random_float(i, 9));
        const V3f place(6.0f * random_float(i, 1) - 3.0f, 6.0f * random_float(i, 2) - 3.0f, 1.0f + random_float(i, 3));
        const M44f matrix = turn * translated(place);
        LightShape shape = SphereLight{0.1f * scale};
        if (i % 3 == 1) shape = DiskLight{0.15f * scale};
        if (i % 3 == 2) shape = RectLight{0.3f * scale, 0.2f * scale};
        lights.push_back(make_light(shape, matrix));
        lights.back().radiance = Rgb(10.0f * random_float(i, 4));
        if (i % 17 == 3) lights.back().radiance *= -1.0f;
        if (i % 5 == 4) lights.back().shaping.cone_angle = 40.0f;
    }
    return lights;
}

// Strings of lights along a coast: clusters of unlike size and strength, spots that point every way, the receivers among
// them.
std::vector<Light> strings(std::uint32_t count) {
    std::vector<Light> lights;
    const float scale = 1.0f / std::sqrt(float(count));
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::uint32_t cluster = i % 10;
        const float t = 2.0f * kPi * (float(cluster) + 0.8f * random_float(i, 31)) / 10.0f;
        const V3f place((2.0f + 0.2f * random_float(i, 32)) * std::cos(t),
                        (2.0f + 0.2f * random_float(i, 33)) * std::sin(t),
                        0.4f + 0.5f * random_float(cluster, 34) + 0.1f * random_float(i, 35));
        M44f turn;
        turn.setAxisAngle(
            V3f(random_float(i, 36) - 0.5f, random_float(i, 37) - 0.5f, random_float(i, 38) - 0.5f).normalized(),
            kPi * random_float(i, 39));
        LightShape shape = SphereLight{0.1f * scale};
        if (i % 2 == 1) shape = RectLight{0.3f * scale, 0.1f * scale};
        lights.push_back(make_light(shape, turn * translated(place)));
        lights.back().radiance = Rgb(std::pow(10.0f, 2.0f * random_float(i, 40)));
        if (i % 3 == 2) lights.back().shaping.cone_angle = 60.0f;
    }
    return lights;
}

// Relative deviation of single-sample estimates of E over points of the floor; lights that subtract are made to add, as
// signs are noise whatever the choice.
double noise(std::vector<Light> lights) {
    for (Light& light : lights) light.radiance.x = std::abs(light.radiance.x);
    const LightSampler sampler(lights);
    double variance = 0.0, mean = 0.0;
    constexpr std::uint32_t kPoints = 40, kSamples = 400;
    for (std::uint32_t p = 0; p < kPoints; ++p) {
        const LightReceiver receiver{V3f(4.0f * random_float(p, 11) - 2.0f, 4.0f * random_float(p, 12) - 2.0f, 0.0f),
                                     V3f(0, 0, 1), kNoObject};
        double sum = 0.0, squares = 0.0;
        for (std::uint32_t i = 0; i < kSamples; ++i) {
            Sampler random(hash(p, i), 0, 0);  // independent
            const float u = random.next_1d();
            const LightSample s = sampler.sample(receiver, u, random.next_2d());
            const double value = s.pdf > 0.0f ? double(s.radiance.x * std::max(0.0f, s.direction.z) / s.pdf) : 0.0;
            sum += value, squares += value * value;
        }
        mean += std::abs(sum) / kSamples;
        variance += (squares - sum * sum / kSamples) / (kSamples - 1);
    }
    return std::sqrt(variance / kPoints) / (mean / kPoints);
}

}  // namespace

TEST_CASE("light picker: probabilities sum to one, and are those of pick(), for receivers of all kinds") {
    std::vector<Light> all = swarm(500);
    all.push_back(make_light(DomeLight{}));
    all.push_back(make_light(DistantLight{}));
    const LightSampler sampler(all);
    std::vector<PickEntry> entries;
    for (int i = 0; i < int(all.size()); ++i) entries.push_back({i, i == 3 ? 50.0f : 1.0f});
    const LightPicker picker = sampler.make_picker(entries);
    for (const V3f& normal : {V3f(0, 0, 1), V3f(0, 0, -1), V3f(0.6f, 0, 0.8f), V3f(0.0f)}) {
        for (const V3f& position : {V3f(0.0f), V3f(0.5f, 0.5f, 1.5f), V3f(30.0f, -20.0f, 5.0f)}) {
            const LightReceiver receiver{position, normal, kNoObject};
            LightPicker::Weights weights;
            picker.weigh(receiver, weights);
            double total = 0.0;
            std::vector<double> expected;
            for (int i = 0; i < int(all.size()); ++i) {
                expected.push_back(double(picker.probability(receiver, weights, i)));
                total += expected.back();
            }
            CHECK(total == doctest::Approx(1.0).epsilon(1e-4));
            std::vector<double> counted(all.size(), 0.0);
            constexpr int kCount = 1 << 15;
            for (int i = 0; i < kCount; ++i) {
                const LightPick pick = picker.pick_one(receiver, weights, (float(i) + 0.5f) / kCount);
                REQUIRE(pick.light >= 0);
                CHECK(double(pick.probability) == doctest::Approx(expected[std::size_t(pick.light)]).epsilon(1e-3));
                counted[std::size_t(pick.light)] += 1.0 / kCount;
            }
            for (std::size_t i = 0; i < all.size(); ++i) CHECK(std::abs(counted[i] - expected[i]) < 2.5 / kCount);
        }
    }
}

TEST_CASE("light picker: several lights for one receiver, each as often as it is told") {
    std::vector<Light> lights = swarm(40);
    lights.push_back(make_light(DomeLight{}));
    lights.back().radiance = Rgb(0.05f);
    lights.push_back(make_light(DistantLight{1.0f}));
    for (std::size_t i = 0; i < lights.size(); ++i) lights[i].group = i % 7 == 0 ? "few" : "many";
    const LightSampler sampler(lights);
    for (const float asked : {1.0f, 1.5f, 3.0f, 8.0f}) {
        const LightReceiver receiver{V3f(0.3f, 0.2f, 0.0f), V3f(0, 0, 1), kNoObject, asked};
        std::vector<double> counted(lights.size(), 0.0), told(lights.size(), 0.0);
        std::size_t most = 0;
        constexpr int kCount = 1 << 14;
        std::vector<LightSample> samples;
        for (int i = 0; i < kCount; ++i) {
            sampler.sample(receiver, (float(i) + 0.5f) / kCount, V2f(0.5f), samples);
            most = std::max(most, samples.size());
            std::vector<int> twice;
            for (const LightSample& sample : samples) {
                const auto light = std::size_t(sample.light);
                CHECK(std::find(twice.begin(), twice.end(), sample.light) == twice.end());
                twice.push_back(sample.light);
                counted[light] += 1.0 / kCount;
                const LightSample alone = sampler.sample_one(sample.light, receiver.position, V2f(0.5f));
                told[light] = double(sample.pdf / alone.pdf);
            }
        }
        CHECK(double(most) < double(asked) + 2.5);
        for (std::size_t i = 0; i < lights.size(); ++i) CHECK(std::abs(counted[i] - told[i]) < 4.0 / kCount);
    }
}

TEST_CASE("light picker: no light that reaches a receiver is left out") {
    const std::vector<Light> lights = swarm(700);
    const LightSampler sampler(lights);
    std::vector<PickEntry> entries;
    for (int i = 0; i < int(lights.size()); ++i) entries.push_back({i, 1.0f});
    const LightPicker picker = sampler.make_picker(entries);
    for (std::uint32_t p = 0; p < 50; ++p) {
        const V3f position(6 * random_float(p, 21) - 3, 6 * random_float(p, 22) - 3, 3 * random_float(p, 23));
        const V3f normal =
            V3f(random_float(p, 24) - 0.5f, random_float(p, 25) - 0.5f, random_float(p, 26) - 0.5f).normalized();
        const LightReceiver receiver{position, normal, kNoObject};
        LightPicker::Weights weights;
        picker.weigh(receiver, weights);
        for (int light = 0; light < int(lights.size()); ++light) {
            bool reaches = false;
            for (std::uint32_t i = 0; i < 16; ++i) {
                Sampler random(1, 0, i);
                const LightSample s = sampler.sample_one(light, position, random.next_2d());
                reaches = reaches || (s.pdf > 0.0f && s.radiance.x != 0.0f && s.direction.dot(normal) > 1e-4f);
            }
            if (reaches) CHECK(picker.probability(receiver, weights, light) > 0.0f);
        }
    }
}

TEST_CASE("light picker: ten thousand lights are at most twice as noisy as ten") {
    const double ten = noise(swarm(10)), many = noise(swarm(10000));
    MESSAGE("noise of one sample: ten lights ", ten, ", ten thousand ", many);
    CHECK(many < 2.0 * ten);
    const double few = noise(strings(10)), strung = noise(strings(10000));
    MESSAGE("along a coast: ten lights ", few, ", ten thousand ", strung);
    CHECK(strung < 2.0 * few);
}

TEST_CASE("light picker: groups are asked as often as their light is uncertain, whatever their strength") {
    // A sun that a roof with a hole hides from most places, and an open sky.
    std::vector<Light> lights{make_light(DistantLight{1.0f}), make_light(DomeLight{})};
    lights[0].group = "sun", lights[1].group = "sky";
    const RayScene roof({square(1.0f, 5.0f)}, {{0, M44f()}});
    std::vector<LightReceiver> receivers;
    for (std::uint32_t i = 0; i < 400; ++i) {
        receivers.push_back(
            {V3f(2.4f * random_float(i, 51) - 1.2f, 2.4f * random_float(i, 52) - 1.2f, 0.0f), V3f(0, 0, 1), kNoObject});
    }
    const auto shares = [&](float sun, float sky, bool is_balanced) {
        lights[0].radiance = Rgb(sun), lights[1].radiance = Rgb(sky);
        LightSampler sampler(lights);
        if (is_balanced) balance_groups(sampler, roof, receivers);
        std::array<double, 2> result{};
        const LightReceiver receiver{V3f(0.1f, 0.2f, 0.0f), V3f(0, 0, 1), kNoObject};
        GroupPicker::Weights weights;
        sampler.picker(LightUse::surface).weigh(receiver, weights);
        for (int i = 0; i < 2; ++i) {
            result[std::size_t(i)] = double(sampler.picker(LightUse::surface).probability(receiver, weights, i));
        }
        return result;
    };
    CHECK(shares(1.0f, 1.0f, false)[0] == doctest::Approx(0.5));
    const auto even = shares(1.0f, 1.0f, true);
    CHECK(even[0] + even[1] == doctest::Approx(1.0));
    CHECK(even[0] > 0.55);
    CHECK(even[1] >= 0.25);
    for (const auto& [sun, sky] : {std::pair{1e4f, 1.0f}, {-0.35f, 20.0f}}) {
        const auto graded = shares(sun, sky, true);
        CHECK(graded[0] == doctest::Approx(even[0]).epsilon(1e-6));
        CHECK(graded[1] == doctest::Approx(even[1]).epsilon(1e-6));
    }
}

TEST_CASE(
    "light picker: balanced groups are picked as often as they are told, one after the other and several at a time") {
    std::vector<Light> lights = swarm(60);
    for (std::size_t i = 0; i < lights.size(); ++i) lights[i].group = i < 40 ? "a" : i < 50 ? "b" : i < 57 ? "c" : "d";
    LightSampler sampler(lights);
    std::vector<LightReceiver> receivers;
    for (std::uint32_t i = 0; i < 50; ++i) receivers.push_back({V3f(random_float(i, 61), 0.0f, 0.0f), V3f(0, 0, 1)});
    balance_groups(sampler, RayScene({}, {}), receivers);
    for (const float asked : {1.0f, 2.0f, 3.0f, 6.0f}) {
        const LightReceiver receiver{V3f(-2.0f, 1.5f, 0.0f), V3f(0, 0, 1), kNoObject, asked};
        std::vector<double> counted(lights.size(), 0.0);
        constexpr int kCount = 1 << 14;
        std::vector<LightSample> samples;
        for (int i = 0; i < kCount; ++i) {
            sampler.sample(receiver, (float(i) + 0.5f) / kCount, V2f(0.5f), samples);
            for (const LightSample& sample : samples) counted[std::size_t(sample.light)] += 1.0 / kCount;
        }
        GroupPicker::Weights weights;
        const GroupPicker& picker = sampler.picker(LightUse::surface);
        picker.weigh(receiver, weights);
        double total = 0.0;
        for (std::size_t i = 0; i < lights.size(); ++i) {
            const double told = double(picker.probability(receiver, weights, int(i)));
            total += told;
            CHECK(std::abs(counted[i] - told) < 4.0 / kCount);
        }
        if (asked <= 4.0f) CHECK(total == doctest::Approx(asked).epsilon(1e-3));
    }
}

TEST_CASE("light picker: shares of groups are less noisy than even ones") {
    // Ten lamps, a group each, along a floor under a dome; the noise of what one look at the lights gives.
    std::vector<Light> lights{make_light(DomeLight{})};
    lights[0].radiance = Rgb(0.02f);
    for (int i = 0; i < 10; ++i) {
        lights.push_back(make_light(SphereLight{0.05f}, translated({0.75f * float(i) - 3.4f, 0.0f, 0.4f})));
        lights.back().radiance = Rgb(10.0f);
        lights.back().group = str("lamp ", i);
    }
    LightSampler sampler(lights);
    std::vector<LightReceiver> receivers;
    for (std::uint32_t i = 0; i < 400; ++i) {
        receivers.push_back(
            {V3f(8.0f * random_float(i, 71) - 4.0f, 2.0f * random_float(i, 72) - 1.0f, 0.0f), V3f(0, 0, 1)});
    }
    const auto noise_of = [&](float picks) {
        double squares = 0.0, sum = 0.0;
        std::vector<LightSample> samples;
        for (std::size_t place = 0; place < receivers.size(); ++place) {
            LightReceiver receiver = receivers[place];
            receiver.picks = picks;
            constexpr int kCount = 64;
            double first = 0.0, second = 0.0;
            for (int i = 0; i < kCount; ++i) {
                Sampler random(7, std::uint32_t(kCount * place) + std::uint32_t(i), 0);
                const float u_pick = random.next_1d();
                sampler.sample(receiver, u_pick, random.next_2d(), samples);
                double light = 0.0;
                for (const LightSample& s : samples) {
                    if (s.pdf > 0.0f) light += double(s.radiance.x * std::max(0.0f, s.direction.z) / s.pdf);
                }
                first += light / kCount, second += light * light / kCount;
            }
            squares += second - first * first, sum += first;
        }
        return std::sqrt(squares * double(receivers.size())) / sum;
    };
    for (const float picks : {1.0f, 3.0f}) {
        sampler.picker(LightUse::surface).set_scales({});
        const double even = noise_of(picks);
        balance_groups(sampler, RayScene({}, {}), receivers);
        const double shared = noise_of(picks);
        MESSAGE(picks, " at a time: even ", even, ", by shares ", shared);
        CHECK(shared < 0.8 * even);
    }
}

TEST_CASE("crowd: a bake of many lights gives the sum of their own, and the same bits on two threads") {
    std::vector<Light> lights = swarm(400);
    IrradianceOptions options;
    options.samples = 1024;
    const RayScene roof({square(0.5f, 0.6f)}, {{0, M44f()}});
    double one_by_one = 0.0;
    for (const Light& light : lights) one_by_one += double(irradiance_at({light}, 0.4f, roof, options).x);
    CHECK(irradiance_at(lights, 0.4f, roof, options).x == doctest::Approx(one_by_one).epsilon(0.01));
    // Multipliers hold for each light, and groups keep their own.
    for (std::size_t i = 0; i < lights.size(); ++i) {
        lights[i].multipliers[int(LightComponent::translucency)] = i % 2 ? 3.0f : 0.0f;
        lights[i].group = i % 4 == 1 ? "odd" : "";
    }
    PointSet points;
    for (int i = 0; i < 300; ++i) {
        points.positions.emplace_back(float(i) * 0.01f, 0.0f, 0.0f);
        points.normals.emplace_back(0.0f, 0.0f, 1.0f);
    }
    options.samples = 16;
    const LightSampler sampler(lights);
    const auto bake = [&](int threads) {
        return with_threads(threads, [&] { return bake_irradiance(points, roof, sampler, full, options); });
    };
    const Irradiance one = bake(1), two = bake(2);
    CHECK(one.groups == 2);
    CHECK(one.values == two.values);
    CHECK(one.errors == two.errors);
    double expected = 0.0;
    options.samples = 1024;
    for (std::size_t i = 1; i < lights.size(); i += 4)
        expected += double(irradiance_at({lights[i]}, 0.4f, roof, options).x);
    options.samples = 4095;
    CHECK(bake_irradiance(one_point(V3f(0.4f, 0, 0), V3f(0, 0, 1)), roof, sampler, full, options).values[1].x ==
          doctest::Approx(expected).epsilon(0.02));
}

TEST_CASE("bake error: what is estimated is what is there, and a target is met") {
    const Light rect = make_light(RectLight{1.0f, 1.0f}, translated({0, 0, 1}));
    const LightSampler sampler({rect});
    const RayScene roof({square(0.2f, 0.4f)}, {{0, M44f()}});
    PointSet points;
    for (int i = 0; i < 200; ++i) {
        points.positions.emplace_back(float(i) * 0.005f - 0.5f, 0.1f, 0.0f);
        points.normals.emplace_back(0.0f, 0.0f, 1.0f);
    }
    IrradianceOptions options;
    options.samples = 1 << 14;
    options.seed = 77;
    const Irradiance truth = bake_irradiance(points, roof, sampler, full, options);
    const auto rms = [&](const Irradiance& baked) {
        double squares = 0.0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            squares += std::pow(double(baked.values[i].x) - double(truth.values[i].x), 2);
        }
        return std::sqrt(squares / double(points.size()));
    };
    const auto estimated = [&](const Irradiance& baked) {
        double squares = 0.0;
        for (const float error : baked.errors) squares += double(error) * double(error);
        return std::sqrt(squares / double(points.size()));
    };
    options.seed = 0;
    options.samples = 64;
    const Irradiance plain = bake_irradiance(points, roof, sampler, full, options);
    CHECK(estimated(plain) > 0.7 * rms(plain));
    CHECK(estimated(plain) < 4.0 * rms(plain));
    options.samples = 16;
    options.error = 0.01f;
    options.max_rounds = 256;
    const Irradiance adapted = bake_irradiance(points, roof, sampler, full, options);
    double largest = 0.0;
    for (const Rgb& value : truth.values) largest = std::max(largest, double(value.x));
    CHECK(rms(adapted) < 0.01 * largest);
    CHECK(adapted.rays > 2 * points.size() * 16);
    // Twins cancel to the bit whatever the rounds.
    Light twin = rect;
    twin.radiance = Rgb(-1.0f);
    const LightSampler both({rect, twin});
    for (const float error : {0.0f, 0.02f}) {
        options.error = error;
        for (const Rgb& value : bake_irradiance(points, roof, both, full, options).values) CHECK(value == Rgb(0.0f));
    }
}
