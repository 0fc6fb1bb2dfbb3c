// Images on surfaces: filtered lookup by texture coordinates, over UDIM tiles, or projected along the three axes.
// Model: uv (0,0) is the lower left corner, as in USD; row 0 of the data is the top of the image. A missing alpha is 1.
//   A pixel's ellipse on the surface is read as up to 8 probes along its long axis [McCormack1999], each bilinear in two
//   levels of the pyramid (mipmap.h) whose texels are as wide as its short axis. Where a mesh has no texture coordinates
//   (or is asked to) an image is projected along x, y and z of rest space and blended by the normal.
// Units: values after `scale` and `bias`, linear; positions and footprints in metres of rest space (render/surface.h).
// Valid: 1 to 4 channels; any size; a non-finite st reads as (0,0).
// Not: filtering across the edges of UDIM tiles, which repeat their last texel there.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/material/mipmap.h"

namespace frazil {

enum class Wrap { repeat, clamp, mirror, black };

struct Texture {
    struct Tile {
        int number = 0;  // UDIM, 1001 and on; 0 = the image of all st
        std::shared_ptr<const Mipmap> image;
    };
    std::vector<Tile> tiles;                            // by ascending number; at least one
    Wrap wrap_s = Wrap::repeat, wrap_t = Wrap::repeat;  // of an image that is not UDIM
    float missing[4] = {0, 0, 0, 1};                    // r, g, b, a where there is no tile
    std::string content;  // tells images apart that are read as they are needed; empty = at hand

    bool is_udim() const { return tiles.front().number > 0; }
    // Of the first tile.
    int width() const { return tiles.front().image->width(); }
    int height() const { return tiles.front().image->height(); }
    int channels() const { return tiles.front().image->channels(); }
};

// One image of all st, with all its levels. ValueError, beginning with `path`, as of Mipmap.
std::shared_ptr<Texture> make_texture(int width, int height, int channels, std::vector<float> texels,
                                      Wrap wrap_s = Wrap::repeat, Wrap wrap_t = Wrap::repeat,
                                      const std::string& path = "Texture");

// One input of a material: a constant, or a texture channel read at st transformed by UsdTransform2d.
// value = texel * scale + bias.
struct TextureLookup {
    std::shared_ptr<const Texture> texture;
    int first_channel = 0;                    // 0..3; a scalar input reads this one, a colour reads three from it
    bool is_grey = false;                     // a colour reads the first channel three times
    V3f scale = V3f(1.0f), bias = V3f(0.0f);  // by channel; a scalar input takes those of its channel, alpha takes z
    // st' = rotate(st * st_scale, st_rotation degrees) + st_translation
    V2f st_scale = V2f(1.0f), st_translation = V2f(0.0f);
    float st_rotation = 0.0f;
    bool is_triplanar = false;    // projected even where there are texture coordinates
    float triplanar_size = 1.0f;  // of one repeat of a projected image, metres
};

template <class T>
struct MaterialInput {
    T value{};
    TextureLookup lookup;  // used where it has a texture
};

// Where a texture is read. All but st in rest space.
struct TexturePoint {
    TexturePoint() = default;
    // A point without extent.
    TexturePoint(const V2f& texture_coordinates) : st(texture_coordinates) {}  // NOLINT: a place is a place

    V2f st = V2f(0.0f);
    bool has_st = true;                                  // else textures are projected
    V3f s_gradient = V3f(0.0f), t_gradient = V3f(0.0f);  // of st along the surface, 1/m
    V3f position = V3f(0.0f), normal = V3f(0, 1, 0);
    // Half axes of the ellipse that is looked at; zero = no filter.
    V3f long_axis = V3f(0.0f), short_axis = V3f(0.0f);

    // From two edges of a triangle and how st changes along them.
    void set_gradients(const V3f& edge1, const V3f& edge2, const V2f& change1, const V2f& change2);
    // Unit vectors around the normal: the way in which s grows and t does not, and across it where t grows; any where the
    // mesh has no st.
    std::pair<V3f, V3f> st_frame() const;
    V2f st_along(const V3f& v) const { return {s_gradient.dot(v), t_gradient.dot(v)}; }
    // The same by a step along the surface.
    TexturePoint moved(const V3f& step) const {
        TexturePoint result = *this;
        result.st += st_along(step);
        result.position += step;
        return result;
    }
};

// texel * scale + bias. A single-channel texture gives grey.
Rgb eval_color(const MaterialInput<Rgb>& input, const TexturePoint& at);
float eval_float(const MaterialInput<float>& input, const TexturePoint& at);
// The normal of a normal map in rest space, unit length: in the frame of st around at.normal, or in those of the three
// projections. at.normal without a texture, or where st has no direction.
V3f eval_normal(const TextureLookup& lookup, const TexturePoint& at);
// The gradient of a height (metres) along the surface, over steps as wide as the footprint and one texel at least.
V3f eval_slope(const MaterialInput<float>& height, const TexturePoint& at);

}  // namespace frazil
