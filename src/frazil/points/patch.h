// Flat pieces of a mesh's triangles: what points are thrown on, and what they share out among them as their areas.
// Model: a triangle that is small beside the spacing is one patch; a larger one is cut in its own plane, across its longer
//   extent, until its parts are. A patch belongs to the tile that its middle lies in, so that no triangle is cut at tiles.
// Units: positions and spacings in the tile's own unit (the reference spacing) from its origin, so that float carries them
//   whatever the mesh's size and place; corners in the patch's own plane, from its centre.
// Valid: any triangle with an area; slivers become chains of slivers.
// Not: neighbours across edges: a mesh is a soup here.
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

// A cube of space with coordinates of its own: local = (world - origin) / unit, the cube being [0, size]³. It is number
// `tile` of a grid of such cubes.
struct TileFrame {
    V3d grid_origin;
    double width = 1.0;  // of the cubes, metres
    V3i tile;
    double unit = 1.0;

    V3d origin() const { return grid_origin + V3d(tile) * width; }
    double size() const { return width / unit; }
    V3d to_local(const V3d& world) const { return (world - origin()) / unit; }
    bool is_inside(const V3d& world) const { return tile_at(world, grid_origin, width) == tile; }

    // The cube that a place lies in. The one rule for that, so that every place has one.
    static V3i tile_at(const V3d& world, const V3d& grid_origin, double width);
};

inline constexpr int kMostCorners = 8;

struct Patch {
    // Counter-clockwise; the last corner fills the lanes after it.
    alignas(32) float x[kMostCorners], y[kMostCorners], spacing[kMostCorners];
    V3f center, axes[2], normal;
    float radius;  // no corner is farther from the centre
    float least_spacing, largest_spacing;
    float center_spacing;  // spacing is center_spacing + spacing_slope · (x, y)
    V2f spacing_slope;
    V2f low, high;  // what bounds x and y
    std::int32_t count;
    std::int32_t triangle;
    double area;  // m²
};

// The longest edge of a triangle that stays whole, and the extents of the parts of larger ones, in (least) spacings.
inline constexpr double kLongestEdge = 3.0;
inline constexpr double kPatchWidth = 2.5;

// How far a part of a larger triangle reaches from the place that its tile holds, at most, in (largest) spacings.
inline constexpr double kPartReach = 2.5;

// A place rounded to what is stored. Out of line: GCC 12 drops the rounding of two coordinates at a time where it sees
// them go back to double.
[[gnu::noinline]] V3f to_stored(const V3d& place);

// The unit normal of a triangle, evaluated in double; zero where the triangle has no area.
V3f unit_normal(const Mesh& mesh, std::size_t triangle);

struct TriangleShape {
    bool has_area;
    bool is_whole;  // one patch
    V3d center;     // of its smallest circle, metres: that of the patch which the whole triangle is
};
TriangleShape shape_of(const Mesh& mesh, const SpacingField& spacing, std::size_t triangle);

// Append the patches of `triangle` that belong to the tile. A whole triangle is taken as it is: only its own tile asks.
void append_patches(const Mesh& mesh, const SpacingField& spacing, const TileFrame& frame, std::int32_t triangle,
                    std::vector<Patch>& patches);

}  // namespace frazil
