// One light in world space: directions towards it with their densities, and what a ray sees of it.
// Model: rect by its solid angle [Urena2013], sphere by its cone of directions [PBRT4, Section 12.2], disk by area,
//   cylinder by the angle across and its length, distant uniform in its cone, dome by its image, mesh by area; a rect
//   with an image half by its solid angle, half by the image; a dome with portals before the point partly by the solid
//   angle of these, partly as without. Sheared or unevenly scaled shapes are sampled in the frame
//   where they are not, and the density follows the map.
// Units: pdf per steradian.
// Valid: any light that check_light accepts; the density of intersect() is that of sample().
// Not: the choice among lights (light_sampling.h).
#pragma once

#include <limits>
#include <span>
#include <variant>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/light.h"
#include "frazil/lighting/light_bounds.h"
#include "frazil/lighting/mesh_emitter.h"

namespace frazil {

inline constexpr float kBelowOne = 0.99999994f;  // the largest of numbers in [0, 1)

struct LightSample {
    V3f direction = V3f(0.0f);                                // unit length, from the shading point to the light
    float distance = std::numeric_limits<float>::infinity();  // where a shadow ray must end (a hair less)
    Rgb radiance = Rgb(0.0f);                                 // towards the point, component multipliers not applied
    float pdf = 0.0f;                                         // per steradian, the pick included; 0 = no sample
    bool is_delta = false;  // parallel light: radiance is irradiance at normal incidence, pdf the pick's probability
    int light = -1;
};

// What a ray sees of a light that it runs into.
struct LightHit {
    Rgb radiance = Rgb(0.0f);
    float pdf = 0.0f;  // density with which sample() would have chosen this direction
    float distance = std::numeric_limits<float>::infinity();
    int light = -1;
};

class WorldLight {
  public:
    // ValueError where check_light refuses the light.
    explicit WorldLight(const Light& light);

