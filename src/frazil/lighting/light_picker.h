// The choice of one light among many for one receiver.
// Model: a tree of light bounds [ContyEstevez2018], one for each set of linked objects. The choice begins among the nodes
//   of a fixed cut, so that up to kCut lights are weighed one by one; lights from infinity always are, and below the cut
//   the last sixteen. Several choices for one receiver are systematic: what has its share of the weight or more is chosen
//   for certain.
// Units: probabilities.
// Valid: thread-safe after construction; the same for any number of threads. Every light that can reach a receiver that
//   it is linked to has a probability above 0; other objects' lights have none. One float chooses: probabilities below
//   1e-6 are met unevenly.
// Not: visibility, nor what the surface makes of the light.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/light_bounds.h"
#include "frazil/lighting/linking.h"
#include "frazil/lighting/world_light.h"

namespace frazil {

// Who asks for light.
struct LightReceiver {
    V3f position = V3f(0.0f);
    V3f normal = V3f(0.0f);  // unit length, on the side that receives; zero = from all sides
    std::uint32_t object = kNoObject;
    float picks = 1.0f;  // how many lights it asks for at a time, about; >= 1
};

// A light of a picker, and what its power is multiplied by (absolute, above 0).
struct PickEntry {
    int light = -1;
    float scale = 1.0f;
};

struct LightPick {
    int light = -1;            // none
    float probability = 0.0f;  // of being among those that are chosen at a time
};

class LightPicker {
  public:
    static constexpr std::size_t kCut = 32;

    // Lights and table must outlive the picker; link_of_light[i] is light i's set in the table.
    LightPicker(const std::vector<WorldLight>& lights, std::span<const PickEntry> entries, const LinkTable& links,
                std::span<const std::uint32_t> link_of_light);

    bool is_empty() const { return nodes_.empty() && infinite_.empty(); }

    // The first step of the choice, shared by all choices for one receiver.
    struct Weights {
        std::vector<float> values;  // by slot of the cut
        float total = 0.0f;
    };
    void weigh(const LightReceiver& receiver, Weights& weights) const;
    // Append as many lights as the receiver asks for, or fewer; none of them twice.
    void pick(const LightReceiver& receiver, const Weights& weights, float u, std::vector<LightPick>& picks) const;
    // One light, whatever the receiver asks for, as pick() gives a receiver that asks for one.
    LightPick pick_one(const LightReceiver& receiver, const Weights& weights, float u) const;
    // With what probability pick() gives this light.
    float probability(const LightReceiver& receiver, const Weights& weights, int light) const;

    // Append the lights whose boxes the ray crosses before t_max.
    void find_along(const V3f& origin, const V3f& direction, float t_max, std::vector<int>& lights) const;

    // Append the lights from infinity.
    void append_infinite(std::vector<int>& lights) const {
        for (const Infinite& item : infinite_) lights.push_back(item.light);
    }

  private:
    struct Node {
        LightBounds bounds;
        int parent = -1, left = -1, right = -1;  // no children: a leaf
        int light = -1;
        int leaves = 1;  // lights of the node
        float scale = 1.0f;
        std::uint32_t link = 0;
    };
    struct Infinite {
        int light = -1;
        float scale = 1.0f;
        std::uint32_t link = 0;
    };
    int build(std::span<PickEntry> entries, std::uint32_t link, int depth);
    float node_importance(int node, const LightReceiver& receiver) const;
    // The same, light by light where the node has few.
    float close_importance(int node, const LightReceiver& receiver) const;
    // The share of a node's left child.
    float left_share(const Node& node, const LightReceiver& receiver) const;
    // The probability that a slot is chosen.
    static float slot_share(const LightReceiver& receiver, const Weights& weights, std::size_t slot);
    // The light of a slot; `left` in [0, 1) chooses among those of its node.
    LightPick pick_in_slot(const LightReceiver& receiver, std::size_t slot, float left) const;

    const std::vector<WorldLight>& lights_;
    const LinkTable& links_;
    std::vector<Node> nodes_;
    std::vector<int> roots_, cut_;        // of nodes_
    std::vector<int> slot_of_node_;       // in the cut; -1
    std::vector<int> leaf_of_light_;      // -1 where the picker lacks the light
    std::vector<Infinite> infinite_;      // slots after the cut's
    std::vector<int> infinite_of_light_;  // index, -1
};

}  // namespace frazil
