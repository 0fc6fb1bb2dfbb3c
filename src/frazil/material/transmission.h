// Rough dielectric refraction: light that goes through a GGX boundary.
// Model: [Walter2007] with visible normals [Dupuy2023]. Two ways: `entering` from outside, scaled so that reflection and
//   refraction together lose nothing; `inner` for light that is inside already, whose every microfacet reflects or refracts
//   all it gets.
// Units: pdf per steradian; values are f * cos(wi) for radiance over squared index, which refraction keeps.
// Valid: alpha in [1e-4, 1], eta = index of wi's side / index of wo's side; wo.z > 0, wi.z < 0 for what goes through.
// Not: anisotropy, dispersion.
#pragma once

#include <memory>

#include "frazil/material/microfacet.h"

namespace frazil {

// Indices nearer to each other than this have no boundary between them: light goes straight on.
inline constexpr float kMatchedIndex = 1e-3f;
inline bool is_index_matched(float eta) {
    return std::abs(eta - 1.0f) < kMatchedIndex;
}

// Refract wo at the microfacet normal h (wo.h > 0); false under total internal reflection.
bool refract(const V3f& wo, const V3f& h, float eta, V3f& wi);

// The density of wi where visible normals refract wo, and single-scattering f * cos of it, Fresnel and masking included.
float transmission_pdf(const V3f& wo, const V3f& wi, float alpha, float eta);
float transmission_eval(const V3f& wo, const V3f& wi, float alpha, float eta);

// How much of the light from wo a rough boundary lets in by single scattering, tabulated over (cos, alpha).
class TransmissionAlbedo {
  public:
    // eta >= 1.
    explicit TransmissionAlbedo(float eta);
    float eval(float cos_theta, float alpha) const;

  private:
    std::shared_ptr<const AlbedoTable> table_;
};

// Where light goes at the boundary, and what it is worth there.
struct BoundarySample {
    V3f wi = V3f(0.0f);
    float weight = 0.0f;  // of the sample; 0 = lost
    bool is_reflection = false;
};

// Enter from outside: the lobe integrates to one, so that the caller's transmittance says how much enters.
BoundarySample sample_entering(const V3f& wo, float alpha, float eta, const TransmissionAlbedo& albedo, const V2f& u);

// Meet the boundary from inside (or between two media): reflect or go through, by Fresnel's odds; weight 1.
BoundarySample sample_inner(const V3f& wo, float alpha, float eta, float u_lobe, const V2f& u);
// f * cos of going through from inside, which is also its density.
float inner_transmission(const V3f& wo, const V3f& wi, float alpha, float eta);

}  // namespace frazil
