// How a surface scatters light: one face over the material models.
// Model: standard materials by StandardBsdf; ice by its boundary's glossy reflection over the diffuse one of its overlays (its
//   core answers by gather and by refracted rays: path.h).
//   Where a bump tilts the normal, light fades towards the smooth surface's horizon instead of being cut off [Chiang2019].
// Units: f * cos per steradian.
// Valid: reflection only: zero where a direction is below the surface's horizon (its normal without bump). The fade only
//   takes energy, and only where there is bump.
#pragma once

#include <optional>

#include "frazil/material/standard.h"
#include "frazil/render/bodies.h"
#include "frazil/render/surface.h"

namespace frazil {

// f * cos of the lobes of one pair of directions, and the density with which sample() would choose wi. Also what these are
// worth along a path, over that density.
struct Scattering {
    Rgb diffuse = Rgb(0.0f), specular = Rgb(0.0f), refraction = Rgb(0.0f);
    float pdf = 0.0f;

    Rgb sum() const { return diffuse + specular + refraction; }
    void scale(const Rgb& factor) { diffuse *= factor, specular *= factor, refraction *= factor; }
};

// The scattering of one surface, directions in world space.
class Shader {
  public:
    // `body` is the surface's translucent body, null for other materials; `blur` broadens their glossy lobes (that of ice
    // is the surface's covering's).
    Shader(const Surface& surface, const Body* body, float blur = 0.0f);

    // The fraction of light that the surface stops: 1 but for cut-out standard materials.
    float opacity() const { return standard_ ? standard_->opacity() : 1.0f; }
    // Whether what is seen in the reflection has edges, so that light through ice must be bent in it.
    bool is_glossy() const { return alpha() < kGlossyAlpha; }
    // Of the glossy lobe.
    float alpha() const { return standard_ ? standard_->alpha() : alpha_; }
    Rgb emission() const { return standard_ ? standard_->emission() : Rgb(0.0f); }

    // Whether it scatters any light: without overlays, a boundary that is index-matched or whose specular is 0 does not.
    bool scatters() const;
    // The share of light from all around that goes towards wo, all lobes together.
    Rgb albedo(const V3f& wo) const;

    Scattering eval(const V3f& wo, const V3f& wi) const;
    // False where the sample is lost.
    bool sample(const V3f& wo, float u_lobe, const V2f& u, V3f& wi) const;

  private:
    static constexpr float kGlossyAlpha = 0.1f;
    V3f to_local(const V3f& v) const { return {v.dot(tangent_), v.dot(bitangent_), v.dot(normal_)}; }
    V3f to_world(const V3f& v) const { return tangent_ * v.x + bitangent_ * v.y + normal_ * v.z; }

    // 1 without bump.
    float terminator(const V3f& wi) const;

    V3f horizon_, normal_, tangent_, bitangent_;
    std::optional<StandardBsdf> standard_;
    const Body* body_ = nullptr;
    // Of ice: its boundary, the core under it, and what its overlays scatter.
    float alpha_ = 0.0f, roughness_ = 0.0f, diffuse_chance_ = 0.0f;
    Rgb core_albedo_ = Rgb(0.0f), reflectance_ = Rgb(0.0f);
};

}  // namespace frazil
