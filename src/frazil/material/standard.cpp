#include "frazil/material/standard.h"

#include "frazil/base/trigonometry.h"
#include "frazil/material/microfacet.h"

namespace frazil {
namespace {

Rgb clamp01(const Rgb& c) {
    return {std::clamp(c.x, 0.0f, 1.0f), std::clamp(c.y, 0.0f, 1.0f), std::clamp(c.z, 0.0f, 1.0f)};
}

// 2 ∫ (F0 + (1 - F0)(1 - cos)^5) cos dcos.
Rgb schlick_average(const Rgb& f0) {
    return f0 + (Rgb(1.0f) - f0) / 21.0f;
}

}  // namespace

StandardBsdf::StandardBsdf(const StandardMaterial& material, const TexturePoint& at, const Rgb& display_color,
                           float blur) {
    const Rgb color = clamp01(material.uses_display_color ? display_color : eval_color(material.diffuse_color, at));
    alpha_ = alpha_from_roughness(blurred_roughness(eval_float(material.roughness, at), blur));
    if (material.use_specular_workflow) {
        diffuse_ = color;
        f0_ = clamp01(eval_color(material.specular_color, at));
    } else {
        const float metallic = std::clamp(eval_float(material.metallic, at), 0.0f, 1.0f);
        diffuse_ = color * (1.0f - metallic);
        f0_ = Rgb(fresnel_f0(material.ior)) * (1.0f - metallic) + color * metallic;
    }
    clearcoat_ = std::clamp(eval_float(material.clearcoat, at), 0.0f, 1.0f);
    clearcoat_alpha_ = alpha_from_roughness(blurred_roughness(eval_float(material.clearcoat_roughness, at), blur));
    clearcoat_f0_ = fresnel_f0(material.ior);
    emission_ = eval_color(material.emissive_color, at);
    opacity_ = std::clamp(eval_float(material.opacity, at), 0.0f, 1.0f);
    if (material.opacity_threshold > 0.0f) opacity_ = opacity_ >= material.opacity_threshold ? 1.0f : 0.0f;

    const GgxAlbedo& tables = ggx_albedo();
    multiple_scale_ = multiple_scattering_scale(schlick_average(f0_), alpha_);
    const float white = tables.white.average(alpha_), schlick = tables.schlick.average(alpha_);
    specular_albedo_mean_ = clamp01(f0_ * (white - schlick) + Rgb(schlick) + multiple_scale_ * (1.0f - white));
}

Rgb StandardBsdf::specular_albedo(float cos_theta) const {
    const float white = ggx_albedo().white.eval(cos_theta, alpha_);
    const float schlick = ggx_albedo().schlick.eval(cos_theta, alpha_);
    return clamp01(f0_ * (white - schlick) + Rgb(schlick) + multiple_scale_ * (1.0f - white));
}

float StandardBsdf::clearcoat_albedo(float cos_theta) const {
    if (clearcoat_ == 0.0f) return 0.0f;
    const float white = ggx_albedo().white.eval(cos_theta, clearcoat_alpha_);
    const float schlick = ggx_albedo().schlick.eval(cos_theta, clearcoat_alpha_);
    return clearcoat_ * (clearcoat_f0_ * (white - schlick) + schlick);
}

BsdfValue StandardBsdf::eval(const V3f& wo, const V3f& wi) const {
    BsdfValue value;
    if (wo.z <= 0.0f || wi.z <= 0.0f) return value;
    const float weight = schlick_weight(wo.dot((wo + wi).normalized()));
    const Rgb fresnel = f0_ + (Rgb(1.0f) - f0_) * weight;
    value.specular = fresnel * ggx_eval(wo, wi, alpha_) + multiple_scale_ * ggx_multiple_eval(wo, wi, alpha_);

    // Diffuse receives what specular leaves, on the way in and on the way out, and loses nothing between.
    const Rgb enters = Rgb(1.0f) - specular_albedo(wo.z), leaves = Rgb(1.0f) - specular_albedo(wi.z);
    const Rgb mean = Rgb(1.0f) - specular_albedo_mean_;
    for (int c = 0; c < 3; ++c) {
        if (mean[c] > 1e-6f) value.diffuse[c] = diffuse_[c] * enters[c] * leaves[c] / mean[c] * wi.z * kInvPi;
    }
    if (clearcoat_ > 0.0f) {
        // The coat takes its share from what lies below; the larger of both directions keeps reciprocity and energy.
        const float below = 1.0f - std::max(clearcoat_albedo(wo.z), clearcoat_albedo(wi.z));
        const float coat_fresnel = clearcoat_f0_ + (1.0f - clearcoat_f0_) * weight;
        value.diffuse *= below;
        value.specular = value.specular * below + Rgb(clearcoat_ * coat_fresnel * ggx_eval(wo, wi, clearcoat_alpha_));
    }
    return value;
}

BsdfValue StandardBsdf::albedo(const V3f& wo) const {
    if (wo.z <= 0.0f) return {};
    const Rgb specular = specular_albedo(wo.z);
    const float coat = clearcoat_albedo(wo.z);
    return {diffuse_ * (Rgb(1.0f) - specular) * (1.0f - coat), specular * (1.0f - coat) + Rgb(coat)};
}

StandardBsdf::LobeWeights StandardBsdf::lobe_weights(const V3f& wo) const {
    const float white = ggx_albedo().white.eval(wo.z, alpha_), schlick = ggx_albedo().schlick.eval(wo.z, alpha_);
    const float coat = clearcoat_albedo(wo.z);
    const float multiple = luminance(multiple_scale_) * (1.0f - white);
    // The cosine lobe serves multiple scattering too; no lobe starves where the colours are dark.
    LobeWeights w{luminance(albedo(wo).diffuse) + multiple * (1.0f - coat) + 1e-4f,
                  (luminance(f0_) * (white - schlick) + schlick) * (1.0f - coat) + 1e-4f, coat};
    const float sum = w.diffuse + w.specular + w.clearcoat;
    return {w.diffuse / sum, w.specular / sum, w.clearcoat / sum};
}

float StandardBsdf::pdf(const V3f& wo, const V3f& wi) const {
    if (wo.z <= 0.0f || wi.z <= 0.0f) return 0.0f;
    const LobeWeights w = lobe_weights(wo);
    float pdf = w.diffuse * wi.z * kInvPi + w.specular * ggx_pdf(wo, wi, alpha_);
    if (w.clearcoat > 0.0f) pdf += w.clearcoat * ggx_pdf(wo, wi, clearcoat_alpha_);
    return pdf;
}

BsdfSample StandardBsdf::sample(const V3f& wo, float u_lobe, const V2f& u) const {
    BsdfSample result;
    if (wo.z <= 0.0f) return result;
    const LobeWeights w = lobe_weights(wo);
    if (u_lobe < w.diffuse) {
        result.wi = cosine_hemisphere(u);
    } else {
        result.wi = ggx_sample(wo, u_lobe < w.diffuse + w.specular ? alpha_ : clearcoat_alpha_, u);
    }
    if (result.wi.z <= 0.0f) return result;
    result.pdf = pdf(wo, result.wi);
    result.value = eval(wo, result.wi);
    return result;
}

}  // namespace frazil
