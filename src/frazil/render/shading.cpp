#include "frazil/render/shading.h"

namespace frazil {

float surface_opacity(const Surface& surface) {
    const auto* standard = std::get_if<StandardMaterial>(&surface.material->model);
    if (!standard) return 1.0f;
    const float opacity = eval_float(standard->opacity, surface.st);
    if (standard->opacity_threshold > 0.0f) return opacity >= standard->opacity_threshold ? 1.0f : 0.0f;
    return opacity;
}

Rgb surface_emission(const Surface& surface) {
    const auto* standard = std::get_if<StandardMaterial>(&surface.material->model);
    return standard ? eval_color(standard->emissive_color, surface.st) : Rgb(0.0f);
}

V3f mapped_normal(const StandardMaterial& material, const Surface& surface, const Scene& scene, const Hit& hit,
                  const V3f& wo) {
    const MaterialInput<Rgb> map{Rgb(0.0f, 0.0f, 1.0f), material.normal};
    return bent_towards_viewer(apply_normal_map(surface, scene, hit, eval_color(map, surface.st)), wo);
}

Shader::Shader(const Surface& surface, const Body* body)
    : geometric_normal_(surface.geometric_normal), normal_(surface.normal), body_(body) {
    std::tie(tangent_, bitangent_) = tangent_frame(normal_);
    if (body_) {
        alpha_ = alpha_from_roughness(eval_float(body_->material->roughness, surface.st));
    } else {
        const auto& material = std::get<StandardMaterial>(surface.material->model);
        standard_.emplace(material, surface.st, surface.display_color);
    }
}

BsdfValue Shader::eval(const V3f& wo, const V3f& wi) const {
    if (geometric_normal_.dot(wi) <= 0.0f) return {};
    const V3f local_wo = to_local(wo), local_wi = to_local(wi);
    if (local_wi.z <= 0.0f) return {};
    if (standard_) return standard_->eval(local_wo, local_wi);
    BsdfValue value;
    value.specular =
        Rgb(body_->material->specular * dielectric_reflection(local_wo, local_wi, alpha_, *body_->boundary));
    value.pdf = ggx_pdf(local_wo, local_wi, alpha_);
    return value;
}

bool Shader::sample(const V3f& wo, float u_lobe, const V2f& u, V3f& wi) const {
    const V3f local_wo = to_local(wo);
    const V3f local_wi = standard_ ? standard_->sample(local_wo, u_lobe, u) : ggx_sample(local_wo, alpha_, u);
    if (!(local_wi.z > 0.0f)) return false;
    wi = to_world(local_wi);
    return geometric_normal_.dot(wi) > 0.0f;
}

}  // namespace frazil
