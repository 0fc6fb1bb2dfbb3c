// Motion vectors: where what a pixel shows will be in the next frame.
// Model: the same place of the surface, by triangle and barycentrics, under the next frame's vertices, transforms and camera.
// Units: pixels, x to the right, y upwards, from this frame to the next.
// Valid: objects are the same by path, meshes by the number of vertices and triangles; others stand still.
// Not: motion of what is seen in reflections and through ice; changes of topology.
#pragma once

#include <optional>

#include "frazil/geometry/ray_scene.h"
#include "frazil/render/scene.h"

namespace frazil {

// How a scene goes on, from the same scene a frame later.
SceneMotion motion_between(const Scene& scene, const Scene& next);

class MotionVectors {
  public:
    // The scene must outlive this; without motion of its own everything stands still.
    MotionVectors(const Scene& scene, int width, int height);

    V2f of_hit(const Hit& hit) const;
    // What is infinitely far away: only the camera's turn and zoom move it.
    V2f of_background(const V3f& direction) const;

  private:
    V2f pixels_between(const V3f& position, const V3f& next, bool is_direction) const;

    const Scene& scene_;
    float width_, height_;
    M44f world_to_camera_, world_to_next_camera_;
};

}  // namespace frazil
