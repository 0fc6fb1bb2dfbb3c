// Random materials, seeded: energy, reciprocity and sampling hold for all parameters, not only for those that a test picks.
#include <doctest/doctest.h>

#include <cmath>

#include "chi_square.h"
#include "frazil/material/microfacet.h"
#include "frazil/material/standard.h"
#include "frazil/material/transmission.h"
#include "scenes.h"

using namespace frazil;
using namespace frazil::test;

namespace {

// Numbers of one random case.
class Draw {
  public:
    explicit Draw(std::uint32_t number) : sampler_(2024, number, 0) {}
    float in(float low, float high) { return low + (high - low) * sampler_.next_1d(); }
    float log_in(float low, float high) { return low * std::pow(high / low, sampler_.next_1d()); }
    bool flip(float chance = 0.5f) { return sampler_.next_1d() < chance; }
    Rgb color() { return {in(0.0f, 1.0f), in(0.0f, 1.0f), in(0.0f, 1.0f)}; }
    // Above the surface, not quite along it.
    V3f direction() {
        const float z = in(0.08f, 1.0f), phi = in(0.0f, 2.0f * kPi), r = std::sqrt(1.0f - z * z);
        return {r * std::cos(phi), r * std::sin(phi), z};
    }

  private:
    Sampler sampler_;
};

StandardMaterial random_standard(Draw& draw) {
    StandardMaterial material;
    material.diffuse_color.value = draw.color();
    material.use_specular_workflow = draw.flip(0.3f);
    material.specular_color.value = draw.color();
    material.metallic.value = draw.flip() ? 0.0f : draw.in(0.0f, 1.0f);
    material.roughness.value = draw.in(0.05f, 1.0f);
    material.clearcoat.value = draw.flip() ? 0.0f : draw.in(0.0f, 1.0f);
    material.clearcoat_roughness.value = draw.in(0.05f, 1.0f);
    material.ior = draw.in(1.0f, 2.5f);
    return material;
}

// ∫ f cos dwi over the hemisphere, by the material's own samples and by the cosine's, balanced.
double reflected(const StandardBsdf& bsdf, const V3f& wo) {
    constexpr std::uint32_t kCount = 1 << 13;
    double sum = 0.0;
    for (std::uint32_t i = 0; i < kCount; ++i) {
        Sampler sampler(12, 0, i);
        const BsdfSample own = bsdf.sample(wo, sampler.next_1d(), sampler.next_2d());
        const V2f v = sampler.next_2d();
        const float r = std::sqrt(v.x), phi = 2.0f * kPi * v.y;
        for (const V3f& wi : {own.pdf > 0.0f ? own.wi : V3f(0, 0, -1),
                              V3f(r * std::cos(phi), r * std::sin(phi), std::sqrt(1.0f - v.x))}) {
            if (wi.z <= 0.0f) continue;
            const BsdfValue value = bsdf.eval(wo, wi);
            sum += double(value.diffuse.x + value.specular.x) / double(bsdf.pdf(wo, wi) + wi.z * kInvPi);
        }
    }
    return sum / kCount;
}

}  // namespace

TEST_CASE("random standard materials reflect no more than they receive, as much as albedo() says, and as much back") {
    for (std::uint32_t number = 0; number < 30; ++number) {
        CAPTURE(number);
        Draw draw(number);
        const StandardBsdf bsdf(random_standard(draw), V2f(0.0f));
        const V3f a = draw.direction(), b = draw.direction();
        const double share = reflected(bsdf, a);
        CHECK(share < 1.01);
        const BsdfValue albedo = bsdf.albedo(a);
        CHECK(double(albedo.diffuse.x + albedo.specular.x) == doctest::Approx(share).epsilon(0.05));
        const BsdfValue there = bsdf.eval(a, b), back = bsdf.eval(b, a);
        for (int c = 0; c < 3; ++c) {
            CHECK(there.diffuse[c] / b.z == doctest::Approx(double(back.diffuse[c] / a.z)).epsilon(1e-3));
            CHECK(there.specular[c] / b.z == doctest::Approx(double(back.specular[c] / a.z)).epsilon(1e-3));
        }
    }
}

TEST_CASE("random standard materials are sampled by their density") {
    for (std::uint32_t number = 100; number < 108; ++number) {
        CAPTURE(number);
        Draw draw(number);
        StandardMaterial material = random_standard(draw);
        // Cells of the sphere must not be coarser than the lobes.
        material.roughness.value = draw.in(0.4f, 1.0f);
        material.clearcoat_roughness.value = draw.in(0.4f, 1.0f);
        const StandardBsdf bsdf(material, V2f(0.0f));
        const V3f wo = draw.direction();
        std::uint32_t index = 0;
        const ChiSquare result = chi_square(
            [&](const V2f& u, V3f& wi) {
                Sampler lobe(78, index++, 0);
                const BsdfSample sample = bsdf.sample(wo, lobe.next_1d(), u);
                wi = sample.wi;
                return sample.pdf > 0.0f;
            },
            [&](const V3f& wi) { return double(bsdf.pdf(wo, wi)); }, V3f(0, 0, 1), 1.0);
        CHECK(result.p_value > 1e-4);
        CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.01));
    }
}

