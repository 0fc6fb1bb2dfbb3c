// Images on surfaces: bilinear lookup over a mip chain. Files are read in Python; the core sees arrays.
// Model: uv (0,0) is the lower left corner, as in USD; row 0 of the data is the top of the image.
// Units: values after `scale` and `bias`, linear.
// Valid: 1 to 4 channels; any size.
// Not: UDIM, anisotropic filtering.
#pragma once

#include <memory>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

enum class Wrap { repeat, clamp, mirror, black };

struct Texture {
    int width = 0, height = 0, channels = 0;
    std::vector<float> texels;  // linear
    Wrap wrap_s = Wrap::repeat, wrap_t = Wrap::repeat;
};

// One input of a material: a constant, or a texture channel read at st transformed by UsdTransform2d.
// value = texel * scale + bias.
struct TextureLookup {
    std::shared_ptr<const Texture> texture;
    int first_channel = 0;  // 0..3; a scalar input reads this one, a colour reads three from it
    V3f scale = V3f(1.0f), bias = V3f(0.0f);
    // st' = rotate(st * st_scale, st_rotation degrees) + st_translation
    V2f st_scale = V2f(1.0f), st_translation = V2f(0.0f);
    float st_rotation = 0.0f;
};

template <class T>
struct MaterialInput {
    T value{};
    TextureLookup lookup;  // used where it has a texture
};

// texel * scale + bias at st. A single-channel texture gives grey.
Rgb eval_color(const MaterialInput<Rgb>& input, const V2f& st);
float eval_float(const MaterialInput<float>& input, const V2f& st);

}  // namespace frazil
