// Rays against the whole scene, by Embree 3.13 or 4.
// Model: a mesh that is placed once is traced in world space; one that is placed often is an Embree instance. Nested
//   instances arrive flattened: one placement per leaf.
// Units: metres, world space. Directions need not be unit length; t counts in their length.
// Valid: thread-safe after construction. Robust (watertight) traversal. Questions about some of the placements alone go
//   through an Embree filter; the others do not pay for it.
// Not: curves, volumes, motion blur.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/geometry/mesh.h"

namespace frazil {

struct Ray {
    V3f origin;
    V3f direction;
    float t_min = 0.0f;
    float t_max = std::numeric_limits<float>::infinity();
};

struct Hit {
    float t = 0.0f;
    std::uint32_t placement = 0;  // index into the placements that the RayScene was made of
    std::uint32_t triangle = 0;
    V2f uv{0.0f};                // barycentrics of the triangle's second and third corner
    V3f geometric_normal{0.0f};  // unit length, world space, on the side that the winding tells
};

// One mesh somewhere in the world; `mesh` is an index.
struct Placement {
    std::uint32_t mesh = 0;
    M44f local_to_world;
};

// What a placement does to light that goes straight through it.
struct Passage {
    float share = 0.0f;           // of the light that enters; 0: it stops all light
    float eta = 1.0f;             // of its inside, relative to the outside
    Rgb attenuation = Rgb(0.0f);  // 1/m, inside
    Rgb tint = Rgb(1.0f);         // of light each time that it goes through the boundary
    int priority = 0;  // where bodies overlap the highest fills the place, the one entered first among equals
    // Where it is denser in one place than in another: the integral of its density along a unit direction, metres, and
    // the attenuation per metre of that, beside `attenuation`.
    std::function<float(const V3f& origin, const V3f& direction, float length)> depth = nullptr;
    Rgb dense_attenuation = Rgb(0.0f);

    // The light that is left after a way inside.
    Rgb along(const V3f& origin, const V3f& direction, float length) const {
        Rgb optical_depth = attenuation * length;
        if (depth) optical_depth += dense_attenuation * depth(origin, direction, length);
        return exp(-optical_depth);
    }
};

// Placements that a ray may meet, one byte each (beyond the end: 0); null = all.
using PlacementMask = const std::vector<std::uint8_t>*;

class RayScene {
  public:
    // The meshes may go after construction. An empty scene is allowed: every ray misses.
    RayScene(const std::vector<Mesh>& meshes, const std::vector<Placement>& placements);
    ~RayScene();
    RayScene(RayScene&&) noexcept;
    RayScene& operator=(RayScene&&) noexcept;

    // The nearest hit in (t_min, t_max); false where there is none.
    bool intersect(const Ray& ray, Hit& hit) const;
    // Whether anything lies in (t_min, t_max).
    bool is_occluded(const Ray& ray) const;
    // The same for many rays at once, out[i] 1 or 0, and hits[i].t infinite where there is none. Rays of like direction are traced
    // together: faster the more there are and the nearer those that follow one another start.
    void are_occluded(std::span<const Ray> rays, std::span<std::uint8_t> out) const;
    // `are_alike`: rays that follow one another go nearly the same way, as a pixel's.
    void intersect(std::span<const Ray> rays, std::span<Hit> hits, PlacementMask mask = nullptr,
                   bool are_alike = false) const;

    // The same among some of the placements.
    bool intersect(const Ray& ray, Hit& hit, PlacementMask mask) const;
    bool is_occluded(const Ray& ray, PlacementMask mask) const;

    // What each placement does to light that goes straight through it. Empty (as constructed): all are opaque. Rays do not
    // heed it; lighting/shadow.h does.
    void set_passages(std::vector<Passage> passages);
    const std::vector<Passage>& passages() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// A ray origin just off the surface at `position`, on the side that `normal` points to: no hit with the surface itself,
// whatever the scale [Wachter2019].
V3f offset_origin(const V3f& position, const V3f& normal);

}  // namespace frazil
