#include "frazil/lighting/light_picker.h"

#include <algorithm>
#include <map>

namespace frazil {
namespace {

constexpr int kBins = 12;
// So many lights are weighed one by one in the choice between two nodes: with few lights a node's estimate is poor, as
// some shine elsewhere.
constexpr int kFew = 16;
constexpr int kMaxDepth = 48;  // beyond it lights are halved by number

V3f center_of(const Box3f& box) {
    return (box.min + box.max) * 0.5f;
}

bool crosses(const Box3f& box, const V3f& origin, const V3f& inverse, float t_max) {
    float near = 0.0f, far = t_max;
    for (int axis = 0; axis < 3; ++axis) {
        float a = (box.min[axis] - origin[axis]) * inverse[axis], b = (box.max[axis] - origin[axis]) * inverse[axis];
        if (a > b) std::swap(a, b);
        // Comparisons that a NaN (an origin on the slab of a parallel ray) leaves alone.
        if (a > near) near = a;
        if (b < far) far = b;
    }
    return near <= far * 1.0001f + 1e-6f;
}

}  // namespace

LightPicker::LightPicker(const std::vector<WorldLight>& lights, std::span<const PickEntry> entries,
                         const LinkTable& links, std::span<const std::uint32_t> link_of_light)
    : lights_(lights), links_(links), leaf_of_light_(lights.size(), -1), infinite_of_light_(lights.size(), -1) {
    // One tree for each link set.
    std::map<std::uint32_t, std::vector<PickEntry>> finite;
    for (const PickEntry& entry : entries) {
        const WorldLight& light = lights[std::size_t(entry.light)];
        const std::uint32_t link = link_of_light[std::size_t(entry.light)];
        if (light.is_finite()) {
            if (light.bounds().power > 0.0f) finite[link].push_back(entry);
        } else if (light.importance(V3f(0.0f), V3f(0.0f)) * entry.scale > 0.0f) {
            infinite_of_light_[std::size_t(entry.light)] = int(infinite_.size());
            infinite_.push_back({entry.light, entry.scale, link});
        }
    }
    for (auto& [link, list] : finite) {
        nodes_.reserve(nodes_.size() + 2 * list.size());
        roots_.push_back(build(list, link, 0));
    }

    // The cut: open the costliest node until it is full.
    cut_ = roots_;
    while (cut_.size() < kCut) {
        int best = -1;
        float most = -1.0f;
        for (std::size_t i = 0; i < cut_.size(); ++i) {
            const Node& node = nodes_[std::size_t(cut_[i])];
            const float cost = node.left < 0 ? -1.0f : tree_cost(node.bounds);
            if (cost > most) best = int(i), most = cost;
        }
        if (best < 0) break;
        const Node& node = nodes_[std::size_t(cut_[std::size_t(best)])];
        cut_[std::size_t(best)] = node.left;
        cut_.push_back(node.right);
    }
    slot_of_node_.assign(nodes_.size(), -1);
    for (std::size_t i = 0; i < cut_.size(); ++i) slot_of_node_[std::size_t(cut_[i])] = int(i);
}

int LightPicker::build(std::span<PickEntry> entries, std::uint32_t link, int depth) {
    const int index = int(nodes_.size());
    nodes_.emplace_back();
    nodes_[std::size_t(index)].link = link;
    const auto bounds_of = [&](const PickEntry& entry) {
        return scaled(lights_[std::size_t(entry.light)].bounds(), entry.scale);
    };
    if (entries.size() == 1) {
        Node& leaf = nodes_[std::size_t(index)];
        leaf.bounds = bounds_of(entries[0]);
        leaf.light = entries[0].light;
        leaf.scale = entries[0].scale;
        leaf_of_light_[std::size_t(leaf.light)] = index;
        return index;
    }

    // Split where the two halves cost least, over bins of each axis [ContyEstevez2018].
    Box3f centers;
    for (const PickEntry& entry : entries) centers.extendBy(center_of(bounds_of(entry).box));
    const V3f size = centers.max - centers.min;
    int best_axis = -1, best_bin = 0;
    float best_cost = std::numeric_limits<float>::infinity();
    const auto bin_of = [&](const PickEntry& entry, int axis) {
        const float x =
            (center_of(lights_[std::size_t(entry.light)].bounds().box)[axis] - centers.min[axis]) / size[axis];
        return std::clamp(int(x * kBins), 0, kBins - 1);
    };
    for (int axis = 0; axis < 3 && depth < kMaxDepth; ++axis) {
        if (!(size[axis] > 0.0f)) continue;
        LightBounds bins[kBins], below[kBins];
        for (const PickEntry& entry : entries) {
            LightBounds& bin = bins[bin_of(entry, axis)];
            bin = merged(bin, bounds_of(entry));
        }
        LightBounds sum;
        for (int i = 0; i < kBins; ++i) below[i] = sum = merged(sum, bins[i]);
        LightBounds above;
        for (int i = kBins - 1; i > 0; --i) {
            above = merged(above, bins[i]);
            if (above.power == 0.0f || below[i - 1].power == 0.0f) continue;
            // Long boxes are split across.
            const float stretch = max_component(size) / size[axis];
            const float cost = stretch * (tree_cost(below[i - 1]) + tree_cost(above));
            if (cost < best_cost) best_cost = cost, best_axis = axis, best_bin = i;
        }
    }
    std::size_t middle = entries.size() / 2;
    if (best_axis >= 0) {
        const auto split = std::stable_partition(entries.begin(), entries.end(),
                                                 [&](const PickEntry& e) { return bin_of(e, best_axis) < best_bin; });
        middle = std::size_t(split - entries.begin());
    }
    const int left = build(entries.first(middle), link, depth + 1);
    const int right = build(entries.subspan(middle), link, depth + 1);
    nodes_[std::size_t(left)].parent = nodes_[std::size_t(right)].parent = index;
    Node& node = nodes_[std::size_t(index)];
    node.leaves = int(entries.size());
    node.left = left, node.right = right;
    node.bounds = merged(nodes_[std::size_t(left)].bounds, nodes_[std::size_t(right)].bounds);
    return index;
}

float LightPicker::node_importance(int index, const LightReceiver& receiver) const {
    const Node& node = nodes_[std::size_t(index)];
    if (node.light < 0) return importance(node.bounds, receiver.position, receiver.normal);
    return node.scale * lights_[std::size_t(node.light)].importance(receiver.position, receiver.normal);
}

float LightPicker::close_importance(int index, const LightReceiver& receiver) const {
    const Node& node = nodes_[std::size_t(index)];
    if (node.leaves == 1 || node.leaves > kFew) return node_importance(index, receiver);
    return close_importance(node.left, receiver) + close_importance(node.right, receiver);
}

float LightPicker::left_share(const Node& node, const LightReceiver& receiver) const {
    const float left = close_importance(node.left, receiver), right = close_importance(node.right, receiver);
    return left + right > 0.0f ? left / (left + right) : 0.5f;
}

void LightPicker::weigh(const LightReceiver& receiver, Weights& weights) const {
    weights.values.clear();
    weights.total = 0.0f;
    const auto add = [&](std::uint32_t link, auto&& weight) {
        weights.values.push_back(links_.has(link, receiver.object) ? weight() : 0.0f);
        weights.total += weights.values.back();
    };
    for (const int node : cut_) {
        add(nodes_[std::size_t(node)].link, [&] { return node_importance(node, receiver); });
    }
    for (const Infinite& item : infinite_) {
        add(item.link, [&] {
            return item.scale * lights_[std::size_t(item.light)].importance(receiver.position, receiver.normal);
        });
    }
}

LightPick LightPicker::pick_in_slot(const LightReceiver& receiver, std::size_t slot, float left) const {
    if (slot >= cut_.size()) return {infinite_[slot - cut_.size()].light, 1.0f};
    int node = cut_[slot];
    float probability = 1.0f;
    while (nodes_[std::size_t(node)].left >= 0) {
        const Node& parent = nodes_[std::size_t(node)];
        const float share = left_share(parent, receiver);
        const bool is_left = left < share;
        node = is_left ? parent.left : parent.right;
        left = is_left ? left / share : (left - share) / (1.0f - share);
        left = std::clamp(left, 0.0f, kBelowOne);
        probability *= is_left ? share : 1.0f - share;
    }
    return {nodes_[std::size_t(node)].light, probability};
}

LightPick LightPicker::pick_one(const LightReceiver& receiver, const Weights& weights, float u) const {
    if (!(weights.total > 0.0f)) return {};
    float left = u * weights.total;
    int slot = -1;
    for (std::size_t i = 0; i < weights.values.size(); ++i) {
        if (weights.values[i] == 0.0f) continue;
        slot = int(i);
        if (left < weights.values[i]) break;
        left -= weights.values[i];
    }
    const float weight = weights.values[std::size_t(slot)];
    LightPick pick = pick_in_slot(receiver, std::size_t(slot), std::clamp(left / weight, 0.0f, kBelowOne));
    pick.probability *= weight / weights.total;
    return pick;
}

void LightPicker::pick(const LightReceiver& receiver, const Weights& weights, float u,
                       std::vector<LightPick>& picks) const {
    if (!(receiver.picks > 1.0f)) {
        if (const LightPick pick = pick_one(receiver, weights, u); pick.light >= 0) picks.push_back(pick);
        return;
    }
    if (!(weights.total > 0.0f)) return;
    // A comb with teeth at u, u + 1, ... over the slots' shares laid end to end; none is longer than 1.
    double tooth = double(u);
    for (std::size_t slot = 0; slot < weights.values.size(); ++slot) {
        const double share = double(slot_share(receiver, weights, slot));
        if (tooth < share) {
            LightPick pick = pick_in_slot(receiver, slot, std::min(float(tooth / share), kBelowOne));
            pick.probability *= float(share);
            picks.push_back(pick);
            tooth += 1.0;
        }
        tooth -= share;
    }
}

float LightPicker::slot_share(const LightReceiver& receiver, const Weights& weights, std::size_t slot) {
    return std::min(1.0f, receiver.picks * weights.values[slot] / weights.total);
}

float LightPicker::probability(const LightReceiver& receiver, const Weights& weights, int light) const {
    if (!(weights.total > 0.0f)) return 0.0f;
    if (const int infinite = infinite_of_light_[std::size_t(light)]; infinite >= 0) {
        return slot_share(receiver, weights, cut_.size() + std::size_t(infinite));
    }
    int node = leaf_of_light_[std::size_t(light)];
    if (node < 0) return 0.0f;
    float probability = 1.0f;
    while (slot_of_node_[std::size_t(node)] < 0) {
        const int parent = nodes_[std::size_t(node)].parent;
        const float share = left_share(nodes_[std::size_t(parent)], receiver);
        probability *= nodes_[std::size_t(parent)].left == node ? share : 1.0f - share;
        node = parent;
    }
    return probability * slot_share(receiver, weights, std::size_t(slot_of_node_[std::size_t(node)]));
}

void LightPicker::find_along(const V3f& origin, const V3f& direction, float t_max, std::vector<int>& lights) const {
    const V3f inverse(1.0f / direction.x, 1.0f / direction.y, 1.0f / direction.z);
    thread_local std::vector<int> open;
    open.assign(roots_.begin(), roots_.end());
    while (!open.empty()) {
        const Node& node = nodes_[std::size_t(open.back())];
        open.pop_back();
        if (!crosses(node.bounds.box, origin, inverse, t_max)) continue;
        if (node.left < 0) {
            lights.push_back(node.light);
        } else {
            open.push_back(node.left);
            open.push_back(node.right);
        }
    }
}

}  // namespace frazil
