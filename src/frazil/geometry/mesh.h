// A triangle mesh with the attributes that rendering and points need.
// Model: positions and triangles; normals, uvs and colors each carry their own interpolation, so that nothing has to be
//   split at seams.
// Units: positions in metres, counter-clockwise triangles seen from outside.
// Valid: any triangle soup with finite positions and indices in range (check_mesh); zero-area triangles are allowed and
//   ignored by all stages.
// Not: polygons and subdivision surfaces, which become triangles in subdivision.h or when a scene is read.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

// How the values of a primvar belong to the mesh: one; one per triangle; per vertex; per triangle corner.
enum class Interpolation { constant, uniform, vertex, corner };

template <class T>
struct Primvar {
    std::vector<T> values;
    Interpolation interpolation = Interpolation::vertex;

    bool is_empty() const { return values.empty(); }

    // The value at barycentrics (u, v) of a triangle: (1-u-v) v0 + u v1 + v v2. The primvar must not be empty.
    T at(const std::vector<V3i>& triangles, std::uint32_t triangle, const V2f& uv) const {
        const auto mix = [&](std::size_t a, std::size_t b, std::size_t c) {
            return values[a] * (1.0f - uv.x - uv.y) + values[b] * uv.x + values[c] * uv.y;
        };
        switch (interpolation) {
            case Interpolation::constant:
                return values[0];
            case Interpolation::uniform:
                return values[triangle];
            case Interpolation::vertex: {
                const V3i& t = triangles[triangle];
                return mix(t.x, t.y, t.z);
            }
            case Interpolation::corner: {
                const std::size_t first = 3 * std::size_t(triangle);
                return mix(first, first + 1, first + 2);
            }
        }
        return values[0];
    }
};

struct Mesh {
    std::vector<V3f> positions;
    std::vector<V3i> triangles;
    Primvar<V3f> normals;  // unit length; empty = faceted
    Primvar<V2f> uvs;
    Primvar<Rgb> colors;  // USD displayColor
    // Positions in a pose that does not move, one per vertex, or none: where points are placed, so that they stay on a
    // moving mesh (USD primvar rest or Pref).
    std::vector<V3f> rest;
    std::vector<float> spacing;  // of points, metres in the world, one per vertex; none = by material

    std::size_t triangle_count() const { return triangles.size(); }
};

// Refuse NaN or infinite positions, indices out of range and primvars of the wrong length: ValueError, its message
// beginning with `path`.
void check_mesh(const Mesh& mesh, const std::string& path);

// The geometric normal times twice the area: zero for a degenerate triangle. Evaluated in double, so that slivers and
// meshes far from the origin keep their area.
V3d triangle_cross(const Mesh& mesh, std::size_t triangle);

// Sum of the triangles' areas in m².
double surface_area(const Mesh& mesh);

Box3f bounds(const Mesh& mesh);

// The mesh in its rest pose: without attributes, as points need it. The mesh must have one.
Mesh rest_pose(const Mesh& mesh);

// Positions, rest positions and normals moved by local_to_world; a mirroring matrix also flips the winding, so that outside stays
// outside.
Mesh transformed(const Mesh& mesh, const M44f& local_to_world);

// Some of the triangles, in the order given, with the vertices that they use and no others.
Mesh submesh(const Mesh& mesh, const std::vector<std::int32_t>& triangles);

}  // namespace frazil
