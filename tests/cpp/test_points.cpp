// The parts that Poisson points are made of, each against what it must give exactly.
#include <doctest/doctest.h>

#include <hwy/targets.h>

#include <bit>
#include <cstring>
#include <string>

#include "frazil/base/error.h"
#include "frazil/base/random.h"
#include "frazil/points/exact_shares.h"
#include "frazil/points/neighbourhood.h"
#include "frazil/points/patch_kernel.h"
#include "frazil/points/poisson.h"
#include "frazil/points/side.h"
#include "frazil/points/tile_grid.h"

using namespace frazil;

namespace {

Mesh tilted_triangle() {
    Mesh mesh;
    mesh.positions = {{0.1f, 0.2f, 0.3f}, {9.0f, 1.0f, 2.0f}, {2.0f, 7.0f, 5.0f}};
    mesh.triangles = {{0, 1, 2}};
    return mesh;
}

// The areas of all patches of a mesh, by its tiles; every corner must be within the patch's radius.
double area_of_patches(const Mesh& mesh, const SpacingField& spacing, double tile_width) {
    const TileGrid grid = make_tile_grid(mesh, spacing, tile_width, 1000000);
    double area = 0.0;
    for (std::size_t tile = 0; tile < grid.count(); ++tile) {
        std::vector<Patch> patches;
        for (std::size_t i = grid.starts[tile]; i < grid.starts[tile + 1]; ++i) {
            append_patches(mesh, spacing, grid.frame(tile, spacing.constant), grid.triangles[i], patches);
        }
        for (const Patch& patch : patches) {
            area += patch.area;
            CHECK(patch.radius <= kPatchWidth * std::sqrt(0.5) * 1.0001);
            CHECK(patch.axes[0].cross(patch.axes[1]).dot(patch.normal) > 0.9999f);
            for (int k = 0; k < kMostCorners; ++k) {
                CHECK(std::hypot(patch.x[k], patch.y[k]) <= patch.radius);
                // In the box that the grid tells.
                const V3f corner = patch.center + patch.axes[0] * patch.x[k] + patch.axes[1] * patch.y[k];
                const TileFrame frame = grid.frame(tile, spacing.constant);
                const V3d low = frame.to_local(grid.boxes[tile].min), high = frame.to_local(grid.boxes[tile].max);
                for (int axis = 0; axis < 3; ++axis) {
                    CHECK(corner[axis] >= low[axis] - 1e-4);
                    CHECK(corner[axis] <= high[axis] + 1e-4);
                }
            }
        }
    }
    return area;
}

// A patch and points around it, entered into a neighbourhood that reaches all of them.
struct PatchAmongPoints {
    Mesh mesh = tilted_triangle();
    TileFrame frame = {V3d(0.0), 12.0, V3i(0), 1.0};
    Patch patch;
    std::vector<Patch> patches;
    Neighbourhood near;
    Candidates candidates;

    PatchAmongPoints(std::uint32_t seed, int count, const std::vector<float>* spacing = nullptr) {
        mesh.positions = {{4.0f, 4.0f, 4.0f}, {6.2f, 4.5f, 4.1f}, {4.8f, 6.0f, 5.0f}};
        append_patches(mesh, {spacing ? 10.0 : 1.0, spacing}, frame, 0, patches);
        REQUIRE(patches.size() == 1);
        patch = patches[0];
        patches[0].largest_spacing = 4.0f;
        near.reset(patches, 0.0, kSameSideCosine);
        const auto random = [&] { return to_unit_float(hash(seed++)) * 4.0f - 2.0f; };
        for (int i = 0; i < count; ++i) {
            const V3f place =
                patch.center + patch.axes[0] * random() + patch.axes[1] * random() + patch.normal * (0.1f * random());
            near.add(place, patch.normal, place);
        }
        candidates = near.candidates(0);
    }

