// Texture lookup: orientation, filtering, wrap modes, transforms, channels, refusals.
#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/material/texture.h"

using namespace frazil;

namespace {

// 4 x 2 texels, each channel c of texel i holds i + 100 c.
std::shared_ptr<Texture> numbered(int channels, Wrap wrap = Wrap::repeat) {
    auto texture = std::make_shared<Texture>();
    texture->width = 4, texture->height = 2, texture->channels = channels;
    texture->wrap_s = texture->wrap_t = wrap;
    for (int i = 0; i < 8; ++i) {
        for (int c = 0; c < channels; ++c) texture->texels.push_back(float(i + 100 * c));
    }
    return texture;
}

MaterialInput<Rgb> color_of(std::shared_ptr<Texture> texture) {
    MaterialInput<Rgb> input;
    input.lookup.texture = std::move(texture);
    return input;
}

float red(const std::shared_ptr<Texture>& texture, float s, float t) {
    return eval_color(color_of(texture), V2f(s, t)).x;
}

}  // namespace

TEST_CASE("texture: without an image the value stands; st (0,0) is the lower left, row 0 the top") {
    MaterialInput<Rgb> plain{Rgb(0.1f, 0.2f, 0.3f), {}};
    CHECK(eval_color(plain, V2f(0.5f)) == Rgb(0.1f, 0.2f, 0.3f));
    const auto image = numbered(3);
    CHECK(red(image, 0.125f, 0.25f) == doctest::Approx(4));  // lower left texel
    CHECK(red(image, 0.875f, 0.75f) == doctest::Approx(3));  // upper right texel
    CHECK(eval_color(color_of(image), V2f(0.375f, 0.75f)) == Rgb(1.0f, 101.0f, 201.0f));
}

TEST_CASE("texture: bilinear between texel centres") {
    const auto image = numbered(1);
    CHECK(red(image, 0.25f, 0.75f) == doctest::Approx(0.5));
    CHECK(red(image, 0.125f, 0.5f) == doctest::Approx(2.0));
    CHECK(red(image, 0.3125f, 0.6875f) == doctest::Approx(0.875 * 0.75 + 0.125 * 4.75));
}

TEST_CASE("texture: wrap modes at and beyond the edges") {
    const struct {
        Wrap wrap;
        double at_edge, beyond;  // s = 0 and s = 1.125 in the top row
    } cases[] = {
        {Wrap::repeat, 1.5, 0.0},  // half of the last and half of the first
        {Wrap::clamp, 0.0, 3.0},
        {Wrap::mirror, 0.0, 3.0},
        {Wrap::black, 0.0, 0.0},
    };
    for (const auto& c : cases) {
        CHECK(red(numbered(1, c.wrap), 0.0f, 0.75f) == doctest::Approx(c.at_edge));
        CHECK(red(numbered(1, c.wrap), 1.125f, 0.75f) == doctest::Approx(c.beyond));
    }
    CHECK(red(numbered(1, Wrap::mirror), 1.375f, 0.75f) == doctest::Approx(2));
    CHECK(red(numbered(1, Wrap::repeat), -3.625f, 5.75f) == doctest::Approx(1));
    CHECK(red(numbered(1, Wrap::black), 1.0f, 0.75f) == doctest::Approx(1.5));  // fades over half a texel
    CHECK(std::isfinite(red(numbered(1), 1e30f, -1e30f)));
    CHECK(red(numbered(1), NAN, 0.75f) == red(numbered(1), 0.0f, 0.0f));
}

TEST_CASE("texture: channels of images that have fewer") {
    const V2f st(0.125f, 0.75f);
    const auto scalar = [&](int channels, int channel) {
        MaterialInput<float> input;
        input.lookup.texture = numbered(channels);
        input.lookup.first_channel = channel;
        return eval_float(input, st);
    };
    CHECK(eval_color(color_of(numbered(1)), st) == Rgb(0.0f));
    CHECK(eval_color(color_of(numbered(2)), V2f(0.375f, 0.75f)) == Rgb(1.0f));  // grey and alpha
    CHECK(scalar(4, 2) == 200.0f);
    CHECK(scalar(4, 3) == 300.0f);
    CHECK(scalar(2, 3) == 100.0f);
    CHECK(scalar(3, 3) == 1.0f);
    CHECK(scalar(1, 1) == 0.0f);
}

TEST_CASE("texture: scale and bias by channel, UsdTransform2d: scale, then rotate, then translate") {
    MaterialInput<Rgb> input = color_of(numbered(3));
    input.lookup.scale = V3f(2.0f, 0.0f, 1.0f);
    input.lookup.bias = V3f(1.0f, 5.0f, 0.0f);
    CHECK(eval_color(input, V2f(0.375f, 0.75f)) == Rgb(3.0f, 5.0f, 201.0f));

    TextureLookup& lookup = input.lookup;
    lookup.scale = V3f(1.0f), lookup.bias = V3f(0.0f);
    lookup.st_scale = V2f(0.5f, 2.0f);
    lookup.st_rotation = 90.0f;
    lookup.st_translation = V2f(1.125f, 0.5f);
    // (0.5, 0.5) -> scaled (0.25, 1.0) -> turned (-1.0, 0.25) -> moved (0.125, 0.75)
    CHECK(eval_color(input, V2f(0.5f, 0.5f)).x == doctest::Approx(0.0).epsilon(1e-4));
    // (0.5, 0.375) -> (0.25, 0.75) -> (-0.75, 0.25) -> (0.375, 0.75)
    CHECK(eval_color(input, V2f(0.5f, 0.375f)).x == doctest::Approx(1.0).epsilon(1e-4));
}

TEST_CASE("texture: a normal map gives a unit vector, and straight up where it is nothing") {
    TextureLookup lookup;
    CHECK(eval_normal(lookup, V2f(0.0f)) == V3f(0, 0, 1));
    auto map = std::make_shared<Texture>();
    map->width = map->height = 1, map->channels = 3;
    map->texels = {0.5f, 0.75f, 1.0f};
    lookup.texture = map;
    lookup.scale = V3f(2.0f), lookup.bias = V3f(-1.0f);
    const V3f n = eval_normal(lookup, V2f(0.3f));
    CHECK(n.length() == doctest::Approx(1.0));
    CHECK(n.y == doctest::Approx(0.5 / std::sqrt(1.25)));
    map->texels = {0.5f, 0.5f, 0.5f};
    CHECK(eval_normal(lookup, V2f(0.3f)) == V3f(0, 0, 1));
}

TEST_CASE("texture: broken images are refused") {
    Texture texture = *numbered(3);
    CHECK_NOTHROW(check_texture(texture, "/tex"));
    texture.texels[7] = NAN;
    CHECK_THROWS_WITH_AS(check_texture(texture, "/tex"),
                         doctest::Contains("/tex: pixels must be finite, got nan at column 2, row 0"), ValueError);
    texture.texels.pop_back();
    CHECK_THROWS_WITH_AS(check_texture(texture, "/tex"), doctest::Contains("= 24 values, got 23"), ValueError);
    texture.channels = 5;
    CHECK_THROWS_WITH_AS(check_texture(texture, "/tex"), doctest::Contains("channels must be 1 to 4"), ValueError);
    texture.channels = 1, texture.width = 0;
    CHECK_THROWS_WITH_AS(check_texture(texture, "/tex"), doctest::Contains("at least 1 x 1"), ValueError);
}
