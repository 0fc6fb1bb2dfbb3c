#include "frazil/render/surface.h"

#include <algorithm>
#include <tuple>

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

// A place from its barycentrics: as exact as the vertices, unlike a ray's origin + t * direction.
V3f at_hit(const std::vector<V3f>& positions, const V3i& triangle, const V2f& uv) {
    return positions[triangle.x] * (1.0f - uv.x - uv.y) + positions[triangle.y] * uv.x + positions[triangle.z] * uv.y;
}

// The place that the tangent planes of a triangle's corners curve over: never below the triangle [Hanika2021]. `normals`
// are on the viewer's side.
V3f lifted(const V3f corners[3], const V3f normals[3], const V2f& uv, const V3f& position) {
    constexpr float kHighest = 0.25f;  // of the longest edge: what normals tell of a box is not its shape
    const float weights[3] = {1.0f - uv.x - uv.y, uv.x, uv.y};
    V3f sum(0.0f);
    float longest2 = 0.0f;
    for (int k = 0; k < 3; ++k) {
        const V3f away = position - corners[k];
        sum += normals[k] * (weights[k] * std::max(0.0f, -away.dot(normals[k])));
        longest2 = std::max(longest2, (corners[(k + 1) % 3] - corners[k]).length2());
    }
    const float limit2 = kHighest * kHighest * longest2;
    if (sum.length2() > limit2) sum *= std::sqrt(limit2 / sum.length2());
    return position + sum;
}

// The longer and the shorter half axis of what a cone of radius `footprint` cuts out of the surface.
std::pair<V3f, V3f> footprint_axes(const V3f& n, const V3f& wo, float footprint, float least_cosine) {
    V3f slant = wo - n * n.dot(wo);
    slant = slant.length2() > 1e-8f ? slant.normalized() : tangent_frame(n).first;
    const float cosine = std::clamp(n.dot(wo), least_cosine, 1.0f);
    return {slant * (footprint / cosine), n.cross(slant) * footprint};
}

// The alpha of the normals' slopes over a footprint, from how they turn over the triangle.
float spread_of_normals(const V3f corners[3], const V3f normals[3], const V3f& n, const V3f& wo, float footprint) {
    constexpr float kLeastCosine = 0.1f, kMost = 0.42f;
    const V3f e1 = corners[1] - corners[0], e2 = corners[2] - corners[0];
    const float a = e1.dot(e1), b = e1.dot(e2), c = e2.dot(e2), determinant = a * c - b * b;
    if (!(determinant > 0.0f)) return 0.0f;
    const auto turn2 = [&](const V3f& way) {
        const float x = way.dot(e1), y = way.dot(e2);
        const float u = (c * x - b * y) / determinant, v = (a * y - b * x) / determinant;
        return ((normals[1] - normals[0]) * u + (normals[2] - normals[0]) * v).length2();
    };
    const auto [longer, shorter] = footprint_axes(n, wo, footprint, kLeastCosine);
    // Half of the mean square over the ellipse is alpha² of the slopes.
    return std::min(kMost, std::sqrt(0.5f * (turn2(longer) + turn2(shorter))));
}

bool has_image(const TextureLookup& lookup) {
    return lookup.texture != nullptr;
}

bool reads_images(const StandardMaterial& m) {
    return has_image(m.diffuse_color.lookup) || has_image(m.emissive_color.lookup) ||
           has_image(m.specular_color.lookup) || has_image(m.metallic.lookup) || has_image(m.roughness.lookup) ||
           has_image(m.clearcoat.lookup) || has_image(m.clearcoat_roughness.lookup) || has_image(m.opacity.lookup) ||
           has_image(m.normal) || has_image(m.bump.lookup);
}

bool reads_images(const IceMaterial& m) {
    return has_image(m.roughness.lookup) || has_image(m.tint.lookup) || has_image(m.normal) ||
           has_image(m.bump.lookup) ||
           std::any_of(m.overlays.begin(), m.overlays.end(), [](const Overlay& o) { return has_image(o.mask.lookup); });
}

// The normal that a bump or a normal map makes of at.normal, in rest space.
V3f mapped_normal(const TextureLookup& map, const MaterialInput<float>& bump, const TexturePoint& at) {
    V3f normal = eval_normal(map, at);
    if (bump.lookup.texture) {
        const V3f slope = eval_slope(bump, at);
        normal = (normal - (slope - normal * normal.dot(slope))).normalized();
    }
    return normal;
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

}  // namespace

SurfaceResolver::SurfaceResolver(const Scene& scene) : scene_(scene) {
    frames_.reserve(scene.objects.size());
    for (const Object& object : scene.objects) {
        const M44f rigid = rigid_part(object.local_to_world);
        frames_.push_back({object.local_to_world.inverse(), rigid.inverse(), rigid});
    }
    for (const Material& material : scene.materials) {
        reads_images_.push_back(std::visit([](const auto& model) { return reads_images(model); }, material.model));
    }
}

