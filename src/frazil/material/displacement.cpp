#include "frazil/material/displacement.h"

#include <cmath>
#include <tuple>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"

namespace frazil {

void check_displacement(const Displacement& displacement, const std::string& path) {
    if (!std::isfinite(displacement.height.value)) {
        throw ValueError(
            str(path, ": displacement must be finite, got ", displacement.height.value, ". Mend the shader's input."));
    }
    if (displacement.pattern) check_pattern(*displacement.pattern, path);
}

std::vector<V3f> eval_displacement(const Displacement& displacement, const Mesh& mesh, float metres_per_unit) {
    std::vector<V3f> offsets(3 * mesh.triangles.size(), V3f(0.0f));
    parallel_for(mesh.triangles.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t triangle = begin; triangle < end; ++triangle) {
            const V3i& t = mesh.triangles[triangle];
            const auto number = std::uint32_t(triangle);
            const V3f e1 = mesh.positions[t.y] - mesh.positions[t.x], e2 = mesh.positions[t.z] - mesh.positions[t.x];
            const V3f cross = e1.cross(e2);
            if (!(cross.length2() > 0.0f) && mesh.normals.is_empty()) continue;
            TexturePoint at;
            at.has_st = !mesh.uvs.is_empty();
            if (at.has_st) {
                const V2f st0 = mesh.uvs.at(mesh.triangles, number, {0.0f, 0.0f});
                const V2f d1 = mesh.uvs.at(mesh.triangles, number, {1.0f, 0.0f}) - st0;
                const V2f d2 = mesh.uvs.at(mesh.triangles, number, {0.0f, 1.0f}) - st0;
                at.set_gradients(e1 * metres_per_unit, e2 * metres_per_unit, d1, d2);
            }
            const float radius = 0.5f * std::sqrt(0.5f * cross.length()) * metres_per_unit;
            for (int k = 0; k < 3; ++k) {
                const V2f corner(k == 1 ? 1.0f : 0.0f, k == 2 ? 1.0f : 0.0f);
                const V3f normal = mesh.normals.is_empty()
                                       ? cross.normalized()
                                       : mesh.normals.at(mesh.triangles, number, corner).normalized();
                if (at.has_st) at.st = mesh.uvs.at(mesh.triangles, number, corner);
                at.position = mesh.positions[t[k]] * metres_per_unit;
                at.normal = normal;
                std::tie(at.long_axis, at.short_axis) = tangent_frame(normal);
                at.long_axis *= radius, at.short_axis *= radius;

                V3f offset = normal;
                if (displacement.vector) {
                    const V3f v = eval_color(*displacement.vector, at);
                    if (displacement.space == VectorSpace::object) {
                        offset = v;
                    } else {
                        const auto [tangent, bitangent] = at.st_frame();
                        offset = tangent * v.x + bitangent * v.y + normal * v.z;
                    }
                } else {
                    offset *= eval_float(displacement.height, at);
                }
                if (displacement.pattern) {
                    offset *= eval_pattern(*displacement.pattern, {at.position, normal, radius});
                }
                offsets[3 * triangle + std::size_t(k)] = offset;
            }
        }
    });
    return offsets;
}

}  // namespace frazil
