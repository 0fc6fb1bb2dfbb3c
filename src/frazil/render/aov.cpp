#include "frazil/render/aov.h"

#include <algorithm>
#include <array>

namespace frazil {
namespace {

constexpr std::array kTable = {
    Aov{"beauty", "RGBA", "sum of the additive layers, and coverage of the pixel as alpha", AovFilter::average, false,
        true},
    Aov{"translucency", "RGB", "light that has diffused through ice", AovFilter::average, true, true},
    Aov{"diffuse", "RGB", "diffuse reflection, with what it lights further", AovFilter::average, true, true},
    Aov{"specular", "RGB", "glossy reflection, with what is seen in it", AovFilter::average, true, true},
    Aov{"refraction", "RGB", "what is seen through the boundary of ice, unscattered", AovFilter::average, true, true},
    Aov{"volume", "RGB", "light scattered once inside ice", AovFilter::average, true, true},
    Aov{"emission", "RGB", "light that surfaces emit", AovFilter::average, true, true},
    Aov{"background", "RGB", "dome lights seen directly", AovFilter::average, true, true},
    Aov{"Z", "Z", "distance along the viewing axis, metres; infinity where nothing is hit", AovFilter::nearest, false,
        false},
    Aov{"N", "XYZ", "shading normal, world space", AovFilter::average, false, true},
    Aov{"P", "XYZ", "position, world space, metres", AovFilter::nearest, false, false},
    Aov{"object_id", "I", "1 + index of the object, 0 where nothing is hit; names are in the metadata",
        AovFilter::nearest, false, false},
    Aov{"albedo", "RGB", "share of light that the first surface sends back, all lobes together", AovFilter::average,
        false, true},
    Aov{"sample_count", "Y", "samples that the pixel has got", AovFilter::average, false, false},
    Aov{"variance", "Y", "squared standard error of the beauty's luminance", AovFilter::average, false, false},
    Aov{"coverage", "RGB", "W: the profile summed over the surface around the point; Rd_total on a plane",
        AovFilter::average, false, true},
};

}  // namespace

std::span<const Aov> aov_table() {
    return kTable;
}

const Aov* find_aov(std::string_view name) {
    const auto found = std::find_if(kTable.begin(), kTable.end(), [&](const Aov& aov) { return aov.name == name; });
    return found == kTable.end() ? nullptr : &*found;
}

}  // namespace frazil