    // out[i] from u[i]; the pdf has no pick and `light` stays -1. Samples towards one point share its set-up.
    void sample(const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const;

    // False where the ray misses, or meets the light at or beyond t_max or from its dark side. Never a mesh: see
    // hit_triangle().
    bool intersect(const V3f& origin, const V3f& direction, float t_max, LightHit& hit) const;

    // The same for a ray that has met a triangle of a mesh light's object at distance t.
    bool hit_triangle(std::uint32_t triangle, const V3f& direction, float t, LightHit& hit) const;

    // An estimate of the absolute irradiance at a point without occlusion, for the choice among lights; 0 only where no
    // light arrives. A normal of zero receives from all sides alike.
    float importance(const V3f& position, const V3f& normal) const;
    // Where it is and where to it shines; only where is_finite().
    const LightBounds& bounds() const { return bounds_; }
    bool is_finite() const { return !is_dome() && !std::holds_alternative<Distant>(shape_); }

    bool is_dome() const { return std::holds_alternative<Dome>(shape_); }
    // Whether it sends every place the same: a dome without portals.
    bool is_same_everywhere() const { return is_dome() && std::get<Dome>(shape_).portals.empty(); }
    // Whether a dome has portals that light may come through to the position.
    bool has_portal_before(const V3f& position) const;
    // A uniform dome: cosine-weighted directions serve it best.
    bool is_uniform_dome() const;
    // Radiance of a dome in a direction; only where is_dome().
    Rgb dome_radiance(const V3f& direction) const;
    // sample() without portals, for a place that receives on the side of `normal`: directions from behind may come with a
    // pdf of 0. Only for a dome with an image.
    void sample_dome(const V3f& normal, std::span<const V2f> u, std::span<LightSample> out) const;
    // The radiances of many, with the densities of sample_dome(); only for a dome with an image.
    void dome_radiances(std::span<const V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances) const;

  private:
    struct Distant {
        V3f axis;    // towards the light
        float cap;   // 1 - cos(half angle); 0 = parallel
        float size;  // projected solid angle, for importance
    };
    struct Rect {
        V3f center, normal;   // normal on the side that shines
        V3f x, y;             // unit axes
        float width, height;  // in metres
        M44f world_to_local;  // rotation (and shear) about `center` into the frame (x, y, normal)
        float shear;          // |det| of (x, y, normal); 1 for a true rectangle
        std::shared_ptr<const LightImage> image;
    };
    struct Dome {
        std::shared_ptr<const Environment> image;
        V3f x, y, z;  // orthonormal axes in the world
        std::vector<Rect> portals;
    };
    struct RectView;    // a rect as a point sees it
    struct PortalView;  // the same of a portal
    struct Disk {
        V3f center, normal, x, y;  // semi-axes
        float area;
        M44f world_to_local;  // into the frame (x, y, normal)
    };
    struct Sphere {
        V3f center;
        M44f local_to_world, world_to_local;  // to and from the unit sphere, translation left out
        float scale;                          // cube root of |det local_to_world|
    };
    struct Cylinder {
        V3f center;
        M44f local_to_world, world_to_local;  // to and from length 1 and radius 1 along x, translation left out
        float scale;
    };
    // What importance() needs of a light with a surface.
    struct Extent {
        V3f center;
        float radius = 0.0f, projected_area = 0.0f;
        V3f normal = V3f(0.0f);  // zero = shines to all sides
    };
    class Builder;

    // The square of the image that a place of the rect shows, and the image's density of directions there.
    V2f image_place(const Rect& rect, const V3d& local_offset, const V3f& at) const;
    float image_pdf(const Rect& rect, const V2f& place, const V3f& to_light) const;
    // What shaping leaves of light that travels to the receiver against `direction`.
    Rgb shaped(const V3f& direction) const {
        return eval(shaping_, {direction.dot(frame_[0]), direction.dot(frame_[1]), direction.dot(frame_[2])});
    }

    // The portals that light may come through to the position, with their shares of what these get; until the thread's
    // next call.
    static const std::vector<PortalView>& portals_before(const Dome& dome, const V3f& position);
    static float portal_pdf(const std::vector<PortalView>& portals, const V3f& direction);
    void sample_portals(const Dome& dome, const std::vector<PortalView>& portals, std::span<const V2f> u,
                        std::span<LightSample> out) const;
    // Direction, radiance and density as without portals.
    LightSample sample_whole(const Dome& dome, const V2f& u) const;
    Rgb eval_whole(const Dome& dome, const V3f& direction, float& pdf) const;

    void sample_from(const Dome& dome, const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const;
    void sample_from(const Distant& distant, const V3f& position, std::span<const V2f> u,
                     std::span<LightSample> out) const;
    void sample_from(const Rect& rect, const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const;
    void sample_from(const Disk& disk, const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const;
    void sample_from(const Sphere& sphere, const V3f& position, std::span<const V2f> u,
                     std::span<LightSample> out) const;
    void sample_from(const Cylinder& cylinder, const V3f& position, std::span<const V2f> u,
                     std::span<LightSample> out) const;
    void sample_from(const MeshEmitter& mesh, const V3f& position, std::span<const V2f> u,
                     std::span<LightSample> out) const;
    bool hit_by(const Dome& dome, const V3f& origin, const V3f& direction, LightHit& hit) const;
    bool hit_by(const Distant& distant, const V3f& origin, const V3f& direction, LightHit& hit) const;
    bool hit_by(const Rect& rect, const V3f& origin, const V3f& direction, LightHit& hit) const;
    bool hit_by(const Disk& disk, const V3f& origin, const V3f& direction, LightHit& hit) const;
    bool hit_by(const Sphere& sphere, const V3f& origin, const V3f& direction, LightHit& hit) const;
    bool hit_by(const Cylinder& cylinder, const V3f& origin, const V3f& direction, LightHit& hit) const;
    bool hit_by(const MeshEmitter&, const V3f&, const V3f&, LightHit&) const { return false; }

    Rgb radiance_;
    float brightness_;  // absolute luminance
    Extent extent_;
    LightBounds bounds_;
    Shaping shaping_;
    bool is_shaped_ = false;
    V3f frame_[3];  // of the shaping: the light's axes, orthonormal; it shines along the last one's opposite
    std::variant<Dome, Distant, Rect, Disk, Sphere, Cylinder, MeshEmitter> shape_;
};

}  // namespace frazil