    V3f at(float x, float y) const { return patch.center + patch.axes[0] * x + patch.axes[1] * y; }
    std::uint32_t nearest(const V3f& place) const {
        std::uint32_t best = 0;
        for (std::uint32_t i = 1; i < near.size(); ++i) {
            if ((near.worlds[i] - place).length2() < (near.worlds[best] - place).length2()) best = i;
        }
        return best;
    }
};

// The place of the patch's triangle with these weights of the second and third corner.
V2f place_in(const Patch& patch, float u, float v) {
    return V2f(patch.x[0], patch.y[0]) * (1 - u - v) + V2f(patch.x[1], patch.y[1]) * u +
           V2f(patch.x[2], patch.y[2]) * v;
}

}  // namespace

TEST_CASE("patches of all tiles are the triangle, once") {
    const Mesh mesh = tilted_triangle();
    for (const double spacing : {0.05, 0.3, 2.0, 50.0}) {
        CHECK(area_of_patches(mesh, {spacing, nullptr}, 1.0) == doctest::Approx(surface_area(mesh)).epsilon(1e-9));
    }
}

TEST_CASE("a face in the plane between two tiles belongs to one of them") {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 8}};
    mesh.triangles = {{0, 1, 2}};
    TileGrid grid = make_tile_grid(mesh, {1.0, nullptr}, 1.0, 1000);
    for (V3f& p : mesh.positions) p.z += float(grid.origin.z + grid.size);
    for (const double spacing : {0.1, 1.0}) {
        CHECK(area_of_patches(mesh, {spacing, nullptr}, 1.0) == doctest::Approx(0.5).epsilon(1e-9));
    }
}

TEST_CASE("shares of a patch are what is nearest to each point, in floats and in double") {
    for (const int count : {1, 2, 5, 12, 40}) {
        PatchAmongPoints scene(std::uint32_t(count), count);
        std::vector<Share> exact, quick;
        std::vector<ExactGap> gaps;
        Gap gap;
        share_exactly(scene.patch, scene.frame, scene.candidates, scene.near.worlds, -1.0, exact, gaps);
        REQUIRE(share_patch(scene.patch, scene.candidates, quick, gap));

        // By counting.
        std::vector<double> counted(scene.near.size(), 0.0);
        constexpr int kSteps = 300;
        double farthest = 0.0;
        for (int i = 0; i < kSteps; ++i) {
            for (int k = 0; k + i < kSteps; ++k) {
                const V2f place = place_in(scene.patch, (i + 0.33f) / kSteps, (k + 0.33f) / kSteps);
                const std::uint32_t owner = scene.nearest(scene.at(place.x, place.y));
                counted[owner] += 2.0 / (kSteps * (kSteps + 1.0));
                farthest = std::max<double>(farthest, (scene.near.worlds[owner] - scene.at(place.x, place.y)).length());
            }
        }
        double total = 0.0, exact_total = 0.0;
        for (const Share& share : quick) total += share.weight;
        for (const Share& share : exact) exact_total += share.weight;
        CHECK(total * 0.5 == doctest::Approx(scene.patch.area).epsilon(1e-5));
        CHECK(exact_total * 0.5 == doctest::Approx(scene.patch.area).epsilon(1e-5));
        for (const Share& share : quick)
            CHECK(share.weight / total == doctest::Approx(counted[share.point]).epsilon(0.02));
        for (const Share& share : exact) {
            CHECK(share.weight / total == doctest::Approx(counted[share.point]).epsilon(0.02));
        }
        // The farthest corner is as far as the farthest place, and where it says it is.
        CHECK(1.0 + gaps[0].excess == doctest::Approx(farthest).epsilon(0.02));
        CHECK(1.0 + gaps[0].excess >= farthest - 1e-5);
        CHECK(std::sqrt(1.0 + gap.excess2) == doctest::Approx(1.0 + gaps[0].excess).epsilon(1e-5));
        CHECK(gap.open < 1e-5f);
        if (gap.excess2 <= 0.0f) continue;
        const V3f there = scene.at(gap.corner.x, gap.corner.y);
        CHECK((scene.near.worlds[scene.nearest(there)] - there).length2() ==
              doctest::Approx(1.0 + gap.excess2).epsilon(1e-4));
        // A place further in is still as far from its point as the spacing.
        for (const float random : {0.0f, 0.3f, 0.999f}) {
            const V2f inside = gap.place(random);
            const V3f place = scene.at(inside.x, inside.y);
            CHECK((scene.near.worlds[scene.nearest(place)] - place).length() >= 1.0f - 1e-5f);
            if (random > 0.0f) CHECK((inside - gap.corner).length() > 1e-3f);
        }
    }
}

