#include <doctest/doctest.h>

#include <cmath>
#include <vector>

#include "frazil/material/noise.h"

using namespace frazil;

namespace {

V3f place_of(std::uint32_t i) {
    const auto coordinate = [&](std::uint32_t axis) { return 40.0f * (to_unit_float(hash(i, axis)) - 0.5f); };
    return {coordinate(1), coordinate(2), coordinate(3)};
}

// One of the twelve directions from a cube's middle to its edges, dotted with the offset.
float along_edge(std::uint32_t bits, const V3f& offset) {
    static const int kEdges[16][3] = {{1, 1, 0},  {-1, 1, 0},  {1, -1, 0}, {-1, -1, 0}, {1, 0, 1},  {-1, 0, 1},
                                      {1, 0, -1}, {-1, 0, -1}, {0, 1, 1},  {0, -1, 1},  {0, 1, -1}, {0, -1, -1},
                                      {1, 1, 0},  {0, -1, 1},  {-1, 1, 0}, {0, -1, -1}};
    const int* edge = kEdges[bits & 15U];
    return float(edge[0]) * offset.x + float(edge[1]) * offset.y + float(edge[2]) * offset.z;
}

// Gradient noise corner by corner, in double precision.
double plain_noise(const V3f& place, std::uint32_t seed, int shift) {
    const V3f floor(std::floor(place.x), std::floor(place.y), std::floor(place.z));
    const V3f inside = place - floor;
    double sum = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
        const V3i step(corner & 1, corner >> 1 & 1, corner >> 2);
        double weight = 1.0;
        for (int axis = 0; axis < 3; ++axis) {
            const double t = double(inside[axis]), fade = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
            weight *= step[axis] ? fade : 1.0 - fade;
        }
        const std::uint32_t h =
            cell_hash(int(floor.x) + step.x, int(floor.y) + step.y, int(floor.z) + step.z, seed) >> shift;
        sum += weight * double(along_edge(h, inside - V3f(step)));
    }
    return sum;
}

}  // namespace

TEST_CASE("noise: what the corners of a lattice cell give, one by one") {
    for (std::uint32_t i = 0; i < 3000; ++i) {
        const V3f place = place_of(i);
        const std::uint32_t seed = hash(i, 9U);
        CHECK(double(gradient_noise(place, seed)) ==
              doctest::Approx(plain_noise(place, seed, 16)).epsilon(1e-5).scale(1.0));
        const V3f three = vector_noise(place, seed);
        for (int c = 0; c < 3; ++c) {
            CHECK(double(three[c]) == doctest::Approx(plain_noise(place, seed, 8 * (c + 1))).epsilon(1e-5).scale(1.0));
        }
        const float octaves = fractal_noise(place, 3, 0.0f, seed);
        const V3f second = place * kLacunarity, third = place * (kLacunarity * kLacunarity);
        CHECK(octaves == doctest::Approx(gradient_noise(place, seed) + 0.5f * gradient_noise(second, seed + 1U) +
                                         0.25f * gradient_noise(third, seed + 2U))
                             .epsilon(1e-5)
                             .scale(1.0));
    }
}

TEST_CASE("noise: the nearest wall of the cells is the one that a search through all finds") {
    int walls = 0;
    for (std::uint32_t i = 0; i < 3000; ++i) {
        const V3f place = place_of(i);
        const std::uint32_t seed = hash(i, 9U);
        const V3i own(int(std::floor(place.x)), int(std::floor(place.y)), int(std::floor(place.z)));
        std::vector<V3f> points;
        std::vector<std::uint32_t> hashes;
        for (int cell = 0; cell < 343; ++cell) {
            const V3i at = own + V3i(cell % 7 - 3, cell / 7 % 7 - 3, cell / 49 - 3);
            points.push_back(cell_point(at.x, at.y, at.z, seed) - place);
            hashes.push_back(cell_hash(at.x, at.y, at.z, seed));
        }
        std::size_t nearest = 0;
        for (std::size_t k = 0; k < points.size(); ++k) {
            if (points[k].length2() < points[nearest].length2()) nearest = k;
        }
        CellWall plain;
        for (std::size_t k = 0; k < points.size(); ++k) {
            if (k == nearest) continue;
            const V3f across = points[k] - points[nearest];
            const float distance = (points[k] + points[nearest]).dot(across) / (2.0f * across.length());
            if (distance < plain.distance) plain = {distance, across.normalized(), hashes[k] ^ hashes[nearest]};
        }
        const float reach = 0.3f * to_unit_float(hash(i, 5U));
        const CellWall wall = nearest_cell_wall(place, reach, seed);
        CAPTURE(i);
        if (plain.distance > reach) {
            CHECK(wall.distance > 1e29f);
            continue;
        }
        ++walls;
        CHECK(wall.distance == doctest::Approx(plain.distance).epsilon(1e-4).scale(1.0));
        CHECK((wall.normal - plain.normal).length() < 1e-4f);
        CHECK(wall.id == plain.id);
    }
    CHECK(walls > 500);
}
