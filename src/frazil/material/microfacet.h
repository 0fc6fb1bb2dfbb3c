// GGX microfacet reflection at a dielectric or metallic boundary, with energy compensation, and its albedo tables.
// Model: height-correlated Smith GGX, visible-normal sampling [Heitz2018]; multiple scattering by [KullaConty2017].
// Units: alpha = roughness² (alpha_from_roughness is the one place that maps it).
// Valid: alpha in [1e-4, 1]; wo, wi in the local frame (z = normal), both pointing away.
// Not: anisotropy, transmission.
#pragma once

#include "frazil/base/vec.h"

namespace frazil {

float alpha_from_roughness(float roughness);

// F0 of a dielectric boundary: ((eta-1)/(eta+1))².
float fresnel_f0(float eta);

// f_r(wo, wi) * cos(wi), without the Fresnel factor, single scattering; 0 below the horizon.
float ggx_eval(const V3f& wo, const V3f& wi, float alpha);
// A direction wi reflected about a visible microfacet normal; z <= 0 means the sample is lost.
V3f ggx_sample(const V3f& wo, float alpha, const V2f& u);
// Solid-angle density of ggx_sample.
float ggx_pdf(const V3f& wo, const V3f& wi, float alpha);

// Directional albedo of the dielectric GGX reflection with exact Fresnel and energy compensation, tabulated over
// (cos, alpha) for one eta; average() is its cosine-weighted mean. What is not reflected enters: transmittance = 1 -
// albedo.
class DielectricAlbedo {
  public:
    explicit DielectricAlbedo(float eta);
    float eval(float cos_theta, float alpha) const;
    float average(float alpha) const;

  private:
    static constexpr int kSize = 32;
    float eta_;
    float directional_[kSize][kSize];
    float average_[kSize];
};

}  // namespace frazil
