// Polygon cages as triangle meshes: flat, or on the Catmull-Clark limit surface by Embree's evaluation.
// Model: every face is cut into level x level quads (n-gons through their n sub-quads) whose corners lie on the limit
//   surface, with limit normals. Vertices on shared edges are shared, so that a closed cage gives a watertight mesh.
// Units: metres.
// Valid: n-gons, boundaries, creases, corners, holes (faces left out of the result, but shaping their neighbours). Faces
//   of fewer than three corners are left out; those of more than 15 (Embree's limit) are triangulated before.
// Not: Loop and bilinear schemes; displacement.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frazil/geometry/mesh.h"

namespace frazil {

// A polygon mesh as USD gives it. Right-handed winding.
struct ControlMesh {
    std::vector<V3f> positions;
    std::vector<std::int32_t> face_vertex_counts;
    std::vector<std::int32_t> face_vertex_indices;
    std::vector<std::int32_t> hole_faces;
    // Creases as chains of vertex indices, `crease_lengths` each, with one sharpness per chain.
    std::vector<std::int32_t> crease_indices;
    std::vector<std::int32_t> crease_lengths;
    std::vector<float> crease_sharpnesses;
    std::vector<std::int32_t> corner_indices;
    std::vector<float> corner_sharpnesses;
    // Primvars of the cage: uniform, vertex (varying too) or corner (face-varying).
    Primvar<V3f> normals;  // of flat polygons; a subdivided surface has its own
    Primvar<V2f> uvs;
    Primvar<Rgb> colors;
    bool is_boundary_smooth = false;  // interpolateBoundary: false = edgeAndCorner, true = edgeOnly
};

struct RefinedMesh {
    Mesh mesh;
    std::vector<std::int32_t> faces;  // the cage face of each triangle
};

// ValueError, beginning with `path`, for indices, counts and primvars that do not fit together or NaN positions.
void check_control_mesh(const ControlMesh& cage, const std::string& path);

// Refine the cage; `level` >= 1 is the number of quads along each edge of a quad face (made even where there are other
// faces). Level 1 is the triangulated cage with its vertices on the limit surface. Face-varying uvs follow the surface
// inside and are linear along seams and boundaries; colors are bilinear.
RefinedMesh subdivide(const ControlMesh& cage, int level, const std::string& path);

// The same cage as flat polygons: n-gons cut by ear clipping in their plane, holes left out.
RefinedMesh triangulate(const ControlMesh& cage, const std::string& path);

}  // namespace frazil
