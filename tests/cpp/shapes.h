// Shapes that several tests render or sample.
#pragma once

#include <map>
#include <utility>

#include "frazil/geometry/mesh.h"

namespace frazil::test {

// A sphere about the origin: an octahedron whose triangles are cut in four `levels` times, with smooth normals.
inline Mesh sphere(float radius, int levels) {
    Mesh mesh;
    mesh.positions = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    mesh.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    for (int level = 0; level < levels; ++level) {
        std::map<std::pair<int, int>, int> middles;
        const auto middle = [&](int a, int b) {
            const auto [found, is_new] =
                middles.try_emplace(std::minmax(a, b), static_cast<int>(mesh.positions.size()));
            if (is_new) mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]).normalized());
            return found->second;
        };
        std::vector<V3i> finer;
        for (const V3i& t : mesh.triangles) {
            const int ab = middle(t.x, t.y), bc = middle(t.y, t.z), ca = middle(t.z, t.x);
            finer.insert(finer.end(), {{t.x, ab, ca}, {ab, t.y, bc}, {ca, bc, t.z}, {ab, bc, ca}});
        }
        mesh.triangles = std::move(finer);
    }
    mesh.normals = {mesh.positions, Interpolation::vertex};
    for (V3f& position : mesh.positions) position *= radius;
    return mesh;
}

// A box between two corners, facing outwards.
inline Mesh box_of(const V3f& low, const V3f& high) {
    Mesh box;
    for (const float z : {low.z, high.z}) {
        box.positions.insert(box.positions.end(),
                             {{low.x, low.y, z}, {high.x, low.y, z}, {high.x, high.y, z}, {low.x, high.y, z}});
    }
    box.triangles = {{0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}, {0, 1, 5}, {0, 5, 4},
                     {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
    return box;
}

// A square of the given half side in the plane y = height, facing +y.
inline Mesh floor_square(float half, float height) {
    Mesh mesh;
    mesh.positions = {{-half, height, half}, {half, height, half}, {half, height, -half}, {-half, height, -half}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    return mesh;
}

}  // namespace frazil::test
