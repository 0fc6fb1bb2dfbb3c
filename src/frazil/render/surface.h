// What a ray has hit: the place, its normals and its texture coordinates, ready for shading.
// Model: two-sided: the normals turn towards the viewer. The shading normal is bent until the viewer is above it. Patterns
//   are read in rest space: the object's own frame under its scale, without its rotation and place, so that their widths
//   are metres and they stay with a moving object. Textures see the ellipse that the ray's cone cuts out of the surface.
//   Light is not cut off by the facets of a smooth mesh: `horizon` is the smooth normal's, and rays leave from `lifted`,
//   the place on the curved surface that the vertices' normals tell [Hanika2021]. Where these turn within the footprint the
//   surface looks rougher: their variance, as slopes, adds to that of the microfacets [TokuyoshiKaplanyan2019].
// Units: metres, world space.
#pragma once

#include <functional>
#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/material/texture.h"
#include "frazil/points/point_set.h"
#include "frazil/render/scene.h"

namespace frazil {

struct Surface {
    std::uint32_t object = 0;
    const Material* material = nullptr;
    V3f position = V3f(0.0f);
    V3f geometric_normal = V3f(0.0f);  // unit length, on the viewer's side
    V3f normal = V3f(0.0f);            // for shading, unit length, the viewer above it
    V3f horizon = V3f(0.0f);           // the same without bump and normal map
    V3f lifted = V3f(0.0f);            // where rays leave on the viewer's side
    float normal_spread = 0.0f;      // slope by which the normal varies over the footprint: at least as rough it looks
    V2f st = V2f(0.0f);              // (0, 0) where the mesh has none
    TexturePoint texture_point;      // where textures are read; st alone for materials that read none
    V3f local_position = V3f(0.0f);  // in the mesh's own space, in its rest pose
    Rgb display_color = Rgb(0.18f);
    Covering covering;                     // of ice: its overlays, with the roughness that they leave
    std::vector<float> overlay_opacities;  // of those, one by one; empty where nobody asks
};

// Resolves hits into surfaces; holds what that needs per object.
class SurfaceResolver {
  public:
    explicit SurfaceResolver(const Scene& scene);

    // `direction` is the ray's, towards the surface; `footprint` the radius of what the ray stands for, metres. Bump and
    // normal map are left out where the surface only lets light pass.
    Surface resolve(const Hit& hit, const V3f& direction, float footprint = 0.0f, bool with_bump = false) const;

    // What light that goes straight through the surface of a hit meets: place, smooth normals and covering, as resolve gives
    // them without bump.
    Surface resolve_passage(const Hit& hit, const V3f& direction, float footprint) const;

    // What a hit shows before it is shaded: place, smooth normals and texture coordinates, as resolve gives them; the rest
    // is left out.
    Surface glimpse(const Hit& hit, const V3f& direction) const;

    // Where a hit lies, in world space: the position that resolve gives it.
    V3f position(const Hit& hit) const;

    // What each point of an object of ice shows over the disc of its area: texture coordinates, covering and
    // overlays' opacities; the rest is left out. visit(point, surface) comes from several threads at once.
    void look_at_points(std::uint32_t object, const PointSet& points,
                        const std::function<void(std::size_t point, const Surface& surface)>& visit) const;

    // The part of light that the overlays let enter at each point of an object of ice; empty where all of it enters.
    std::vector<float> entering(std::uint32_t object, const PointSet& points) const;

    // How the covering of a surface of ice, resolved with bump or looked at, changes with each overlay's opacity.
    std::vector<CoveringSlope> slopes(const Surface& surface) const;
    // Which part of the light that enters each point an overlay takes, more by the logarithm of its opacity: (N, overlays).
    std::vector<float> taken_by_overlays(std::uint32_t object, const PointSet& points) const;

    // World space to the object's rest space and back: rigid, perhaps mirrored.
    const M44f& world_to_rest(std::uint32_t object) const { return frames_[object].world_to_rest; }
    const M44f& rest_to_world(std::uint32_t object) const { return frames_[object].rest_to_world; }

  private:
    struct Frames {
        M44f world_to_local, world_to_rest, rest_to_world;
    };
    // True where vertices have normals that hold there.
    bool place(const Hit& hit, const V3f& direction, Surface& surface) const;
    // What patterns and images make of a place.
    void look(const Hit& hit, const V3f& wo, float footprint, bool with_bump, Surface& surface) const;
    Covering covering(const IceMaterial& ice, const TexturePoint& at, float footprint, bool with_bump,
                      std::vector<float>* opacities = nullptr) const;
    // Where textures are read on a triangle; its footprint is left to the caller. `normal` in world space.
    TexturePoint texture_point(std::uint32_t object, std::uint32_t triangle, const V2f& uv, const V3f& position,
                               const V3f& normal) const;

    const Scene& scene_;
    std::vector<Frames> frames_;
    std::vector<std::uint8_t> reads_images_;  // per material
};

}  // namespace frazil
