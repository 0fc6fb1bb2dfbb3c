// Light that enters ice right where a path meets it, for the compensation that fills up (gathering.cpp).
// Model: a light and a direction for each place, by numbers of its own, asked for together once it is known what a picture
//   would show of it.
// Units: irradiance.
// Valid: thread-safe; what is asked for beside a place does not matter to it.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/render/bodies.h"
#include "frazil/render/tile.h"

namespace frazil {

struct Entering {
    Rgb irradiance = Rgb(0.0f);
    std::uint32_t group = 0;
};

class EnteringLight {
  public:
    // All must outlive this.
    EnteringLight(const RayScene& ray_scene, const LightSampler& lights,
                  const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::size_t>& group_of_light)
        : ray_scene_(ray_scene), lights_(lights), bodies_(bodies), group_of_light_(group_of_light) {}

    // One estimate each: out[i] at *places[i].
    void sample(std::span<const EnteringPlace* const> places, std::span<Entering> out) const;

  private:
    const RayScene& ray_scene_;
    const LightSampler& lights_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
    const std::vector<std::size_t>& group_of_light_;
};

}  // namespace frazil
