// GGX microfacet reflection at a dielectric or metallic boundary, with energy compensation, and its albedo tables.
// Model: height-correlated Smith GGX, visible-normal sampling by spherical caps [Dupuy2023]; the light that further
//   bounces between microfacets would carry is a second lobe [KullaConty2017], so that no energy is lost. Refraction is in
//   transmission.h.
// Units: alpha = roughness² (alpha_from_roughness is the one place that maps it).
// Valid: alpha in [1e-4, 1]; wo, wi in the local frame (z = normal), both pointing away.
// Not: anisotropy.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

// roughness in [0, 1], clamped; alpha in [1e-4, 1].
float alpha_from_roughness(float roughness);
// The roughness of a lobe that is blurred by another of `blur` (an alpha): alphas add in quadrature.
float blurred_roughness(float roughness, float blur);

// F0 of a dielectric boundary: ((eta-1)/(eta+1))².
float fresnel_f0(float eta);

// (1 - cos)^5: how far Schlick's approximation goes from F0 to 1.
float schlick_weight(float cos_theta);

// Density of the microfacet normal h, and Smith's Lambda: the ratio of masked to visible area.
float ggx_distribution(const V3f& h, float alpha);
float smith_lambda(const V3f& w, float alpha);
// A microfacet normal visible from wo (wo.z > 0), and its density D G1 (wo.h) / wo.z per steradian of normals.
V3f ggx_sample_normal(const V3f& wo, float alpha, const V2f& u);
float ggx_normal_pdf(const V3f& wo, const V3f& h, float alpha);

// f_r(wo, wi) * cos(wi), without the Fresnel factor, single scattering; 0 below the horizon.
float ggx_eval(const V3f& wo, const V3f& wi, float alpha);
// A direction wi reflected about a visible microfacet normal; z <= 0 means the sample is lost.
V3f ggx_sample(const V3f& wo, float alpha, const V2f& u);
// Solid-angle density of ggx_sample.
float ggx_pdf(const V3f& wo, const V3f& wi, float alpha);

// A table over (cos, alpha), finer towards grazing angles and towards smooth surfaces, read by bilinear interpolation.
class AlbedoTable {
  public:
    // Fill with value(cos, alpha), evaluated in parallel.
    explicit AlbedoTable(const std::function<float(float, float)>& value);
    float eval(float cos_theta, float alpha) const;
    // 2 ∫ eval(cos, alpha) cos dcos: exact for the interpolated table.
    float average(float alpha) const;

  private:
    static constexpr int kCosines = 64, kAlphas = 33;
    static float cosine_at(int i);
    static float alpha_at(int j);

    std::vector<float> directional_;  // [alpha][cosine]
    std::vector<float> average_;      // [alpha]
};

// Directional albedo of single-scattering GGX where every microfacet reflects all (Fresnel 1), and the part of it that
// carries Schlick's weight: with F = F0 + (1 - F0) weight the albedo is F0 * (white - schlick) + schlick.
struct GgxAlbedo {
    AlbedoTable white, schlick;
};
const GgxAlbedo& ggx_albedo();

// The lobe of multiple scattering, f_r * cos(wi), for a mean Fresnel reflectance of 1; reciprocal.
float ggx_multiple_eval(const V3f& wo, const V3f& wi, float alpha);
// What that lobe is multiplied by where microfacets reflect `fresnel_average` on average [KullaConty2017].
Rgb multiple_scattering_scale(const Rgb& fresnel_average, float alpha);

// Directional albedo of the dielectric GGX reflection with exact Fresnel and energy compensation, tabulated over
// (cos, alpha) for one eta; average() is its cosine-weighted mean. What is not reflected enters: transmittance = 1 -
// albedo. It is the integral of dielectric_reflection over wi within 3e-3 (test: microfacet albedo).
class DielectricAlbedo {
  public:
    // eta of the inside relative to the outside, in [1, 4]: ValueError otherwise.
    explicit DielectricAlbedo(float eta);
    float eval(float cos_theta, float alpha) const;
    float average(float alpha) const;
    float eta() const { return eta_; }
    // Mean Fresnel reflectance of the smooth boundary.
    float fresnel_mean() const { return fresnel_mean_; }

  private:
    float eta_, fresnel_mean_;
    std::shared_ptr<const AlbedoTable> total_;
};

// f_r * cos(wi) of the dielectric boundary: single scattering with exact Fresnel plus multiple scattering.
float dielectric_reflection(const V3f& wo, const V3f& wi, float alpha, const DielectricAlbedo& albedo);

}  // namespace frazil
