// The parts that Poisson points are made of, each against what it must give exactly.
#include <doctest/doctest.h>

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
                // Not farther out of the tile than the grid says.
                const V3f corner = patch.center + patch.axes[0] * patch.x[k] + patch.axes[1] * patch.y[k];
                const double overhang = grid.overhang / spacing.constant + 1e-4;
                for (int axis = 0; axis < 3; ++axis) {
                    CHECK(corner[axis] >= -overhang);
                    CHECK(corner[axis] <= grid.size / spacing.constant + overhang);
                }
            }
        }
    }
    return area;
}

// A patch and points around it, entered into a neighbourhood.
struct PatchAmongPoints {
    Mesh mesh = tilted_triangle();
    TileFrame frame = {V3d(0.0), 12.0, V3i(0), 1.0};
    Patch patch;
    Neighbourhood near;
    Candidates candidates;

    PatchAmongPoints(std::uint32_t seed, int count) {
        mesh.positions = {{4.0f, 4.0f, 4.0f}, {6.2f, 4.5f, 4.1f}, {4.8f, 6.0f, 5.0f}};
        std::vector<Patch> patches;
        append_patches(mesh, {1.0, nullptr}, frame, 0, patches);
        REQUIRE(patches.size() == 1);
        patch = patches[0];
        near.reset(12.0, 3.0, 4.0);
        const std::uint32_t cell = near.mark(patch.center);
        const auto random = [&] { return to_unit_float(hash(seed++)) * 4.0f - 2.0f; };
        for (int i = 0; i < count; ++i) {
            const V3f place =
                patch.center + patch.axes[0] * random() + patch.axes[1] * random() + patch.normal * (0.1f * random());
            near.add(place, patch.normal, place);
        }
        find_candidates(near, cell, patch, 4.0f, kSameSideCosine, candidates);
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
        const V3f there = scene.at(gap.corner.x, gap.corner.y);
        CHECK((scene.near.worlds[scene.nearest(there)] - there).length2() ==
              doctest::Approx(1.0 + gap.excess2).epsilon(1e-4));
        // A place further in is still as far from its point as the spacing.
        if (gap.excess2 < 0.0f) continue;
        for (const float random : {0.0f, 0.3f, 0.999f}) {
            const V2f inside = gap.place(random);
            const V3f place = scene.at(inside.x, inside.y);
            CHECK((scene.near.worlds[scene.nearest(place)] - place).length() >= 1.0f - 1e-5f);
            if (random > 0.0f) CHECK((inside - gap.corner).length() > 1e-3f);
        }
    }
}

TEST_CASE("cells are only covered where all of them is near a point, and darts only hit the patch where none is") {
    int hits = 0;
    for (std::uint32_t seed = 0; seed < 40; ++seed) {
        PatchAmongPoints scene(seed * 1000, 3);
        const Patch& patch = scene.patch;
        const std::uint64_t cells = uncovered_cells(patch, scene.candidates, 0, ~std::uint64_t(0));
        for (std::uint32_t k = 0; k < 400; ++k) {
            const float u = to_unit_float(hash(k, 1)), v = to_unit_float(hash(k, 2));
            const V2f place(patch.low.x + u * (patch.high.x - patch.low.x),
                            patch.low.y + v * (patch.high.y - patch.low.y));
            const bool is_marked = cells >> (8 * int(v * 8) + int(u * 8)) & 1;
            const V3f there = scene.at(place.x, place.y);
            const float distance = (scene.near.worlds[scene.nearest(there)] - there).length();
            if (!is_marked) CHECK(distance < 1.0f);
        }
        RandomStream random{seed};
        int tries = 50;
        V2f hit;
        while (throw_darts(patch, scene.candidates, cells, random, tries, hit)) {
            ++hits;
            const V3f there = scene.at(hit.x, hit.y);
            CHECK((scene.near.worlds[scene.nearest(there)] - there).length() > 1.0f);
            for (int k = 0; k < 3; ++k) {
                const V2f a(patch.x[k], patch.y[k]), b(patch.x[(k + 1) % 3], patch.y[(k + 1) % 3]);
                CHECK((b - a).cross(hit - a) >= -1e-6f);
            }
        }
    }
    CHECK(hits > 100);
}

TEST_CASE("a patch finds every point within reach on its side, and none on the other") {
    Neighbourhood near;
    near.reset(12.0, 1.6, 2.0);
    std::uint32_t state = 1;
    const auto random = [&] { return to_unit_float(hash(state++)) * 14.0f - 1.0f; };
    std::vector<Patch> patches(200);
    std::vector<std::uint32_t> cells;
    for (Patch& patch : patches) {
        patch.center = V3f(random(), random(), random());
        patch.axes[0] = V3f(1, 0, 0);
        patch.axes[1] = V3f(0, 1, 0);
        patch.normal = V3f(0, 0, 1);
        cells.push_back(near.mark(patch.center));
    }
    for (int i = 0; i < 2000; ++i) {
        const V3f place(random(), random(), random());
        near.add(place, V3f(0, 0, i % 2 ? 1.0f : -1.0f), place);
    }
    for (std::size_t look = 0; look < patches.size(); ++look) {
        const V3f& center = patches[look].center;
        std::size_t expected = 0;
        for (std::size_t i = 1; i < near.size(); i += 2) expected += (near.worlds[i] - center).length2() < 3.9f;
        Candidates found;
        find_candidates(near, cells[look], patches[look], std::sqrt(3.9f), kSameSideCosine, found);
        CHECK(found.count == int(expected));
        for (int k = 0; k < found.count; ++k) {
            CHECK(found.points[k] % 2 == 1);
            const V3f d = near.worlds[found.points[k]] - center;
            CHECK(found.x[k] == doctest::Approx(d.x));
            CHECK(found.y[k] == doctest::Approx(d.y));
            CHECK(found.s[k] == doctest::Approx(d.length2()));
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
