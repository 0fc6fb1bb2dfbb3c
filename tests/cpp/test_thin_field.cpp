#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/sampler.h"
#include "frazil/points/cells.h"
#include "frazil/points/poisson.h"
#include "frazil/render/thickness.h"
#include "frazil/render/thin_field.h"
#include "shapes.h"

namespace frazil {
namespace {

// A body, and what points on a part of its surface know of it.
struct Body {
    Body(const Mesh& mesh, const Mesh& part, double spacing, std::uint32_t seed = 0, bool has_cells = false)
        : scene({mesh}, {Placement{}}),
          points(poisson_points(part, spacing, {.seed = seed})),
          cells(cells_of(points, part)),
          known(thinness(points, has_cells ? below_cells() : below(), scene, *thin, 0.0f, nullptr, &itself)),
          field(points, has_cells ? &cells : nullptr, known, nullptr, thin) {}

    const Medium medium{Rgb(9.43f), Rgb(0.57f, 0.3f, 0.0f), 1.0f};
    const std::shared_ptr<const ThinMedium> thin = std::make_shared<const ThinMedium>(ThinMedium::of(medium, 0.0f));
    const RayScene scene;
    const std::vector<std::uint8_t> itself{1};
    const PointSet points;
    const Cells cells;
    const Thinness known;
    const ThinField field;

