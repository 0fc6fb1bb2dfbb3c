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

// Groups are taken evenly, as many as the receiver asks for; where these are all of them, each picks its part of the rest.
float GroupPicker::group_share(const LightReceiver& receiver, const Weights& weights) {
    return std::min(1.0f, receiver.picks / static_cast<float>(weights.count));
}

LightReceiver GroupPicker::in_group(const LightReceiver& receiver, const Weights& weights) {
    LightReceiver result = receiver;
    result.picks = std::max(1.0f, receiver.picks / static_cast<float>(weights.count));
    return result;
}

void GroupPicker::pick(const LightReceiver& receiver, const Weights& weights, float u,
                       std::vector<LightPick>& picks) const {
    picks.clear();
    if (weights.count == 0) return;
    const LightReceiver own = in_group(receiver, weights);
    const double share = double(group_share(receiver, weights));
    // A comb with teeth at u, u + 1, ... over the shares laid end to end.
    double tooth = double(u);
    int left = weights.count;
    for (std::size_t g = 0; g < pickers_.size(); ++g) {
        if (!(weights.groups[g].total > 0.0f)) continue;
        const bool is_last = --left == 0 && picks.empty();  // whatever rounding says
        if (tooth < share || is_last) {
            const std::size_t begin = picks.size();
            pickers_[g].pick(own, weights.groups[g], std::min(float(tooth / share), kBelowOne), picks);
            for (std::size_t i = begin; i < picks.size(); ++i) picks[i].probability *= float(share);
            tooth += 1.0;
        }
        tooth -= share;
    }
}

float GroupPicker::probability(const LightReceiver& receiver, const Weights& weights, int light) const {
    const int g = picker_of_light_[std::size_t(light)];
    if (g < 0 || weights.count == 0) return 0.0f;
    return group_share(receiver, weights) *
           pickers_[std::size_t(g)].probability(in_group(receiver, weights), weights.groups[std::size_t(g)], light);
}

}  // namespace frazil