TEST_CASE("where spacing varies, shares and the largest gap are those of doubles") {
    const std::vector<float> spacing = {0.9f, 1.3f, 1.1f};
    int gaps_found = 0;
    for (std::uint32_t seed = 0; seed < 200; ++seed) {
        PatchAmongPoints scene(seed * 1000, 1 + seed % 14, &spacing);
        std::vector<Share> exact, quick;
        std::vector<ExactGap> gaps;
        Gap gap;
        share_exactly(scene.patch, scene.frame, scene.candidates, scene.near.worlds, -1.0, exact, gaps);
        REQUIRE(share_patch(scene.patch, scene.candidates, quick, gap));
        std::vector<float> weights(scene.near.size(), 0.0f);
        for (const Share& share : quick) weights[share.point] += share.weight;
        for (const Share& share : exact) weights[share.point] -= share.weight;
        for (const float weight : weights) CHECK(std::abs(weight) < 2e-5f);
        // The exact one looks for the largest part of the spacing, the other for the largest difference of squares.
        double most = -1e30;
        for (const ExactGap& at : gaps) {
            const V2f place(float(at.x), float(at.y));
            const double local = scene.patch.center_spacing + scene.patch.spacing_slope.dot(place);
            most = std::max(most, ((1.0 + at.excess) * (1.0 + at.excess) - 1.0) * local * local);
        }
        CHECK(gap.excess2 == doctest::Approx(most).epsilon(1e-4));
        gaps_found += gap.excess2 > 0.0f;
    }
    CHECK(gaps_found > 50);
}

TEST_CASE("a sliver is shared out as in double, to its last part in a thousand") {
    for (std::uint32_t seed = 0; seed < 300; ++seed) {
        std::uint32_t state = seed * 1000;
        const auto random = [&] { return to_unit_float(hash(state++)); };
        const float height = std::pow(10.0f, -6.0f * random());
        Mesh mesh;
        mesh.positions = {{4.0f, 4.0f, 4.0f}, {6.5f, 4.0f, 4.0f}, {4.0f + 2.5f * random(), 4.0f + height, 4.0f}};
        mesh.triangles = {{0, 1, 2}};
        const TileFrame frame = {V3d(0.0), 12.0, V3i(0), 1.0};
        std::vector<Patch> patches;
        append_patches(mesh, {1.0, nullptr}, frame, 0, patches);
        REQUIRE(patches.size() == 1);
        Neighbourhood near;
        near.reset(patches, 0.0, kSameSideCosine);
        for (int i = 0; i < 5; ++i) {
            const V3f place(3.5f + 3.5f * random(), 4.0f + height * random(), 4.0f);
            near.add(place, patches[0].normal, place);
        }
        std::vector<Share> exact, quick;
        std::vector<ExactGap> gaps;
        Gap gap;
        share_exactly(patches[0], frame, near.candidates(0), near.worlds, -1.0, exact, gaps);
        if (!share_patch(patches[0], near.candidates(0), quick, gap)) continue;
        std::vector<float> weights(near.size(), 0.0f);
        float total = 0.0f;
        for (const Share& share : quick) weights[share.point] += share.weight, total += share.weight;
        for (const Share& share : exact) weights[share.point] -= share.weight;
        CAPTURE(height);
        for (const float weight : weights) CHECK(std::abs(weight) < 1e-3f * total);
    }
}

