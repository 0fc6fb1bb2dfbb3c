#include "frazil/translucency/block_sources.h"

#include <cmath>

namespace frazil {
namespace {

// Of a cluster's largest squared radius, what a single footprint may have before it is cut. Coverage on a plane is the
// same within 3e-4 from 0.05 to 0.6, at a seventh of the time.
constexpr float kDiscShare = 0.6f;
// In mean free paths, how far parts of a cell may stand off the surface: farther, energy is lost.
constexpr double kFarthestOff = 0.05;

// Power of `area` that is lit so, centred `offset` from the centroid.
GroupPower group_power(const Rgb& irradiance, float area, const V3f& offset) {
    return {{irradiance.x * area, irradiance.y * area, irradiance.z * area},
            {2.0f * offset.x, 2.0f * offset.y, 2.0f * offset.z}};
}

}  // namespace

BlockSources::BlockSources(const PointTree::Impl& tree, const OpeningRule& rule, bool has_footprints)
    : tree_(tree),
      rule_(rule),
      has_footprints_(has_footprints),
      farthest_off_(static_cast<float>(kFarthestOff * shortest_mean_free_path(tree.kernel->profile))) {}

void BlockSources::add_cluster(std::uint32_t index) {
    const TreeNode& node = clusters().nodes[index];
    const NodeArea& area = clusters().areas_of_nodes[index];
    const float scale = has_footprints_ && node.trace > 0.0f ? 1.0f + 2.0f * node.footprint / node.trace : 1.0f;
    Source& source = list_.sources.emplace_back();
    source.center = {node.center.x, node.center.y, node.center.z};
    for (int i = 0; i < 6; ++i) source.covariance[i] = area.covariance[i] * scale;
    source.trace = node.trace * scale;
    source.area = area.area;
    list_.powers.push_back(&tree_.node_powers[index * tree_.groups]);
}

// A point without extent.
void BlockSources::add_point(std::uint32_t p) {
    const V3f& center = clusters().positions[p];
    const float area = clusters().areas[p];
    list_.sources.push_back({{center.x, center.y, center.z}, {}, 0.0f, area});
    GroupPower* to = list_.add_own(tree_.groups);
    for (std::size_t g = 0; g < tree_.groups; ++g) {
        to[g] = group_power(tree_.irradiance[p * tree_.groups + g], area, V3f(0.0f));
    }
}

// A part of a point's cell about `center`: `share` of its area. Its powers are for the caller to add.
void BlockSources::add_part(std::uint32_t p, const PointCell& cell, V3f center, float share, float largest_squared) {
    const float squared = 2.0f * cell.trace * share;
    // Of a part that stays too large for its second moments, those of the largest that they hold for. By the rest it stands
    // off the surface, a little: the mean of 1/r over a disc of radius R is 2/R, as far from its middle as R/2.
    float v = share;
    if (squared > largest_squared) {
        v *= largest_squared / squared;
        center += footprint_normal(clusters().footprints[p]) *
                  std::min(farthest_off_, std::sqrt(0.25f * (squared - largest_squared)));
    }
    const auto& c = cell.covariance;
    list_.sources.push_back({{center.x, center.y, center.z},
                             {v * c[0], v * c[1], v * c[2], 2.0f * v * c[3], 2.0f * v * c[4], 2.0f * v * c[5]},
                             v * cell.trace,
                             clusters().areas[p] * share});
}

// A cell in one piece.
void BlockSources::add_whole(std::uint32_t p, const PointCell& cell, float largest_squared) {
    const float area = clusters().areas[p];
    add_part(p, cell, clusters().positions[p], 1.0f, largest_squared);
    GroupPower* to = list_.add_own(tree_.groups);
    for (std::size_t g = 0; g < tree_.groups; ++g) {
        const V3f offset = tree_.power_offset(p, g, lean_reach(cell.trace));
        to[g] = group_power(tree_.irradiance[p * tree_.groups + g], area, offset);
    }
}

// A cell that is large against the kernel is cut into seven parts of equal area with the same second moments together.
void BlockSources::add_split(std::uint32_t p, const PointCell& cell, const CellFrame& frame, const V2f& z, float share,
                             float largest_squared) {
    if (2.0f * cell.trace * share <= largest_squared || share < 1e-3f) {
        const float area = clusters().areas[p];
        const V3f center = clusters().positions[p] + frame.axes[0] * z.x + frame.axes[1] * z.y;
        add_part(p, cell, center, share, largest_squared);
        GroupPower* to = list_.add_own(tree_.groups);
        for (std::size_t g = 0; g < tree_.groups; ++g) {
            const V2f& lean = leans_[g];
            const float weight = power_at(lean, z);
            // The centre of power within the part.
            const float within = weight > 0.25f ? share / weight : 0.0f;
            to[g] = group_power(tree_.irradiance[p * tree_.groups + g], area * share * weight,
                                (frame.axes[0] * lean.x + frame.axes[1] * lean.y) * within);
        }
        return;
    }
    add_split(p, cell, frame, z, share / 7.0f, largest_squared);
    const float reach = std::sqrt(2.0f * share);
    for (int k = 0; k < 6; ++k) {
        const float angle = k * kPi / 3.0f;
        add_split(p, cell, frame, z + V2f(std::cos(angle), std::sin(angle)) * reach, share / 7.0f, largest_squared);
    }
}

void BlockSources::add_points(const TreeNode& leaf, const Box3f& box) {
    for (std::uint32_t p = leaf.first; p < leaf.first + leaf.size(); ++p) {
        if (!has_footprints_) {
            add_point(p);
            continue;
        }
        const PointCell cell(clusters(), p);
        // From the cell's rim: what stands on a cell is nearest to its middle parts.
        const float squared = 2.0f * cell.trace;
        const float distance =
            std::max(0.0f, std::sqrt(squared_distance(box, clusters().positions[p])) - std::sqrt(squared));
        const float largest = kDiscShare * rule_.largest_squared(distance * distance);
        if (squared <= largest) {
            add_whole(p, cell, largest);
            continue;
        }
        const CellFrame frame(clusters(), p, cell);
        leans_.clear();
        for (std::size_t g = 0; g < tree_.groups; ++g) {
            leans_.push_back(frame.lean_of(tree_.power_offset(p, g, lean_reach(cell.trace))));
        }
        add_split(p, cell, frame, V2f(0.0f), 1.0f, largest);
    }
}

}  // namespace frazil