TEST_CASE("random rough boundaries: refraction is reciprocal, its samples follow its density, entering loses nothing") {
    for (std::uint32_t number = 200; number < 230; ++number) {
        CAPTURE(number);
        Draw draw(number);
        const float eta = draw.in(1.05f, 2.0f), alpha = alpha_from_roughness(draw.in(0.3f, 1.0f));
        const V3f wo = draw.direction();
        CAPTURE(eta);
        CAPTURE(alpha);
        for (std::uint32_t i = 0; i < 16; ++i) {
            V3f wi;
            if (!refract(wo, ggx_sample_normal(wo, alpha, Sampler(5, i, number).next_2d()), eta, wi)) continue;
            if (wi.z > -0.05f) continue;
            const float there = transmission_eval(wo, wi, alpha, eta) / -wi.z;
            const float back = transmission_eval(-wi, -wo, alpha, 1.0f / eta) / wo.z;
            CHECK(there / (eta * eta) == doctest::Approx(back).epsilon(5e-3));
        }
        const TransmissionAlbedo single(eta);
        double sum = 0.0;
        constexpr int kCount = 4096;
        for (int i = 0; i < kCount; ++i) {
            Sampler sampler(3, number, std::uint32_t(i));
            sum += double(sample_entering(wo, alpha, eta, single, sampler.next_2d()).weight);
        }
        CHECK(sum / kCount == doctest::Approx(1.0).epsilon(0.01));
        if (number % 5 != 0) continue;
        const float ratio = draw.flip() ? eta : 1.0f / eta;
        V3f axis;
        if (!refract(wo, V3f(0, 0, 1), ratio, axis)) axis = V3f(0, 0, -1);
        const ChiSquare result =
            chi_square([&](const V2f& u,
                           V3f& wi) { return refract(wo, ggx_sample_normal(wo, alpha, u), ratio, wi) && wi.z < 0.0f; },
                       [&](const V3f& wi) { return double(transmission_pdf(wo, wi, alpha, ratio)); }, axis, 1.0);
        CHECK(result.p_value > 1e-4);
        CHECK(result.mass == doctest::Approx(result.hit_rate).epsilon(0.02));
    }
}

TEST_CASE("white furnace of random ice: never more than what comes in, and all of it where nothing takes any") {
    for (std::uint32_t number = 300; number < 330; ++number) {
        CAPTURE(number);
        Draw draw(number);
        const float sigma_s = draw.log_in(0.01f, 60.0f), eta = draw.in(1.0f, 1.45f);
        const bool is_whole = number % 2 == 0;
        Scene scene = scene_of(sphere(1.0f, 4), ice(Rgb(1e-7f), eta, draw.in(0.0f, 1.0f), CompensationMode::conserve));
        IceMaterial& model = std::get<IceMaterial>(scene.materials[0].model);
        model.medium.sigma_s_prime = Rgb(sigma_s);
        model.spacing.value = 0.06f;
        // A body that light crosses with hardly a collision needs gains beyond the usual limit.
        model.compensation.limit = 1e4f;
        model.volume = draw.flip() ? 1.0f : draw.in(0.0f, 1.0f);
        model.anisotropy = draw.in(-0.8f, 0.8f);
        if (draw.flip()) model.refraction_roughness = draw.in(0.0f, 1.0f);
        // What is not seen through has to be scattered by something.
        model.refraction = sigma_s > 5.0f ? draw.in(0.0f, 1.0f) : 1.0f;
        if (!is_whole) {
            model.translucency = draw.in(0.0f, 1.0f);
            model.specular = draw.flip() ? 1.0f : draw.in(0.0f, 1.0f);
            model.refraction_tint = Rgb(draw.in(0.5f, 1.0f));
            model.age = draw.in(0.0f, 1.0f);
            const int overlays = int(draw.in(0.0f, 3.0f));
            for (int i = 0; i < overlays; ++i) {
                Overlay overlay;
                overlay.pattern.kind = PatternKind(int(draw.in(0.0f, 6.99f)));
                overlay.pattern.size = draw.log_in(0.05f, 1.0f);
                overlay.pattern.amount = draw.in(0.0f, 1.0f);
                overlay.color = draw.flip() ? Rgb(1.0f) : draw.color();
                overlay.opacity = draw.in(0.0f, 1.0f);
                overlay.scattering = draw.in(0.0f, 1.0f);
                overlay.roughness = draw.in(0.0f, 1.0f);
                overlay.age_end = draw.in(0.0f, 1.0f);
                model.overlays.push_back(overlay);
            }
        }
        CAPTURE(sigma_s);
        CAPTURE(eta);
        CAPTURE(model.roughness.value);
        CAPTURE(model.refraction);
        CAPTURE(model.volume);
        scene.lights = {dome(Rgb(1.0f))};
        RenderOptions options = small();
        options.width = options.height = 16;
        options.samples = 64;
        const Film film = render(scene, options).film;
        for (const int channel : {0, 1, 2}) {
            const double mean = mean_inside(film, "beauty", channel);
            CHECK(mean < 1.02);
            if (is_whole) CHECK(mean > 0.98);
        }
    }
}
