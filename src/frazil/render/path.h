// Paths from the camera: what each sample adds to a tile, and which gathers it asks for.
// Model: unidirectional path tracing with multiple importance sampling of lights and lobes (balance heuristic
//   [Veach1997]); ice ends in a gather request plus its glossy reflection.
//   Light goes to the layer of the first lobe that it was scattered by.
// Units: radiance.
// Valid: thread-safe; a pure function of the ray and the sampler.
// Not: refraction, volumes.
#pragma once

#include <memory>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/render/bodies.h"
#include "frazil/render/shading.h"
#include "frazil/render/surface.h"
#include "frazil/render/tile.h"

namespace frazil {

class PathTracer {
  public:
    // Everything must outlive the tracer. `group_of_light` gives each light's index among the light groups.
    PathTracer(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
               const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::size_t>& group_of_light,
               int max_bounces);

    // Trace one sample. `sampler` stands after the camera's own dimensions.
    void trace(const Ray& camera_ray, const V3f& view_axis, Sampler sampler, std::uint32_t pixel, Tile& tile) const;

    // Answer the tile's gather requests and forget them.
    void gather(const GatherOptions& options, Tile& tile) const;

  private:
    struct Path;
    void add_lights_on_ray(const Path& path, const Hit* surface, Tile& tile) const;
    void add_direct_light(const Path& path, const Surface& surface, const Shader& shader, const V3f& wo,
                          Sampler& sampler, Tile& tile) const;
    void request_gather(const Path& path, const Surface& surface, const V3f& wo, Sampler& sampler, Tile& tile) const;

    const Scene& scene_;
    const RayScene& ray_scene_;
    const LightSampler& lights_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const std::vector<std::size_t>& group_of_light_;
    SurfaceResolver resolver_;
    int max_bounces_;
};

}  // namespace frazil
