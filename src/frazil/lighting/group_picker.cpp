#include "frazil/lighting/group_picker.h"

#include <algorithm>
#include <map>

namespace frazil {
namespace {

constexpr float kByWeight = 0.5f;  // of the groups' shares, where they are not even

}  // namespace

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
    if (weights.count > 0) set_shares(receiver, weights);
}

void GroupPicker::set_shares(const LightReceiver& receiver, Weights& weights) const {
    const std::size_t groups = pickers_.size();
    weights.shares.assign(groups, 0.0f);
    float total = 0.0f;
    for (std::size_t g = 0; g < groups; ++g) {
        if (!scales_.empty()) total += weights.groups[g].total * scales_[g];
    }
    const float even = 1.0f / static_cast<float>(weights.count);
    for (std::size_t g = 0; g < groups; ++g) {
        if (!(weights.groups[g].total > 0.0f)) continue;
        const float own = total > 0.0f ? weights.groups[g].total * scales_[g] / total : even;
        weights.shares[g] = (1.0f - kByWeight) * even + kByWeight * own;
    }
    // As many as the receiver asks for; what is certain leaves the rest to the others.
    const float wanted = std::min(receiver.picks, static_cast<float>(weights.count));
    for (int round = 0; round < weights.count; ++round) {
        float certain = 0.0f, rest = 0.0f;
        for (const float share : weights.shares) (share >= 1.0f ? certain : rest) += share;
        if (!(rest > 0.0f)) break;
        const float factor = (wanted - certain) / rest;
        bool is_done = true;
        for (float& share : weights.shares) {
            if (share >= 1.0f) continue;
            share *= factor;
            if (share >= 1.0f - 1e-5f && share > 0.0f) share = 1.0f, is_done = false;
        }
        if (is_done) break;
    }
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
    // A comb with teeth at u, u + 1, ... over the shares laid end to end.
    double tooth = double(u);
    int left = weights.count;
    for (std::size_t g = 0; g < pickers_.size(); ++g) {
        if (!(weights.groups[g].total > 0.0f)) continue;
        const double share = double(weights.shares[g]);
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
    return weights.shares[std::size_t(g)] *
           pickers_[std::size_t(g)].probability(in_group(receiver, weights), weights.groups[std::size_t(g)], light);
}

}  // namespace frazil