TEST_CASE("cells are only covered where all of them is near a point, and darts only hit the patch where none is") {
    int hits = 0;
    for (std::uint32_t seed = 0; seed < 40; ++seed) {
        PatchAmongPoints scene(seed * 1000, 3);
        const Patch& patch = scene.patch;
        const std::uint64_t all = cells_of(patch), cells = uncovered_cells(patch, scene.candidates, 0, all);
        for (std::uint32_t k = 0; k < 400; ++k) {
            const float u = to_unit_float(hash(k, 1)), v = to_unit_float(hash(k, 2));
            const V2f place(patch.low.x + u * (patch.high.x - patch.low.x),
                            patch.low.y + v * (patch.high.y - patch.low.y));
            const bool is_marked = cells >> (8 * int(v * 8) + int(u * 8)) & 1;
            const V3f there = scene.at(place.x, place.y);
            const float distance = (scene.near.worlds[scene.nearest(there)] - there).length();
            bool is_inside = true;
            for (int e = 0; e < patch.count; ++e) {
                const V2f a(patch.x[e], patch.y[e]), b(patch.x[(e + 1) % patch.count], patch.y[(e + 1) % patch.count]);
                is_inside &= (b - a).cross(place - a) >= 0.0f;
            }
            if (!is_marked && is_inside) CHECK(distance < 1.0f);
        }
        RandomStream random{seed};
        for (int throws = 0; throws < 6; ++throws) {
            const int count = 3 + throws;
            const Darts darts = throw_darts(patch, scene.candidates, cells, random, count);
            CHECK((darts.free >> count) == 0);
            for (int lane = 0; lane < count; ++lane) {
                const V2f at(darts.x[lane], darts.y[lane]);
                const V3f there = scene.at(at.x, at.y);
                const float distance = (scene.near.worlds[scene.nearest(there)] - there).length();
                float inside = 1.0f;
                for (int k = 0; k < patch.count; ++k) {
                    const V2f a(patch.x[k], patch.y[k]);
                    const V2f b(patch.x[(k + 1) % patch.count], patch.y[(k + 1) % patch.count]);
                    inside = std::min(inside, (b - a).cross(at - a));
                }
                if (darts.free >> lane & 1) {
                    ++hits;
                    CHECK(distance > 1.0f);
                    CHECK(inside >= -1e-6f);
                } else {
                    CHECK((distance < 1.0f + 1e-4f || inside < 1e-6f));
                }
            }
            // Nothing changes without a point; with one more, only where it is near.
            CHECK(free_darts(patch, scene.candidates, scene.candidates.count, darts) == darts.free);
            if (darts.free == 0) continue;
            const int first = std::countr_zero(darts.free);
            const float x = darts.x[first], y = darts.y[first], s = x * x + y * y;
            const unsigned left = free_darts(patch, {&x, &y, &s, nullptr, 1}, 0, darts);
            for (int lane = 0; lane < count; ++lane) {
                const float distance = (V2f(darts.x[lane], darts.y[lane]) - V2f(x, y)).length();
                if (std::abs(distance - 1.0f) < 1e-3f) continue;
                const bool stays = (darts.free >> lane & 1) != 0 && distance > 1.0f;
                CHECK((left >> lane & 1) == unsigned(stays));
            }
        }
    }
    CHECK(hits > 100);
    // The cells of a triangle are not all of its bounds.
    CHECK(std::popcount(cells_of(PatchAmongPoints(0, 1).patch)) < 56);
}

