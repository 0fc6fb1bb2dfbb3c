// Small triangular pieces of a mesh inside one tile: what points are thrown on and areas are shared out over.
// Model: a triangle is clipped to the tile's box, the polygon cut into a fan, and every piece halved at its longest edge
//   until that edge is short beside the local spacing.
// Units: corner positions and radii in the tile's own unit (the reference spacing) from its origin, so that float carries
//   them whatever the mesh's size and place; barycentrics in double.
// Valid: any triangle with an area; slivers become chains of slivers.
// Not: quality triangles: everything downstream is exact for any shape.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/geometry/mesh.h"

namespace frazil {

using V2d = Imath::V2d;

// The distance that points keep: one number, or one per vertex, linear over each triangle. Metres.
struct SpacingField {
    double constant = 0.0;
    const std::vector<float>* per_vertex = nullptr;

    double at_vertex(std::int32_t vertex) const {
        return per_vertex ? std::min<double>((*per_vertex)[vertex], constant) : constant;
    }
};

// A cube of space with coordinates of its own: local = (world - origin) / unit, the cube being [0, size]³.
struct TileFrame {
    V3d origin;
    double unit = 1.0;
    double size = 1.0;

    V3d to_local(const V3f& world) const { return (V3d(world) - origin) / unit; }
};

struct Fragment {
    V3f corners[3];
    float radii[3];  // the spacing at the corners
    V2d uv[3];       // barycentrics of the corners in the triangle
    V3f normal;
    std::int32_t triangle;
};

// The unit normal of a triangle, evaluated in double; zero where the triangle has no area.
V3f unit_normal(const Mesh& mesh, std::size_t triangle);

// The longest distance from a triangle's centroid to a corner, for a triangle whose longest edge is 1.
inline constexpr double kCentroidReach = 2.0 / 3.0;

// Append the pieces of `triangle` inside the tile. No edge is longer than `longest_edge` × the spacing at its piece.
void append_fragments(const Mesh& mesh, const SpacingField& spacing, const TileFrame& frame, std::int32_t triangle,
                      double longest_edge, std::vector<Fragment>& fragments);

}  // namespace frazil
