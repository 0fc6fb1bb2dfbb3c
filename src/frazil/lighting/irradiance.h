// Irradiance at points: the light that enters a translucent body, baked once per shot.
// Model: E = ∫ L(w) T(cos) cos dw over the outer hemisphere, per light group, with ray-traced shadows and the boundary's
//   transmittance T; every light is served by its own stratified samples, quasi-Monte Carlo per point. Domes with an image
//   share theirs between the image's density and the cosine by the balance heuristic.
// Units: W/m² (the lights' unit).
// Valid: the same bits for any number of threads; seeded by (seed, point), so that a light's part does not depend on the
//   other lights and a negative twin cancels to the bit. Lights whose translucency multiplier is 0 cost nothing.
// Not: bounces between surfaces (bounce.h).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/points/point_set.h"

namespace frazil {

struct IrradianceOptions {
    int samples = 64;  // per point and light, 1 to 2^20; a power of two is stratified best
    std::uint32_t seed = 0;
    LightComponent component = LightComponent::translucency;  // whose multipliers the lights take
};

struct Irradiance {
    std::size_t groups = 1;
    std::vector<Rgb> values;  // (N, groups)
    std::uint64_t rays = 0;
    std::uint64_t dropped_samples = 0;  // non-finite
};

// The light groups of a light list in order of first appearance; an empty name is the default group. One default group
// where there is no light.
std::vector<std::string> light_groups(const std::vector<Light>& lights);

// `transmittance(cos)` is the fraction of light that enters at that angle: 1 - Fresnel, or a table for a rough
// boundary. It is tabulated once, at steps of 1/1024 in cos. ValueError for samples < 1 or points without normals.
Irradiance bake_irradiance(const PointSet& points, const RayScene& scene, const LightSampler& lights,
                           const std::function<float(float)>& transmittance, const IrradianceOptions& options = {},
                           Progress* progress = nullptr);

// The rays that bake_irradiance traces, in its order: what a bench needs to compare with bare ray tracing.
std::vector<Ray> shadow_rays(const PointSet& points, const LightSampler& lights, const IrradianceOptions& options = {});

}  // namespace frazil
