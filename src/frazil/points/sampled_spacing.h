// Poisson points with a spacing that is a function of the place on the mesh: a texture's, or a camera's.
// Model: triangles are halved until their edges are at most two of the spacings there, and further down to one where the
//   spacing is not linear; on each piece it is linear between the corners. Points are placed on the pieces, and then named
//   by the triangles these were cut from.
// Units: metres.
// Valid: what varies over more than two spacings is found wherever it is; for what was sampled poisson.h's guarantees hold.
// Not: detail of a texture that is finer than that.
#pragma once

#include <functional>
#include <span>

#include "frazil/points/poisson.h"

namespace frazil {

// A place of a mesh whose spacing is asked for.
struct SpacingPlace {
    std::uint32_t triangle;
    V2f barycentrics;  // of the triangle's second and third corner
};

// Write the spacing, > 0, at each of the places; thousands at once. Called by many threads at once.
using SpacingFunction = std::function<void(std::span<const SpacingPlace> places, std::span<float> spacings)>;

// A function of one place as a function of many.
template <class F>
SpacingFunction at_each_place(F spacing) {
    return [spacing](std::span<const SpacingPlace> places, std::span<float> spacings) {
        for (std::size_t i = 0; i < places.size(); ++i)
            spacings[i] = spacing(places[i].triangle, places[i].barycentrics);
    };
}

// ValueError as from poisson_points, and where more pieces would be needed than points are allowed.
PointSet poisson_points(const Mesh& mesh, const SpacingFunction& spacing, const PoissonOptions& options = {},
                        Progress* progress = nullptr);

}  // namespace frazil
