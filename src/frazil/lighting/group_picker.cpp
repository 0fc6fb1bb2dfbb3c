#include "frazil/lighting/group_picker.h"

#include <algorithm>
#include <map>

namespace frazil {

GroupPicker::GroupPicker(const std::vector<WorldLight>& lights, std::span<const PickEntry> entries,
                         const LinkTable& links, std::span<const std::uint32_t> link_of_light,
                         std::span<const std::string> group_of_light)
    : picker_of_light_(lights.size(), -1) {
    std::map<std::string, std::vector<PickEntry>> groups;
    for (const PickEntry& entry : entries) groups[group_of_light[std::size_t(entry.light)]].push_back(entry);
    for (const auto& [name, own] : groups) {
        for (const PickEntry& entry : own) picker_of_light_[std::size_t(entry.light)] = int(pickers_.size());
        pickers_.emplace_back(lights, own, links, link_of_light);
    }
}

void GroupPicker::weigh(const LightReceiver& receiver, Weights& weights) const {
    weights.groups.resize(pickers_.size());
    weights.count = 0;
    for (std::size_t g = 0; g < pickers_.size(); ++g) {
        pickers_[g].weigh(receiver, weights.groups[g]);
        if (weights.groups[g].total > 0.0f) ++weights.count;
    }
}

LightPick GroupPicker::pick(const LightReceiver& receiver, const Weights& weights, float u) const {
    if (weights.count == 0) return {};
    const float scaled = u * static_cast<float>(weights.count);
    int left = std::min(static_cast<int>(scaled), weights.count - 1);
    const float rest = std::clamp(scaled - static_cast<float>(left), 0.0f, 0.99999994f);
    for (std::size_t g = 0; g < pickers_.size(); ++g) {
        if (!(weights.groups[g].total > 0.0f) || left-- > 0) continue;
        LightPick picked = pickers_[g].pick(receiver, weights.groups[g], rest);
        picked.probability /= static_cast<float>(weights.count);
        return picked;
    }
    return {};
}

float GroupPicker::probability(const LightReceiver& receiver, const Weights& weights, int light) const {
    const int g = picker_of_light_[std::size_t(light)];
    if (g < 0 || weights.count == 0) return 0.0f;
    return pickers_[std::size_t(g)].probability(receiver, weights.groups[std::size_t(g)], light) /
           static_cast<float>(weights.count);
}

}  // namespace frazil
