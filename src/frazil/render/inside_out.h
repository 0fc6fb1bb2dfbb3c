// Ice that is modelled inside out: closed meshes whose faces wind inwards.
// Model: such a mesh is turned round, so that its points stand on the outside, where light comes from.
// Not: open meshes, whose outside is where their faces wind to; meshes whose faces wind both ways (Interiors names those).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "frazil/render/scene.h"

namespace frazil {

struct TurnedScene {
    std::optional<Scene> scene;         // with those meshes turned; none where there are none
    std::vector<std::string> warnings;  // one for each object
};

TurnedScene turned_outwards(const Scene& scene);

}  // namespace frazil
