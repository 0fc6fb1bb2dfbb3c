// The choice of one light among many for one receiver.
// Model: a tree of light bounds [ContyEstevez2018], one for each set of linked objects, and lights from infinity by
//   their power. The choice begins among the nodes of a fixed cut, so that up to kCut lights are weighed one by one.
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
};

// A light of a picker, and what its power is multiplied by (absolute, above 0).
struct PickEntry {
    int light = -1;
    float scale = 1.0f;
};

struct LightPick {
    int light = -1;  // none
    float probability = 0.0f;
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
    LightPick pick(const LightReceiver& receiver, const Weights& weights, float u) const;
    // With what probability pick() gives this light.
    float probability(const LightReceiver& receiver, const Weights& weights, int light) const;

    // Append the lights whose boxes the ray crosses before t_max.
    void find_along(const V3f& origin, const V3f& direction, float t_max, std::vector<int>& lights) const;

    // Append the lights from infinity.
    void append_infinite(std::vector<int>& lights) const {
        for (const Infinite& list : infinite_) lights.insert(lights.end(), list.lights.begin(), list.lights.end());
    }

  private:
    struct Node {
        LightBounds bounds;
        int parent = -1, left = -1, right = -1;  // no children: a leaf
        int light = -1;
        float scale = 1.0f;
        std::uint32_t link = 0;
    };
    // Lights from infinity that share a link set.
    struct Infinite {
        std::uint32_t link = 0;
        std::vector<int> lights;
        std::vector<float> weights;
        float total = 0.0f;
    };
    int build(std::span<PickEntry> entries, std::uint32_t link, int depth);
    float node_importance(int node, const LightReceiver& receiver) const;
    // The share of a node's left child.
    float left_share(const Node& node, const LightReceiver& receiver) const;

    const std::vector<WorldLight>& lights_;
    const LinkTable& links_;
    std::vector<Node> nodes_;
    std::vector<int> roots_, cut_;    // of nodes_
    std::vector<int> slot_of_node_;   // in the cut; -1
    std::vector<int> leaf_of_light_;  // -1 where the picker lacks the light
    std::vector<Infinite> infinite_;  // slots after the cut's
    std::vector<int> infinite_of_light_;
};

}  // namespace frazil
