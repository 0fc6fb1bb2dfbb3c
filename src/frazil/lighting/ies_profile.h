// A luminaire's light by direction: luminous intensity over vertical and horizontal angles [IES-LM-63], type C.
// Model: bilinear in the angles; 0 beyond the vertical angles that are given. A horizontal range of 0, 90 or 180 degrees
//   stands for an even, a fourfold and a mirrored distribution, one of 90 to 270 for one mirrored the other way.
// Units: degrees; intensities in candela, factors on radiance here. Vertical angle 0 is the light's -z; horizontal
//   angles count from the -x that the light shines to towards -y (as OpenUSD's hdEmbree has it).
// Valid: finite intensities >= 0, angles that rise, the horizontal ones over 0, 90, 180 or 360 degrees.
// Not: types A and B, tilt, the luminaire's own size.
#pragma once

#include <string>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

class IesProfile {
  public:
    // values[h * vertical.size() + v]. ValueError (beginning with `path`) where the rules above are broken.
    IesProfile(std::vector<float> vertical, std::vector<float> horizontal, std::vector<float> values,
               const std::string& path);

    // The intensity of light that arrives from the unit direction `towards` the light, in the light's frame.
    // `angle_scale` widens (> 1) or narrows (< 1) the profile about vertical angle 0, negative ones about 180; 0 is none
    // (UsdLuxShapingAPI).
    float eval(const V3f& towards, float angle_scale = 0.0f) const;
    // The mean intensity: exact, over the hemisphere where the vertical angles span no more than that, else over the sphere.
    float mean() const { return mean_; }

    const std::vector<float>& vertical() const { return vertical_; }
    const std::vector<float>& horizontal() const { return horizontal_; }
    const std::vector<float>& values() const { return values_; }

  private:
    float at(float vertical, float horizontal) const;  // degrees

    std::vector<float> vertical_, horizontal_, values_;
    float mean_ = 0.0f;
};

}  // namespace frazil
