// UsdPreviewSurface: what everything but ice is made of.
// Model: UsdPreviewSurface 2.6: diffuse + GGX specular (metallic or specular workflow) + clearcoat + emission + opacity.
//   Fresnel by Schlick; multiple scattering compensated and diffuse coupled to it [KullaConty2017]: a white surface
//   without clearcoat reflects all it receives.
// Units: roughness is the user's (alpha = roughness²).
// Valid: the ranges of the specification; values outside are clamped to them.
// Not: refraction, occlusion.
#pragma once

#include "frazil/material/texture.h"

namespace frazil {

struct StandardMaterial {
    MaterialInput<Rgb> diffuse_color{Rgb(0.18f), {}};
    bool uses_display_color = false;  // the mesh's displayColor takes the place of diffuse_color
    MaterialInput<Rgb> emissive_color{Rgb(0.0f), {}};
    bool use_specular_workflow = false;
    MaterialInput<Rgb> specular_color{Rgb(0.0f), {}};
    MaterialInput<float> metallic{0.0f, {}};
    MaterialInput<float> roughness{0.5f, {}};
    MaterialInput<float> clearcoat{0.0f, {}};
    MaterialInput<float> clearcoat_roughness{0.01f, {}};
    MaterialInput<float> opacity{1.0f, {}};
    float opacity_threshold = 0.0f;
    float ior = 1.5f;
    TextureLookup normal;                 // tangent-space normal map, scale and bias as authored (usually 2 and -1)
    MaterialInput<float> bump{0.0f, {}};  // height, metres; a texture
};

// f_r * cos(wi), in the two parts that become AOVs; specular holds the clearcoat.
struct BsdfValue {
    Rgb diffuse = Rgb(0.0f), specular = Rgb(0.0f);
};

struct BsdfSample {
    V3f wi = V3f(0.0f);  // local frame
    BsdfValue value;
    float pdf = 0.0f;  // of the whole mixture; 0 = the sample is lost
};

// A StandardMaterial at one surface point, its textures read. Directions in the local frame (z = shading normal).
class StandardBsdf {
  public:
    // `display_color` replaces the diffuse colour where the material asks for it.
    // `blur` is an alpha that makes the glossy lobes broader.
    StandardBsdf(const StandardMaterial& material, const TexturePoint& at, const Rgb& display_color = Rgb(0.18f),
                 float blur = 0.0f);

    // Both zero unless wo and wi lie above the surface.
    BsdfValue eval(const V3f& wo, const V3f& wi) const;
    // `u_lobe` picks diffuse, specular or clearcoat; `u` the direction.
    BsdfSample sample(const V3f& wo, float u_lobe, const V2f& u) const;
    // Density of sample() per steradian.
    float pdf(const V3f& wo, const V3f& wi) const;

    const Rgb& emission() const { return emission_; }
    // Of the specular lobe.
    float alpha() const { return alpha_; }
    // 0 or 1 where the material has a threshold.
    float opacity() const { return opacity_; }
    // Fraction of light from wo that is reflected, per part; for AOVs and denoising.
    BsdfValue albedo(const V3f& wo) const;

  private:
    struct LobeWeights {
        float diffuse, specular, clearcoat;
    };
    LobeWeights lobe_weights(const V3f& wo) const;
    Rgb specular_albedo(float cos_theta) const;
    float clearcoat_albedo(float cos_theta) const;

    Rgb diffuse_, f0_, multiple_scale_, specular_albedo_mean_, emission_;
    float alpha_, clearcoat_, clearcoat_alpha_, clearcoat_f0_, opacity_;
};

}  // namespace frazil
