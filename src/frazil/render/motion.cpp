#include "frazil/render/motion.h"

#include <map>

namespace frazil {

SceneMotion motion_between(const Scene& scene, const Scene& next) {
    SceneMotion motion;
    motion.camera = next.camera;
    motion.positions.resize(scene.meshes.size());
    std::map<std::string, const Object*> by_path;
    for (const Object& object : next.objects) by_path[object.path] = &object;
    for (const Object& object : scene.objects) {
        const auto found = by_path.find(object.path);
        motion.local_to_world.push_back(found == by_path.end() ? object.local_to_world : found->second->local_to_world);
        if (found == by_path.end()) continue;
        const Mesh &mesh = scene.meshes[object.mesh], &later = next.meshes[found->second->mesh];
        if (mesh.positions.size() != later.positions.size() || mesh.triangles != later.triangles) continue;
        if (mesh.positions != later.positions) motion.positions[object.mesh] = later.positions;
    }
    return motion;
}

MotionVectors::MotionVectors(const Scene& scene, int width, int height)
    : scene_(scene),
      width_(static_cast<float>(width)),
      height_(static_cast<float>(height)),
      world_to_camera_(scene.camera.camera_to_world.inverse()),
      world_to_next_camera_(scene.motion ? scene.motion->camera.camera_to_world.inverse() : world_to_camera_) {}

V2f MotionVectors::of_hit(const Hit& hit) const {
    const Object& object = scene_.objects[hit.placement];
    const Mesh& mesh = scene_.meshes[object.mesh];
    if (!scene_.motion) return V2f(0.0f);
    const auto place = [&](const std::vector<V3f>& positions, const M44f& local_to_world) {
        const V3i& t = mesh.triangles[hit.triangle];
        const V3f local = positions[std::size_t(t.x)] * (1.0f - hit.uv.x - hit.uv.y) +
                          positions[std::size_t(t.y)] * hit.uv.x + positions[std::size_t(t.z)] * hit.uv.y;
        return local * local_to_world;
    };
    const std::vector<V3f>& moved = scene_.motion->positions[object.mesh];
    const V3f next = place(moved.empty() ? mesh.positions : moved, scene_.motion->local_to_world[hit.placement]);
    return pixels_between(place(mesh.positions, object.local_to_world), next, false);
}

V2f MotionVectors::of_background(const V3f& direction) const {
    if (!scene_.motion || scene_.camera.is_orthographic) return V2f(0.0f);
    return pixels_between(direction, direction, true);
}

V2f MotionVectors::pixels_between(const V3f& position, const V3f& next, bool is_direction) const {
    const auto image = [&](const Camera& camera, const M44f& world_to_camera, const V3f& at, V2f& x) {
        V3f local;
        if (is_direction) {
            world_to_camera.multDirMatrix(at, local);
        } else {
            local = at * world_to_camera;
        }
        return image_position(camera, local, width_ / height_, x);
    };
    V2f from, to;
    const Camera& later = scene_.motion->camera;
    // What goes behind the camera has no place in the picture.
    if (!image(scene_.camera, world_to_camera_, position, from) || !image(later, world_to_next_camera_, next, to)) {
        return V2f(0.0f);
    }
    return {(to.x - from.x) * width_, (from.y - to.y) * height_};
}

}  // namespace frazil
