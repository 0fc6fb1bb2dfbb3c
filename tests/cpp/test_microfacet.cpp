// GGX: sampling, energy, reciprocity; the dielectric's albedo and furnace; the standard BSDF.
#include <doctest/doctest.h>

#include <cmath>

#include "chi_square.h"
#include "frazil/base/error.h"
#include "frazil/material/microfacet.h"
#include "frazil/material/standard.h"

using namespace frazil;

namespace {

constexpr double kPiD = 3.14159265358979323846;

V3f at_angle(float theta, float phi = 0.4f) {
    return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

// ∫ f dwi over the hemisphere: half the samples by visible normals, half by cosine, balanced.
template <class Lobe>
double hemisphere_integral(const V3f& wo, float alpha, const Lobe& lobe, std::uint32_t count = 1 << 14) {
    double sum = 0.0;
    for (std::uint32_t i = 0; i < count; ++i) {
        Sampler sampler(11, 0, i);
        const V2f u = sampler.next_2d(), v = sampler.next_2d();
        const float r = std::sqrt(v.x), phi = 2.0f * kPi * v.y;
        for (const V3f& wi :
             {ggx_sample(wo, alpha, u), V3f(r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - v.x))}) {
            if (wi.z <= 0.0f) continue;
            sum += double(lobe(wi)) / double(ggx_pdf(wo, wi, alpha) + wi.z * kInvPi);
        }
    }
    return sum / count;
}

StandardMaterial white_plastic(float roughness) {
    StandardMaterial material;
    material.diffuse_color.value = Rgb(1.0f);
    material.roughness.value = roughness;
    return material;
}

}  // namespace

TEST_CASE("microfacet: ggx_pdf is the density of ggx_sample") {
    for (const float alpha : {0.05f, 0.3f, 1.0f}) {
        for (const float theta : {0.0f, 0.8f, 1.45f}) {
            const V3f wo = at_angle(theta);
            const auto sample = [&](const V2f& u, V3f& wi) {
                wi = ggx_sample(wo, alpha, u);
                return wi.z > 0.0f;
            };
            const V3f mirror(-wo.x, -wo.y, wo.z);
            // The narrow lobe in cells about the mirror direction, the wide ones over the sphere.
            const bool is_narrow = alpha < 0.1f;
            const V3f pole = is_narrow ? mirror : V3f(0, 0, 1);
            const auto result = test::chi_square(
                sample, [&](const V3f& wi) { return double(ggx_pdf(wo, wi, alpha)); }, pole, is_narrow ? 0.03 : 1.0);
            CAPTURE(alpha);
            CAPTURE(theta);
            CHECK(result.p_value > 1e-4);
            CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.01));
        }
    }
}

TEST_CASE("microfacet: single scattering is reciprocal and never makes energy; smooth loses none") {
    const V3f a = at_angle(0.3f, 0.1f), b = at_angle(1.2f, 2.5f);
    for (const float alpha : {1e-4f, 0.02f, 0.2f, 1.0f}) {
        CHECK(ggx_eval(a, b, alpha) / b.z == doctest::Approx(double(ggx_eval(b, a, alpha) / a.z)).epsilon(1e-4));
        for (const float theta : {0.0f, 0.5f, 1.0f, 1.4f, 1.55f}) {
            const V3f wo = at_angle(theta);
            const double albedo =
                hemisphere_integral(wo, alpha, [&](const V3f& wi) { return ggx_eval(wo, wi, alpha); });
            CHECK(albedo <= 1.001);
            if (alpha < 0.01f && theta < 1.5f) CHECK(albedo == doctest::Approx(1.0).epsilon(2e-3));
            CHECK(albedo == doctest::Approx(double(ggx_albedo().white.eval(wo.z, alpha))).epsilon(5e-3));
        }
    }
    CHECK(ggx_eval(a, -b, 0.5f) == 0.0f);
    CHECK(ggx_pdf(-a, b, 0.5f) == 0.0f);
}

TEST_CASE("microfacet: a white microsurface with multiple scattering reflects all: furnace") {
    for (const float alpha : {0.03f, 0.25f, 0.6f, 1.0f}) {
        for (const float theta : {0.0f, 0.7f, 1.3f, 1.5f}) {
            const V3f wo = at_angle(theta);
            const float scale = multiple_scattering_scale(Rgb(1.0f), alpha).x;
            CHECK(scale == doctest::Approx(1.0));
            const double total = hemisphere_integral(wo, alpha, [&](const V3f& wi) {
                return ggx_eval(wo, wi, alpha) + scale * ggx_multiple_eval(wo, wi, alpha);
            });
            CAPTURE(alpha);
            CAPTURE(theta);
            CHECK(total == doctest::Approx(1.0).epsilon(4e-3));
        }
    }
}

