#include "frazil/material/texture.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr int kMaxProbes = 8;
constexpr float kBlend = 4.0f;  // sharpness of the blend between projections

struct Texel {
    float c[4] = {0, 0, 0, 0};
    void add(const Texel& other, float weight) {
        for (int i = 0; i < 4; ++i) c[i] += weight * other.c[i];
    }
};

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

// The four texels around a point.
Texel bilinear(const MipLevel& level, int channels, const V2f& st, Wrap wrap_s, Wrap wrap_t) {
    // Far outside the image a float has no fraction left; the bound keeps the cast defined.
    constexpr float kFar = 1e9f;
    const float x = std::clamp(st.x * float(level.width) - 0.5f, -kFar, kFar);
    const float y = std::clamp((1.0f - st.y) * float(level.height) - 0.5f, -kFar, kFar);
    const float x0 = std::floor(x), y0 = std::floor(y);
    const bool has_alpha = channels == 2 || channels == 4;
    Texel result;
    if (!has_alpha) result.c[3] = 1.0f;
    for (int corner = 0; corner < 4; ++corner) {
        const int dx = corner & 1, dy = corner >> 1;
        const float weight = (dx ? x - x0 : 1.0f - (x - x0)) * (dy ? y - y0 : 1.0f - (y - y0));
        const int i = wrap_index(static_cast<long long>(x0) + dx, level.width, wrap_s);
        const int j = wrap_index(static_cast<long long>(y0) + dy, level.height, wrap_t);
        if (i < 0 || j < 0 || weight == 0.0f) continue;
        const std::size_t at = (std::size_t(j) * std::size_t(level.width) + std::size_t(i)) * std::size_t(channels);
        for (int c = 0; c < 3; ++c) result.c[c] += weight * level.at(at + std::size_t(channels >= 3 ? c : 0));
        if (has_alpha) result.c[3] += weight * level.at(at + std::size_t(channels) - 1);
    }
    return result;
}

// The image around st as an ellipse with these half axes (of st) sees it.
Texel filtered(const Mipmap& image, const V2f& st, V2f a, V2f b, Wrap wrap_s, Wrap wrap_t) {
    const auto in_texels = [&](const V2f& v) {
        return V2f(v.x * float(image.width()), v.y * float(image.height())).length();
    };
    float longer = in_texels(a), shorter = in_texels(b);
    if (!(longer >= shorter)) std::swap(a, b), std::swap(longer, shorter);
    if (!(longer > 0.5f) || !std::isfinite(longer)) {
        return bilinear(image.level(0), image.channels(), st, wrap_s, wrap_t);
    }
    shorter = std::max(shorter, longer / kMaxProbes);
    const float lod = std::clamp(std::log2(2.0f * shorter), 0.0f, float(image.level_count() - 1));
    const int fine = int(lod);
    const float coarse_share = lod - float(fine);
    const int probes =
        fine + 1 >= image.level_count() ? 1 : std::clamp(int(std::ceil(longer / shorter - 0.25f)), 1, kMaxProbes);
    Texel result;
    for (int probe = 0; probe < probes; ++probe) {
        const V2f at = st + a * ((2.0f * float(probe) + 1.0f) / float(probes) - 1.0f);
        const float weight = 1.0f / float(probes);
        result.add(bilinear(image.level(fine), image.channels(), at, wrap_s, wrap_t), weight * (1.0f - coarse_share));
        if (coarse_share > 0.0f) {
            result.add(bilinear(image.level(fine + 1), image.channels(), at, wrap_s, wrap_t), weight * coarse_share);
        }
    }
    return result;
}

V2f rotated(const TextureLookup& lookup, const V2f& st) {
    const V2f scaled(st.x * lookup.st_scale.x, st.y * lookup.st_scale.y);
    if (lookup.st_rotation == 0.0f) return scaled;
    const float angle = lookup.st_rotation * (kPi / 180.0f), c = std::cos(angle), s = std::sin(angle);
    return {c * scaled.x - s * scaled.y, s * scaled.x + c * scaled.y};
}

