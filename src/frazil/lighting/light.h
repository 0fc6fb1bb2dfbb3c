// Lights as UsdLux defines them, with Frazil's multipliers per component.
// Model: UsdLuxLightAPI. `radiance` is the product of intensity, 2^exposure, color and colour temperature; with
//   `normalize` it is divided by the light's area (or, for a distant light, the sine-squared of its half angle times
//   pi).
// Units: radiance (W/m²/sr) for dome and area lights; a distant light's `radiance` times its solid angle is irradiance.
// Valid: finite values; negative radiance subtracts. Lights shine along -z of their frame; a rect spans x and y.
// Not: shaping, filters, linking.
#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/environment.h"

namespace frazil {

struct DomeLight {
    std::shared_ptr<const Environment> image;  // none = uniform
};
struct DistantLight {
    float angle = 0.53f;  // full angle in degrees; 0 = parallel
};
struct RectLight {
    float width = 1.0f, height = 1.0f;  // in the light's own units, scaled by light_to_world
};
struct DiskLight {
    float radius = 0.5f;
};
struct SphereLight {
    float radius = 0.5f;
};

using LightShape = std::variant<DomeLight, DistantLight, RectLight, DiskLight, SphereLight>;

// The components that a light can be told to act on; each light has one multiplier per component.
enum class LightComponent { diffuse, specular, translucency };
inline constexpr int kLightComponentCount = 3;

struct Light {
    std::string path;
    std::string group;  // frazil:lightGroup; empty = the default group
    LightShape shape;
    Rgb radiance = Rgb(1.0f);  // final, `normalize` not yet applied
    bool normalize = false;
    M44f light_to_world;
    float multipliers[kLightComponentCount] = {1.0f, 1.0f, 1.0f};
};

// Refuse non-finite values and sizes out of range: ValueError beginning with the light's path.
void check_light(const Light& light);

}  // namespace frazil
