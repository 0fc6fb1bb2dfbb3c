// Paths from the camera: what each sample adds to a tile, and which gathers it asks for.
// Model: unidirectional path tracing with multiple importance sampling of lights and lobes (balance heuristic
//   [Veach1997]). Where the camera sees ice a path is split: one part is reflected, the other refracted. Inside ice every
//   piece of the path sends u = exp(-sigma_s_prime d) of its weight on, absorbed on the way, and asks for a gather with
//   the rest at its start. Light goes to the layer of the first lobe that it was scattered by.
// Units: radiance; inside ice radiance over squared index.
// Valid: thread-safe; a pure function of the ray and the sampler.
// Not: caustics: light reaches surfaces behind ice and in it along straight lines.
#pragma once

#include <memory>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/render/bodies.h"
#include "frazil/render/film_layout.h"
#include "frazil/render/first_hits.h"
#include "frazil/render/interior.h"
#include "frazil/render/lpe_tracks.h"
#include "frazil/render/motion.h"
#include "frazil/render/shading.h"
#include "frazil/render/surface.h"
#include "frazil/render/tile.h"
#include "frazil/render/volume.h"

namespace frazil {

struct Path;
struct IceCore;

class PathTracer {
  public:
    // Everything must outlive the tracer. `group_of_light` gives each light's index among the light groups.
    PathTracer(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
               const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::size_t>& group_of_light,
               const FilmLayout& layout, int max_bounces, const PixelCone& pixel = {},
               const MotionVectors* motion = nullptr);

    // What samples see first.
    void see(std::span<const Ray> camera_rays, std::vector<FirstHit>& seen, Tile& tile) const;
    // Note it in the tile where that is certain before it is shaded: then it may stand for others, and they for it.
    void note_first(FirstHit& first, const V3f& view_axis, const Sampler& sampler, std::uint32_t pixel,
                    Tile& tile) const;
    // Shade one sample, for as many as it stands for. `sampler` stands after the camera's own dimensions.
    void trace(const FirstHit& first, float samples, const V3f& view_axis, Sampler sampler, std::uint32_t pixel,
               Tile& tile) const;

    // Each begins with an object's path.
    const std::vector<std::string>& warnings() const { return interiors_.warnings(); }

  private:
    void note(const Hit& hit, const Surface& surface, float depth, const Sampler& sampler, std::uint32_t pixel,
              Tile& tile) const;
    // Follow a path to its end, from what it sees first; a part that is split off goes to `split`, where there is room for one.
    void follow(Path& path, const FirstHit* first, const V3f* view_axis, Path* split, bool& has_split,
                Tile& tile) const;

    // Radiance to the layers of the path's first lobe; to `primary` where the camera sees it directly.
    void deliver(const Path& path, Component primary, const Scattering& weights, std::size_t group, const Rgb& radiance,
                 Tile& tile) const;
    void add_own_light(const Path& path, const Surface& surface, const Shader& shader, Tile& tile) const;
    bool reflect(Path& path, const Surface& surface, const Shader& shader, const V3f& wo, float odds) const;
    void add_light(const Path& path, Component component, std::size_t group, const Rgb& radiance, Tile& tile) const;
    void add_lights_on_ray(const Path& path, const Hit* surface, Tile& tile) const;
    void add_direct_light(const Path& path, const Surface& surface, const Shader& shader, const V3f& wo,
                          Sampler& sampler, Tile& tile) const;
    void add_light_sample(const Path& path, const Surface& surface, const Shader& shader, const V3f& wo,
                          const LightSample& sample, float u_shadow, Tile& tile) const;
    Rgb visibility(const Path& path, int light, const Ray& ray, const InsideOf& inside, Tile& tile,
                   bool& is_straight) const;
    void add_light_beyond(const Path& path, const Surface& surface, const Crossing& crossing, float alpha,
                          Sampler& sampler, Tile& tile) const;

    // Ice: entering it, going on inside, meeting its boundary from inside. False where the path ends.
    // The light of a body's core at its surface, seen from outside or from inside.
    IceCore core_at(const Path& path, const Surface& surface, int body, bool from_inside) const;
    float sight(const Path& path) const;
    float chord_behind(const Surface& surface, const V3f& direction, Tile& tile) const;
    bool enter(Path& path, const Surface& surface, const Crossing& crossing, float odds, const IceCore& core,
               Sampler& sampler) const;
    bool cross_interior(Path& path, float length, Sampler& sampler, Tile& tile) const;
    bool find_sheet(const Path& path, float length, float& t, V3f& normal, Rgb& color) const;
    bool meet_sheet(Path& path, const V3f& position, const V3f& normal, const Rgb& color, Tile& tile) const;
    bool meet_boundary(Path& path, const Surface& surface, const Crossing& crossing, Sampler& sampler,
                       Tile& tile) const;
    // What is seen through ice, by refraction alone: `share` of the path's weight ends at the object.
    void add_matte(const Path& path, std::size_t object, const Rgb& share, Tile& tile) const;
    void request_gather(const Path& path, const IceCore& core, const Rgb& share, Tile& tile) const;
    void note_entering(IceCore& core, const Path& path, const Surface& surface, const Body& body, Tile& tile) const;
    // What light path expressions keep.
    void add_lpes_of_light(const Path& path, const Rgb& lobes, int light, const Rgb& radiance, Tile& tile) const;
    void add_lpes_beyond(const Path& path, LpeKind kind, std::size_t object, int light, const Rgb& radiance,
                         Tile& tile) const;

    const Scene& scene_;
    const RayScene& ray_scene_;
    const LightSampler& lights_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const std::vector<std::size_t>& group_of_light_;
    const FilmLayout& layout_;
    SurfaceResolver resolver_;
    Interiors interiors_;
    SingleScattering single_scattering_;
    InsideOf camera_inside_;
    std::vector<std::uint8_t> may_let_pass_;  // by object: a first hit that may be gone through
    int max_bounces_;
    PixelCone pixel_;
    const MotionVectors* motion_;
};

}  // namespace frazil
