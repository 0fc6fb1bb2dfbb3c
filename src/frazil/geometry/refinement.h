// Triangles cut until no edge is longer than a length: room for displacement.
// Model: every edge that is too long is halved, in rounds; whether an edge is cut depends on its own length alone, so that
//   neighbours agree and no cracks open: its length in the rest pose, where there is one, so that a deforming mesh keeps
//   its triangles. New vertices lie on the flat triangles; primvars, rest pose and spacing are linear.
// Units: those of the mesh.
// Valid: any mesh; the result has at most `most_triangles`, with longer edges where more would be needed.
// Not: curved surfaces, which subdivide() makes first.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/geometry/mesh.h"

namespace frazil {

struct CutMesh {
    Mesh mesh;
    std::vector<std::int32_t> parents;  // the triangle that each was cut from
    float longest_edge = 0.0f;
};

// ValueError where edge_length is not > 0.
CutMesh cut_long_edges(const Mesh& mesh, float edge_length, std::size_t most_triangles);

// Move each vertex by the mean of the offsets at its corners (3 per triangle), and give the new shape its normals: smooth
// where they were (faceted meshes: where neighbours stood at less than 30 degrees), broken where they were broken.
// ValueError where the offsets are not 3 per triangle, or not finite.
Mesh displaced(const Mesh& mesh, const std::vector<V3f>& offsets);

}  // namespace frazil
