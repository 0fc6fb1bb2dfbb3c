// Choosing directions towards lights, with their densities, for direct light and multiple importance sampling.
// Model: one light picked per sample by power, then a direction on it: area lights by solid angle where the closed form
//   is known (sphere, rect), by area otherwise; dome by its image; [PBRT4, Section 12].
// Units: pdf per steradian, the pick included.
// Valid: thread-safe. Nothing is clamped; negative lights are sampled by absolute power.
#pragma once

#include <limits>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/light.h"

namespace frazil {

struct LightSample {
    V3f direction;                                            // unit length, from the shading point to the light
    float distance = std::numeric_limits<float>::infinity();  // where a shadow ray must end (a hair less)
    Rgb radiance;                                             // towards the point, component multipliers not applied
    float pdf = 0.0f;       // per steradian; 0 = no sample. Infinite (is_delta) for a parallel light
    bool is_delta = false;  // then radiance is irradiance at normal incidence and pdf the pick's probability alone
    int light = -1;
};

// What a ray sees of a light that it runs into.
struct LightHit {
    Rgb radiance;
    float pdf = 0.0f;  // density with which sample() would have chosen this direction
    float distance = std::numeric_limits<float>::infinity();
    int light = -1;
};

class LightSampler {
  public:
    explicit LightSampler(const std::vector<Light>& lights);

    bool is_empty() const;
    const std::vector<Light>& lights() const;

    // One direction for the point; `u_pick` chooses the light, `u` the direction.
    LightSample sample(const V3f& position, float u_pick, const V2f& u) const;
    // A direction towards one given light, so that every light (group) can be served on its own; its pdf has no pick.
    LightSample sample_one(int light, const V3f& position, const V2f& u) const;

    // Every light along the ray that has a finite extent or is a dome, in front of t_max: appended to `hits`. pdf
    // includes the pick of sample().
    void intersect(const V3f& origin, const V3f& direction, float t_max, std::vector<LightHit>& hits) const;

    // Dome radiance alone (the background of camera rays).
    Rgb background(const V3f& direction) const;

  private:
    struct Prepared;
    std::vector<Light> lights_;
    std::shared_ptr<const Prepared> prepared_;
};

}  // namespace frazil
