// Light that reaches points by way of other surfaces: one bounce per call.
// Model: E = ∫ L(x', -w) T(cos) cos dw over the directions in which a surface is seen, by cosine-distributed
//   quasi-Monte Carlo rays, those of an even dome (irradiance.h); what the surface sends is the caller's:
//   reflected_light() for opaque diffuse surfaces, a gather at the hit for ice (then ice lights ice). Each hit tells its
//   weight in the point's irradiance, so that a caller that keeps them can let light bounce again without another ray.
// Units: W/m² for irradiance, W/m²/sr for radiance.
// Valid: the same bits for any number of threads where the caller's function is one of its arguments alone.
// Not: light straight from lights (irradiance.h), glossy surfaces.
#pragma once

#include <functional>
#include <span>

#include "frazil/lighting/irradiance.h"

namespace frazil {

// A surface that a point sees.
struct BounceHit {
    std::uint32_t point = 0;  // index into the points
    V3f position{0.0f};       // on the surface, metres
    V3f direction{0.0f};      // from the point to the surface, unit length
    Rgb weight = Rgb(0.0f);   // sr: what the radiance along the ray counts in the point's irradiance, pi T / n
    V3f along{0.0f};          // where its light travels along the point's surface: along_surface()
    Hit surface;
};

// Points whose hits make one batch: neighbours in space.
inline constexpr std::size_t kPointsPerBounceBatch = 256;

// Fill radiance[i * groups + g] with what hits[i] sends back along its ray, per light group; 0 as they come. Called from
// several threads at once, once for every batch of points, 0, 1 ... in all; their cut does not depend on the number of
// threads, and the hits of a point are in one batch.
using BounceRadiance = std::function<void(std::size_t batch, std::span<const BounceHit> hits, std::span<Rgb> radiance)>;

// (N, groups) irradiance that surfaces send to the points. options.samples counts rays per point.
Irradiance bake_bounce(const PointSet& points, const RayScene& scene, std::size_t groups,
                       const BounceRadiance& radiance, const Transmittance& transmittance,
                       const IrradianceOptions& options = {}, Progress* progress = nullptr);

// What opaque diffuse surfaces reflect: albedo / pi times their irradiance, `samples` shadow rays per hit and light, with
// the diffuse multiplier of each light. `albedo` may return 0 for surfaces that are dealt with elsewhere (ice): they
// cost nothing. Scene and lights must outlive the result.
BounceRadiance reflected_light(const RayScene& scene, const LightSampler& lights,
                               std::function<Rgb(const BounceHit&)> albedo, int samples = 4, std::uint32_t seed = 0);

}  // namespace frazil
