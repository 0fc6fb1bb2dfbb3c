#include "frazil/material/microfacet.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/translucency/fresnel.h"

namespace frazil {
namespace {

constexpr float kMinAlpha = 1e-4f;
// Below this cosine a direction counts as grazing: the table and the formulas stop there.
constexpr float kMinCosine = 1e-4f;

// Integrate fresnel(cos(wo, h)) * GGX over wi by stratified visible normals: the mean of F G2/G1.
template <class Fresnel>
float single_scattering_albedo(float cos_theta, float alpha, const Fresnel& fresnel) {
    constexpr int kAzimuths = 24, kPolar = 48;
    const V3f wo(std::sqrt(std::max(0.0f, 1.0f - cos_theta * cos_theta)), 0.0f, cos_theta);
    const float lambda_o = smith_lambda(wo, alpha);
    double sum = 0.0;
    for (int i = 0; i < kAzimuths; ++i) {
        for (int j = 0; j < kPolar; ++j) {
            // The plane of incidence mirrors the lobe: half the azimuths do.
            const V2f u(0.5f * (float(i) + 0.5f) / kAzimuths, (float(j) + 0.5f) / kPolar);
            const V3f wi = ggx_sample(wo, alpha, u);
            if (wi.z <= 0.0f) continue;
            const float cos_half = wo.dot((wo + wi).normalized());
            sum += fresnel(cos_half) * (1.0f + lambda_o) / (1.0f + lambda_o + smith_lambda(wi, alpha));
        }
    }
    return static_cast<float>(sum / (kAzimuths * kPolar));
}

}  // namespace

float alpha_from_roughness(float roughness) {
    const float r = std::clamp(roughness, 0.0f, 1.0f);
    return std::max(r * r, kMinAlpha);
}

float blurred_roughness(float roughness, float blur) {
    if (blur == 0.0f) return roughness;
    const float alpha = alpha_from_roughness(roughness);
    return std::sqrt(std::min(1.0f, std::sqrt(alpha * alpha + blur * blur)));
}

float fresnel_f0(float eta) {
    const float r = (eta - 1.0f) / (eta + 1.0f);
    return r * r;
}

float schlick_weight(float cos_theta) {
    const float m = std::clamp(1.0f - cos_theta, 0.0f, 1.0f), m2 = m * m;
    return m2 * m2 * m;
}

float ggx_distribution(const V3f& h, float alpha) {
    const float a2 = alpha * alpha;
    const float s = (h.x * h.x + h.y * h.y) / a2 + h.z * h.z;
    return 1.0f / (kPi * a2 * s * s);
}

float smith_lambda(const V3f& w, float alpha) {
    const float tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
    // sqrt(1 + x) - 1 without the cancellation for small x.
    const float x = alpha * alpha * tan2;
    return 0.5f * x / (std::sqrt(1.0f + x) + 1.0f);
}

float ggx_eval(const V3f& wo, const V3f& wi, float alpha) {
    if (wo.z <= 0.0f || wi.z <= 0.0f) return 0.0f;
    const V3f h = (wo + wi).normalized();
    return ggx_distribution(h, alpha) / (4.0f * wo.z * (1.0f + smith_lambda(wo, alpha) + smith_lambda(wi, alpha)));
}

V3f ggx_sample_normal(const V3f& wo, float alpha, const V2f& u) {
    // Stretch to the hemisphere configuration, where visible normals are those of a spherical cap [Dupuy2023].
    const V3f stretched = V3f(alpha * wo.x, alpha * wo.y, wo.z).normalized();
    const float phi = 2.0f * kPi * u.x;
    const float z = (1.0f - u.y) * (1.0f + stretched.z) - stretched.z;
    const float sine = std::sqrt(std::clamp(1.0f - z * z, 0.0f, 1.0f));
    const V3f cap(sine * std::cos(phi), sine * std::sin(phi), z);
    const V3f unscaled = cap + stretched;
    return V3f(alpha * unscaled.x, alpha * unscaled.y, unscaled.z).normalized();
}

float ggx_normal_pdf(const V3f& wo, const V3f& h, float alpha) {
    const float cosine = wo.dot(h);
    if (wo.z <= 0.0f || h.z <= 0.0f || cosine <= 0.0f) return 0.0f;
    return ggx_distribution(h, alpha) * cosine / (wo.z * (1.0f + smith_lambda(wo, alpha)));
}

V3f ggx_sample(const V3f& wo, float alpha, const V2f& u) {
    const V3f h = ggx_sample_normal(wo, alpha, u);
    return h * (2.0f * wo.dot(h)) - wo;
}

float ggx_pdf(const V3f& wo, const V3f& wi, float alpha) {
    if (wo.z <= 0.0f || wi.z <= 0.0f) return 0.0f;
    const V3f h = (wo + wi).normalized();
    return ggx_distribution(h, alpha) / (4.0f * wo.z * (1.0f + smith_lambda(wo, alpha)));
}

float AlbedoTable::cosine_at(int i) {
    const float t = float(i) / float(kCosines - 1);
    return std::max(t * t, kMinCosine);
}

float AlbedoTable::alpha_at(int j) {
    return alpha_from_roughness(float(j) / float(kAlphas - 1));
}

AlbedoTable::AlbedoTable(const std::function<float(float, float)>& value)
    : directional_(kAlphas * kCosines), average_(kAlphas) {
    parallel_for(kAlphas, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t j = begin; j < end; ++j) {
            float* row = &directional_[j * kCosines];
            for (int i = 0; i < kCosines; ++i) row[i] = value(cosine_at(i), alpha_at(int(j)));
            // 2 ∫ E mu dmu with mu = t²: 4 ∫ E t³ dt, E linear in t between the nodes.
            double sum = 0.0;
            for (int i = 0; i + 1 < kCosines; ++i) {
                const double a = double(i) / (kCosines - 1), b = double(i + 1) / (kCosines - 1);
                const double slope = (double(row[i + 1]) - double(row[i])) / (b - a);
                const double offset = double(row[i]) - slope * a;
                const double a4 = a * a * a * a, b4 = b * b * b * b;
                sum += 4.0 * (offset * (b4 - a4) / 4.0 + slope * (b4 * b - a4 * a) / 5.0);
            }
            average_[j] = static_cast<float>(sum);
        }
    });
}

