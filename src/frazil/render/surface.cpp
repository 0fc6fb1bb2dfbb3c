#include "frazil/render/surface.h"

namespace frazil {
namespace {

V3f towards(const V3f& normal, const V3f& side) {
    return normal.dot(side) < 0.0f ? -normal : normal;
}

// The unit vector nearest to `normal` that has the viewer a little above its horizon.
V3f bent_towards_viewer(const V3f& normal, const V3f& wo) {
    constexpr float kLeastCosine = 1e-3f;
    const float cosine = normal.dot(wo);
    if (cosine >= kLeastCosine) return normal;
    return (normal + wo * (kLeastCosine - cosine)).normalized();
}

// The shading normal turned, in the tangent frame of st, by a normal map's value.
V3f mapped_normal(const Surface& surface, const Object& object, const Mesh& mesh, const Hit& hit,
                  const V3f& tangent_space_normal) {
    // The direction in which s grows, from the triangle's three corners.
    const V3i& t = mesh.triangles[hit.triangle];
    const V2f st0 = mesh.uvs.at(mesh.triangles, hit.triangle, {0.0f, 0.0f});
    const V2f d1 = mesh.uvs.at(mesh.triangles, hit.triangle, {1.0f, 0.0f}) - st0;
    const V2f d2 = mesh.uvs.at(mesh.triangles, hit.triangle, {0.0f, 1.0f}) - st0;
    const float determinant = d1.x * d2.y - d1.y * d2.x;
    if (determinant == 0.0f) return surface.normal;
    const V3f e1 = mesh.positions[t.y] - mesh.positions[t.x];
    const V3f e2 = mesh.positions[t.z] - mesh.positions[t.x];
    V3f tangent;
    object.local_to_world.multDirMatrix((e1 * d2.y - e2 * d1.y) / determinant, tangent);
    tangent -= surface.normal * surface.normal.dot(tangent);
    if (!(tangent.length2() > 0.0f)) return surface.normal;
    tangent.normalize();
    const V3f bitangent = surface.normal.cross(tangent) * (determinant < 0.0f ? -1.0f : 1.0f);
    const V3f n =
        tangent * tangent_space_normal.x + bitangent * tangent_space_normal.y + surface.normal * tangent_space_normal.z;
    return n.length2() > 0.0f ? n.normalized() : surface.normal;
}

}  // namespace

SurfaceResolver::SurfaceResolver(const Scene& scene) : scene_(scene) {
    world_to_local_.reserve(scene.objects.size());
    for (const Object& object : scene.objects) world_to_local_.push_back(object.local_to_world.inverse());
}

Surface SurfaceResolver::resolve(const Hit& hit, const V3f& direction) const {
    const Object& object = scene_.objects[hit.placement];
    const Mesh& mesh = scene_.meshes[object.mesh];
    Surface surface;
    surface.object = hit.placement;
    surface.material = &scene_.materials[object.material];

    // The place from barycentrics: as exact as the vertices, unlike origin + t * direction.
    const V3i& triangle = mesh.triangles[hit.triangle];
    const V3f local = mesh.positions[triangle.x] * (1.0f - hit.uv.x - hit.uv.y) +
                      mesh.positions[triangle.y] * hit.uv.x + mesh.positions[triangle.z] * hit.uv.y;
    surface.local_position = local;
    surface.position = local * object.local_to_world;

    const V3f wo = -direction;
    surface.geometric_normal = towards(hit.geometric_normal, wo);
    surface.normal = surface.geometric_normal;
    if (!mesh.normals.is_empty()) {
        const V3f normal =
            transform_normal(mesh.normals.at(mesh.triangles, hit.triangle, hit.uv), world_to_local_[hit.placement]);
        if (is_finite(normal) && normal.length2() > 0.0f) {
            surface.normal = bent_towards_viewer(towards(normal, surface.geometric_normal), wo);
        }
    }
    if (!mesh.uvs.is_empty()) surface.st = mesh.uvs.at(mesh.triangles, hit.triangle, hit.uv);
    if (!mesh.colors.is_empty()) surface.display_color = mesh.colors.at(mesh.triangles, hit.triangle, hit.uv);
    const auto* standard = std::get_if<StandardMaterial>(&surface.material->model);
    if (standard && standard->normal.texture && !mesh.uvs.is_empty()) {
        const V3f mapped = mapped_normal(surface, object, mesh, hit, eval_normal(standard->normal, surface.st));
        surface.normal = bent_towards_viewer(mapped, wo);
    }
    return surface;
}

}  // namespace frazil
