// The picture: one float array per AOV of the table.
// Model: additive layers are accumulated apart; the beauty is their sum, made when the film is finished.
// Units: by AOV.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frazil/render/aov.h"

namespace frazil {

struct Layer {
    int channels = 0;
    std::vector<float> pixels;  // (height, width, channels), row 0 on top
};

struct Film {
    int width = 0, height = 0;
    std::map<std::string, Layer> layers;  // by AOV name
};

}  // namespace frazil
