// Images on surfaces: bilinear lookup. Files are read in Python; the core sees arrays.
// Model: uv (0,0) is the lower left corner, as in USD; row 0 of the data is the top of the image. A missing alpha is 1.
// Units: values after `scale` and `bias`, linear.
// Valid: 1 to 4 channels; any size; a non-finite st reads as (0,0).
// Not: UDIM, mip-maps, anisotropic filtering.
#pragma once

#include <memory>
#include <string>
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
    int first_channel = 0;                    // 0..3; a scalar input reads this one, a colour reads three from it
    V3f scale = V3f(1.0f), bias = V3f(0.0f);  // by channel; a scalar input takes those of its channel, alpha takes z
    // st' = rotate(st * st_scale, st_rotation degrees) + st_translation
    V2f st_scale = V2f(1.0f), st_translation = V2f(0.0f);
    float st_rotation = 0.0f;
};

template <class T>
struct MaterialInput {
    T value{};
    TextureLookup lookup;  // used where it has a texture
};

// Refuse a texture whose size, channels and texel count do not agree, or with a texel that is not finite: ValueError
// beginning with `path`.
void check_texture(const Texture& texture, const std::string& path);

// texel * scale + bias at st. A single-channel texture gives grey.
Rgb eval_color(const MaterialInput<Rgb>& input, const V2f& st);
float eval_float(const MaterialInput<float>& input, const V2f& st);
// The tangent-space normal of a normal map, unit length; (0,0,1) without a texture.
V3f eval_normal(const TextureLookup& lookup, const V2f& st);

}  // namespace frazil