TexturePoint SurfaceResolver::texture_point(std::uint32_t object, std::uint32_t triangle, const V2f& uv,
                                            const V3f& position, const V3f& normal) const {
    const Mesh& mesh = scene_.meshes[scene_.objects[object].mesh];
    TexturePoint at;
    at.has_st = !mesh.uvs.is_empty();
    if (at.has_st) at.st = mesh.uvs.at(mesh.triangles, triangle, uv);
    at.position = position * world_to_rest(object);
    world_to_rest(object).multDirMatrix(normal, at.normal);
    if (!at.has_st || !reads_images_[scene_.objects[object].material]) return at;

    // How s and t grow over the triangle, from its three corners.
    const V3i& t = mesh.triangles[triangle];
    const V2f st0 = mesh.uvs.at(mesh.triangles, triangle, {0.0f, 0.0f});
    const V2f d1 = mesh.uvs.at(mesh.triangles, triangle, {1.0f, 0.0f}) - st0;
    const V2f d2 = mesh.uvs.at(mesh.triangles, triangle, {0.0f, 1.0f}) - st0;
    const auto edge = [&](int to) {
        V3f world, rest;
        scene_.objects[object].local_to_world.multDirMatrix(mesh.positions[to] - mesh.positions[t.x], world);
        world_to_rest(object).multDirMatrix(world, rest);
        return rest;
    };
    at.set_gradients(edge(t.y), edge(t.z), d1, d2);
    return at;
}

Covering SurfaceResolver::covering(const IceMaterial& ice, const TexturePoint& at, float footprint, bool with_bump,
                                   std::vector<float>* opacities) const {
    const float roughness = eval_float(ice.roughness, at);
    const PatternPoint point{at.position, at.normal, footprint};
    return eval_overlays(ice.overlays, ice.age, roughness, point, at, with_bump, opacities);
}

std::vector<CoveringSlope> SurfaceResolver::slopes(const Surface& surface) const {
    const auto* ice = std::get_if<IceMaterial>(&surface.material->model);
    if (!ice || surface.overlay_opacities.empty()) return {};
    return covering_slopes(ice->overlays, surface.overlay_opacities);
}

std::vector<float> SurfaceResolver::taken_by_overlays(std::uint32_t object, const PointSet& points) const {
    const auto& ice = std::get<IceMaterial>(scene_.materials[scene_.objects[object].material].model);
    const std::size_t overlays = ice.overlays.size();
    std::vector<float> result(points.size() * overlays);
    look_at_points(object, points, [&](std::size_t k, const Surface& surface) {
        const std::vector<CoveringSlope> of_overlays = slopes(surface);
        const float scattered = surface.covering.scattered;
        for (std::size_t o = 0; o < overlays; ++o) {
            result[k * overlays + o] = scattered < 1.0f ? of_overlays[o].scattered / (1.0f - scattered) : 0.0f;
        }
    });
    return result;
}

void SurfaceResolver::look_at_points(std::uint32_t object, const PointSet& points,
                                     const std::function<void(std::size_t, const Surface&)>& visit) const {
    const Material& material = scene_.materials[scene_.objects[object].material];
    const auto& ice = std::get<IceMaterial>(material.model);
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const auto triangle = static_cast<std::uint32_t>(points.triangles[k]);
            Surface surface;
            surface.object = object;
            surface.material = &material;
            TexturePoint& at = surface.texture_point;
            at = texture_point(object, triangle, points.barycentrics[k], points.positions[k], points.normals[k]);
            const float footprint = std::sqrt(points.areas[k] * kInvPi);
            std::tie(at.long_axis, at.short_axis) = tangent_frame(at.normal);
            at.long_axis *= footprint, at.short_axis *= footprint;
            surface.covering = covering(ice, at, footprint, false, &surface.overlay_opacities);
            visit(k, surface);
        }
    });
}

std::vector<float> SurfaceResolver::entering(std::uint32_t object, const PointSet& points) const {
    const auto* ice = std::get_if<IceMaterial>(&scene_.materials[scene_.objects[object].material].model);
    if (!ice || ice->overlays.empty()) return {};
    std::vector<float> result(points.size());
    look_at_points(object, points,
                   [&](std::size_t k, const Surface& surface) { result[k] = 1.0f - surface.covering.scattered; });
    return result;
}

V3f SurfaceResolver::position(const Hit& hit) const {
    const Object& object = scene_.objects[hit.placement];
    const Mesh& mesh = scene_.meshes[object.mesh];
    return at_hit(mesh.positions, mesh.triangles[hit.triangle], hit.uv) * object.local_to_world;
}

