#include "frazil/render/surface.h"

#include "frazil/base/parallel.h"

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

// The rotation (and mirroring) of a matrix, its scale and shear left out: the orthogonal part of its polar decomposition by
// Newton's iteration, with the matrix's translation.
M44f rigid_part(const M44f& matrix) {
    M44f m = matrix;
    m[3][0] = m[3][1] = m[3][2] = 0.0f;
    for (int step = 0; step < 30; ++step) {
        const M44f inverse = m.inverse();
        const M44f next = (m + inverse.transposed()) * 0.5f;
        float change = 0.0f;
        for (int i = 0; i < 3; ++i) {
            for (int j = 0; j < 3; ++j) change = std::max(change, std::abs(next[i][j] - m[i][j]));
        }
        m = next;
        if (change < 1e-6f) break;
    }
    m[3][0] = matrix[3][0], m[3][1] = matrix[3][1], m[3][2] = matrix[3][2], m[3][3] = 1.0f;
    return m;
}

Covering covering_at(const IceMaterial& ice, const PatternPoint& place, const V2f& st, bool with_bump) {
    const float roughness = eval_float(ice.roughness, st);
    if (!ice.overlays.empty()) return eval_overlays(ice.overlays, ice.age, roughness, place, st, with_bump);
    Covering bare;
    bare.roughness = roughness;
    return bare;
}

}  // namespace

SurfaceResolver::SurfaceResolver(const Scene& scene) : scene_(scene) {
    frames_.reserve(scene.objects.size());
    for (const Object& object : scene.objects) {
        const M44f rigid = rigid_part(object.local_to_world);
        frames_.push_back({object.local_to_world.inverse(), rigid.inverse(), rigid});
    }
}

PatternPoint SurfaceResolver::place(std::uint32_t object, const V3f& position, const V3f& normal,
                                    float footprint) const {
    PatternPoint point;
    point.position = position * world_to_rest(object);
    world_to_rest(object).multDirMatrix(normal, point.normal);
    point.footprint = footprint;
    return point;
}

std::vector<CoveringSlope> SurfaceResolver::slopes(const Surface& surface) const {
    const auto* ice = std::get_if<IceMaterial>(&surface.material->model);
    return ice ? covering_slopes(ice->overlays, ice->age, surface.place, surface.st) : std::vector<CoveringSlope>();
}

std::vector<float> SurfaceResolver::taken_by_overlays(std::uint32_t object, const PointSet& points) const {
    const auto& ice = std::get<IceMaterial>(scene_.materials[scene_.objects[object].material].model);
    const std::size_t overlays = ice.overlays.size();
    std::vector<float> result(points.size() * overlays);
    for_points(object, points, [&](std::size_t k, const PatternPoint& at, const V2f& st) {
        const std::vector<CoveringSlope> slopes = covering_slopes(ice.overlays, ice.age, at, st);
        const float scattered = eval_overlays(ice.overlays, ice.age, 0.0f, at, st, false).scattered;
        for (std::size_t o = 0; o < overlays; ++o) {
            result[k * overlays + o] = scattered < 1.0f ? slopes[o].scattered / (1.0f - scattered) : 0.0f;
        }
    });
    return result;
}

template <class Visit>
void SurfaceResolver::for_points(std::uint32_t object, const PointSet& points, const Visit& visit) const {
    const Mesh& mesh = scene_.meshes[scene_.objects[object].mesh];
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const auto triangle = static_cast<std::uint32_t>(points.triangles[k]);
            const V2f st =
                mesh.uvs.is_empty() ? V2f(0.0f) : mesh.uvs.at(mesh.triangles, triangle, points.barycentrics[k]);
            // A point stands for a disc of its area.
            const float footprint = std::sqrt(points.areas[k] * kInvPi);
            visit(k, place(object, points.positions[k], points.normals[k], footprint), st);
        }
    });
}

std::vector<float> SurfaceResolver::entering(std::uint32_t object, const PointSet& points) const {
    const auto* ice = std::get_if<IceMaterial>(&scene_.materials[scene_.objects[object].material].model);
    if (!ice || ice->overlays.empty()) return {};
    std::vector<float> result(points.size());
    for_points(object, points, [&](std::size_t k, const PatternPoint& at, const V2f& st) {
        result[k] = 1.0f - eval_overlays(ice->overlays, ice->age, 0.0f, at, st, false).scattered;
    });
    return result;
}

Surface SurfaceResolver::resolve(const Hit& hit, const V3f& direction, float footprint, bool with_bump) const {
    const Object& object = scene_.objects[hit.placement];
    const Mesh& mesh = scene_.meshes[object.mesh];
    Surface surface;
    surface.object = hit.placement;
    surface.material = &scene_.materials[object.material];

    // The place from barycentrics: as exact as the vertices, unlike origin + t * direction.
    const V3i& triangle = mesh.triangles[hit.triangle];
    const auto at_hit = [&](const std::vector<V3f>& positions) {
        return positions[triangle.x] * (1.0f - hit.uv.x - hit.uv.y) + positions[triangle.y] * hit.uv.x +
               positions[triangle.z] * hit.uv.y;
    };
    const V3f local = at_hit(mesh.positions);
    surface.local_position = mesh.rest.empty() ? local : at_hit(mesh.rest);
    surface.position = local * object.local_to_world;

    const V3f wo = -direction;
    surface.geometric_normal = towards(hit.geometric_normal, wo);
    surface.normal = surface.geometric_normal;
    if (!mesh.normals.is_empty()) {
        const V3f normal = transform_normal(mesh.normals.at(mesh.triangles, hit.triangle, hit.uv),
                                            frames_[hit.placement].world_to_local);
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
    if (const auto* ice = std::get_if<IceMaterial>(&surface.material->model)) {
        // Patterns see the surface from outside, whichever side the viewer is on.
        const V3f outside = surface.normal * (hit.geometric_normal.dot(surface.geometric_normal) < 0.0f ? -1.0f : 1.0f);
        surface.place = place(hit.placement, surface.position, outside, footprint);
        surface.covering = covering_at(*ice, surface.place, surface.st, with_bump);
        if (surface.covering.slope != V3f(0.0f)) {
            V3f slope;
            rest_to_world(hit.placement).multDirMatrix(surface.covering.slope, slope);
            slope -= outside * outside.dot(slope);
            const V3f tilted = towards((outside - slope).normalized(), surface.geometric_normal);
            surface.normal = bent_towards_viewer(tilted, wo);
        }
    }
    return surface;
}

}  // namespace frazil
