// The picture: one float array per AOV of the table, and what is needed to change it later.
// Model: additive layers are accumulated apart; the beauty is their sum, made when the film is finished.
// Units: by AOV.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/render/aov.h"
#include "frazil/translucency/compensation.h"

namespace frazil {

struct Layer {
    int channels = 0;
    std::vector<float> pixels;  // (height, width, channels), row 0 on top
};

// What one layer `translucency_ramp<K>` holds: the light that came from about this far, as if the knot were white.
// translucency = Σ color * scale * layer, with scale = 1 / Σ_k of the material color_k * share_k where energy is
// preserved, else 1.
struct RampKnot {
    std::string material;   // its path
    float distance = 0.0f;  // metres
    Rgb color = Rgb(1.0f);  // as rendered
    Rgb share = Rgb(1.0f);  // of the profile's energy under this knot's hat function
    bool preserves_energy = false;
    bool is_fixed = false;  // not a knot: a material without a ramp, or what the compensation `fill` adds
};

// The area compensation that a material of ice was rendered with.
struct RenderedCompensation {
    std::string material;  // its path
    Compensation compensation;
};

// An overlay that the picture has layers of.
struct RenderedOverlay {
    std::string name, material;  // of the layers; the material's path
    float opacity = 1.0f, age = 0.5f, age_begin = 0.0f, age_end = 1.0f;
};

struct Film {
    int width = 0, height = 0;
    std::map<std::string, Layer> layers;  // by AOV name
    std::vector<std::string> groups;      // of lights, in the order of the layers; "" for lights without one
    std::vector<RampKnot> knots;          // by number of the layer; empty where the layers were not asked for
    std::vector<RenderedCompensation> compensations;
    std::vector<RenderedOverlay> overlays;  // empty where the layers were not asked for
};

}  // namespace frazil
