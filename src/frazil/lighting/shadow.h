// What is left of a light along a shadow ray.
// Model: opaque things stop it; what has a Passage lets it straight on, at the cost of Fresnel's reflection and its tint at
//   both sides and exp(-attenuation * length) inside. Where such bodies overlap one fills the place, and there is no
//   boundary between them. UsdLuxShadowAPI: the shadow's colour, the distance within which things cast
//   it and its fade; shadow linking.
// Units: fractions.
// Valid: thread-safe. Plain shadows of opaque things cost one occlusion ray, and packets of rays share their way.
// Not: the light's own radiance; refraction.
#pragma once

#include <span>

#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"

namespace frazil {

// The fraction of light that goes straight along the ray (direction of unit length), among the placements of the mask.
Rgb transmittance(const RayScene& scene, const Ray& ray, PlacementMask mask = nullptr);

// The factor on the light's radiance; the ray ends at the light, its direction is of unit length.
Rgb shadow_factor(const RayScene& scene, const LightSampler& lights, int light, const Ray& ray);

// The same for many rays towards one light: out[i] from rays[i].
void shadow_factors(const RayScene& scene, const LightSampler& lights, int light, std::span<const Ray> rays,
                    std::span<Rgb> out);

// The same for rays towards several lights.
void shadow_factors(const RayScene& scene, const LightSampler& lights, std::span<const int> light,
                    std::span<const Ray> rays, std::span<Rgb> out);

}  // namespace frazil
