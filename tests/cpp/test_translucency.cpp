#include <doctest/doctest.h>

#include <hwy/targets.h>

#include <cmath>
#include <cstring>

#include "frazil/base/parallel.h"
#include "frazil/translucency/gather_kernel.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {
namespace {

const Medium kMedium{Rgb(30.0f, 25.0f, 40.0f), Rgb(0.6f, 0.15f, 0.05f), 1.31f};

PointSet sphere_points(int count, float radius) {
    PointSet points;
    for (int k = 0; k < count; ++k) {
        const float z = 1.0f - 2.0f * (k + 0.5f) / count, rho = std::sqrt(1.0f - z * z);
        const float angle = std::fmod(2.39996323f * k, 2.0f * kPi);
        points.normals.push_back(V3f(rho * std::cos(angle), rho * std::sin(angle), z));
        points.positions.push_back(points.normals.back() * radius);
        points.areas.push_back(4.0f * kPi * radius * radius / count);
    }
    return points;
}

std::vector<Rgb> striped_irradiance(const PointSet& points, std::size_t groups) {
    std::vector<Rgb> out;
    for (const V3f& p : points.positions) {
        for (std::size_t g = 0; g < groups; ++g) out.push_back(Rgb(p.x > 0.1f * g ? 2.0f : 0.1f, 1.0f, 0.5f + p.y));
    }
    return out;
}

}  // namespace

TEST_CASE("kernel table: error under 1e-4 of the albedo, weighted by the energy of its ring; zero beyond its reach") {
    for (const Medium& medium :
         {kMedium, Medium{Rgb(1000.0f), Rgb(0.01f, 1.0f, 300.0f), 1.31f}, Medium{Rgb(30.0f), Rgb(0.0f), 1.0f}}) {
        for (const ProfileKind kind :
             {ProfileKind::dipole, ProfileKind::better_dipole, ProfileKind::normalized_diffusion,
              ProfileKind::photon_beam, ProfileKind::multiple_scattering}) {
            CAPTURE(name_of(kind));
            const Profile profile = make_profile(kind, medium);
            const KernelTable table = tabulate(profile);
            for (int c = 0; c < 3; ++c) {
                double worst = 0.0;
                for (double r = 1e-3 * bend_length(profile, c); r < table.reach; r *= 1.02) {
                    const double error = table.eval(c, static_cast<float>(r * r)).value - reflectance(profile, c, r);
                    worst = std::max(worst, std::abs(error) * 2.0 * kPi * r * r / albedo(profile, c));
                }
                CHECK(worst < 1e-4);
                CHECK(table.eval(c, 1.01f * table.reach * table.reach).value == 0.0f);
            }
        }
    }
}

namespace {

// Run the kernels for one instruction set, and for the best one again afterwards.
struct OnlyTarget {
    explicit OnlyTarget(std::int64_t target) { choose(target); }
    ~OnlyTarget() { choose(0); }
    static void choose(std::int64_t target) {
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    }
};

}  // namespace

TEST_CASE("gather kernel: SIMD equals the scalar path, for every instruction set of this processor") {
    std::vector<std::string> tried;
    const Profile profile = Dipole(kMedium);
    const KernelTable table = tabulate(profile);
    Ramp ramp{{0.0f, 0.05f, 0.3f}, {Rgb(1.0f, 0.0f, 0.2f), Rgb(0.3f, 1.0f, 0.5f), Rgb(2.0f)}, false};
    constexpr std::size_t groups = 5;
    SourceList list;
    const PointSet points = sphere_points(100, 0.2f);
    for (const V3f& p : points.positions) {
        list.powers.push_back(nullptr);
        list.sources.push_back({{p.x, p.y, p.z}, {1e-4f, 2e-4f, 1e-4f, 5e-5f, -3e-5f, 1e-5f}, 4e-4f, 0.005f});
        for (std::size_t g = 0; g < groups; ++g) {
            const float power = 0.01f * (1.0f + g) * (1.5f + p.z);
            list.own.push_back({{power, 2.0f * power, 3.0f * power}, {0.01f, -0.005f, 0.002f * g}});
        }
    }
    list.settle(groups);
    for (const std::int64_t target : {HWY_SSSE3, HWY_SSE4, HWY_AVX2, HWY_AVX3}) {
        if (!(hwy::SupportedTargets() & target)) continue;
        const OnlyTarget only(target);
        tried.push_back(simd_target());
        CAPTURE(tried.back());
        for (const RampHinges& hinges : {RampHinges{}, hinges_of(ramp, Rgb(1.0f, 2.0f, 0.5f))}) {
            BlockSums simd, scalar;
            for (BlockSums* block : {&simd, &scalar}) {
                block->lanes = 37;
                block->clear(groups);
                for (std::size_t lane = 0; lane < kBlockLanes; ++lane) block->x[lane] = 0.2f - 0.005f * lane;
            }
            add_sources(table, hinges, list, groups, simd);
            add_sources_scalar(table, hinges, list, groups, scalar);
            for (std::size_t lane = 0; lane < 37; ++lane) {
                for (std::size_t c = 0; c < 3; ++c) {
                    CHECK(simd.coverage[c][lane] == doctest::Approx(scalar.coverage[c][lane]).epsilon(1e-5));
                }
                for (std::size_t c = 0; c < 3 * groups; ++c) {
                    const std::size_t at = c * kBlockLanes + lane;
                    CHECK(simd.exitance[at] == doctest::Approx(scalar.exitance[at]).epsilon(1e-4));
                }
            }
        }
    }
    // Each was really another one.
    for (std::size_t i = 1; i < tried.size(); ++i) CHECK(tried[i] != tried[i - 1]);
    CHECK_FALSE(tried.empty());
}

TEST_CASE("point tree: the same bits for one thread and for four") {
    const PointSet points = sphere_points(20000, 0.3f);
    const auto gathered = [&](int threads) {
        return with_threads(threads, [&] {
            const PointTree tree(points, striped_irradiance(points, 2), 2, Dipole(kMedium));
            return tree.gather(points.positions.data(), points.size());
        });
    };
    const Gathered one = gathered(1), four = gathered(4);
    CHECK(std::memcmp(one.exitance.data(), four.exitance.data(), one.exitance.size() * sizeof(Rgb)) == 0);
    CHECK(std::memcmp(one.coverage.data(), four.coverage.data(), one.coverage.size() * sizeof(Rgb)) == 0);
}

TEST_CASE("point tree: a shading point's own place in the call does not matter beyond the tolerance") {
    const PointSet points = sphere_points(20000, 0.3f);
    const PointTree tree(points, striped_irradiance(points, 1), 1, Dipole(kMedium));
    const Gathered together = tree.gather(points.positions.data(), points.size());
    for (std::size_t k = 0; k < points.size(); k += 1999) {
        const Gathered alone = tree.gather(&points.positions[k], 1);
        for (int c = 0; c < 3; ++c) {
            CHECK(alone.exitance[0][c] == doctest::Approx(together.exitance[k][c]).epsilon(0.02));
        }
    }
}

}  // namespace frazil