TEST_CASE("a patch has every point within its reach on its side, and none on the other") {
    for (const std::size_t count : {1, 7, 200, 3000}) {
        std::uint32_t state = 1;
        const auto random = [&] { return to_unit_float(hash(state++)) * 14.0f - 1.0f; };
        std::vector<Patch> patches(count);
        for (Patch& patch : patches) {
            patch.center = V3f(random(), random(), random());
            patch.axes[0] = V3f(1, 0, 0);
            patch.axes[1] = V3f(0, 1, 0);
            patch.normal = V3f(0, 0, 1);
            patch.radius = 0.5f + 0.05f * random();
            patch.largest_spacing = 1.0f;
        }
        Neighbourhood near;
        near.reset(patches, 0.0, kSameSideCosine);
        for (int i = 0; i < 2000; ++i) {
            const V3f place(random(), random(), random());
            near.add(place, V3f(0, 0, i % 2 ? 1.0f : -1.0f), place);
        }
        for (std::size_t look = 0; look < count; look += 1 + count / 50) {
            const Patch& patch = patches[look];
            const float reach = reach_of(patch, 0.0);
            CHECK(reach >= patch.radius + 1.0f);
            const Candidates found = near.candidates(look);
            std::vector<std::uint32_t> expected;
            for (std::uint32_t i = 1; i < near.size(); i += 2) {
                if ((near.worlds[i] - patch.center).length2() < reach * reach) expected.push_back(i);
            }
            REQUIRE(std::vector<std::uint32_t>(found.points, found.points + found.count) == expected);
            CHECK(near.count(look) == expected.size());
            for (int k = 0; k < found.count; ++k) {
                const V3f d = near.worlds[found.points[k]] - patch.center;
                CHECK(found.x[k] == doctest::Approx(d.x));
                CHECK(found.y[k] == doctest::Approx(d.y));
                CHECK(found.s[k] == doctest::Approx(d.length2()));
            }
        }
    }
}

TEST_CASE("poisson points refuse a spacing that is no length") {
    const Mesh mesh = tilted_triangle();
    CHECK_THROWS_AS(poisson_points(mesh, 0.0), ValueError);
    CHECK_THROWS_AS(poisson_points(mesh, std::vector<float>{1.0f}), ValueError);
    CHECK_THROWS_AS(poisson_points(Mesh(), 1.0), ValueError);
    CHECK_THROWS_AS(poisson_points_by_count(mesh, 0), ValueError);
}

TEST_CASE("every set of instructions makes the same points") {
    // A ball of slivers and large triangles, and a spacing that varies.
    Mesh mesh;
    std::vector<float> spacing;
    constexpr int kRings = 9, kSectors = 31;
    for (int i = 0; i <= kRings; ++i) {
        for (int k = 0; k < kSectors; ++k) {
            const float a = kPi * float(i) / kRings, b = 2.0f * kPi * float(k) / kSectors;
            mesh.positions.push_back({std::sin(a) * std::cos(b), std::cos(a), 1.3f * std::sin(a) * std::sin(b)});
            spacing.push_back(0.03f + 0.02f * float(i) / kRings);
            const int next = (k + 1) % kSectors;
            if (i == kRings) continue;
            mesh.triangles.push_back({i * kSectors + k, (i + 1) * kSectors + k, i * kSectors + next});
            mesh.triangles.push_back({i * kSectors + next, (i + 1) * kSectors + k, (i + 1) * kSectors + next});
        }
    }
    const auto same = [](const auto& a, const auto& b) {
        return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
    };
    const PointSet even = poisson_points(mesh, 0.05), varying = poisson_points(mesh, spacing);
    const auto targets = hwy::SupportedAndGeneratedTargets();
    for (const auto target : targets) {
        CAPTURE(std::string(hwy::TargetName(target)));
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        const PointSet even_here = poisson_points(mesh, 0.05), varying_here = poisson_points(mesh, spacing);
        hwy::SetSupportedTargetsForTest(0);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        CHECK(same(even.positions, even_here.positions));
        CHECK(same(even.areas, even_here.areas));
        CHECK(same(varying.positions, varying_here.positions));
        CHECK(same(varying.areas, varying_here.areas));
    }
    MESSAGE("sets of instructions compared: " << targets.size());
}
