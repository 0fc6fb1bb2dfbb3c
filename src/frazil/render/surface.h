// What a ray has hit: the place, its normals and its texture coordinates, ready for shading.
// Model: two-sided: the normals turn towards the viewer. The shading normal is bent until the viewer is above it.
// Units: metres, world space.
// Not: derivatives (textures are read without a footprint).
#pragma once

#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/render/scene.h"

namespace frazil {

struct Surface {
    std::uint32_t object = 0;
    const Material* material = nullptr;
    V3f position = V3f(0.0f);
    V3f geometric_normal = V3f(0.0f);  // unit length, on the viewer's side
    V3f normal = V3f(0.0f);            // for shading, unit length, the viewer above it
    V2f st = V2f(0.0f);                // (0, 0) where the mesh has none
    V3f local_position = V3f(0.0f);    // in the mesh's own space
    Rgb display_color = Rgb(0.18f);
};

// Resolves hits into surfaces; holds what that needs per object.
class SurfaceResolver {
  public:
    explicit SurfaceResolver(const Scene& scene);

    // `direction` is the ray's, towards the surface.
    Surface resolve(const Hit& hit, const V3f& direction) const;

  private:
    const Scene& scene_;
    std::vector<M44f> world_to_local_;
};

}  // namespace frazil
