// Irradiance at points: the light that enters a translucent body, baked once per shot.
// Model: E = ∫ L(w) T(cos) cos dw over the outer hemisphere, per light group, with ray-traced shadows and the boundary's
//   transmittance T; every light is served by its own stratified samples, quasi-Monte Carlo per point. Domes with an image
//   share theirs between the image's density and the cosine by the balance heuristic. A group's lights with a surface,
//   where they are more than kCrowd, are a crowd: they share the samples of sixteen lights, each sample picks one
//   (light_picker.h). Errors are estimated from neighbouring samples [Wolter1985], which tends to exceed them.
// Units: W/m² (the lights' unit).
// Valid: the same bits for any number of threads; seeded by (seed, point), so that a light's part does not depend on the
//   other lights and a negative twin cancels to the bit (outside crowds). Lights whose translucency multiplier is 0, or
//   that are not linked to a point's object, cost nothing.
// Not: bounces between surfaces (bounce.h).
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/lighting/places.h"
#include "frazil/points/point_set.h"

namespace frazil {

// Per channel: irradiance times the part along the surface of the direction in which that light travels, W/m².
struct Flow {
    V3f channel[3] = {V3f(0.0f), V3f(0.0f), V3f(0.0f)};
    V3f& operator[](std::size_t c) { return channel[c]; }
    const V3f& operator[](std::size_t c) const { return channel[c]; }
};

// The part along the surface of light's direction.
inline V3f along_surface(const V3f& towards_light, const V3f& normal) {
    return normal * towards_light.dot(normal) - towards_light;
}

inline void add_flow(Flow& flow, const Rgb& irradiance, const V3f& along) {
    for (int c = 0; c < 3; ++c) flow[static_cast<std::size_t>(c)] += along * irradiance[c];
}

// The fraction of light that enters at an angle whose cosine is this, per channel.
using Transmittance = std::function<Rgb(float cosine)>;

struct IrradianceOptions {
    int samples = 64;  // per point and light, 1 to 2^20; a power of two is stratified best
    std::uint32_t seed = 0;
    LightComponent component = LightComponent::translucency;  // whose multipliers the lights take
    std::vector<std::uint32_t> objects =
        {};  // that the points lie on, for light linking: one each, one for all, or none
    // Relative error (one standard deviation) to reach by more samples, 0 = none. Relative to what arrives at the point,
    // or to a tenth of what would arrive if nothing were in the way, whichever is larger.
    float error = 0.0f;
    int max_rounds = 16;  // how many times `samples` a light may take at a point for that
    // Where rays start: spread over the cell of each point, so that irradiance is a mean over what the point stands for; or,
    // without, at the points themselves.
    CellSource cells = {};
    bool with_flows = false;
};

// So many lights of a group are served one by one in the bake.
inline constexpr std::size_t kCrowd = 32;

struct Irradiance {
    std::size_t groups = 1;
    std::vector<Rgb> values;  // (N, groups)
    // (N, groups), with cells: covariance of irradiance, summed over channels, with the place in the cell; W/m. Divided by
    // the irradiance it is how far the centre of the light lies from the cell's centroid.
    std::vector<V3f> moments;
    std::vector<Flow> flows;    // (N, groups), where asked for
    std::vector<float> errors;  // (N), one standard deviation of the luminance of all groups together, estimated
    std::uint64_t rays = 0;
    std::uint64_t dropped_samples = 0;  // non-finite
};

// The light groups of a light list in order of first appearance; an empty name is the default group. One default group
// where there is no light.
std::vector<std::string> light_groups(const std::vector<Light>& lights);

// `transmittance(cos)` is the fraction of light that enters at that angle: 1 - Fresnel, or a table for a rough
// boundary. It is tabulated once, at steps of 1/1024 in cos. ValueError for options out of
// range or points without normals.
Irradiance bake_irradiance(const PointSet& points, const RayScene& scene, const LightSampler& lights,
                           const Transmittance& transmittance, const IrradianceOptions& options = {},
                           Progress* progress = nullptr);

// The rays that bake_irradiance traces, in its order: what a bench needs to compare with bare ray tracing.
std::vector<Ray> shadow_rays(const PointSet& points, const LightSampler& lights, const IrradianceOptions& options = {});

}  // namespace frazil
