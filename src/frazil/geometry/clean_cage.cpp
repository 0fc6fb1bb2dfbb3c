#include "frazil/geometry/clean_cage.h"

#include <algorithm>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr std::size_t kMaxFaceSize = 15;  // Embree's

bool has_repeated_vertex(const std::vector<std::int32_t>& vertices, std::vector<std::int32_t>& scratch) {
    scratch = vertices;
    std::sort(scratch.begin(), scratch.end());
    return std::adjacent_find(scratch.begin(), scratch.end()) != scratch.end();
}

}  // namespace

CleanCage clean_cage(const ControlMesh& cage, const std::string& path) {
    CleanCage result;
    std::vector<std::size_t> first_piece(cage.face_vertex_counts.size());
    ControlMesh& out = result.cage;
    const auto add_face = [&](std::size_t face, const std::vector<std::size_t>& corners) {
        out.face_vertex_counts.push_back(std::int32_t(corners.size()));
        result.faces.push_back(std::int32_t(face));
        for (const std::size_t corner : corners) {
            out.face_vertex_indices.push_back(cage.face_vertex_indices[corner]);
            result.corners.push_back(corner);
        }
    };
    std::size_t first = 0;
    std::vector<std::size_t> corners;
    std::vector<std::int32_t> vertices, scratch;
    for (std::size_t face = 0; face < cage.face_vertex_counts.size(); ++face) {
        const int count = cage.face_vertex_counts[face];
        first_piece[face] = result.faces.size();
        // Edges without length go: a corner whose vertex is the next one's, too.
        corners.clear(), vertices.clear();
        for (int i = 0; i < count; ++i) {
            const std::int32_t vertex = cage.face_vertex_indices[first + i];
            if (vertex == cage.face_vertex_indices[first + (i + 1) % count]) continue;
            corners.push_back(first + i), vertices.push_back(vertex);
        }
        first += count;
        if (corners.size() < 3) continue;
        if (corners.size() <= kMaxFaceSize && !has_repeated_vertex(vertices, scratch)) {
            add_face(face, corners);
            continue;
        }
        ControlMesh polygon;
        polygon.face_vertex_counts = {std::int32_t(corners.size())};
        for (std::size_t i = 0; i < corners.size(); ++i) {
            polygon.positions.push_back(cage.positions[vertices[i]]);
            polygon.face_vertex_indices.push_back(std::int32_t(i));
        }
        for (const V3i& t : triangulate(polygon, path).mesh.triangles) {
            if (has_repeated_vertex({vertices[t.x], vertices[t.y], vertices[t.z]}, scratch)) continue;
            add_face(face, {corners[t.x], corners[t.y], corners[t.z]});
        }
    }
    out.positions = cage.positions;
    out.crease_indices = cage.crease_indices;
    out.crease_lengths = cage.crease_lengths;
    out.crease_sharpnesses = cage.crease_sharpnesses;
    out.corner_indices = cage.corner_indices;
    out.corner_sharpnesses = cage.corner_sharpnesses;
    out.is_boundary_smooth = cage.is_boundary_smooth;
    for (const std::int32_t hole : cage.hole_faces) {
        for (std::size_t i = first_piece[hole]; i < result.faces.size() && result.faces[i] == hole; ++i) {
            out.hole_faces.push_back(std::int32_t(i));
        }
    }
    const auto pull = [&](const auto& primvar, auto& pulled) {
        pulled.interpolation = primvar.interpolation;
        if (primvar.is_empty()) return;
        if (primvar.interpolation == Interpolation::corner) {
            for (const std::size_t corner : result.corners) pulled.values.push_back(primvar.values[corner]);
        } else if (primvar.interpolation == Interpolation::uniform) {
            for (const std::int32_t face : result.faces) pulled.values.push_back(primvar.values[face]);
        } else {
            pulled.values = primvar.values;
        }
    };
    pull(cage.uvs, out.uvs);
    pull(cage.colors, out.colors);
    return result;
}

void check_creases(const ControlMesh& cage, const std::string& path) {
    std::size_t indices = 0, edges = 0;
    for (const std::int32_t length : cage.crease_lengths) {
        if (length < 2) throw ValueError(str(path, ": creaseLengths must be >= 2, got ", length, "."));
        indices += length, edges += length - 1;
    }
    if (indices != cage.crease_indices.size()) {
        throw ValueError(str(path, ": creaseIndices must have ", indices, " entries (the sum of creaseLengths), got ",
                             cage.crease_indices.size(), "."));
    }
    const std::size_t sharpnesses = cage.crease_sharpnesses.size();
    if (sharpnesses != cage.crease_lengths.size() && sharpnesses != edges) {
        throw ValueError(str(path, ": creaseSharpnesses must have ", cage.crease_lengths.size(),
                             " values (one per crease), got ", sharpnesses, "."));
    }
    for (const auto* values : {&cage.crease_sharpnesses, &cage.corner_sharpnesses}) {
        for (const float value : *values) {
            if (!(value >= 0.0f)) throw ValueError(str(path, ": sharpness must be >= 0, got ", value, "."));
        }
    }
    if (cage.corner_indices.size() != cage.corner_sharpnesses.size()) {
        throw ValueError(str(path, ": cornerSharpnesses must have ", cage.corner_indices.size(),
                             " values (one per corner), got ", cage.corner_sharpnesses.size(), "."));
    }
}

}  // namespace frazil
