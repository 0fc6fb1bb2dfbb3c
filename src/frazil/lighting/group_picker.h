// The choice of lights for a receiver when lights come in groups: groups first, evenly, then lights of them by power.
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
    // As many lights as the receiver asks for, about; none of them twice.
    void pick(const LightReceiver& receiver, const Weights& weights, float u, std::vector<LightPick>& picks) const;
    // With what probability pick() gives this light.
    float probability(const LightReceiver& receiver, const Weights& weights, int light) const;

  private:
    static float group_share(const LightReceiver& receiver, const Weights& weights);
    static LightReceiver in_group(const LightReceiver& receiver, const Weights& weights);

    std::vector<LightPicker> pickers_;  // by group
    std::vector<int> picker_of_light_;  // -1 where no picker has it
};

}  // namespace frazil
