// Overlays: cracks, frost, snow and dirt on the surface of ice, and what all of them together do to it.
// Model: each covers the surface by its opacity times its mask. What is covered hides what would be seen through it and
//   reflects the part `scattering` of the light diffusely; only the rest enters the body. Light that leaves the body
//   takes the overlay's colour on its way. Overlays lie over one another in their order [Xie2014].
// Units: metres.
// Valid: fractions in 0..1; energy: scattered + entering = 1.
// Not: thickness; bump is a slope, not a displacement.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "frazil/material/pattern.h"
#include "frazil/material/texture.h"

namespace frazil {

struct Overlay {
    std::string name;                    // of its layers in a picture; empty = its number in the material, from 1
    Rgb color = Rgb(0.9f, 0.95f, 1.0f);  // of what is scattered, 0..1
    float opacity = 1.0f;                // where the mask is 1
    float roughness = 0.5f;              // of the surface there
    float scattering = 0.7f;             // part of the light that does not enter
    float bump = 0.0f;                   // height where the mask is 1, metres
    float internal = 0.0f;               // opacity of fracture planes inside the body, as seen through refraction
    // Opacity grows from nothing at age_begin to all of it at age_end.
    float age_begin = 0.0f, age_end = 1.0f;
    Pattern pattern;
    MaterialInput<float> mask{1.0f, {}};  // multiplies the pattern
};

// Refuse what is out of range: ValueError beginning with `path`.
void check_overlay(const Overlay& overlay, const std::string& path);

// How much of an overlay's opacity there is at an age, 0..1.
float age_weight(const Overlay& overlay, float age);

// What the overlays make of a place on the surface.
struct Covering {
    float covered = 0.0f;                           // of what would be seen through the surface
    float scattered = 0.0f;                         // of the light that would enter
    Rgb reflectance = Rgb(0.0f);                    // diffuse, scattered times colour
    Rgb tint = Rgb(1.0f);                           // of what leaves the body
    float roughness = 0.0f, bare_roughness = 0.0f;  // with the overlays, and without
    V3f slope = V3f(0.0f);                          // gradient of height in rest space
};

// `roughness` is the bare surface's. The slope is left 0 unless `with_slope`. `opacities`, unless null, becomes each overlay's
// here.
Covering eval_overlays(std::span<const Overlay> overlays, float age, float roughness, const PatternPoint& point,
                       const TexturePoint& at, bool with_slope, std::vector<float>* opacities = nullptr);

// How a covering changes with one overlay's opacity: derivatives by its logarithm.
struct CoveringSlope {
    float covered = 0.0f, scattered = 0.0f;
    Rgb reflectance = Rgb(0.0f), tint = Rgb(0.0f);
    bool operator==(const CoveringSlope&) const = default;
};

// One for each overlay, of the opacities that eval_overlays tells.
std::vector<CoveringSlope> covering_slopes(std::span<const Overlay> overlays, std::span<const float> opacities);

}  // namespace frazil
