// Closed shells that run into each other and are one body: what lies inside of them.
// Model: a place is inside a shell where the first hit with that shell alone, on a ray in any direction, leaves it.
// Units: metres, world space.
// Valid: thread-safe; closed meshes, turned inside out or not. Shells whose surfaces coincide are told apart: each is asked
//   by itself.
// Not: which objects are shells of one body (translucency_sets.h).
#pragma once

#include <limits>
#include <vector>

#include "frazil/geometry/ray_scene.h"

namespace frazil {

class Shells {
  public:
    // `objects` is the number of placements; the ray scene must outlive this.
    Shells(const RayScene& ray_scene, std::size_t objects) : ray_scene_(&ray_scene), is_member_(objects, 0) {}

    // `outward` turns the winding's normal outwards, +1 or -1; `box` is the shell's in the world.
    void add(std::size_t object, float outward, const Box3f& box);

    bool has(std::size_t object) const { return is_member_[object] != 0; }
    std::size_t size() const { return shells_.size(); }

    static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
    // Whether the place is inside a shell of an object below `before`, other than `except`.
    bool contains(const V3f& position, std::size_t except = kAll, std::size_t before = kAll) const;
    // The way along a ray that begins inside to where the last shell is left, or something else met; infinite where
    // neither is. `begins_outside` tells where it does, if it meets a shell from there.
    float way_through(Ray ray, bool* begins_outside = nullptr) const;

  private:
    struct Shell {
        std::size_t object;
        float outward;
        Box3f box;
        std::vector<std::uint8_t> mask;
    };
    const RayScene* ray_scene_;
    std::vector<std::uint8_t> is_member_;
    std::vector<Shell> shells_;
};

}  // namespace frazil
