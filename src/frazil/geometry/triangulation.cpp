// The flat half of subdivision.h: checks of a cage, and polygons cut by ear clipping.
#include <numeric>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/geometry/subdivision.h"

namespace frazil {
namespace {

constexpr float kLargestCoordinate = 1e15f;  // squares of lengths stay finite

template <class T>
void check_cage_primvar(const Primvar<T>& primvar, const ControlMesh& cage, const std::string& path, const char* name) {
    if (primvar.is_empty()) return;
    const std::size_t expected[] = {1, cage.face_vertex_counts.size(), cage.positions.size(),
                                    cage.face_vertex_indices.size()};
    constexpr const char* kPer[] = {"mesh", "face", "vertex", "face corner"};
    const int kind = int(primvar.interpolation);
    if (primvar.values.size() == expected[kind]) return;
    throw ValueError(str(path, ": ", name, " must have ", expected[kind], " values (one per ", kPer[kind], "), got ",
                         primvar.values.size(), ". Check its interpolation."));
}

// One polygon in its own plane, as a ring of corners that ears are clipped from.
class EarClipper {
  public:
    // Fill `corners` with (count - 2) triples of corner numbers 0..count-1.
    void clip(const V3f* const* positions, int count, std::int32_t* corners) {
        project(positions, count);
        previous_.resize(count), next_.resize(count), is_reflex_.resize(count);
        for (int i = 0; i < count; ++i) previous_[i] = (i + count - 1) % count, next_[i] = (i + 1) % count;
        for (int i = 0; i < count; ++i) is_reflex_[i] = area(previous_[i], i, next_[i]) <= 0.0;

        int at = 0, remaining = count, misses = 0;
        while (remaining > 3) {
            // A polygon that crosses itself may have no ear: take any corner then, so that the loop ends.
            if (!is_ear(at) && misses++ < remaining) {
                at = next_[at];
                continue;
            }
            misses = 0;
            const int before = previous_[at], after = next_[at];
            *corners++ = before, *corners++ = at, *corners++ = after;
            next_[before] = after, previous_[after] = before;
            is_reflex_[at] = 0;
            is_reflex_[before] = area(previous_[before], before, after) <= 0.0;
            is_reflex_[after] = area(before, after, next_[after]) <= 0.0;
            --remaining;
            // Skip one corner, so that a convex polygon does not become a fan of slivers.
            at = next_[after];
        }
        *corners++ = previous_[at], *corners++ = at, *corners++ = next_[at];
    }

  private:
    // Drop the axis that the polygon faces most, keeping its orientation.
    void project(const V3f* const* positions, int count) {
        V3d normal(0.0);
        for (int i = 0; i < count; ++i) {
            const V3d a = V3d(*positions[i]) - V3d(*positions[0]);
            const V3d b = V3d(*positions[(i + 1) % count]) - V3d(*positions[0]);
            normal += a.cross(b);
        }
        int axis = 0;
        for (int i = 1; i < 3; ++i) {
            if (std::abs(normal[i]) > std::abs(normal[axis])) axis = i;
        }
        int x = (axis + 1) % 3, y = (axis + 2) % 3;
        if (normal[axis] < 0.0) std::swap(x, y);
        points_.resize(count);
        for (int i = 0; i < count; ++i) points_[i] = {double((*positions[i])[x]), double((*positions[i])[y])};
    }

    double area(int a, int b, int c) const { return (points_[b] - points_[a]).cross(points_[c] - points_[a]); }

    bool is_ear(int at) const {
        if (is_reflex_[at]) return false;
        const int a = previous_[at], c = next_[at];
        for (int i = next_[c]; i != a; i = next_[i]) {
            if (!is_reflex_[i] || points_[i] == points_[a] || points_[i] == points_[at] || points_[i] == points_[c]) {
                continue;
            }
            if (area(a, at, i) >= 0.0 && area(at, c, i) >= 0.0 && area(c, a, i) >= 0.0) return false;
        }
        return true;
    }