Texel read(const TextureLookup& lookup, const V2f& mesh_st, const V2f& mesh_a, const V2f& mesh_b, bool is_projected) {
    const Texture& texture = *lookup.texture;
    V2f st(0.0f), a(0.0f), b(0.0f);
    if (std::isfinite(mesh_st.x) && std::isfinite(mesh_st.y)) {
        st = rotated(lookup, mesh_st) + lookup.st_translation;
        a = rotated(lookup, mesh_a), b = rotated(lookup, mesh_b);
    }
    if (!texture.is_udim()) {
        // A projection has no outside.
        const auto wrap = [&](Wrap w) { return is_projected && w == Wrap::black ? Wrap::repeat : w; };
        return filtered(*texture.tiles.front().image, st, a, b, wrap(texture.wrap_s), wrap(texture.wrap_t));
    }
    const float column = std::floor(st.x), row = std::floor(st.y);
    const V2f within(st.x - column, st.y - row);
    if (is_projected) return filtered(*texture.tiles.front().image, within, a, b, Wrap::clamp, Wrap::clamp);
    if (column >= 0.0f && column < 10.0f && row >= 0.0f && row < 1000.0f) {
        const int number = 1001 + int(column) + 10 * int(row);
        const auto tile = std::lower_bound(texture.tiles.begin(), texture.tiles.end(), number,
                                           [](const Texture::Tile& t, int n) { return t.number < n; });
        if (tile != texture.tiles.end() && tile->number == number) {
            return filtered(*tile->image, within, a, b, Wrap::clamp, Wrap::clamp);
        }
    }
    Texel missing;
    std::copy_n(texture.missing, 4, missing.c);
    return missing;
}

// The three projections: where a place lies in each, seen from outside and not mirrored, with the axes of s, t and the
// outside.
struct Projection {
    float weight;
    V3f s, t, out;
};

std::array<Projection, 3> projections(const V3f& normal) {
    const auto sign = [](float v) { return v < 0.0f ? -1.0f : 1.0f; };
    std::array<Projection, 3> result{Projection{std::pow(std::abs(normal.x), kBlend), V3f(0, 0, -sign(normal.x)),
                                                V3f(0, 1, 0), V3f(sign(normal.x), 0, 0)},
                                     Projection{std::pow(std::abs(normal.y), kBlend), V3f(1, 0, 0),
                                                V3f(0, 0, -sign(normal.y)), V3f(0, sign(normal.y), 0)},
                                     Projection{std::pow(std::abs(normal.z), kBlend), V3f(sign(normal.z), 0, 0),
                                                V3f(0, 1, 0), V3f(0, 0, sign(normal.z))}};
    const float sum = result[0].weight + result[1].weight + result[2].weight;
    for (Projection& p : result) p.weight = sum > 0.0f ? p.weight / sum : 1.0f / 3.0f;
    return result;
}

bool is_projected(const TextureLookup& lookup, const TexturePoint& at) {
    return lookup.is_triplanar || !at.has_st;
}

Texel read_projected(const TextureLookup& lookup, const TexturePoint& at, const Projection& p) {
    const float scale = 1.0f / lookup.triplanar_size;
    const auto project = [&](const V3f& v) { return V2f(p.s.dot(v), p.t.dot(v)) * scale; };
    return read(lookup, project(at.position), project(at.long_axis), project(at.short_axis), true);
}

Texel read(const TextureLookup& lookup, const TexturePoint& at) {
    if (!is_projected(lookup, at)) {
        return read(lookup, at.st, at.st_along(at.long_axis), at.st_along(at.short_axis), false);
    }
    Texel result;
    for (const Projection& p : projections(at.normal)) {
        if (p.weight > 1e-3f) result.add(read_projected(lookup, at, p), p.weight);
    }
    return result;
}

Rgb to_color(const TextureLookup& lookup, const Texel& texel) {
    Rgb result;
    for (int c = 0; c < 3; ++c) {
        const int channel = lookup.is_grey ? lookup.first_channel : std::min(lookup.first_channel + c, 3);
        result[c] = texel.c[channel] * lookup.scale[c] + lookup.bias[c];
    }
    return result;
}

}  // namespace

