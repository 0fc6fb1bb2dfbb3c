#include "frazil/material/transmission.h"

#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

// The microfacet normal that takes wo to wi, on wo's side; false where there is none.
bool refraction_normal(const V3f& wo, const V3f& wi, float eta, V3f& h) {
    if (wo.z <= 0.0f || wi.z >= 0.0f) return false;
    h = -(wo + wi * eta);
    const float length = h.length();
    if (!(length > 1e-7f)) return false;
    h /= h.z < 0.0f ? -length : length;
    return h.z > 0.0f && wo.dot(h) > 0.0f && wi.dot(h) < 0.0f;
}

// Steradians of h per steradian of wi [Walter2007, Eq. 17].
float normals_per_direction(const V3f& wo, const V3f& wi, const V3f& h, float eta) {
    const float denominator = wo.dot(h) + eta * wi.dot(h);
    return eta * eta * std::abs(wi.dot(h)) / (denominator * denominator);
}

}  // namespace

bool refract(const V3f& wo, const V3f& h, float eta, V3f& wi) {
    const float cosine = wo.dot(h);
    const float cos2_t = 1.0f - (1.0f - cosine * cosine) / (eta * eta);
    if (cos2_t <= 0.0f) return false;
    wi = h * (cosine / eta - std::sqrt(cos2_t)) - wo / eta;
    return true;
}

float transmission_pdf(const V3f& wo, const V3f& wi, float alpha, float eta) {
    V3f h;
    if (!refraction_normal(wo, wi, eta, h)) return 0.0f;
    return ggx_normal_pdf(wo, h, alpha) * normals_per_direction(wo, wi, h, eta);
}

float transmission_eval(const V3f& wo, const V3f& wi, float alpha, float eta) {
    V3f h;
    if (!refraction_normal(wo, wi, eta, h)) return 0.0f;
    // Masking and shadowing on opposite sides of a height field are not correlated: G2 = B(1 + L_o, 1 + L_i), whose
    // ratio to G1(wo) G1(wi) is close to one [Walter2007 takes their product].
    const float lambda_o = smith_lambda(wo, alpha), lambda_i = smith_lambda(wi, alpha);
    const float masking = 1.0f / ((1.0f + lambda_o) * (1.0f + lambda_i));
    return (1.0f - fresnel_dielectric(wo.dot(h), eta)) * ggx_distribution(h, alpha) * masking * wo.dot(h) / wo.z *
           normals_per_direction(wo, wi, h, eta);
}

TransmissionAlbedo::TransmissionAlbedo(float eta) {
    table_ = std::make_shared<AlbedoTable>([eta](float cos_theta, float alpha) {
        constexpr int kAzimuths = 12, kPolar = 24;
        const V3f wo(std::sqrt(std::max(0.0f, 1.0f - cos_theta * cos_theta)), 0.0f, cos_theta);
        double sum = 0.0;
        for (int i = 0; i < kAzimuths; ++i) {
            for (int j = 0; j < kPolar; ++j) {
                // The plane of incidence mirrors the lobe: half the azimuths do.
                const V2f u(0.5f * (float(i) + 0.5f) / kAzimuths, (float(j) + 0.5f) / kPolar);
                const V3f h = ggx_sample_normal(wo, alpha, u);
                V3f wi;
                if (!refract(wo, h, eta, wi) || wi.z >= 0.0f) continue;
                sum += (1.0f - fresnel_dielectric(wo.dot(h), eta)) / (1.0f + smith_lambda(wi, alpha));
            }
        }
        return static_cast<float>(sum / (kAzimuths * kPolar));
    });
}

float TransmissionAlbedo::eval(float cos_theta, float alpha) const {
    return table_->eval(cos_theta, alpha);
}

BoundarySample sample_entering(const V3f& wo, float alpha, float eta, const TransmissionAlbedo& albedo, const V2f& u) {
    if (is_index_matched(eta)) return {-wo, 1.0f, false};
    const V3f h = ggx_sample_normal(wo, alpha, u);
    BoundarySample sample;
    if (!refract(wo, h, eta, sample.wi) || sample.wi.z >= 0.0f) return sample;
    const float single = (1.0f - fresnel_dielectric(wo.dot(h), eta)) / (1.0f + smith_lambda(sample.wi, alpha));
    sample.weight = single / std::max(albedo.eval(wo.z, alpha), 1e-4f);
    return sample;
}

BoundarySample sample_inner(const V3f& wo, float alpha, float eta, float u_lobe, const V2f& u) {
    if (is_index_matched(eta)) return {-wo, 1.0f, false};
    const V3f h = ggx_sample_normal(wo, alpha, u);
    BoundarySample sample{V3f(0.0f), 1.0f, true};
    if (u_lobe >= fresnel_dielectric(wo.dot(h), eta) && refract(wo, h, eta, sample.wi) && sample.wi.z < 0.0f) {
        sample.is_reflection = false;
        return sample;
    }
    sample.wi = h * (2.0f * wo.dot(h)) - wo;
    // What would go on into the surface is reflected by its mean plane instead: nothing is lost.
    if (sample.wi.z <= 0.0f) sample.wi.z = std::max(-sample.wi.z, 1e-4f);
    sample.wi.normalize();
    return sample;
}

float inner_transmission(const V3f& wo, const V3f& wi, float alpha, float eta) {
    V3f h;
    if (is_index_matched(eta) || !refraction_normal(wo, wi, eta, h)) return 0.0f;
    return (1.0f - fresnel_dielectric(wo.dot(h), eta)) * ggx_normal_pdf(wo, h, alpha) *
           normals_per_direction(wo, wi, h, eta);
}

}  // namespace frazil
