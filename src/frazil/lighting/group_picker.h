// The choice of one light for a receiver when lights come in groups: a group first, evenly, then a light of it by power.
// Model: so every light group's layer is sampled alike, and what a group is scaled by changes no choice: layers of groups are
//   linear in the groups' intensities sample by sample, not only in the mean.
// Units: probabilities.
// Valid: as LightPicker, of which there is one per group; groups that cannot reach the receiver get no share.
#pragma once

#include <string>
#include <vector>

#include "frazil/lighting/light_picker.h"

namespace frazil {

class GroupPicker {
  public:
    // Everything must outlive the picker; group_of_light[i] names light i's group.
    GroupPicker(const std::vector<WorldLight>& lights, std::span<const PickEntry> entries, const LinkTable& links,
                std::span<const std::uint32_t> link_of_light, std::span<const std::string> group_of_light);

    struct Weights {
        std::vector<LightPicker::Weights> groups;
        int count = 0;  // groups with weight above 0
    };
    void weigh(const LightReceiver& receiver, Weights& weights) const;
    LightPick pick(const LightReceiver& receiver, const Weights& weights, float u) const;
    // With what probability pick() gives this light.
    float probability(const LightReceiver& receiver, const Weights& weights, int light) const;

  private:
    std::vector<LightPicker> pickers_;  // by group
    std::vector<int> picker_of_light_;  // -1 where no picker has it
};

}  // namespace frazil
