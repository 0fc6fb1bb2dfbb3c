#include <doctest/doctest.h>

#include <map>
#include <numeric>

#include "frazil/render/first_hits.h"

using namespace frazil;

namespace {

FirstHit seen(std::uint32_t object, const V3f& normal, float off = 0.0f) {
    FirstHit first;
    first.is_hit = first.is_noted = true;
    first.hit.placement = object;
    first.normal = normal;
    first.position = normal * off;
    first.footprint = 0.01f;
    return first;
}

}  // namespace

TEST_CASE("first hits: shaded samples stand for all of their kind, and for none of another") {
    const V3f up(0.0f, 1.0f, 0.0f), aside(1.0f, 0.0f, 0.0f);
    std::vector<FirstHit> hits;
    for (int i = 0; i < 40; ++i) hits.push_back(seen(0, up));
    for (int i = 0; i < 15; ++i) hits.push_back(seen(0, aside));     // round an edge
    for (int i = 0; i < 6; ++i) hits.push_back(seen(0, up, -1.0f));  // far below
    for (int i = 0; i < 2; ++i) hits.push_back(seen(1, up));         // another object
    hits.push_back({});                                              // nothing
    const auto kind = [](std::uint32_t i) { return i < 40 ? 0 : i < 55 ? 1 : i < 61 ? 2 : i < 63 ? 3 : 4; };
    for (const int wanted : {1, 4, 16, 64}) {
        for (std::uint32_t seed = 0; seed < 20; ++seed) {
            std::vector<ShadedSample> shaded;
            choose_shaded(hits, wanted, seed, shaded);
            std::map<int, float> stood_for;
            for (const auto& [sample, weight] : shaded) stood_for[kind(sample)] += weight;
            CHECK(stood_for == std::map<int, float>{{0, 40.0f}, {1, 15.0f}, {2, 6.0f}, {3, 2.0f}, {4, 1.0f}});
            CHECK(shaded.size() <= std::size_t(wanted) + 5);
        }
    }
}

TEST_CASE("first hits: every sample is as likely to be shaded as any other of its run") {
    const std::vector<FirstHit> hits(10, seen(0, V3f(0.0f, 1.0f, 0.0f)));
    std::vector<double> weight(10, 0.0);
    constexpr int kSeeds = 20000;
    for (std::uint32_t seed = 0; seed < kSeeds; ++seed) {
        std::vector<ShadedSample> shaded;
        choose_shaded(hits, 3, seed, shaded);
        for (const auto& [sample, samples] : shaded) weight[sample] += samples;
    }
    // A sample is shaded with the chance 1/weight of its run: five standard deviations.
    for (const double w : weight) CHECK(w / kSeeds == doctest::Approx(1.0).epsilon(5.0 * std::sqrt(3.0 / kSeeds)));
}