bool SurfaceResolver::place(const Hit& hit, const V3f& direction, Surface& surface) const {
    const Object& object = scene_.objects[hit.placement];
    const Mesh& mesh = scene_.meshes[object.mesh];
    surface.object = hit.placement;
    surface.material = &scene_.materials[object.material];

    const V3i& triangle = mesh.triangles[hit.triangle];
    const V3f local = at_hit(mesh.positions, triangle, hit.uv);
    surface.local_position = mesh.rest.empty() ? local : at_hit(mesh.rest, triangle, hit.uv);
    surface.position = surface.lifted = local * object.local_to_world;
    if (!mesh.uvs.is_empty()) surface.st = mesh.uvs.at(mesh.triangles, hit.triangle, hit.uv);

    const V3f wo = -direction;
    surface.geometric_normal = towards(hit.geometric_normal, wo);
    surface.normal = surface.geometric_normal;
    if (mesh.normals.is_empty()) return false;
    const M44f& world_to_local = frames_[hit.placement].world_to_local;
    const V3f normal = transform_normal(mesh.normals.at(mesh.triangles, hit.triangle, hit.uv), world_to_local);
    if (!is_finite(normal) || !(normal.length2() > 0.0f)) return false;
    surface.normal = bent_towards_viewer(towards(normal, surface.geometric_normal), wo);
    return true;
}

Surface SurfaceResolver::glimpse(const Hit& hit, const V3f& direction) const {
    Surface surface;
    place(hit, direction, surface);
    return surface;
}

Surface SurfaceResolver::resolve(const Hit& hit, const V3f& direction, float footprint, bool with_bump) const {
    const Object& object = scene_.objects[hit.placement];
    const Mesh& mesh = scene_.meshes[object.mesh];
    const V3f wo = -direction;
    Surface surface;
    if (place(hit, direction, surface)) {
        const M44f& world_to_local = frames_[hit.placement].world_to_local;
        V3f corners[3], normals[3];
        for (int k = 0; k < 3; ++k) {
            corners[k] = mesh.positions[mesh.triangles[hit.triangle][k]] * object.local_to_world;
            const V2f corner(k == 1 ? 1.0f : 0.0f, k == 2 ? 1.0f : 0.0f);
            normals[k] =
                towards(transform_normal(mesh.normals.at(mesh.triangles, hit.triangle, corner), world_to_local),
                        surface.geometric_normal);
        }
        const V3f place = frazil::lifted(corners, normals, hit.uv, surface.position);
        if (is_finite(place)) surface.lifted = place;
        if (footprint > 0.0f) {
            const float spread = spread_of_normals(corners, normals, surface.geometric_normal, wo, footprint);
            if (std::isfinite(spread)) surface.normal_spread = spread;
        }
    }
    surface.horizon = surface.normal;
    if (!mesh.colors.is_empty()) surface.display_color = mesh.colors.at(mesh.triangles, hit.triangle, hit.uv);
    look(hit, wo, footprint, with_bump, surface);
    return surface;
}

Surface SurfaceResolver::resolve_passage(const Hit& hit, const V3f& direction, float footprint) const {
    Surface surface = glimpse(hit, direction);
    look(hit, -direction, footprint, false, surface);
    return surface;
}

void SurfaceResolver::look(const Hit& hit, const V3f& wo, float footprint, bool with_bump, Surface& surface) const {
    const auto* ice = std::get_if<IceMaterial>(&surface.material->model);
    const bool has_images = reads_images_[scene_.objects[hit.placement].material];
    if (!has_images && !(ice && !ice->overlays.empty())) {
        surface.texture_point.st = surface.st;
        if (ice) surface.covering = covering(*ice, surface.texture_point, footprint, false);
        return;
    }
    // Patterns and images see the surface from outside, whichever side the viewer is on.
    const float side = hit.geometric_normal.dot(surface.geometric_normal) < 0.0f ? -1.0f : 1.0f;
    TexturePoint& at = surface.texture_point;
    at = texture_point(hit.placement, hit.triangle, hit.uv, surface.position, surface.normal * side);
    if (footprint > 0.0f && has_images) {
        // The cone's circle, drawn out where the surface is seen aslant.
        const auto [longer, shorter] = footprint_axes(surface.geometric_normal, wo, footprint, 1e-3f);
        world_to_rest(hit.placement).multDirMatrix(longer, at.long_axis);
        world_to_rest(hit.placement).multDirMatrix(shorter, at.short_axis);
    }
    V3f mapped = at.normal;
    if (with_bump && has_images) {
        const auto* standard = std::get_if<StandardMaterial>(&surface.material->model);
        mapped = ice ? mapped_normal(ice->normal, ice->bump, at) : mapped_normal(standard->normal, standard->bump, at);
    }
    if (ice) {
        surface.covering = covering(*ice, at, footprint, with_bump, with_bump ? &surface.overlay_opacities : nullptr);
        const V3f& slope = surface.covering.slope;
        if (slope != V3f(0.0f)) mapped = (mapped - (slope - mapped * mapped.dot(slope))).normalized();
    }
    if (mapped != at.normal) {
        V3f normal;
        rest_to_world(hit.placement).multDirMatrix(mapped * side, normal);
        if (normal.dot(surface.geometric_normal) <= 0.0f)
            normal -= surface.geometric_normal * (normal.dot(surface.geometric_normal) - 1e-3f);
        surface.normal = bent_towards_viewer(normal.normalized(), wo);
    }
}

}  // namespace frazil