TEST_CASE("microfacet albedo: the dielectric lobe integrates to the table, for any angle, roughness and eta") {
    for (const float eta : {1.05f, 1.31f, 1.5f, 2.4f}) {
        const DielectricAlbedo table(eta);
        double worst = 0.0;
        for (const float roughness : {0.03f, 0.1f, 0.17f, 0.33f, 0.52f, 0.77f, 1.0f}) {
            const float alpha = alpha_from_roughness(roughness);
            for (const float cosine : {0.013f, 0.05f, 0.11f, 0.31f, 0.52f, 0.83f, 1.0f}) {
                const V3f wo(std::sqrt(1.0f - cosine * cosine), 0.0f, cosine);
                const double integral = hemisphere_integral(
                    wo, alpha, [&](const V3f& wi) { return dielectric_reflection(wo, wi, alpha, table); });
                const double error = std::abs(integral - double(table.eval(cosine, alpha)));
                worst = std::max(worst, error);
                CHECK(table.eval(cosine, alpha) <= 1.0f);
            }
        }
        CAPTURE(eta);
        CAPTURE(worst);
        CHECK(worst < 3e-3);
    }
}

TEST_CASE("microfacet albedo: smooth limit is Fresnel; normal incidence is F0; the average is the mean") {
    const DielectricAlbedo table(1.31f);
    CHECK(table.eval(1.0f, 1e-4f) == doctest::Approx(double(fresnel_f0(1.31f))).epsilon(1e-3));
    CHECK(table.average(1e-4f) == doctest::Approx(double(table.fresnel_mean())).epsilon(5e-3));
    for (const float alpha : {0.01f, 0.4f, 1.0f}) {
        double mean = 0.0;
        constexpr int kSteps = 2000;
        for (int i = 0; i < kSteps; ++i) {
            const double c = (i + 0.5) / kSteps;
            mean += 2.0 * c * double(table.eval(float(c), alpha)) / kSteps;
        }
        CHECK(double(table.average(alpha)) == doctest::Approx(mean).epsilon(1e-3));
    }
    const DielectricAlbedo nothing(1.0f);
    CHECK(nothing.eval(0.5f, 0.3f) == doctest::Approx(0.0));
    CHECK_THROWS_WITH_AS(DielectricAlbedo(0.5f), doctest::Contains("eta must be in [1, 4], got 0.5"), ValueError);
    CHECK_THROWS_AS(DielectricAlbedo(NAN), ValueError);
}

TEST_CASE("microfacet: the dielectric lobe is reciprocal") {
    const DielectricAlbedo table(1.31f);
    const V3f a = at_angle(0.3f, 0.1f), b = at_angle(1.3f, 2.0f);
    for (const float alpha : {0.05f, 0.5f, 1.0f}) {
        const double forward = dielectric_reflection(a, b, alpha, table) / b.z;
        CHECK(forward == doctest::Approx(double(dielectric_reflection(b, a, alpha, table) / a.z)).epsilon(1e-4));
    }
}

TEST_CASE("standard: a white surface reflects all it receives, a dark or coated one less: furnace") {
    for (const float roughness : {0.05f, 0.3f, 0.7f, 1.0f}) {
        StandardMaterial metal = white_plastic(roughness), coated = white_plastic(roughness);
        metal.metallic.value = 1.0f;
        coated.clearcoat.value = 1.0f;
        coated.clearcoat_roughness.value = 0.1f;
        for (const float theta : {0.0f, 0.6f, 1.2f, 1.45f}) {
            const V3f wo = at_angle(theta);
            const auto total = [&](const StandardMaterial& material) {
                const StandardBsdf bsdf(material, V2f(0.0f));
                return hemisphere_integral(wo, alpha_from_roughness(material.roughness.value), [&](const V3f& wi) {
                    const BsdfValue value = bsdf.eval(wo, wi);
                    return value.diffuse.x + value.specular.x;
                });
            };
            CAPTURE(roughness);
            CAPTURE(theta);
            CHECK(total(white_plastic(roughness)) == doctest::Approx(1.0).epsilon(6e-3));
            CHECK(total(metal) == doctest::Approx(1.0).epsilon(6e-3));
            if (theta < 1.3f) {
                CHECK(total(coated) < 1.01);
                CHECK(total(coated) > 0.8);
            }
            const StandardBsdf bsdf(metal, V2f(0.0f));
            CHECK(bsdf.albedo(wo).diffuse.x + bsdf.albedo(wo).specular.x == doctest::Approx(1.0).epsilon(1e-3));
        }
    }
}

