#include "frazil/render/inside_out.h"

#include <map>

#include "frazil/base/error.h"
#include "frazil/render/interior.h"

namespace frazil {
namespace {

double signed_volume(const Mesh& mesh) {
    const V3d center(bounds(mesh).center());
    double volume = 0.0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        volume += triangle_cross(mesh, i).dot(V3d(mesh.positions[std::size_t(mesh.triangles[i].x)]) - center);
    }
    return volume;
}

bool is_inside_out(const Mesh& mesh) {
    // The volume is quick to tell, whether the mesh is closed is not.
    return !mesh.triangles.empty() && signed_volume(mesh) < 0.0 && outward_side(mesh) < 0.0f;
}

// A mirror turns the faces round; what is mirrored back then stays where it was.
Mesh turned(const Mesh& mesh) {
    M44f mirror;
    mirror[0][0] = -1.0f;
    Mesh result = transformed(mesh, mirror);
    for (V3f& position : result.positions) position.x = -position.x;
    for (V3f& position : result.rest) position.x = -position.x;
    for (V3f& normal : result.normals.values) normal.x = -normal.x;
    return result;
}

}  // namespace

TurnedScene turned_outwards(const Scene& scene) {
    TurnedScene result;
    std::map<std::uint32_t, bool> known;  // by mesh
    for (const Object& object : scene.objects) {
        if (!std::holds_alternative<IceMaterial>(scene.materials[object.material].model)) continue;
        const auto [found, is_new] = known.try_emplace(object.mesh, false);
        if (is_new) {
            found->second = is_inside_out(scene.meshes[object.mesh]);
            if (found->second) {
                if (!result.scene) result.scene = scene;
                Mesh& mesh = result.scene->meshes[object.mesh];
                mesh = turned(mesh);
            }
        }
        if (found->second) {
            result.warnings.push_back(str(object.path,
                                          ": the faces of ice must wind outwards, got a mesh that is inside out. It is "
                                          "turned round; flip its faces, or its orientation in USD."));
        }
    }
    return result;
}

}  // namespace frazil