void TexturePoint::set_gradients(const V3f& edge1, const V3f& edge2, const V2f& change1, const V2f& change2) {
    const V3f cross = edge1.cross(edge2);
    if (!(cross.length2() > 0.0f)) return;
    const V3f along1 = edge2.cross(cross) / cross.length2(), along2 = cross.cross(edge1) / cross.length2();
    s_gradient = along1 * change1.x + along2 * change2.x;
    t_gradient = along1 * change1.y + along2 * change2.y;
}

std::pair<V3f, V3f> TexturePoint::st_frame() const {
    V3f tangent = t_gradient.cross(normal);
    if (tangent.dot(s_gradient) < 0.0f) tangent = -tangent;
    if (!(tangent.length2() > 0.0f)) return tangent_frame(normal);
    tangent.normalize();
    const V3f bitangent = normal.cross(tangent);
    return {tangent, bitangent.dot(t_gradient) < 0.0f ? -bitangent : bitangent};
}

std::shared_ptr<Texture> make_texture(int width, int height, int channels, std::vector<float> texels, Wrap wrap_s,
                                      Wrap wrap_t, const std::string& path) {
    auto texture = std::make_shared<Texture>();
    texture->tiles.push_back({0, std::make_shared<Mipmap>(width, height, channels, std::move(texels), path)});
    texture->wrap_s = wrap_s, texture->wrap_t = wrap_t;
    return texture;
}

Rgb eval_color(const MaterialInput<Rgb>& input, const TexturePoint& at) {
    if (!input.lookup.texture) return input.value;
    return to_color(input.lookup, read(input.lookup, at));
}

float eval_float(const MaterialInput<float>& input, const TexturePoint& at) {
    const TextureLookup& lookup = input.lookup;
    if (!lookup.texture) return input.value;
    const int axis = std::min(lookup.first_channel, 2);
    return read(lookup, at).c[lookup.first_channel] * lookup.scale[axis] + lookup.bias[axis];
}

V3f eval_normal(const TextureLookup& lookup, const TexturePoint& at) {
    if (!lookup.texture) return at.normal;
    V3f result(0.0f);
    if (is_projected(lookup, at)) {
        for (const Projection& p : projections(at.normal)) {
            if (!(p.weight > 1e-3f)) continue;
            const V3f n = to_color(lookup, read_projected(lookup, at, p));
            // What the map adds to a flat surface, laid over the surface's own normal.
            result += (at.normal * n.z + p.s * n.x + p.t * n.y) * p.weight;
        }
    } else {
        if (at.s_gradient == V3f(0.0f)) return at.normal;
        const auto [tangent, bitangent] = at.st_frame();
        const V3f n = to_color(lookup, read(lookup, at));
        result = tangent * n.x + bitangent * n.y + at.normal * n.z;
    }
    return result.length2() > 1e-8f ? result.normalized() : at.normal;
}

V3f eval_slope(const MaterialInput<float>& height, const TexturePoint& at) {
    const TextureLookup& lookup = height.lookup;
    if (!lookup.texture) return V3f(0.0f);
    // One texel, in metres.
    const auto texels = float(std::max(lookup.texture->width(), lookup.texture->height()));
    float step = 0.0f;
    if (is_projected(lookup, at)) {
        step = lookup.triplanar_size / (texels * std::max(std::abs(lookup.st_scale.x), std::abs(lookup.st_scale.y)));
    } else {
        const float density = std::max(at.s_gradient.length() * std::abs(lookup.st_scale.x),
                                       at.t_gradient.length() * std::abs(lookup.st_scale.y)) *
                              texels;
        if (!(density > 0.0f)) return V3f(0.0f);
        step = 1.0f / density;
    }
    step = std::max(step, at.short_axis.length());
    if (!(step > 0.0f) || !std::isfinite(step)) return V3f(0.0f);
    V3f slope(0.0f);
    const auto [tangent, bitangent] = tangent_frame(at.normal);
    for (const V3f& axis : {tangent, bitangent}) {
        const float rise = eval_float(height, at.moved(axis * step)) - eval_float(height, at.moved(axis * -step));
        slope += axis * (rise / (2.0f * step));
    }
    return slope;
}

}  // namespace frazil
