// The parts that Poisson points are made of, each against what it must give exactly.
#include <doctest/doctest.h>

#include "frazil/base/error.h"
#include "frazil/base/random.h"
#include "frazil/points/fragment.h"
#include "frazil/points/nearest_piece.h"
#include "frazil/points/neighbourhood.h"
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

}  // namespace

TEST_CASE("fragments of all tiles are the triangle, once") {
    const Mesh mesh = tilted_triangle();
    const SpacingField spacing{0.3, nullptr};
    const TileGrid grid = make_tile_grid(mesh, 1.0, 1000000);
    double share = 0.0;
    for (std::size_t tile = 0; tile < grid.count(); ++tile) {
        std::vector<Fragment> fragments;
        REQUIRE(grid.starts[tile + 1] - grid.starts[tile] == 1);
        append_fragments(mesh, spacing, {grid.tile_origin(tile), 0.3, grid.size / 0.3}, 0, 1.0, fragments);
        for (const Fragment& f : fragments) {
            const V2d a = f.uv[1] - f.uv[0], b = f.uv[2] - f.uv[0];
            share += std::abs(a.x * b.y - a.y * b.x);
            for (int k = 0; k < 3; ++k) CHECK((f.corners[(k + 1) % 3] - f.corners[k]).length() <= 1.0001f);
        }
    }
    CHECK(share == doctest::Approx(1.0).epsilon(1e-12));
}

TEST_CASE("a face in the plane between two tiles belongs to one of them") {
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 8}};
    mesh.triangles = {{0, 1, 2}};
    TileGrid grid = make_tile_grid(mesh, 1.0, 1000);
    const float plane = float(grid.origin.z + grid.size);
    for (V3f& p : mesh.positions) p.z += plane;
    grid = make_tile_grid(mesh, 1.0, 1000);
    double share = 0.0;
    for (std::size_t tile = 0; tile < grid.count(); ++tile) {
        std::vector<Fragment> fragments;
        append_fragments(mesh, {1.0, nullptr}, {grid.tile_origin(tile), 1.0, grid.size}, 0, 1.0, fragments);
        for (const Fragment& f : fragments) {
            const V2d a = f.uv[1] - f.uv[0], b = f.uv[2] - f.uv[0];
            share += std::abs(a.x * b.y - a.y * b.x);
        }
    }
    CHECK(share == doctest::Approx(1.0).epsilon(1e-12));
}

TEST_CASE("pieces nearest to each point share a fragment fully, in both clips") {
    const V3d corners[3] = {{0, 0, 0}, {1, 0.1, 0}, {0.3, 0.9, 0.2}};
    std::vector<CornerDistances> candidates;
    std::vector<int> all;
    std::uint32_t state = 1;
    const auto random = [&] { return to_unit_float(hash(state++)); };
    for (int i = 0; i < 9; ++i) {
        const V3d p(random() * 1.4 - 0.2, random() * 1.4 - 0.2, random() * 0.2);
        candidates.push_back({{(corners[0] - p).length2(), (corners[1] - p).length2(), (corners[2] - p).length2()}});
        all.push_back(i);
    }
    double exact = 0.0, quick = 0.0;
    for (const int i : all) {
        Piece piece;
        clip_piece(candidates.data(), all, i, piece);
        exact += piece_share(piece);
        quick += share_of(candidates.data(), all, i);
        CHECK(share_of(candidates.data(), all, i) == doctest::Approx(piece_share(piece)).epsilon(1e-4));
    }
    CHECK(exact == doctest::Approx(1.0).epsilon(1e-12));
    CHECK(quick == doctest::Approx(1.0).epsilon(1e-5));
    // Leaving out the dominated changes nothing.
    int nearest[3];
    std::vector<int> kept;
    find_nearest(candidates.data(), 9, nearest);
    drop_dominated(candidates.data(), 9, nearest, kept);
    double shared = 0.0;
    for (const int i : kept) shared += share_of(candidates.data(), kept, i);
    CHECK(shared == doctest::Approx(1.0).epsilon(1e-5));
}

TEST_CASE("a neighbourhood sees every point within reach on its side, and none on the other") {
    Neighbourhood near;
    near.reset(12.0, 1.6, 2.0, kSameSideCosine);
    near.mark(V3f(0.0f), V3f(12.0f));
    std::uint32_t state = 1;
    const auto random = [&] { return to_unit_float(hash(state++)) * 14.0f - 1.0f; };
    std::vector<V3f> places;
    for (int i = 0; i < 2000; ++i) {
        places.emplace_back(random(), random(), random());
        near.add(places.back(), V3f(0, 0, i % 2 ? 1.0f : -1.0f), places.back());
    }
    for (int look = 0; look < 200; ++look) {
        const V3f place(random(), random(), random());
        if (place.x < 0 || place.y < 0 || place.z < 0 || place.x > 12 || place.y > 12 || place.z > 12) continue;
        std::size_t expected = 0, found = 0;
        for (std::size_t i = 1; i < places.size(); i += 2) expected += (places[i] - place).length2() <= 3.9f;
        near.any_near(place, V3f(0, 0, 1), 3.9f, [&](std::uint32_t i) {
            CHECK(i % 2 == 1);
            ++found;
            return false;
        });
        CHECK(found == expected);
    }
}

TEST_CASE("poisson points refuse a spacing that is no length") {
    const Mesh mesh = tilted_triangle();
    CHECK_THROWS_AS(poisson_points(mesh, 0.0), ValueError);
    CHECK_THROWS_AS(poisson_points(mesh, std::vector<float>{1.0f}), ValueError);
    CHECK_THROWS_AS(poisson_points(Mesh(), 1.0), ValueError);
    CHECK_THROWS_AS(poisson_points_by_count(mesh, 0), ValueError);
}