    std::vector<Imath::V2d> points_;
    std::vector<int> previous_, next_;
    std::vector<std::uint8_t> is_reflex_;
};

// A quad along the diagonal that leaves both halves on the front side; the first one where both do.
void split_quad(const V3f* const* p, std::int32_t* corners) {
    const auto cross = [&](int a, int b, int c) { return (V3d(*p[b]) - V3d(*p[a])).cross(V3d(*p[c]) - V3d(*p[a])); };
    const V3d normal = (V3d(*p[2]) - V3d(*p[0])).cross(V3d(*p[3]) - V3d(*p[1]));
    const bool is_first_valid = cross(0, 1, 2).dot(normal) >= 0.0 && cross(0, 2, 3).dot(normal) >= 0.0;
    constexpr std::int32_t kFirst[] = {0, 1, 2, 0, 2, 3}, kSecond[] = {1, 2, 3, 1, 3, 0};
    std::copy_n(is_first_valid ? kFirst : kSecond, 6, corners);
}

template <class T>
Primvar<T> to_triangles(const Primvar<T>& primvar, const std::vector<std::int32_t>& corners,
                        const std::vector<std::int32_t>& faces) {
    Primvar<T> result{{}, primvar.interpolation};
    if (primvar.is_empty()) return result;
    if (primvar.interpolation == Interpolation::corner) {
        result.values.resize(corners.size());
        for (std::size_t i = 0; i < corners.size(); ++i) result.values[i] = primvar.values[corners[i]];
    } else if (primvar.interpolation == Interpolation::uniform) {
        result.values.resize(faces.size());
        for (std::size_t i = 0; i < faces.size(); ++i) result.values[i] = primvar.values[faces[i]];
    } else {
        result.values = primvar.values;
    }
    return result;
}

}  // namespace

void check_control_mesh(const ControlMesh& cage, const std::string& path) {
    for (std::size_t i = 0; i < cage.positions.size(); ++i) {
        const V3f& p = cage.positions[i];
        if (!is_finite(p)) {
            throw ValueError(str(path, ": points must be finite, got NaN or infinity at point ", i,
                                 ". Clean the mesh where it was made."));
        }
        if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) > kLargestCoordinate) {
            throw ValueError(str(path, ": points must be within +-", kLargestCoordinate, ", got (", p.x, ", ", p.y,
                                 ", ", p.z, ") at point ", i, ". Clean the mesh where it was made."));
        }
    }
    std::int64_t corners = 0;
    for (std::size_t i = 0; i < cage.face_vertex_counts.size(); ++i) {
        if (cage.face_vertex_counts[i] < 0) {
            throw ValueError(
                str(path, ": faceVertexCounts must be >= 0, got ", cage.face_vertex_counts[i], " at face ", i, "."));
        }
        corners += cage.face_vertex_counts[i];
    }
    if (corners != std::int64_t(cage.face_vertex_indices.size())) {
        throw ValueError(str(path, ": faceVertexIndices must have ", corners,
                             " entries (the sum of faceVertexCounts), got ", cage.face_vertex_indices.size(), "."));
    }
    const auto check_range = [&](const std::vector<std::int32_t>& indices, std::size_t size, const char* name,
                                 const char* of) {
        for (std::size_t i = 0; i < indices.size(); ++i) {
            if (indices[i] >= 0 && std::size_t(indices[i]) < size) continue;
            throw ValueError(str(path, ": ", name, " must be in 0..", std::int64_t(size) - 1, ", got ", indices[i],
                                 " at entry ", i, ". The mesh has ", size, " ", of, "."));
        }
    };
    check_range(cage.face_vertex_indices, cage.positions.size(), "faceVertexIndices", "points");
    check_range(cage.hole_faces, cage.face_vertex_counts.size(), "holeIndices", "faces");
    check_range(cage.crease_indices, cage.positions.size(), "creaseIndices", "points");
    check_range(cage.corner_indices, cage.positions.size(), "cornerIndices", "points");
    check_cage_primvar(cage.normals, cage, path, "normals");
    check_cage_primvar(cage.uvs, cage, path, "st");
    check_cage_primvar(cage.colors, cage, path, "displayColor");
}

RefinedMesh triangulate(const ControlMesh& cage, const std::string& path) {
    check_control_mesh(cage, path);
    const std::size_t face_count = cage.face_vertex_counts.size();
    std::vector<std::uint8_t> is_hole(face_count, 0);
    for (const std::int32_t face : cage.hole_faces) is_hole[face] = 1;

    // Count first, so that every face knows where its triangles go.
    std::vector<std::size_t> first_corner(face_count + 1, 0), first_triangle(face_count + 1, 0);
    for (std::size_t face = 0; face < face_count; ++face) {
        const int count = cage.face_vertex_counts[face];
        first_corner[face + 1] = first_corner[face] + count;
        first_triangle[face + 1] = first_triangle[face] + (is_hole[face] ? 0 : std::max(0, count - 2));
    }

    RefinedMesh result;
    result.faces.resize(first_triangle.back());
    std::vector<std::int32_t> corners(3 * first_triangle.back());
    parallel_for(face_count, 4096, [&](std::size_t begin, std::size_t end) {
        EarClipper clipper;
        std::vector<const V3f*> positions;
        for (std::size_t face = begin; face < end; ++face) {
            const std::size_t triangles = first_triangle[face + 1] - first_triangle[face];
            if (triangles == 0) continue;
            std::int32_t* out = &corners[3 * first_triangle[face]];
            const int count = cage.face_vertex_counts[face];
            positions.resize(count);
            for (int i = 0; i < count; ++i) {
                positions[i] = &cage.positions[cage.face_vertex_indices[first_corner[face] + i]];
            }
            if (count == 3) {
                std::iota(out, out + 3, 0);
            } else if (count == 4) {
                split_quad(positions.data(), out);
            } else {
                clipper.clip(positions.data(), count, out);
            }
            for (std::size_t i = 0; i < 3 * triangles; ++i) out[i] += std::int32_t(first_corner[face]);
            std::fill_n(&result.faces[first_triangle[face]], triangles, std::int32_t(face));
        }
    });

    Mesh& mesh = result.mesh;
    mesh.positions = cage.positions;
    mesh.triangles.resize(first_triangle.back());
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        for (int corner = 0; corner < 3; ++corner) {
            mesh.triangles[i][corner] = cage.face_vertex_indices[corners[3 * i + corner]];
        }
    }
    mesh.normals = to_triangles(cage.normals, corners, result.faces);
    mesh.uvs = to_triangles(cage.uvs, corners, result.faces);
    mesh.colors = to_triangles(cage.colors, corners, result.faces);
    return result;
}

}  // namespace frazil