    static constexpr float kDeep = 0.067f;
    FirstScattering below() const {
        FirstScattering places{points.positions, std::vector<float>(points.size(), kDeep), {}};
        for (std::size_t k = 0; k < points.size(); ++k) places.centers[k] -= points.normals[k] * kDeep;
        return places;
    }
    FirstScattering below_cells() const {
        FirstScattering places{cells.centroids, std::vector<float>(points.size(), kDeep), {}};
        for (std::size_t k = 0; k < points.size(); ++k) {
            Covariance covariance = cells.covariances[k];
            move_along_normals(-kDeep, cells.normals[k], places.centers[k], covariance);
            places.axes.push_back(ellipse_of(covariance, points.normals[k]));
        }
        return places;
    }
    // Of a depth in free paths, the same in every channel.
    float metres(float depth) const { return depth / mean_sigma_t(medium); }
    // <y> of the red channel by rays, less what a half space has at the depth.
    float traced(const V3f& place, float depth) const {
        const int rays = 4096;
        double sum = 0.0;
        for (int i = 0; i < rays; ++i) {
            const float z = 1.0f - (2.0f * i + 1.0f) / rays, r = std::sqrt(1.0f - z * z), phi = 2.39996323f * i;
            Hit hit;
            if (!scene.intersect({place, V3f(r * std::cos(phi), r * std::sin(phi), z)}, hit)) continue;
            sum += thin->even_light[0].along(hit.t * 10.0f).value;
        }
        return static_cast<float>(sum / rays) - thin->even_light[0].half_space(depth).value;
    }
};

// Of eight free paths.
struct Cube : Body {
    explicit Cube(double spacing = 0.05, std::uint32_t seed = 0, bool has_cells = false)
        : Body(box(), box(), spacing, seed, has_cells) {}
    static Mesh box() { return test::box_of(V3f(-0.4f), V3f(0.4f)); }
};

// Seen on the top of the cube so far from its edge, along a ray towards the edge.
float exponent_at(const Cube& cube, float from_edge, float cosine, float* traced) {
    AbsorbingPlaces places;
    const float depth = cube.thin->even_light[0].absorbed_at(cosine);
    const float below = cube.metres(depth), along = below * std::sqrt(1.0f - cosine * cosine) / cosine;
    places.positions = {V3f(0.4f - from_edge + along, 0.4f - below, 0.07f)};
    places.normals = {V3f(0.0f, 1.0f, 0.0f)};
    places.depths = {Rgb(depth)};
    const std::vector<Rgb> exponents = cube.field.at(places, places.positions, {});
    *traced = cube.traced(places.positions[0], depth);
    return exponents[0].x + exponents[1].x * depth;
}

}  // namespace

TEST_CASE("thin field: what is absorbed less than in a half space, along rays to the edge of a cube and away from it") {
    const Cube cube;
    for (const float cosine : {1.0f, 0.7f, 0.4f}) {
        for (const float from_edge : {0.3f, 0.4f}) {
            float traced = 0.0f;
            const float exponent = exponent_at(cube, from_edge, cosine, &traced);
            CAPTURE(cosine);
            CAPTURE(from_edge);
            CHECK(std::abs(exponent - traced) < 0.05f);
        }
    }
    // At the edge it makes a difference.
    float near = 0.0f, far = 0.0f;
    CHECK(exponent_at(cube, 0.15f, 0.7f, &near) > exponent_at(cube, 0.4f, 0.7f, &far) + 0.2f);
}

TEST_CASE("thin field: in a slab it is what a half space has as deep below the other side") {
    // <y> is Y(up) + Y(down): either half of the directions brings what a half space has that ends there.
    for (const float thickness : {0.5f, 0.8f}) {  // so thick that next to nothing goes straight through
        const Body slab(test::box_of(V3f(-50.0f, -thickness, -50.0f), V3f(50.0f, 0.0f, 50.0f)),
                        test::floor_square(0.8f, 0.0f), 0.05);
        for (const float depth : {0.5f, 1.0f}) {
            AbsorbingPlaces places;
            for (int i = 0; i < 100; ++i) {
                const float x = 0.1f * static_cast<float>(i % 10) - 0.45f,
                            z = 0.1f * static_cast<float>(i / 10) - 0.45f;
                places.positions.push_back({x, -slab.metres(depth), z});
            }
            places.normals.assign(places.positions.size(), V3f(0.0f, 1.0f, 0.0f));
            places.depths.assign(places.positions.size(), Rgb(depth));
            const std::vector<Rgb> exponents = slab.field.at(places, places.positions, {});
            for (const int c : {0, 1}) {
                float mean = 0.0f;
                for (int i = 0; i < 100; ++i) mean += 0.01f * (exponents[2 * i][c] + exponents[2 * i + 1][c] * depth);
                const float sigma_t = slab.medium.sigma_s_prime[c] + slab.medium.sigma_a[c];
                const float exact = slab.thin->even_light[std::size_t(c)].half_space(thickness * sigma_t - depth).value;
                CAPTURE(thickness);
                CAPTURE(depth);
                CAPTURE(c);
                CHECK(std::abs(mean - exact) < 0.03f * exact);
            }
        }
    }
}

TEST_CASE("thin field: cells of sparse points tell what a body is, wherever the points lie") {
    // How far seeds of the points differ, RMS over places.
    const int seeds = 10;
    double alone = 0.0, cells = 0.0;
    for (const float from_edge : {0.12f, 0.2f, 0.3f}) {
        double sums[2] = {0.0, 0.0}, squares[2] = {0.0, 0.0};
        for (int seed = 0; seed < seeds; ++seed) {
            for (const int i : {0, 1}) {
                float traced = 0.0f;
                const double value = exponent_at(Cube(0.15, std::uint32_t(seed), i == 1), from_edge, 0.8f, &traced);
                sums[i] += value;
                squares[i] += value * value;
            }
        }
        alone += squares[0] / seeds - std::pow(sums[0] / seeds, 2);
        cells += squares[1] / seeds - std::pow(sums[1] / seeds, 2);
    }
    alone = std::sqrt(alone / 3.0);
    cells = std::sqrt(cells / 3.0);
    CAPTURE(alone);
    CAPTURE(cells);
    CHECK(cells < 0.7 * alone);
    CHECK(cells < 0.03);
}

TEST_CASE("thin field: points that stand for others near them lose none on another side of an edge") {
    // So dense that they are merged, and so sparse that none is.
    const Cube merged(0.004), plain(0.03);
    float traced = 0.0f;
    for (const float from_edge : {0.05f, 0.1f}) {
        CAPTURE(from_edge);
        CHECK(std::abs(exponent_at(merged, from_edge, 1.0f, &traced) - exponent_at(plain, from_edge, 1.0f, &traced)) <
              0.03f);
    }
}

// What places below a floor of sparse points know where Z is `exponent` of the points' own places, per point.
template <class Exponent>
std::vector<float> told_below_floor(const Exponent& exponent, float known_at_origin = 1.0f) {
    const PointSet points = poisson_points(test::floor_square(1.0f, 0.0f), 0.1, {.seed = 3});
    Thinness known{std::vector<Rgb>(points.size(), Rgb(1.0f)), {}, std::vector<float>(points.size(), 1.0f)};
    for (std::size_t k = 0; k < points.size(); ++k) {
        const V3f& p = points.positions[k];
        const bool is_odd = p.length() < 0.1f && known_at_origin < 1.0f;
        known.exponent.insert(known.exponent.end(), {Rgb(is_odd ? 5.0f : exponent(p)), Rgb(0.0f)});
        if (is_odd) known.known[k] = known_at_origin;
    }
    const Medium medium{Rgb(9.43f), Rgb(0.57f), 1.0f};
    const ThinField field(points, nullptr, known, nullptr,
                          std::make_shared<const ThinMedium>(ThinMedium::of(medium, 0.0f)));
    AbsorbingPlaces places;
    for (int i = 0; i < 400; ++i) {  // not near the border, beyond which nothing is known
        const V2f at(0.05f * static_cast<float>(i % 20) - 0.475f, 0.05f * static_cast<float>(i / 20) - 0.475f);
        places.positions.push_back({at.x, -0.1f, at.y});
    }
    places.normals.assign(400, V3f(0.0f, 1.0f, 0.0f));
    places.depths.assign(400, Rgb(1.0f));
    const std::vector<Rgb> told = field.at(places, places.positions, {});
    std::vector<float> off;
    for (std::size_t i = 0; i < 400; ++i) off.push_back(told[2 * i].x - exponent(places.positions[i]));
    return off;
}

float rms(const std::vector<float>& values) {
    double sum = 0.0;
    for (const float value : values) sum += double(value) * double(value);
    return static_cast<float>(std::sqrt(sum / double(values.size())));
}

TEST_CASE("thin field: where what points know grows evenly along a surface it is told as it is") {
    CHECK(rms(told_below_floor([](const V3f& p) { return 0.5f + 2.0f * p.x - p.z; })) < 0.001f);
}

TEST_CASE("thin field: cells that are half outside of the body are hardly asked") {
    const auto even = [](const V3f&) { return 0.5f; };
    const float odd = rms(told_below_floor(even, 0.99f));
    CHECK(odd > 0.1f);
    CHECK(rms(told_below_floor(even, 0.5f)) < 0.02f * odd);
}

TEST_CASE("thin field: where nothing is absorbed there is no exponent") {
    const Cube cube;
    AbsorbingPlaces places{{V3f(0.3f, 0.35f, 0.0f)}, {V3f(0.0f, 1.0f, 0.0f)}, {Rgb(0.5f)}};
    const std::vector<Rgb> exponents = cube.field.at(places, places.positions, {});
    CHECK(exponents[0].z == 0.0f);
    CHECK(exponents[1].z == 0.0f);
    CHECK(exponents[0].x > 0.0f);
}

}  // namespace frazil
