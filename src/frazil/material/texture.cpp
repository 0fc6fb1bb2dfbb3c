#include "frazil/material/texture.h"

#include <cmath>

#include "frazil/base/error.h"

namespace frazil {
namespace {

// The texel index that wrap mode makes of i; -1 is black.
int wrap_index(long long i, int size, Wrap wrap) {
    if (i >= 0 && i < size) return static_cast<int>(i);
    switch (wrap) {
        case Wrap::repeat:
            return static_cast<int>(((i % size) + size) % size);
        case Wrap::clamp:
            return i < 0 ? 0 : size - 1;
        case Wrap::mirror: {
            const long long period = 2LL * size;
            const long long j = ((i % period) + period) % period;
            return static_cast<int>(j < size ? j : period - 1 - j);
        }
        case Wrap::black:
            return -1;
    }
    return -1;
}

V2f transform_st(const TextureLookup& lookup, const V2f& st) {
    if (!std::isfinite(st.x) || !std::isfinite(st.y)) return V2f(0.0f);
    const V2f scaled(st.x * lookup.st_scale.x, st.y * lookup.st_scale.y);
    if (lookup.st_rotation == 0.0f) return scaled + lookup.st_translation;
    const float angle = lookup.st_rotation * (kPi / 180.0f), c = std::cos(angle), s = std::sin(angle);
    return V2f(c * scaled.x - s * scaled.y, s * scaled.x + c * scaled.y) + lookup.st_translation;
}

// The four texels around a point and their weights, shared by all channels.
struct Footprint {
    std::size_t offset[4];
    float weight[4];
};

Footprint footprint(const Texture& texture, const V2f& st) {
    // Far outside the image a float has no fraction left; the bound keeps the cast defined.
    constexpr float kFar = 1e9f;
    const float x = std::clamp(st.x * float(texture.width) - 0.5f, -kFar, kFar);
    const float y = std::clamp((1.0f - st.y) * float(texture.height) - 0.5f, -kFar, kFar);
    const float x0 = std::floor(x), y0 = std::floor(y);
    Footprint result;
    for (int corner = 0; corner < 4; ++corner) {
        const int dx = corner & 1, dy = corner >> 1;
        const int i = wrap_index(static_cast<long long>(x0) + dx, texture.width, texture.wrap_s);
        const int j = wrap_index(static_cast<long long>(y0) + dy, texture.height, texture.wrap_t);
        const float weight = (dx ? x - x0 : 1.0f - (x - x0)) * (dy ? y - y0 : 1.0f - (y - y0));
        const bool is_black = i < 0 || j < 0;
        result.weight[corner] = is_black ? 0.0f : weight;
        result.offset[corner] =
            is_black ? 0
                     : (std::size_t(j) * std::size_t(texture.width) + std::size_t(i)) * std::size_t(texture.channels);
    }
    return result;
}

// Channel 0..3 (r, g, b, a) of a texture that may have fewer: grey repeats, a missing alpha is 1.
float read_channel(const Texture& texture, const Footprint& at, int channel) {
    const bool has_alpha = texture.channels == 2 || texture.channels == 4;
    if (channel >= 3 && !has_alpha) return 1.0f;
    const int stored = channel >= 3 ? texture.channels - 1 : (texture.channels >= 3 ? channel : 0);
    float sum = 0.0f;
    for (int corner = 0; corner < 4; ++corner) {
        sum += at.weight[corner] * texture.texels[at.offset[corner] + std::size_t(stored)];
    }
    return sum;
}

}  // namespace

void check_texture(const Texture& texture, const std::string& path) {
    if (texture.channels < 1 || texture.channels > 4) {
        throw ValueError(str(path, ": channels must be 1 to 4, got ", texture.channels, ". Convert the image."));
    }
    if (texture.width < 1 || texture.height < 1) {
        throw ValueError(str(path, ": size must be at least 1 x 1, got ", texture.width, " x ", texture.height,
                             ". Give an image with pixels."));
    }
    const std::size_t expected =
        std::size_t(texture.width) * std::size_t(texture.height) * std::size_t(texture.channels);
    if (texture.texels.size() != expected) {
        throw ValueError(str(path, ": texels must be width * height * channels = ", expected, " values, got ",
                             texture.texels.size(), "."));
    }
    for (std::size_t i = 0; i < expected; ++i) {
        if (!std::isfinite(texture.texels[i])) {
            const std::size_t pixel = i / std::size_t(texture.channels);
            throw ValueError(str(path, ": pixels must be finite, got ", texture.texels[i], " at column ",
                                 pixel % std::size_t(texture.width), ", row ", pixel / std::size_t(texture.width),
                                 ". Repair the image."));
        }
    }
}

Rgb eval_color(const MaterialInput<Rgb>& input, const V2f& st) {
    const TextureLookup& lookup = input.lookup;
    if (!lookup.texture) return input.value;
    const Footprint at = footprint(*lookup.texture, transform_st(lookup, st));
    Rgb result;
    for (int c = 0; c < 3; ++c) {
        const float texel = read_channel(*lookup.texture, at, std::min(lookup.first_channel + c, 3));
        result[c] = texel * lookup.scale[c] + lookup.bias[c];
    }
    return result;
}

float eval_float(const MaterialInput<float>& input, const V2f& st) {
    const TextureLookup& lookup = input.lookup;
    if (!lookup.texture) return input.value;
    const Footprint at = footprint(*lookup.texture, transform_st(lookup, st));
    const int axis = std::min(lookup.first_channel, 2);
    return read_channel(*lookup.texture, at, lookup.first_channel) * lookup.scale[axis] + lookup.bias[axis];
}

V3f eval_normal(const TextureLookup& lookup, const V2f& st) {
    if (!lookup.texture) return V3f(0.0f, 0.0f, 1.0f);
    const MaterialInput<Rgb> input{Rgb(0.0f), lookup};
    const V3f normal = eval_color(input, st);
    return normal.length2() > 1e-8f ? normal.normalized() : V3f(0.0f, 0.0f, 1.0f);
}

}  // namespace frazil