float AlbedoTable::eval(float cos_theta, float alpha) const {
    const float x = std::sqrt(std::clamp(cos_theta, 0.0f, 1.0f)) * float(kCosines - 1);
    const float y = std::sqrt(std::clamp(alpha, 0.0f, 1.0f)) * float(kAlphas - 1);
    const int i = std::min(int(x), kCosines - 2), j = std::min(int(y), kAlphas - 2);
    const float fx = x - float(i), fy = y - float(j);
    const float* low = &directional_[std::size_t(j * kCosines + i)];
    const float* high = low + kCosines;
    return (low[0] * (1.0f - fx) + low[1] * fx) * (1.0f - fy) + (high[0] * (1.0f - fx) + high[1] * fx) * fy;
}

float AlbedoTable::average(float alpha) const {
    const float y = std::sqrt(std::clamp(alpha, 0.0f, 1.0f)) * float(kAlphas - 1);
    const int j = std::min(int(y), kAlphas - 2);
    const float fy = y - float(j);
    return average_[std::size_t(j)] * (1.0f - fy) + average_[std::size_t(j + 1)] * fy;
}

const GgxAlbedo& ggx_albedo() {
    static const GgxAlbedo tables{AlbedoTable([](float cos_theta, float alpha) {
                                      return single_scattering_albedo(cos_theta, alpha, [](float) { return 1.0f; });
                                  }),
                                  AlbedoTable([](float cos_theta, float alpha) {
                                      return single_scattering_albedo(cos_theta, alpha,
                                                                      [](float c) { return schlick_weight(c); });
                                  })};
    return tables;
}

float ggx_multiple_eval(const V3f& wo, const V3f& wi, float alpha) {
    if (wo.z <= 0.0f || wi.z <= 0.0f) return 0.0f;
    const AlbedoTable& white = ggx_albedo().white;
    const float lost = std::max(1.0f - white.average(alpha), 1e-6f);
    return (1.0f - white.eval(wo.z, alpha)) * (1.0f - white.eval(wi.z, alpha)) * wi.z * kInvPi / lost;
}

Rgb multiple_scattering_scale(const Rgb& fresnel_average, float alpha) {
    const float white = ggx_albedo().white.average(alpha);
    return fresnel_average * fresnel_average * white / (Rgb(1.0f) - fresnel_average * (1.0f - white));
}

DielectricAlbedo::DielectricAlbedo(float eta) : eta_(eta) {
    if (!(eta >= 1.0f && eta <= 4.0f)) throw ValueError(str("DielectricAlbedo: eta must be in [1, 4], got ", eta, "."));
    fresnel_mean_ = fresnel_average(eta);
    const AlbedoTable& white = ggx_albedo().white;
    total_ = std::make_shared<AlbedoTable>([&](float cos_theta, float alpha) {
        const float single =
            single_scattering_albedo(cos_theta, alpha, [&](float c) { return fresnel_dielectric(c, eta); });
        const float multiple =
            multiple_scattering_scale(Rgb(fresnel_mean_), alpha).x * (1.0f - white.eval(cos_theta, alpha));
        return std::clamp(single + multiple, 0.0f, 1.0f);
    });
}

float DielectricAlbedo::eval(float cos_theta, float alpha) const {
    return total_->eval(cos_theta, alpha);
}

float DielectricAlbedo::average(float alpha) const {
    return total_->average(alpha);
}

float dielectric_reflection(const V3f& wo, const V3f& wi, float alpha, const DielectricAlbedo& albedo) {
    if (wo.z <= 0.0f || wi.z <= 0.0f) return 0.0f;
    const float cos_half = wo.dot((wo + wi).normalized());
    return fresnel_dielectric(cos_half, albedo.eta()) * ggx_eval(wo, wi, alpha) +
           multiple_scattering_scale(Rgb(albedo.fresnel_mean()), alpha).x * ggx_multiple_eval(wo, wi, alpha);
}

}  // namespace frazil
