// The choice of lights for a receiver when lights come in groups: groups first, then lights of them by power.
// Model: groups are picked evenly, or half so and half by the light that they can give the receiver over what they give on
//   the mean (group_balance.h). So what a group is scaled by changes no choice: layers of groups are linear in the groups'
//   intensities sample by sample, not only in the mean. A receiver that asks for as many lights as there are groups, or
//   more, gets one of each.
// Units: probabilities.
// Valid: as LightPicker, of which there is one per group; groups that cannot reach the receiver get no share, the others
//   at least half an even one.
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
        std::vector<float> shares;  // of groups; their sum is the number of groups that are picked at a time
        int count = 0;              // groups with weight above 0
    };
    void weigh(const LightReceiver& receiver, Weights& weights) const;
    // As many lights as the receiver asks for, about; none of them twice.
    void pick(const LightReceiver& receiver, const Weights& weights, float u, std::vector<LightPick>& picks) const;
    // With what probability pick() gives this light.
    float probability(const LightReceiver& receiver, const Weights& weights, int light) const;

    std::size_t group_count() const { return pickers_.size(); }
    const LightPicker& group(std::size_t g) const { return pickers_[g]; }
    // What each group's weights are multiplied by where groups are compared; empty = groups are picked evenly.
    void set_scales(std::vector<float> scales) { scales_ = std::move(scales); }

  private:
    void set_shares(const LightReceiver& receiver, Weights& weights) const;
    static LightReceiver in_group(const LightReceiver& receiver, const Weights& weights);

    std::vector<LightPicker> pickers_;  // by group
    std::vector<int> picker_of_light_;  // -1 where no picker has it
    std::vector<float> scales_;
};

}  // namespace frazil
