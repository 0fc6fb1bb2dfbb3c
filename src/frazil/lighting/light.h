// Lights as UsdLux defines them, with Frazil's multipliers per component.
// Model: UsdLuxLightAPI. `radiance` is the product of intensity, 2^exposure, color and colour temperature; with
//   `normalize` it is divided by the light's size: its area in world space, for a distant light pi sin² of its half angle,
//   1 for a dome and for parallel light.
// Units: radiance (W/m²/sr) for dome and area lights; a distant light's `radiance` times pi sin²(half angle) is the
//   irradiance it gives, or `radiance` itself where its angle is 0.
// Valid: finite values; negative radiance subtracts. Rect, disk and distant shine along -z of their frame, sphere and
//   cylinder (about x, no caps) outwards, a mesh along the normals of its triangles; any invertible light_to_world, a
//   dome's and a distant light's rotation alone.
//   Portals guide the sampling of a dome and change nothing else.
// Not: light filters.
#pragma once

#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/geometry/mesh.h"
#include "frazil/lighting/environment.h"
#include "frazil/lighting/light_image.h"
#include "frazil/lighting/linking.h"
#include "frazil/lighting/shaping.h"

namespace frazil {

struct DomeLight {
    std::shared_ptr<const Environment> image;  // none = uniform
    // Openings that its light comes through (UsdLuxPortalLight): the unit square in x and y about the origin, to the world;
    // light goes along -z.
    std::vector<M44f> portals = {};
};
struct DistantLight {
    float angle = 0.53f;  // full angle in degrees, 0 to 360; 0 = parallel
};
struct RectLight {
    float width = 1.0f, height = 1.0f;        // in the light's own units, scaled by light_to_world
    std::shared_ptr<const LightImage> image;  // multiplies the radiance over the rect; none = even
};
struct DiskLight {
    float radius = 0.5f;
};
struct SphereLight {
    float radius = 0.5f;
};
struct CylinderLight {
    float length = 1.0f, radius = 0.5f;
};
// A mesh that shines. It is no surface of its own: rays find it through the object that shows it.
struct MeshLight {
    std::shared_ptr<const Mesh> mesh;                          // in the light's frame
    std::shared_ptr<const std::vector<Rgb>> triangle_factors;  // multiply the radiance by triangle; none = 1
    std::uint32_t object = kNoObject;                          // of the scene, with this mesh at light_to_world
    bool is_two_sided = false;                                 // else on the side that the winding tells
    bool is_material = false;  // stands for the emission of the object's material, which the camera sees itself
};

using LightShape = std::variant<DomeLight, DistantLight, RectLight, DiskLight, SphereLight, CylinderLight, MeshLight>;

// How a light's shadows depart from opaque ones (UsdLuxShadowAPI).
struct ShadowRules {
    bool is_enabled = true;
    Rgb color = Rgb(0.0f);       // what is left of the light where something is in the way
    float distance = -1.0f;      // metres from the shadowed place within which things cast shadows; < 0 = any
    float falloff = -1.0f;       // width of the zone within `distance` where the shadow fades, metres; < 0 = none
    float falloff_gamma = 1.0f;  // exponent of the fade
    std::shared_ptr<const ObjectSet> casters;  // the only objects that cast shadows; none = all
};

// The components that a light can be told to act on; each light has one multiplier per component.
enum class LightComponent { diffuse, specular, translucency, refraction, volume };
inline constexpr int kLightComponentCount = 5;

struct Light {
    std::string path;
    std::string group;  // frazil:lightGroup; empty = the default group
    LightShape shape;
    Rgb radiance = Rgb(1.0f);  // final, `normalize` not yet applied
    bool normalize = false;
    M44f light_to_world;
    Shaping shaping;
    ShadowRules shadow;
    std::shared_ptr<const ObjectSet> lit;  // the only objects that it lights; none = all
    float multipliers[kLightComponentCount] = {1.0f, 1.0f, 1.0f, 1.0f, 1.0f};
};

// Refuse non-finite values and sizes out of range: ValueError beginning with the light's path.
void check_light(const Light& light);

// What `normalize` divides by (UsdLuxLightAPI's sizeFactor), in m² or steradian.
double size_factor(const Light& light);

// Radiance with `normalize` applied.
Rgb emitted_radiance(const Light& light);

}  // namespace frazil
