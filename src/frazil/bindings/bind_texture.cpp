#include <nanobind/stl/shared_ptr.h>

#include <memory>

#include "frazil/bindings/bindings.h"
#include "frazil/material/texture.h"

namespace frazil {
namespace {

constexpr std::pair<Wrap, const char*> kWrapNames[] = {
    {Wrap::repeat, "repeat"}, {Wrap::clamp, "clamp"}, {Wrap::mirror, "mirror"}, {Wrap::black, "black"}};

// A Python function that gives an image's texels, callable from any thread. What it raises is printed, and no texels come.
std::function<std::vector<float>()> to_loader(const nb::callable& load) {
    std::shared_ptr<nb::callable> shared(new nb::callable(load), [](nb::callable* callable) {
        nb::gil_scoped_acquire gil;
        delete callable;
    });
    return [shared]() -> std::vector<float> {
        nb::gil_scoped_acquire gil;
        try {
            const auto texels = nb::cast<nb::ndarray<const float, nb::c_contig, nb::device::cpu>>((*shared)());
            return {texels.data(), texels.data() + texels.size()};
        } catch (nb::python_error& error) {
            error.discard_as_unraisable("loading a texture");
        } catch (const nb::cast_error&) {
        }
        return {};
    };
}

using TexelArray = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;

void check_shape(const TexelArray& texels, const char* what) {
    if (texels.size() == 0 || texels.shape(2) > 4) {
        throw ValueError(str(what, ": texels must have shape (height, width, 1..4), got (", texels.shape(0), ", ",
                             texels.shape(1), ", ", texels.shape(2), ")."));
    }
}

std::vector<float> copy_texels(const TexelArray& texels) {
    return {texels.data(), texels.data() + texels.size()};
}

// One image of a Texture, and a text that tells its content.
struct TileOfTexture {
    Texture::Tile tile;
    std::string content;
};

}  // namespace

void bind_texture(nb::module_& module) {
    nb::class_<TileOfTexture>(
        module, "TextureTile",
        "One image of a Texture.\n\n"
        "Parameters\n----------\n"
        "number : UDIM, 1001 and on; 0 = the image of all st.\n"
        "texels : (height, width, channels) float32, linear, 1 to 4 channels, row 0 on top.\n"
        "load : function without arguments that gives the same texels again. With it only copies of at most `kept` "
        "texels\n"
        "    on a side are kept now, and finer ones when they are first seen; it may be called from any thread.\n"
        "is_half : keep them as half floats.")
        .def(
            "__init__",
            [](TileOfTexture* self, int number, const TexelArray& texels, const std::optional<nb::callable>& load,
               int kept, bool is_half, std::string content) {
                check_shape(texels, "TextureTile");
                const int width = int(texels.shape(1)), height = int(texels.shape(0)), channels = int(texels.shape(2));
                auto image =
                    load ? std::make_shared<Mipmap>(width, height, channels, copy_texels(texels), to_loader(*load),
                                                    kept, is_half, "TextureTile")
                         : std::make_shared<Mipmap>(width, height, channels, copy_texels(texels), "TextureTile");
                new (self) TileOfTexture{{number, std::move(image)}, std::move(content)};
            },
            "number"_a, "texels"_a, "load"_a = nb::none(), "kept"_a = 64, "is_half"_a = false, "content"_a = "")
        .def_prop_ro("number", [](const TileOfTexture& tile) { return tile.tile.number; })
        .def(
            "memory", [](const TileOfTexture& tile) { return tile.tile.image->bytes(); }, "Bytes that are kept now.");

    nb::class_<Texture>(module, "Texture",
                        "An image on a surface.\n\n"
                        "Parameters\n----------\n"
                        "texels : (height, width, channels) float32, linear, 1 to 4 channels, row 0 on top. Copied.\n"
                        "wrap_s, wrap_t : 'repeat', 'clamp', 'mirror' or 'black'.")
        .def(
            "__init__",
            [](Texture* self, const TexelArray& texels, const std::string& wrap_s, const std::string& wrap_t) {
                check_shape(texels, "Texture");
                new (self) Texture(*make_texture(int(texels.shape(1)), int(texels.shape(0)), int(texels.shape(2)),
                                                 copy_texels(texels), from_name(kWrapNames, wrap_s, "Texture: wrap_s"),
                                                 from_name(kWrapNames, wrap_t, "Texture: wrap_t")));
            },
            "texels"_a, "wrap_s"_a = "repeat", "wrap_t"_a = "repeat")
        .def_static(
            "from_tiles",
            [](const std::vector<TileOfTexture>& tiles, const std::string& wrap_s, const std::string& wrap_t,
               const std::array<float, 4>& missing) {
                if (tiles.empty()) throw ValueError("Texture: tiles must be one or more, got none.");
                auto texture = std::make_shared<Texture>();
                for (const TileOfTexture& tile : tiles) {
                    if (!texture->tiles.empty() && tile.tile.number <= texture->tiles.back().number) {
                        throw ValueError(str("Texture: tiles must be by ascending number, got ", tile.tile.number,
                                             " after ", texture->tiles.back().number, "."));
                    }
                    texture->tiles.push_back(tile.tile);
                    texture->content += tile.content;
                }
                texture->wrap_s = from_name(kWrapNames, wrap_s, "Texture: wrap_s");
                texture->wrap_t = from_name(kWrapNames, wrap_t, "Texture: wrap_t");
                std::copy(missing.begin(), missing.end(), texture->missing);
                return texture;
            },
            "tiles"_a, "wrap_s"_a = "repeat", "wrap_t"_a = "repeat",
            "missing"_a = std::array<float, 4>{0.0f, 0.0f, 0.0f, 1.0f},
            "A texture of TextureTiles by ascending number; `missing` is its value where there is none.")
        .def_prop_ro(
            "texels",
            [](const std::shared_ptr<Texture>& texture) -> nb::object {
                const Mipmap& image = *texture->tiles.front().image;
                if (!image.is_whole()) return nb::none();
                return nb::cast(nb::ndarray<nb::numpy, const float>(
                    image.level(0).texels.data(),
                    {std::size_t(image.height()), std::size_t(image.width()), std::size_t(image.channels())},
                    nb::find(texture)));
            },
            nb::sig("def texels(self) -> numpy.ndarray | None"),
            "Of the first tile; None where it is read from its file as it is needed.")
        .def_prop_ro("tiles",
                     [](const Texture& texture) {
                         std::vector<int> numbers;
                         for (const Texture::Tile& tile : texture.tiles) numbers.push_back(tile.number);
                         return numbers;
                     })
        .def_ro("content", &Texture::content, "Tells the content of images that are read as they are needed.")
        .def(
            "memory",
            [](const Texture& texture) {
                std::size_t sum = 0;
                for (const Texture::Tile& tile : texture.tiles) sum += tile.image->bytes();
                return sum;
            },
            "Bytes that are kept now.")
        .def_prop_ro("wrap_s", [](const Texture& texture) { return to_name(kWrapNames, texture.wrap_s); })
        .def_prop_ro("wrap_t", [](const Texture& texture) { return to_name(kWrapNames, texture.wrap_t); })
        .def("__repr__", [](const Texture& texture) {
            return str("Texture(", texture.width(), "x", texture.height(), ", ", texture.channels(), " channels, ",
                       texture.tiles.size(), " tiles)");
        });

    nb::class_<TextureLookup>(module, "TextureLookup",
                              "How a material input reads a texture: texel * scale + bias, at\n"
                              "st' = rotate(st * st_scale, st_rotation degrees) + st_translation.\n\n"
                              "Parameters\n----------\n"
                              "texture : Texture, shared, not copied.\n"
                              "first_channel : 0..3; a scalar input reads this channel, a colour three from it on.\n"
                              "is_grey : a colour reads that one channel three times.\n"
                              "is_triplanar : project along the axes of rest space even where there are texture\n"
                              "    coordinates; triplanar_size : metres of one repeat where it is projected.")
        .def(
            "__init__",
            [](TextureLookup* self, const std::shared_ptr<Texture>& texture, int first_channel, const Triple& scale,
               const Triple& bias, const Pair& st_scale, float st_rotation, const Pair& st_translation, bool is_grey,
               bool is_triplanar, float triplanar_size) {
                if (first_channel < 0 || first_channel > 3) {
                    throw ValueError(str("TextureLookup: first_channel must be in 0..3, got ", first_channel, "."));
                }
                if (!(triplanar_size > 0.0f)) {
                    throw ValueError(str("TextureLookup: triplanar_size must be > 0, got ", triplanar_size, "."));
                }
                new (self) TextureLookup{texture,
                                         first_channel,
                                         is_grey,
                                         to_v3f(scale),
                                         to_v3f(bias),
                                         V2f(st_scale[0], st_scale[1]),
                                         V2f(st_translation[0], st_translation[1]),
                                         st_rotation,
                                         is_triplanar,
                                         triplanar_size};
            },
            "texture"_a, "first_channel"_a = 0, "scale"_a = Triple{1, 1, 1}, "bias"_a = Triple{0, 0, 0},
            "st_scale"_a = Pair{1, 1}, "st_rotation"_a = 0.0f, "st_translation"_a = Pair{0, 0}, "is_grey"_a = false,
            "is_triplanar"_a = false, "triplanar_size"_a = 1.0f)
        .def_prop_ro("texture",
                     [](const TextureLookup& lookup) { return std::const_pointer_cast<Texture>(lookup.texture); })
        .def_ro("first_channel", &TextureLookup::first_channel)
        .def_prop_ro("scale", [](const TextureLookup& lookup) { return from_v3f(lookup.scale); })
        .def_prop_ro("bias", [](const TextureLookup& lookup) { return from_v3f(lookup.bias); })
        .def_prop_ro("st_scale",
                     [](const TextureLookup& lookup) {
                         return Pair{lookup.st_scale.x, lookup.st_scale.y};
                     })
        .def_prop_ro("st_translation",
                     [](const TextureLookup& lookup) {
                         return Pair{lookup.st_translation.x, lookup.st_translation.y};
                     })
        .def_ro("st_rotation", &TextureLookup::st_rotation)
        .def_ro("is_grey", &TextureLookup::is_grey)
        .def_ro("is_triplanar", &TextureLookup::is_triplanar)
        .def_ro("triplanar_size", &TextureLookup::triplanar_size)
        .def("__repr__", [](const TextureLookup& lookup) {
            return str("TextureLookup(",
                       lookup.texture ? str(lookup.texture->width(), "x", lookup.texture->height()) : "", ", channel ",
                       lookup.first_channel, ")");
        });
}

}  // namespace frazil
