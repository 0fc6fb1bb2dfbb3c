#include <doctest/doctest.h>

#include <cmath>

#include "frazil/translucency/local_expansion.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {
namespace {

constexpr std::size_t kGroups = 3;

// Greatest error of the polynomial of `f` (row, place) over random places of a box.
template <class Function>
double greatest_error(const Box3f& box, const Function& f) {
    LocalExpansion expansion;
    BlockSums nodes;
    nodes.clear(kGroups);
    expansion.place(box, nodes);
    for (std::size_t j = 0; j < nodes.lanes; ++j) {
        const V3f p(nodes.x[j], nodes.y[j], nodes.z[j]);
        for (std::size_t k = 0; k < 3 * kGroups; ++k) nodes.exitance[k * kBlockLanes + j] = f(k, p);
        for (std::size_t c = 0; c < 3; ++c) nodes.coverage[c][j] = f(3 * kGroups + c, p);
    }
    expansion.fit(nodes, kGroups);
    std::vector<V3f> places;
    for (int i = 0; i < 200; ++i) {
        V3f u(std::fmod(0.7548776662f * i, 1.0f), std::fmod(0.5698402910f * i, 1.0f), std::fmod(0.618034f * i, 1.0f));
        places.push_back(box.min + box.size() * u);
    }
    SumRows sums;
    sums.reset(places.size(), kGroups);
    expansion.eval(places, sums);
    double error = 0.0;
    for (std::size_t i = 0; i < places.size(); ++i) {
        for (std::size_t k = 0; k < 3 * kGroups + 3; ++k) {
            error = std::max(error, std::abs(double(sums.exitance(i)[k]) - f(k, places[i])));
        }
    }
    return error;
}

}  // namespace

TEST_CASE("local expansion: quadratic sums are exact, in flat and thin boxes too") {
    const auto quadratic = [](std::size_t row, const V3f& p) {
        return 1.0f + row + p.x - 2.0f * p.y * p.z + row * p.x * p.x - p.z * p.y + 0.5f * p.x * p.z;
    };
    CHECK(greatest_error(Box3f(V3f(-1.0f, 0.5f, -0.2f), V3f(0.0f, 1.0f, 0.3f)), quadratic) < 3e-5);
    CHECK(greatest_error(Box3f(V3f(-1.0f, 0.5f, 0.25f), V3f(0.0f, 1.0f, 0.25f)), quadratic) < 3e-5);
    CHECK(greatest_error(Box3f(V3f(-1.0f, 0.5f, 0.0f), V3f(0.0f, 1.0f, 1e-39f)), quadratic) < 3e-5);
    CHECK(greatest_error(Box3f(V3f(0.1f), V3f(0.1f)), quadratic) < 3e-5);
}

TEST_CASE("local expansion: the error of other sums falls with the third power of the box") {
    const auto bent = [](std::size_t row, const V3f& p) { return std::exp(p.x + 0.3f * p.y - 0.1f * row * p.z); };
    const double large = greatest_error(Box3f(V3f(-0.4f), V3f(0.4f)), bent);
    const double small = greatest_error(Box3f(V3f(-0.1f), V3f(0.1f)), bent);
    CHECK(large < 0.04);
    CHECK(small < large / 40.0);
}

TEST_CASE("point tree: many shading points close together are as exact as one alone") {
    // Light with a hard edge through a plane, and shading points far closer together than a mean free path.
    PointSet points;
    constexpr int kSide = 150;
    for (int i = 0; i < kSide * kSide; ++i) {
        points.positions.push_back(V3f(i % kSide + 0.5f, i / kSide + 0.5f, 0.0f) / float(kSide) -
                                   V3f(0.5f, 0.5f, 0.0f));
        points.normals.push_back(V3f(0.0f, 0.0f, 1.0f));
        points.areas.push_back(1.0f / (kSide * kSide));
    }
    std::vector<Rgb> light;
    for (const V3f& p : points.positions) {
        light.push_back(p.x > 0.0f ? Rgb(3.0f, 2.0f, 1.0f) : Rgb(0.3f));
        light.push_back(p.y > 0.1f ? Rgb(1.0f) : Rgb(0.1f));
    }
    const Medium medium{Rgb(30.0f), Rgb(0.6f, 0.15f, 0.05f), 1.31f};
    const PointTree tree(points, light, 2, Dipole(medium));
    std::vector<V3f> places;
    for (int i = 0; i < 20000; ++i) {
        places.push_back(V3f(0.1f * std::fmod(0.7548776662f * i, 1.0f) - 0.05f,
                             0.1f * std::fmod(0.5698402910f * i, 1.0f) + 0.05f, 0.0f));
    }
    const Gathered out = tree.gather(places.data(), places.size(), {0.003f, Estimator::sum, false});
    double together = 0.0, alone = 0.0, worst = 0.0;
    for (std::size_t i = 0; i < places.size(); i += 400) {
        const Gathered exact = tree.gather_exact(&places[i], 1, Estimator::sum);
        const Gathered single = tree.gather(&places[i], 1, {0.003f, Estimator::sum, false});
        for (std::size_t k = 0; k < 6; ++k) {
            const double truth = exact.exitance[k / 3][k % 3];
            const double error = out.exitance[2 * i + k / 3][k % 3] / truth - 1.0;
            together += error * error / 300.0;
            alone += std::pow(single.exitance[k / 3][k % 3] / truth - 1.0, 2.0) / 300.0;
            worst = std::max(worst, std::abs(error));
        }
    }
    INFO("RMS together ", std::sqrt(together), ", alone ", std::sqrt(alone));
    CHECK(std::sqrt(together) < 1.3 * std::sqrt(alone));
    CHECK(std::sqrt(together) < 0.0045);
    CHECK(worst < 0.02);
}

}  // namespace frazil
