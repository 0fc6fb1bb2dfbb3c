#include "frazil/render/aov.h"

#include <algorithm>
#include <array>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr AovFilter average = AovFilter::average, nearest = AovFilter::nearest;

// Name, channels, meaning, filter, is additive, is half, is default.
constexpr std::array kTable = {
    Aov{"beauty", "RGBA", "sum of the additive layers, and coverage of the pixel as alpha", average, false, true, true},
    Aov{"translucency", "RGB", "light that has diffused through ice", average, true, true, true},
    Aov{"diffuse", "RGB", "diffuse reflection, with what it lights further", average, true, true, true},
    Aov{"specular", "RGB", "glossy reflection, with what is seen in it", average, true, true, true},
    Aov{"refraction", "RGB", "what is seen through the boundary of ice, unscattered", average, true, true, true},
    Aov{"volume", "RGB", "light scattered once inside ice", average, true, true, true},
    Aov{"emission", "RGB", "light that surfaces emit", average, true, true, true},
    Aov{"background", "RGB", "dome lights seen directly", average, true, true, true},
    Aov{"Z", "Z", "distance along the viewing axis, metres; infinity where nothing is hit", nearest, false, false,
        true},
    Aov{"N", "XYZ", "shading normal, world space", average, false, true, true},
    Aov{"P", "XYZ", "position, world space, metres", nearest, false, false, true},
    Aov{"object_id", "I", "1 + index of the object, 0 where nothing is hit; names are in the metadata", nearest, false,
        false, true},
    Aov{"albedo", "RGB", "share of light that the first surface sends back, all lobes together", average, false, true,
        true},
    Aov{"sample_count", "Y", "samples that the pixel has got", average, false, false, true},
    Aov{"variance", "Y", "squared standard error of the beauty's luminance", average, false, false, true},
    Aov{"coverage", "RGB", "W: the profile summed over the surface around the point; Rd_total on a plane", average,
        false, true, true},
    Aov{"translucency_ramp", "RGB", "translucency per knot of the ramps, as if its colour were white; a layer per knot",
        average, false, true, false},
    Aov{"motion", "XY", "way of what is seen to its place in the next frame, pixels, y upwards", nearest, false, false,
        false},
    Aov{"overlay", "RGB", "what a change of each overlay's opacity adds, per overlay and component", average, false,
        true, false},
    Aov{"uv", "UV", "texture coordinates st", nearest, false, false, false},
    Aov{"Pref", "XYZ", "position in the object's own space and rest pose, which stays with it when it moves and bends",
        nearest, false, false, false},
    Aov{"material_id", "I", "1 + index of the material, 0 where nothing is hit; names are in the metadata", nearest,
        false, false, false},
    Aov{"instance_id", "I", "1 + number of the object among those that share its mesh, 0 where nothing is hit", nearest,
        false, false, false},
    Aov{"point_spacing", "Y", "distance of the ice's translucency points, metres; 0 where no ice is hit", nearest,
        false, false, false},
    Aov{"compensation_factor", "RGB", "1 - W/Rd_total: what area compensation makes up for; 0 on a plane", average,
        false, true, false},
    Aov{"occlusion", "Y",
        "share of the hemisphere, by the cosine, that nothing hides: 1 = open; baked at the points of ice", average,
        false, true, false},
    Aov{"bent_normal", "XYZ", "mean direction of what is open, unit length, world space; 0 where nothing is", average,
        false, true, false},
    Aov{"crypto_object", "RGBA", "Cryptomatte of objects: ids and coverages, two a layer, in three layers", average,
        false, false, false},
    Aov{"crypto_material", "RGBA", "Cryptomatte of materials", average, false, false, false},
    Aov{"crypto_asset", "RGBA", "Cryptomatte of assets: what the objects belong to", average, false, false, false},
    Aov{"crypto_refracted_object", "RGBA", "Cryptomatte of objects that are seen through ice", average, false, false,
        false},
    Aov{"crypto_refracted_material", "RGBA", "Cryptomatte of materials that are seen through ice", average, false,
        false, false},
    Aov{"crypto_refracted_asset", "RGBA", "Cryptomatte of assets that are seen through ice", average, false, false,
        false},
    Aov{"matte", "Y", "how much of a pixel shows a matte's objects first; a layer matte.NAME per matte", average, false,
        false, false},
    Aov{"refracted_matte", "Y",
        "the same through glossy refraction, weighted by what the ice on the way lets through; refracted_matte.NAME",
        average, false, false, false},
    Aov{"compensation_off", "RGB", "translucency without area compensation", average, false, true, false},
    Aov{"compensation_ratio", "RGB", "translucency with compensation ratio at strength 1", average, false, true, false},
    Aov{"compensation_conserve", "RGB", "translucency with compensation conserve at strength 1", average, false, true,
        false},
    Aov{"compensation_depth", "RGB", "translucency with compensation depth at strength 1", average, false, true, false},
    Aov{"compensation_fill", "RGB", "translucency with compensation fill at strength 1", average, false, true, false},
    Aov{"compensation_linear", "RGB", "translucency with compensation linear at strength 1", average, false, true,
        false},
};

}  // namespace

std::span<const Aov> aov_table() {
    return kTable;
}

const Aov* find_aov(std::string_view name) {
    const auto found = std::find_if(kTable.begin(), kTable.end(), [&](const Aov& aov) { return aov.name == name; });
    return found == kTable.end() ? nullptr : &*found;
}

void check_aovs(std::span<const std::string> names) {
    for (auto name = names.begin(); name != names.end(); ++name) {
        if (!find_aov(*name)) {
            throw ValueError(str("render: aovs must be names of the AOV table, got '", *name, "'."));
        }
        if (std::find(names.begin(), name, *name) != name) {
            throw ValueError(str("render: aovs must differ from each other, got '", *name, "' twice."));
        }
    }
}

}  // namespace frazil