TEST_CASE("standard: eval is reciprocal, in every part") {
    StandardMaterial material = white_plastic(0.4f);
    material.diffuse_color.value = Rgb(0.7f, 0.4f, 0.1f);
    material.metallic.value = 0.3f;
    material.clearcoat.value = 0.6f;
    material.clearcoat_roughness.value = 0.2f;
    const StandardBsdf bsdf(material, V2f(0.0f));
    const V3f a = at_angle(0.4f, 0.0f), b = at_angle(1.2f, 2.7f);
    const BsdfValue forward = bsdf.eval(a, b), backward = bsdf.eval(b, a);
    for (int c = 0; c < 3; ++c) {
        CHECK(forward.diffuse[c] / b.z == doctest::Approx(double(backward.diffuse[c] / a.z)).epsilon(1e-4));
        CHECK(forward.specular[c] / b.z == doctest::Approx(double(backward.specular[c] / a.z)).epsilon(1e-4));
    }
    CHECK(bsdf.eval(a, -b).diffuse == Rgb(0.0f));
    CHECK(bsdf.eval(-a, b).specular == Rgb(0.0f));
}

TEST_CASE("standard: pdf is the density of sample(), whose value is eval()") {
    StandardMaterial material = white_plastic(0.5f);
    material.diffuse_color.value = Rgb(0.6f, 0.5f, 0.4f);
    material.clearcoat.value = 0.8f;
    material.clearcoat_roughness.value = 0.35f;
    const StandardBsdf bsdf(material, V2f(0.0f));
    for (const float theta : {0.2f, 1.2f}) {
        const V3f wo = at_angle(theta);
        std::uint32_t index = 0;
        const auto sample = [&](const V2f& u, V3f& wi) {
            Sampler lobe(77, index++, 0);
            const BsdfSample s = bsdf.sample(wo, lobe.next_1d(), u);
            if (s.pdf == 0.0f) return false;
            wi = s.wi;
            if (index % 1024 == 0) {
                CHECK(s.pdf == bsdf.pdf(wo, wi));
                CHECK(s.value.specular == bsdf.eval(wo, wi).specular);
            }
            return true;
        };
        const auto result = test::chi_square(
            sample, [&](const V3f& wi) { return double(bsdf.pdf(wo, wi)); }, V3f(0, 0, 1), 1.0);
        CHECK(result.p_value > 1e-4);
        CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.01));
    }
}

TEST_CASE("standard: workflows, display colour, threshold, emission and values out of range") {
    StandardMaterial material;
    material.diffuse_color.value = Rgb(0.5f);
    material.emissive_color.value = Rgb(2.0f);
    material.opacity.value = 0.4f;
    CHECK(StandardBsdf(material, V2f(0.0f)).opacity() == doctest::Approx(0.4));
    material.opacity_threshold = 0.5f;
    CHECK(StandardBsdf(material, V2f(0.0f)).opacity() == 0.0f);
    material.opacity_threshold = 0.3f;
    CHECK(StandardBsdf(material, V2f(0.0f)).opacity() == 1.0f);
    CHECK(StandardBsdf(material, V2f(0.0f)).emission() == Rgb(2.0f));
    const V3f wo(0, 0, 1);
    // Metallic workflow with ior 1.5: F0 0.04 at normal incidence for a smooth surface.
    material.roughness.value = 0.05f;
    CHECK(StandardBsdf(material, V2f(0.0f)).albedo(wo).specular.x == doctest::Approx(0.04).epsilon(0.02));
    material.use_specular_workflow = true;
    material.specular_color.value = Rgb(0.3f, 0.2f, 0.1f);
    CHECK(StandardBsdf(material, V2f(0.0f)).albedo(wo).specular.x == doctest::Approx(0.3).epsilon(0.02));
    material.uses_display_color = true;
    CHECK(StandardBsdf(material, V2f(0.0f), Rgb(0.0f)).albedo(wo).diffuse == Rgb(0.0f));
    material.diffuse_color.value = Rgb(7.0f);
    material.uses_display_color = false;
    material.roughness.value = -3.0f;
    const Rgb albedo = StandardBsdf(material, V2f(0.0f)).albedo(wo).diffuse;
    CHECK(albedo.x <= 1.0f);
}
