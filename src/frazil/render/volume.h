// Light that ice scatters once on the way of a refracted ray.
// Model: L = ∫ sigma_s' e^{-sigma_t' s} p(w, wo) L_i(s, w) e^{-sigma_t' s'} T(w) ds dw. The place on the ray is drawn by
//   free path and, for lights of finite size, in equal angles about the light [KullaFajardo2012], combined by the
//   balance heuristic; light comes straight through the boundary, unbent, dimmed by Fresnel's transmittance T.
// Units: radiance over squared index, as along the refracted ray.
// Valid: sigma_s' and sigma_t' = sigma_s' + sigma_a stand for sigma_s and sigma_t (similarity: what is scattered forward
//   counts as not scattered); `anisotropy` g shapes what is left. Unbiased; thread-safe.
// Not: light that is scattered again (the point tree's), light bent by the boundary, light that other surfaces reflect.
#pragma once

#include "frazil/base/sampler.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/render/interior.h"

namespace frazil {

// Henyey-Greenstein's phase function, per steradian; `cosine` between the directions of travel before and after.
float henyey_greenstein(float cosine, float g);
// A direction of travel after scattering of light that travelled along `direction`; its density is the phase function.
V3f sample_henyey_greenstein(const V3f& direction, float g, const V2f& u);

// A piece of a ray inside ice.
struct Segment {
    V3f origin = V3f(0.0f);
    V3f direction = V3f(0.0f);  // unit length, away from the viewer
    float length = 0.0f;        // metres; may be infinite
    InsideOf inside;            // of which the origin is; not empty
    float footprint = 0.0f;     // over which overlays on the way of light are averaged, metres
};

// One random sample of what is scattered once on a segment.
struct OnceScattered {
    Rgb radiance =
        Rgb(0.0f);   // towards -direction at the origin, from the light below; its `volume` multiplier applied
    int light = -1;  // -1 = no light
    // What the radiance would be under a uniform sky of radiance 1 if nothing absorbed: the share of the segment's light
    // that is scattered once, which the core has to leave to it.
    Rgb share = Rgb(0.0f);
};

class SingleScattering {
  public:
    SingleScattering(const LightSampler& lights, const Interiors& interiors,
                     const std::vector<std::unique_ptr<Body>>& bodies)
        : lights_(lights), interiors_(interiors), bodies_(bodies) {}

    // Draws five dimensions from the sampler; `rays` counts what is traced.
    OnceScattered sample(const Segment& segment, Sampler& sampler, std::uint64_t& rays) const;

  private:
    const LightSampler& lights_;
    const Interiors& interiors_;
    const std::vector<std::unique_ptr<Body>>& bodies_;
};

}  // namespace frazil
