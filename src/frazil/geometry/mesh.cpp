#include "frazil/geometry/mesh.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"

namespace frazil {
namespace {

template <class T>
void check_primvar(const Primvar<T>& primvar, const Mesh& mesh, const std::string& path, const char* name) {
    if (primvar.is_empty()) return;
    std::size_t expected = 1;
    switch (primvar.interpolation) {
        case Interpolation::constant:
            expected = 1;
            break;
        case Interpolation::uniform:
            expected = mesh.triangles.size();
            break;
        case Interpolation::vertex:
            expected = mesh.positions.size();
            break;
        case Interpolation::corner:
            expected = 3 * mesh.triangles.size();
            break;
    }
    if (primvar.values.size() != expected) {
        throw ValueError(str(path, ": ", name, " must have ", expected, " values, got ", primvar.values.size(),
                             ". Give one per vertex or one per triangle corner."));
    }
}

}  // namespace

void check_mesh(const Mesh& mesh, const std::string& path) {
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
        if (!is_finite(mesh.positions[i])) {
            throw ValueError(str(path, ": positions must be finite, got NaN or infinity at vertex ", i,
                                 ". Clean the mesh where it was made."));
        }
    }
    const int vertices = static_cast<int>(mesh.positions.size());
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        for (int corner = 0; corner < 3; ++corner) {
            const int index = mesh.triangles[i][corner];
            if (index < 0 || index >= vertices) {
                throw ValueError(str(path, ": triangle indices must be in 0..", vertices - 1, ", got ", index,
                                     " in triangle ", i, ". The mesh has ", vertices, " vertices."));
            }
        }
    }
    check_primvar(mesh.normals, mesh, path, "normals");
    check_primvar(mesh.uvs, mesh, path, "uvs");
    check_primvar(mesh.colors, mesh, path, "colors");
    if (!mesh.rest.empty() && mesh.rest.size() != mesh.positions.size()) {
        throw ValueError(str(path, ": rest must have one position per vertex (", mesh.positions.size(), "), got ",
                             mesh.rest.size(), ". Give the rest pose of the same mesh."));
    }
    if (!mesh.spacing.empty() && mesh.spacing.size() != mesh.positions.size()) {
        throw ValueError(str(path, ": spacing must have one value per vertex (", mesh.positions.size(), "), got ",
                             mesh.spacing.size(), ". Give one distance per vertex."));
    }
    for (std::size_t i = 0; i < mesh.spacing.size(); ++i) {
        if (mesh.spacing[i] > 0.0f && std::isfinite(mesh.spacing[i])) continue;
        throw ValueError(str(path, ": spacing must be > 0 and finite, got ", mesh.spacing[i], " at vertex ", i,
                             ". It is in metres."));
    }
    for (std::size_t i = 0; i < mesh.rest.size(); ++i) {
        if (is_finite(mesh.rest[i])) continue;
        throw ValueError(str(path, ": rest must be finite, got NaN or infinity at vertex ", i,
                             ". Clean the mesh where it was made."));
    }
}

Mesh rest_pose(const Mesh& mesh) {
    Mesh result;
    result.positions = mesh.rest;
    result.triangles = mesh.triangles;
    return result;
}

V3d triangle_cross(const Mesh& mesh, std::size_t triangle) {
    const V3i& t = mesh.triangles[triangle];
    const V3d a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
    return (b - a).cross(c - a);
}

double surface_area(const Mesh& mesh) {
    return parallel_sum(mesh.triangles.size(), 4096, 0.0, [&](std::size_t begin, std::size_t end) {
        double area = 0.0;
        for (std::size_t i = begin; i < end; ++i) area += 0.5 * triangle_cross(mesh, i).length();
        return area;
    });
}

Box3f bounds(const Mesh& mesh) {
    Box3f box;
    for (const V3f& position : mesh.positions) box.extendBy(position);
    return box;
}

Mesh transformed(const Mesh& mesh, const M44f& local_to_world) {
    Mesh result = mesh;
    const M44f world_to_local = local_to_world.inverse();
    for (V3f& position : result.positions) position = position * local_to_world;
    for (V3f& position : result.rest) position = position * local_to_world;
    for (V3f& normal : result.normals.values) normal = transform_normal(normal, world_to_local);
    const V3f x(local_to_world[0][0], local_to_world[0][1], local_to_world[0][2]);
    const V3f y(local_to_world[1][0], local_to_world[1][1], local_to_world[1][2]);
    const V3f z(local_to_world[2][0], local_to_world[2][1], local_to_world[2][2]);
    if (x.cross(y).dot(z) >= 0.0f) return result;

    for (V3i& triangle : result.triangles) std::swap(triangle.y, triangle.z);
    const auto swap_corners = [](auto& primvar) {
        if (primvar.interpolation != Interpolation::corner) return;
        for (std::size_t i = 0; i + 2 < primvar.values.size(); i += 3)
            std::swap(primvar.values[i + 1], primvar.values[i + 2]);
    };
    swap_corners(result.normals);
    swap_corners(result.uvs);
    swap_corners(result.colors);
    return result;
}

namespace {

template <class T>
Primvar<T> select(const Primvar<T>& primvar, const std::vector<std::int32_t>& triangles,
                  const std::vector<std::int32_t>& kept_vertices) {
    Primvar<T> result{{}, primvar.interpolation};
    if (primvar.is_empty()) return result;
    switch (primvar.interpolation) {
        case Interpolation::constant:
            result.values = primvar.values;
            break;
        case Interpolation::uniform:
            for (const std::int32_t t : triangles) result.values.push_back(primvar.values[t]);
            break;
        case Interpolation::vertex:
            for (const std::int32_t v : kept_vertices) result.values.push_back(primvar.values[v]);
            break;
        case Interpolation::corner:
            for (const std::int32_t t : triangles) {
                for (int corner = 0; corner < 3; ++corner) {
                    result.values.push_back(primvar.values[3 * std::size_t(t) + corner]);
                }
            }
            break;
    }
    return result;
}

}  // namespace

Mesh submesh(const Mesh& mesh, const std::vector<std::int32_t>& triangles) {
    Mesh result;
    std::vector<std::int32_t> new_index(mesh.positions.size(), -1), kept_vertices;
    for (const std::int32_t t : triangles) {
        V3i triangle = mesh.triangles[t];
        for (int corner = 0; corner < 3; ++corner) {
            std::int32_t& index = new_index[triangle[corner]];
            if (index < 0) {
                index = std::int32_t(kept_vertices.size());
                kept_vertices.push_back(triangle[corner]);
            }
            triangle[corner] = index;
        }
        result.triangles.push_back(triangle);
    }
    for (const std::int32_t v : kept_vertices) {
        result.positions.push_back(mesh.positions[v]);
        if (!mesh.rest.empty()) result.rest.push_back(mesh.rest[v]);
        if (!mesh.spacing.empty()) result.spacing.push_back(mesh.spacing[v]);
    }
    result.normals = select(mesh.normals, triangles, kept_vertices);
    result.uvs = select(mesh.uvs, triangles, kept_vertices);
    result.colors = select(mesh.colors, triangles, kept_vertices);
    return result;
}

}  // namespace frazil
