// Texture lookup: orientation, filtering, wrap modes, transforms, channels, refusals.
#include <doctest/doctest.h>

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/material/texture.h"

using namespace frazil;

namespace {

// 4 x 2 texels, each channel c of texel i holds i + 100 c.
std::shared_ptr<Texture> numbered(int channels, Wrap wrap = Wrap::repeat) {
    std::vector<float> texels;
    for (int i = 0; i < 8; ++i) {
        for (int c = 0; c < channels; ++c) texels.push_back(float(i + 100 * c));
    }
    return make_texture(4, 2, channels, std::move(texels), wrap, wrap);
}

// A grey image by a function of column and row.
template <class Function>
std::shared_ptr<Texture> drawn(int size, const Function& function, Wrap wrap = Wrap::repeat) {
    std::vector<float> texels;
    for (int y = 0; y < size; ++y) {
        for (int x = 0; x < size; ++x) texels.push_back(function(x, y));
    }
    return make_texture(size, size, 1, std::move(texels), wrap, wrap);
}

// A place on the plane z = 0 with st = (x, y), seen by an ellipse with these half axes.
TexturePoint on_plane(const V2f& st, const V2f& a, const V2f& b) {
    TexturePoint at(st);
    at.position = V3f(st.x, st.y, 0.0f), at.normal = V3f(0, 0, 1);
    at.s_gradient = V3f(1, 0, 0), at.t_gradient = V3f(0, 1, 0);
    at.long_axis = V3f(a.x, a.y, 0.0f), at.short_axis = V3f(b.x, b.y, 0.0f);
    return at;
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

TEST_CASE("texture: a normal map turns the normal in the frame of st, and leaves it where it says nothing") {
    TextureLookup lookup;
    const TexturePoint flat = on_plane(V2f(0.3f), V2f(0.0f), V2f(0.0f));
    CHECK(eval_normal(lookup, flat) == V3f(0, 0, 1));
    const auto map = [](float x, float y, float z) { return make_texture(1, 1, 3, {x, y, z}); };
    lookup.scale = V3f(2.0f), lookup.bias = V3f(-1.0f);
    lookup.texture = map(0.5f, 0.75f, 1.0f);
    const V3f n = eval_normal(lookup, flat);
    CHECK(n.length() == doctest::Approx(1.0));
    CHECK(n.y == doctest::Approx(0.5 / std::sqrt(1.25)));
    // Mirrored st: t grows the other way.
    TexturePoint mirrored = flat;
    mirrored.t_gradient = V3f(0, -1, 0);
    CHECK(eval_normal(lookup, mirrored).y == doctest::Approx(-0.5 / std::sqrt(1.25)));
    // Projected: the same on a face that looks along x, where s runs along -z and t along y.
    TexturePoint side = flat;
    side.has_st = false, side.normal = V3f(1, 0, 0);
    lookup.texture = map(0.75f, 0.5f, 1.0f);
    CHECK(eval_normal(lookup, side).z == doctest::Approx(-0.5 / std::sqrt(1.25)));
    lookup.texture = map(0.5f, 0.5f, 0.5f);
    CHECK(eval_normal(lookup, flat) == V3f(0, 0, 1));
}

TEST_CASE("texture: broken images are refused") {
    std::vector<float> texels(24, 0.0f);
    CHECK_NOTHROW(Mipmap(4, 2, 3, texels, "/tex"));
    texels[7] = NAN;
    CHECK_THROWS_WITH_AS(Mipmap(4, 2, 3, texels, "/tex"),
                         doctest::Contains("/tex: pixels must be finite, got nan at column 2, row 0"), ValueError);
    texels.pop_back();
    CHECK_THROWS_WITH_AS(Mipmap(4, 2, 3, texels, "/tex"), doctest::Contains("= 24 values, got 23"), ValueError);
    CHECK_THROWS_WITH_AS(Mipmap(4, 2, 5, texels, "/tex"), doctest::Contains("channels must be 1 to 4"), ValueError);
    CHECK_THROWS_WITH_AS(Mipmap(0, 2, 1, texels, "/tex"), doctest::Contains("at least 1 x 1"), ValueError);
}

TEST_CASE("mipmap: every level has the image's mean, odd sizes too") {
    std::vector<float> texels;
    double mean = 0.0;
    for (int i = 0; i < 7 * 5; ++i) texels.push_back(float((i * 37) % 11)), mean += texels.back() / 35.0;
    const Mipmap image(7, 5, 1, texels, "/tex");
    CHECK(image.level_count() == 3);
    CHECK(image.level(1).width == 3);
    CHECK(image.level(1).height == 2);
    for (int l = 0; l < 3; ++l) {
        double sum = 0.0;
        for (const float v : image.level(l).texels) sum += v;
        CHECK(sum / double(image.level(l).texels.size()) == doctest::Approx(mean));
    }
}

TEST_CASE("mipmap: levels that nobody asked for are not kept; the same values come whatever the order of questions") {
    const int size = 256;
    std::vector<float> texels;
    for (int i = 0; i < size * size; ++i) texels.push_back(float(i % 97) / 97.0f);
    int loads = 0;
    const auto make = [&](bool is_half) {
        return Mipmap(
            size, size, 1, texels, [&] { return ++loads, texels; }, 16, is_half, "/tex");
    };
    const Mipmap whole(size, size, 1, texels, "/tex"), coarse_first = make(false), fine_first = make(false);
    CHECK(coarse_first.bytes() == 4 * (256 + 64 + 16 + 4 + 1));
    for (int l = whole.level_count() - 1; l >= 0; --l) CHECK(coarse_first.level(l).texels == whole.level(l).texels);
    for (int l = 0; l < whole.level_count(); ++l) CHECK(fine_first.level(l).texels == whole.level(l).texels);
    CHECK(loads == 4 + 1);  // 32, 64, 128, 256; and 256 with all below it
    CHECK(fine_first.bytes() == whole.bytes());
    CHECK(make(true).level(0).at(5) == doctest::Approx(texels[5]).epsilon(5e-4));
    // A file that has gone leaves the finest level that there is.
    const Mipmap broken(
        size, size, 1, texels, [] { return std::vector<float>(); }, 16, false, "/tex");
    CHECK(broken.level(0).width == 16);
}

TEST_CASE("texture: a wide footprint sees the mean, a narrow one the texel") {
    MaterialInput<float> input;
    input.lookup.texture = drawn(64, [](int x, int y) { return float((x + y) & 1); });
    CHECK(eval_float(input, V2f(0.5f / 64, 1.0f - 0.5f / 64)) == 0.0f);
    const V2f centre(20.5f / 64, 1.0f - 13.5f / 64);
    CHECK(eval_float(input, on_plane(centre, V2f(0.4f / 64, 0), V2f(0, 0.4f / 64))) == doctest::Approx(1.0));
    for (const float radius : {1.0f, 2.0f, 5.0f, 40.0f}) {
        const auto at = on_plane(centre, V2f(radius / 64, 0), V2f(0, radius / 64));
        CHECK(eval_float(input, at) == doctest::Approx(0.5).epsilon(0.01));
    }
}

TEST_CASE("texture: an ellipse blurs along its long axis only") {
    // Stripes along t: blurred by a footprint that is long along s, kept by one that is long along t.
    MaterialInput<float> input;
    input.lookup.texture = drawn(64, [](int x, int) { return float((x / 4) & 1); });
    const V2f in_stripe(6.0f / 64, 0.5f), wide(4.0f / 64, 0.0f), narrow(0.0f, 0.5f / 64);
    CHECK(eval_float(input, on_plane(in_stripe, wide, narrow)) == doctest::Approx(0.5).epsilon(0.05));
    const V2f tall(0.0f, 4.0f / 64), thin(0.5f / 64, 0.0f);
    CHECK(eval_float(input, on_plane(in_stripe, tall, thin)) == doctest::Approx(1.0).epsilon(0.01));
}

TEST_CASE("texture: UDIM tiles by the unit of st, a missing tile by its own value") {
    auto texture = std::make_shared<Texture>();
    for (const auto& [number, value] : {std::pair(1001, 1.0f), {1002, 2.0f}, {1011, 3.0f}}) {
        texture->tiles.push_back({number, std::make_shared<Mipmap>(2, 2, 1, std::vector<float>(4, value), "/tex")});
    }
    texture->missing[0] = 9.0f;
    CHECK(red(texture, 0.5f, 0.5f) == 1.0f);
    CHECK(red(texture, 1.01f, 0.99f) == 2.0f);
    CHECK(red(texture, 0.0f, 1.0f) == 3.0f);
    CHECK(red(texture, 1.5f, 1.5f) == 9.0f);
    CHECK(red(texture, -0.5f, 0.5f) == 9.0f);
    CHECK(red(texture, 10.5f, 0.5f) == 9.0f);  // not the first of the next row
}

TEST_CASE("texture: without st it is projected along the axes, unmirrored, one repeat every triplanar_size") {
    MaterialInput<float> input;
    input.lookup.texture = drawn(4, [](int x, int y) { return float(x + 10 * y); });
    input.lookup.triplanar_size = 2.0f;
    TexturePoint at;
    at.has_st = false;
    at.position = V3f(0.25f, 0.25f, 5.0f), at.normal = V3f(0, 0, 1);
    CHECK(eval_float(input, at) == doctest::Approx(30));  // lower left texel
    at.position.x += 2.0f;                                // one repeat on
    CHECK(eval_float(input, at) == doctest::Approx(30));
    at.position = V3f(0.75f, 0.25f, 5.0f);
    CHECK(eval_float(input, at) == doctest::Approx(31));  // to the right, seen from +z
    at.position = V3f(-0.75f, 0.25f, -5.0f), at.normal = V3f(0, 0, -1);
    CHECK(eval_float(input, at) == doctest::Approx(31));  // to the right, seen from -z
    // Half way between two faces: the mean of both.
    at.position = V3f(0.25f, 0.25f, -0.75f), at.normal = V3f(1, 0, 1).normalized();
    const float front = 30, side = 31;
    CHECK(eval_float(input, at) == doctest::Approx(0.5 * (front + side)));
}

TEST_CASE("texture: the slope of a height image is in metres per metre, whatever the size of a repeat") {
    for (const float size : {1.0f, 3.0f}) {
        // A ramp of 64 texels that rises by 0.5 over one repeat.
        MaterialInput<float> height;
        height.lookup.texture = drawn(64, [](int x, int) { return 0.5f * (float(x) + 0.5f) / 64.0f; });
        TexturePoint at = on_plane(V2f(0.5f), V2f(0.0f), V2f(0.0f));
        at.s_gradient /= size, at.t_gradient /= size;
        const V3f slope = eval_slope(height, at);
        CHECK(slope.x == doctest::Approx(0.5 / size).epsilon(1e-3));
        CHECK(slope.y == doctest::Approx(0.0));
        TexturePoint projected = at;
        projected.has_st = false;
        projected.position = V3f(0.5f * size, 0.2f, 0.0f);
        height.lookup.triplanar_size = size;
        CHECK(eval_slope(height, projected).x == doctest::Approx(0.5 / size).epsilon(1e-3));
    }
}
