#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/sampler.h"
#include "frazil/points/poisson.h"
#include "frazil/render/thickness.h"
#include "frazil/render/thin_field.h"
#include "shapes.h"

namespace frazil {
namespace {

// A cube of eight free paths, and what its points know of it.
struct Cube {
    const Medium medium{Rgb(9.43f), Rgb(0.57f, 0.3f, 0.0f), 1.0f};
    const std::shared_ptr<const ThinMedium> thin = std::make_shared<const ThinMedium>(ThinMedium::of(medium, 0.0f));
    const Mesh mesh = test::box_of(V3f(-0.4f), V3f(0.4f));
    const RayScene scene{{mesh}, {Placement{}}};
    const PointSet points = poisson_points(mesh, 0.05);
    const Thinness known = thinness(points, below(points), scene, *thin);
    const ThinField field{points, known.exponent, nullptr, thin};

    static std::vector<V3f> below(const PointSet& points) {
        std::vector<V3f> places = points.positions;
        for (std::size_t k = 0; k < places.size(); ++k) places[k] -= points.normals[k] * 0.067f;
        return places;
    }
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

// Seen on the top of the cube so far from its edge, along a ray towards the edge.
float exponent_at(const Cube& cube, float from_edge, float cosine, float* traced) {
    AbsorbingPlaces places;
    const float depth = cube.thin->even_light[0].absorbed_at(cosine);
    const float along = 0.1f * depth * std::sqrt(1.0f - cosine * cosine) / cosine;
    places.positions = {V3f(0.4f - from_edge + along, 0.4f - 0.1f * depth, 0.07f)};
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
            CHECK(std::abs(exponent - traced) < 0.06f);
        }
    }
    // At the edge it makes a difference.
    float near = 0.0f, far = 0.0f;
    CHECK(exponent_at(cube, 0.15f, 0.7f, &near) > exponent_at(cube, 0.4f, 0.7f, &far) + 0.2f);
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
