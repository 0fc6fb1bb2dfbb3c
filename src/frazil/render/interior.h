// The inside of ice: which bodies rays can enter, which of them a place is inside of, and how far light reaches there.
// Model: a body can be entered where its mesh is closed (every edge is walked as often one way as the other); its
//   outside is where its volume is positive, so that a mesh turned inside out counts as outside in. Where bodies overlap
//   the one of highest priority fills the place, the one entered first among equals [SchmidtBudge2002].
// Units: metres.
// Valid: thread-safe; meshes with small holes count as closed, open ones are warned of and not entered.
// Not: the surface of the boundary itself (transmission.h).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/material/transmission.h"
#include "frazil/render/bodies.h"
#include "frazil/render/surface.h"

namespace frazil {

// Whether rays can tell inside from outside: the mesh is closed, but for small holes.
bool is_closed(const Mesh& mesh);
// What the winding's normal has to be multiplied by to point out of a closed mesh: +1 or -1; 0 for an open one.
float outward_side(const Mesh& mesh);

// The bodies that a place is inside of, in the order in which they were entered.
class InsideOf {
  public:
    static constexpr int kNone = -1;

    bool is_empty() const { return size_ == 0; }
    int size() const { return size_; }
    int operator[](int i) const { return objects_[std::size_t(i)]; }
    void enter(int object) {
        if (size_ < kMost) objects_[std::size_t(size_++)] = object;
    }
    // Forget one entry of the object; false where the place was not inside of it.
    bool leave(int object);

  private:
    static constexpr int kMost = 16;  // deeper nesting is not told apart
    std::array<int, kMost> objects_{};
    int size_ = 0;
};

// What a ray does at a surface of ice.
struct Crossing {
    InsideOf beyond;                                   // after going through
    int from = InsideOf::kNone, to = InsideOf::kNone;  // the bodies that fill both sides; kNone = air
    bool is_boundary() const { return from != to; }
};

class Interiors {
  public:
    // All must outlive this.
    Interiors(const Scene& scene, const RayScene& ray_scene, const SurfaceResolver& resolver,
              const std::vector<std::unique_ptr<Body>>& bodies);

    // Each names an object that is not entered though its material asks for it.
    const std::vector<std::string>& warnings() const { return warnings_; }
    bool is_empty() const { return is_empty_; }
    // Whether rays may enter this object.
    bool is_open_to_rays(std::uint32_t object) const { return outward_[object] != 0.0f; }

    // The body that fills a place; kNone = air.
    int filling(const InsideOf& inside) const;
    // What the place is inside of, by following one ray to infinity.
    InsideOf inside_at(const V3f& position) const;
    // For a hit on an object that is open to rays.
    Crossing cross(const Hit& hit, const V3f& direction, const InsideOf& inside) const;

    // Index of refraction of what fills a place.
    float eta(int body) const {
        return body == InsideOf::kNone ? 1.0f : bodies_[std::size_t(body)]->material->medium.eta;
    }
    const TransmissionAlbedo& transmission(int body) const { return *transmission_[std::size_t(body)]; }

    // Metres of a body's medium beyond which all light of any channel counts as scattered.
    float scattering_depth(int body) const;
    // What of its medium a way through a body holds; `ray` of unit direction, from its origin.
    struct Depth {
        float scattering, absorption;  // metres
    };
    Depth depth(int body, const Ray& ray, float length) const;
    // The body's density; null where it is that of its medium everywhere.
    const DensityField* density(int body) const { return densities_[std::size_t(body)].get(); }

    // The part of the radiance (over squared index where the ray begins in ice) at the end of the ray that comes straight
    // through ice, without bending: Fresnel's transmittance, scattering and absorption, the narrowing of solid angles
    // where the ray leaves the ice that it begins in, 0 behind anything else. `absorbs` = false leaves absorption out.
    // `rays` counts what is traced; `is_straight` becomes false where a boundary would bend the ray; overlays are
    // averaged over `footprint`.
    Rgb visibility(const Ray& ray, InsideOf inside, std::uint64_t& rays, bool absorbs = true,
                   bool* is_straight = nullptr, float footprint = 0.0f) const;

  private:
    const Scene& scene_;
    const RayScene& ray_scene_;
    const SurfaceResolver& resolver_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    std::vector<float> outward_;  // +1 or -1 times the winding's normal points outwards; 0 = not entered
    std::vector<std::shared_ptr<const TransmissionAlbedo>> transmission_;  // by object
    std::vector<std::unique_ptr<const DensityField>> densities_;           // by object
    std::vector<std::string> warnings_;
    bool is_empty_ = true;
};

}  // namespace frazil
