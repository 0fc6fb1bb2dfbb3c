#include "frazil/render/shading.h"

#include <tuple>

#include "frazil/base/trigonometry.h"

namespace frazil {

Shader::Shader(const Surface& surface, const Body* body, float blur)
    : horizon_(surface.horizon), normal_(surface.normal), body_(body) {
    std::tie(tangent_, bitangent_) = tangent_frame(normal_);
    if (body_) {
        const Covering& covering = surface.covering;
        roughness_ = covering.roughness;
        alpha_ = alpha_from_roughness(roughness_);
        reflectance_ = covering.reflectance;
        // No lobe starves; ice without overlays has but one.
        if (reflectance_ != Rgb(0.0f)) diffuse_chance_ = std::clamp(0.9f * luminance(reflectance_) + 0.05f, 0.1f, 0.9f);
        core_albedo_ = body_->total_reflectance * eval_color(body_->material->tint, surface.texture_point) *
                       covering.tint * (body_->material->translucency * (1.0f - covering.scattered));
    } else {
        const auto& material = std::get<StandardMaterial>(surface.material->model);
        standard_.emplace(material, surface.texture_point, surface.display_color, blur);
    }
}

float Shader::terminator(const V3f& wi) const {
    const float cosine = horizon_.dot(wi);
    if (cosine <= 0.0f) return 0.0f;
    const float tilt = horizon_.dot(normal_), bumped = normal_.dot(wi);
    if (tilt >= 1.0f - 1e-6f || bumped <= 0.0f) return 1.0f;
    const float g = std::min(1.0f, cosine / (bumped * std::max(tilt, 1e-3f)));
    return g * (1.0f + g * (1.0f - g));
}

bool Shader::scatters() const {
    return standard_ || reflectance_ != Rgb(0.0f) ||
           (body_->material->specular > 0.0f && body_->boundary->eta() != 1.0f);
}

Rgb Shader::albedo(const V3f& wo) const {
    const V3f local_wo = to_local(wo);
    if (standard_) {
        const auto lobes = standard_->albedo(local_wo);
        return lobes.diffuse + lobes.specular;
    }
    const float reflected = body_->material->specular * body_->boundary->eval(std::max(0.0f, local_wo.z), alpha_);
    return Rgb(reflected) + (core_albedo_ + reflectance_) * (1.0f - reflected);
}

Scattering Shader::eval(const V3f& wo, const V3f& wi) const {
    const float fade = terminator(wi);
    if (!(fade > 0.0f)) return {};
    const V3f local_wo = to_local(wo), local_wi = to_local(wi);
    if (local_wi.z <= 0.0f) return {};
    if (standard_) {
        const BsdfValue value = standard_->eval(local_wo, local_wi);
        return {value.diffuse * fade, value.specular * fade, Rgb(0.0f), standard_->pdf(local_wo, local_wi)};
    }
    const float reflection = dielectric_reflection(local_wo, local_wi, alpha_, *body_->boundary);
    Scattering value{Rgb(0.0f), Rgb(body_->material->specular * reflection * fade), Rgb(0.0f),
                     ggx_pdf(local_wo, local_wi, alpha_)};
    if (diffuse_chance_ > 0.0f) {
        // Overlays lie under the boundary: light passes it on the way in and on the way out, and is not lost between.
        const float passes = body_->transmittance(local_wo.z, roughness_) *
                             body_->transmittance(local_wi.z, roughness_) / body_->transmittance_average(roughness_);
        value.diffuse = reflectance_ * (passes * local_wi.z * kInvPi * fade);
        value.pdf = (1.0f - diffuse_chance_) * value.pdf + diffuse_chance_ * local_wi.z * kInvPi;
    }
    return value;
}

bool Shader::sample(const V3f& wo, float u_lobe, const V2f& u, V3f& wi) const {
    const V3f local_wo = to_local(wo);
    V3f local_wi;
    if (standard_) {
        local_wi = standard_->sample(local_wo, u_lobe, u).wi;
    } else if (u_lobe < diffuse_chance_) {
        local_wi = cosine_hemisphere(u);
    } else {
        local_wi = ggx_sample(local_wo, alpha_, u);
    }
    if (!(local_wi.z > 0.0f)) return false;
    wi = to_world(local_wi);
    return horizon_.dot(wi) > 0.0f;
}

}  // namespace frazil
