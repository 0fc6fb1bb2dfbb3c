// Displacement: heights along the normal, or vectors, that make a surface's true shape before points and rays meet it.
// Model: offset = normal * height * pattern, or a vector in the frame of st, or in the mesh's own.
// Units: those of the mesh (its positions); patterns in metres, by `metres_per_unit`.
// Valid: at corners of triangles that are fine enough for the image (geometry/refinement.h); images are read over a disc
//   of half the triangle's size, so that what the mesh cannot show does not alias.
// Not: overlapping or self-intersecting results, which are the artist's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frazil/geometry/mesh.h"
#include "frazil/material/pattern.h"
#include "frazil/material/texture.h"

namespace frazil {

enum class VectorSpace { tangent, object };

struct Displacement {
    MaterialInput<float> height{0.0f, {}};
    std::optional<MaterialInput<Rgb>> vector;  // takes the place of the height
    VectorSpace space = VectorSpace::tangent;
    std::optional<Pattern> pattern;  // multiplies either
};

// ValueError beginning with `path`.
void check_displacement(const Displacement& displacement, const std::string& path);

// Offsets at the corners of all triangles, 3 each, for displaced().
std::vector<V3f> eval_displacement(const Displacement& displacement, const Mesh& mesh, float metres_per_unit);

}  // namespace frazil
