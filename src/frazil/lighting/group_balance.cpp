#include "frazil/lighting/group_balance.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/sampler.h"
#include "frazil/lighting/shadow.h"

namespace frazil {
namespace {

constexpr double kLeastVisible = 0.02;
constexpr std::uint32_t kSeed = 0x62616c61U;

// What is left of one light of the group at the receiver, 0 to 1; below 0 where the sample lies behind it, which tells
// nothing.
double visible_share(const LightSampler& lights, const LightPicker& group, const LightPicker::Weights& weights,
                     const RayScene& scene, const LightReceiver& receiver, std::uint32_t index) {
    Sampler random(kSeed, index, 0);
    const LightPick pick = group.pick_one(receiver, weights, random.next_1d());
    if (pick.light < 0) return -1.0;
    const LightSample sample = lights.sample_one(pick.light, receiver.position, random.next_2d());
    if (!(sample.pdf > 0.0f)) return -1.0;
    V3f origin = receiver.position;
    if (receiver.normal != V3f(0.0f)) {
        if (sample.direction.dot(receiver.normal) <= 0.0f) return -1.0;
        origin = offset_origin(origin, receiver.normal);
    }
    const Rgb left = shadow_factor(scene, lights, pick.light, {origin, sample.direction, 0.0f, sample.distance});
    return std::clamp(double(luminance(left)), 0.0, 1.0);
}

}  // namespace

void balance_groups(LightSampler& lights, const RayScene& scene, std::span<const LightReceiver> receivers) {
    if (receivers.empty()) return;
    std::vector<GroupPicker*> done;
    for (std::size_t use = 0; use < kLightUseCount; ++use) {
        GroupPicker& picker = lights.picker(LightUse(use));
        if (picker.group_count() < 2 || std::find(done.begin(), done.end(), &picker) != done.end()) continue;
        done.push_back(&picker);
        std::vector<float> scales;
        for (std::size_t g = 0; g < picker.group_count(); ++g) {
            double possible = 0.0, asked = 0.0, arriving = 0.0;
            LightPicker::Weights weights;
            for (std::uint32_t i = 0; i < receivers.size(); ++i) {
                picker.group(g).weigh(receivers[i], weights);
                if (!(weights.total > 0.0f)) continue;
                possible += double(weights.total);
                const double share = visible_share(lights, picker.group(g), weights, scene, receivers[i], i);
                if (share < 0.0) continue;
                asked += double(weights.total);
                arriving += double(weights.total) * share;
            }
            const double visible = asked > 0.0 ? std::max(arriving / asked, kLeastVisible) : 1.0;
            scales.push_back(possible > 0.0 ? float(1.0 / (possible * std::sqrt(visible))) : 0.0f);
        }
        picker.set_scales(std::move(scales));
    }
}

}  // namespace frazil
