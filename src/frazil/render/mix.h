// Weighted sums of a film's layers: what a change of lights, components or ramp colours after the render comes to.
// Model: out = Σ weight_l * layer_l per channel; layers may be half or float, sums are float.
// Valid: sums run over the layers in order: the same bits for any number of threads and any processor with half floats.
// Not: colour corrections, which are not linear.
#pragma once

#include <cstddef>
#include <span>

#include "frazil/base/vec.h"

namespace frazil {

// One layer of three channels, pixel after pixel; one of the two pointers.
struct MixLayer {
    const float* floats = nullptr;
    const std::uint16_t* halves = nullptr;
    Rgb weight = Rgb(1.0f);
};

// Write the sum to `out`, 3 floats a pixel; zeros where there are no layers.
void mix(std::span<const MixLayer> layers, std::size_t pixels, float* out);

}  // namespace frazil
