// Choosing directions towards lights, with their densities, for direct light and multiple importance sampling.
// Model: one light picked per sample in proportion to the irradiance that it can give at the point, then a direction on
//   it (world_light.h).
// Units: pdf per steradian, the pick included.
// Valid: thread-safe. Nothing is clamped; negative lights are sampled by absolute power; a light whose diffuse and
//   specular multipliers are both 0 is never picked by sample().
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/light.h"
#include "frazil/lighting/world_light.h"

namespace frazil {

class LightSampler {
  public:
    // ValueError where check_light refuses a light.
    explicit LightSampler(const std::vector<Light>& lights);

    bool is_empty() const { return lights_.empty(); }
    const std::vector<Light>& lights() const { return lights_; }
    const WorldLight& world_light(int light) const { return (*world_lights_)[std::size_t(light)]; }

    // One direction for the point; `u_pick` chooses the light, `u` the direction.
    LightSample sample(const V3f& position, float u_pick, const V2f& u) const;
    // A direction towards one given light, so that every light (group) can be served on its own; its pdf has no pick.
    LightSample sample_one(int light, const V3f& position, const V2f& u) const;
    // Many at once: out[i] from u[i].
    void sample_many(int light, const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const;

    // Every light along the ray that has a finite extent or is a dome, in front of t_max: appended to `hits`. Light
    // from infinity (dome, distant) is seen only where t_max is infinite. pdf includes the pick of sample().
    void intersect(const V3f& origin, const V3f& direction, float t_max, std::vector<LightHit>& hits) const;

    // Dome radiance alone (the background of camera rays).
    Rgb background(const V3f& direction) const;

  private:
    // The weight of one light in the choice at a point.
    float pick_weight(std::size_t light, const V3f& position) const;
    float pick_total(const V3f& position) const;

    std::vector<Light> lights_;
    std::shared_ptr<const std::vector<WorldLight>> world_lights_;
};

}  // namespace frazil
