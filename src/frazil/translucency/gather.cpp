#include <bit>
#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/translucency/gather_kernel.h"
#include "frazil/translucency/opening_rule.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

constexpr std::size_t kBlockStep = 16;
constexpr float kWidestBlock = 4.0f;  // in mean free paths, beyond kBlockStep shading points
// Of a cluster's largest squared radius, what a single footprint may have before it is cut. Coverage on a plane is the
// same within 3e-4 from 0.05 to 0.6, at a seventh of the time.
constexpr float kDiscShare = 0.6f;

float squared_distance(const Box3f& box, const V3f& p) {
    float q = 0.0f;
    for (int i = 0; i < 3; ++i) {
        const float d = std::max(0.0f, std::max(box.min[i] - p[i], p[i] - box.max[i]));
        q += d * d;
    }
    return q;
}

// Chooses the clusters and points that stand for the surface as seen from a block of shading points.
struct Cut {
    const PointTree::Impl& tree;
    const OpeningRule* rule;
    bool has_footprints;
    SourceList list;
    std::vector<std::uint32_t> stack;
    std::vector<V2f> leans;  // of each group's power in the cell that is being cut

    const PointClusters& clusters() const { return *tree.clusters; }

    // One group's power of the last source, and how far its centre lies from that of the area.
    void add_power(const float* power, float scale, const V3f& offset) {
        Source& source = list.sources.back();
        GroupPower& to = list.powers.emplace_back();
        for (int c = 0; c < 3; ++c) {
            to.power[c] = power[c] * scale;
            source.power[c] += std::abs(to.power[c]);
        }
        to.offset = {2.0f * offset.x, 2.0f * offset.y, 2.0f * offset.z};
    }

    void add_cluster(std::uint32_t index) {
        const TreeNode& node = clusters().nodes[index];
        const NodeArea& area = clusters().areas_of_nodes[index];
        const float scale = has_footprints && node.trace > 0.0f ? 1.0f + 2.0f * node.footprint / node.trace : 1.0f;
        Source& source = list.sources.emplace_back();
        source.center = {node.center.x, node.center.y, node.center.z};
        for (int i = 0; i < 6; ++i) source.covariance[i] = area.covariance[i] * scale;
        source.trace = node.trace * scale;
        source.area = area.area;
        const float reach = lean_reach(node);
        for (std::size_t g = 0; g < tree.groups; ++g) {
            add_power(&tree.node_powers[3 * (index * tree.groups + g)], 1.0f, tree.node_power_offset(index, g, reach));
        }
    }

    // A part of a point's cell about `center`: `share` of its area. Its powers are for the caller to add.
    void add_part(std::uint32_t p, const PointCell& cell, const V3f& center, float share, float largest_squared) {
        const float squared = 2.0f * cell.trace * share;
        // Of a part that stays too large for its second moments, those of the largest that they hold for.
        float v = has_footprints ? share : 0.0f;
        if (squared > largest_squared && has_footprints) v *= largest_squared / squared;
        const auto& c = cell.covariance;
        list.sources.push_back({{center.x, center.y, center.z},
                                {v * c[0], v * c[1], v * c[2], 2.0f * v * c[3], 2.0f * v * c[4], 2.0f * v * c[5]},
                                v * cell.trace,
                                clusters().areas[p] * share,
                                {0.0f, 0.0f, 0.0f}});
    }

    // A cell in one piece.
    void add_whole(std::uint32_t p, const PointCell& cell, float largest_squared) {
        add_part(p, cell, clusters().positions[p], 1.0f, largest_squared);
        for (std::size_t g = 0; g < tree.groups; ++g) {
            const V3f offset = has_footprints ? tree.power_offset(p, g, lean_reach(cell.trace)) : V3f(0.0f);
            add_power(&tree.irradiance[p * tree.groups + g].x, clusters().areas[p], offset);
        }
    }

    // A cell that is large against the kernel is cut into seven parts of equal area with the same second moments together.
    void add_split(std::uint32_t p, const PointCell& cell, const CellFrame& frame, const V2f& z, float share,
                   float largest_squared) {
        if (2.0f * cell.trace * share <= largest_squared || share < 1e-3f) {
            const V3f center = clusters().positions[p] + frame.axes[0] * z.x + frame.axes[1] * z.y;
            add_part(p, cell, center, share, largest_squared);
            for (std::size_t g = 0; g < tree.groups; ++g) {
                const V2f& lean = leans[g];
                const float weight = power_at(lean, z);
                // The centre of power within the part.
                const float within = weight > 0.25f ? share / weight : 0.0f;
                add_power(&tree.irradiance[p * tree.groups + g].x, clusters().areas[p] * share * weight,
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

    void add_points(const TreeNode& leaf, const Box3f& box) {
        for (std::uint32_t p = leaf.first; p < leaf.first + leaf.size(); ++p) {
            const PointCell cell(clusters(), p);
            if (!has_footprints) {
                add_whole(p, cell, 0.0f);
                continue;
            }
            // From the cell's rim: what stands on a cell is nearest to its middle parts.
            const float squared = 2.0f * cell.trace;
            const float distance =
                std::max(0.0f, std::sqrt(squared_distance(box, clusters().positions[p])) - std::sqrt(squared));
            const float largest = kDiscShare * rule->largest_squared(distance * distance);
            if (squared <= largest) {
                add_whole(p, cell, largest);
                continue;
            }
            const CellFrame frame(clusters(), p, cell);
            leans.clear();
            for (std::size_t g = 0; g < tree.groups; ++g) {
                leans.push_back(frame.lean_of(tree.power_offset(p, g, lean_reach(cell.trace))));
            }
            add_split(p, cell, frame, V2f(0.0f), 1.0f, largest);
        }
    }

    void build(const Box3f& box) {
        list.clear();
        stack.assign(1, 0);
        while (!stack.empty()) {
            const std::uint32_t index = stack.back();
            stack.pop_back();
            const TreeNode& node = clusters().nodes[index];
            const float q = squared_distance(box, node.center);
            const float beyond = node.radius + tree.kernel->table.reach;
            if (q > beyond * beyond) continue;
            const float squared = node.radius * node.radius + (has_footprints ? 4.0f * node.footprint : 0.0f);
            if (squared <= rule->largest_squared(q) && (!node.is_leaf() || node.size() > 1)) {
                add_cluster(index);
            } else if (node.is_leaf()) {
                add_points(node, box);
            } else {
                for (std::uint32_t k = node.size(); k-- > 0;) stack.push_back(node.first + k);
            }
        }
    }
};

// Which level of darkness a block needs: the darkest channel and shading point decide, all groups' light together.
std::size_t darkness_level(const PointTree::Impl& tree, const BlockSums& block) {
    float darkest = 1.0f;
    for (std::size_t c = 0; c < 3; ++c) {
        float mean = 0.0f;
        for (std::size_t g = 0; g < tree.groups; ++g) mean += std::abs(tree.node_powers[3 * g + c]);
        if (!(mean > 0.0f)) continue;
        mean /= tree.clusters->areas_of_nodes[0].area;
        for (std::size_t lane = 0; lane < block.lanes; ++lane) {
            const float expected = mean * block.coverage[c][lane], arrives = std::abs(block.unshaded[c][lane]);
            if (arrives < darkest * expected) darkest = arrives / expected;
        }
    }
    std::size_t level = 0;
    while (level + 1 < kDarkness.size() && darkest < 2.0 * kDarkness[level + 1]) ++level;
    return level;
}

// The shading points that the tree reaches, along a Morton curve; to the rest belongs exactly nothing.
std::vector<KeyedIndex> sorted_positions(const PointTree::Impl& tree, const V3f* positions, std::size_t count) {
    constexpr std::size_t grain = 8192;
    constexpr int kBits = 33, kDropped = 3 * kMortonBits - kBits;
    constexpr std::uint64_t kOutside = std::uint64_t(1) << kBits;
    std::vector<KeyedIndex> keys(count), scratch;
    const Box3f& bounds = tree.clusters->bounds;
    const MortonGrid grid(bounds);
    const float reach = tree.kernel->table.reach + bounds.size().length() * 1e-3f;
    std::vector<std::size_t> outside((count + grain - 1) / grain, 0);
    parallel_for(count, grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            if (!is_finite(positions[i])) {
                throw ValueError(str("PointTree: positions must be finite, got NaN or infinity at row ", i, "."));
            }
            const bool is_outside = squared_distance(bounds, positions[i]) > reach * reach;
            keys[i] = {is_outside ? kOutside : grid.code(positions[i]) >> kDropped, static_cast<std::uint32_t>(i)};
            outside[begin / grain] += is_outside;
        }
    });
    radix_sort(keys, kBits + 1, scratch);
    std::size_t inside = count;
    for (const std::size_t n : outside) inside -= n;
    keys.resize(inside);
    return keys;
}

void copy_exitance(const BlockSums& block, std::size_t lane, std::size_t groups, Rgb* to) {
    for (std::size_t g = 0; g < groups; ++g) {
        for (std::size_t c = 0; c < 3; ++c) to[g][c] = block.exitance[(3 * g + c) * kBlockLanes + lane];
    }
}

}  // namespace

Gathered PointTree::gather(const V3f* positions, std::size_t count, const GatherOptions& options) const {
    if (!(options.tolerance > 0.0f && std::isfinite(options.tolerance))) {
        throw ValueError(str("PointTree: tolerance must be > 0, got ", options.tolerance, ". 0.01 is the default."));
    }
    const Impl& tree = *impl_;
    const TreeKernel& kernel = *tree.kernel;
    Gathered out;
    out.groups = tree.groups;
    out.exitance.assign(count * tree.groups, Rgb(0.0f));
    out.coverage.assign(count, Rgb(0.0f));
    if (options.ramp_layers && kernel.ramp.is_empty()) {
        throw ValueError("PointTree: ramp_layers must be off without a ramp, got on. Give the tree a ramp.");
    }
    if (options.ramp_layers) out.knots = kernel.ramp.distances.size();
    out.layers.assign(count * out.knots * tree.groups, Rgb(0.0f));
    if (count == 0) return out;
    const std::vector<KeyedIndex> order = sorted_positions(tree, positions, count);
    if (tree.clusters->nodes.empty()) return out;

    const std::vector<OpeningRule>& rules = kernel.rules(options.tolerance);
    const RampHinges ramp = hinges_of(kernel.ramp, kernel.ramp_scale);
    std::vector<RampHinges> hats;
    for (std::size_t k = 0; k < out.knots; ++k) hats.push_back(hinges_of(hat(kernel.ramp, k), Rgb(1.0f)));
    const auto widest = static_cast<float>(kWidestBlock * shortest_mean_free_path(kernel.profile));
    parallel_for(order.size(), 8 * kBlockLanes, [&](std::size_t chunk_begin, std::size_t chunk_end) {
        Cut cut{tree, rules.data(), options.estimator == Estimator::noise_free, {}, {}, {}};
        BlockSums block;
        std::size_t level = 0;
        for (std::size_t begin = chunk_begin; begin < chunk_end; begin += block.lanes) {
            // A block is up to kBlockLanes shading points that lie near each other.
            const std::size_t most = std::min(kBlockLanes, chunk_end - begin);
            Box3f box;
            for (block.lanes = 0; block.lanes < most;) {
                const std::size_t next = std::min(most, block.lanes + kBlockStep);
                Box3f wider = box;
                for (std::size_t lane = block.lanes; lane < next; ++lane) {
                    const V3f& p = positions[order[begin + lane].index];
                    block.x[lane] = p.x;
                    block.y[lane] = p.y;
                    block.z[lane] = p.z;
                    wider.extendBy(p);
                }
                if (block.lanes > 0 && wider.size().length() > widest) break;
                box = wider;
                block.lanes = next;
            }
            for (std::size_t lane = block.lanes; lane < kBlockLanes; ++lane) {
                block.x[lane] = block.x[0];
                block.y[lane] = block.y[0];
                block.z[lane] = block.z[0];
            }
            // Gather by the rule of the block before; again where it proves too lax here.
            for (;;) {
                block.clear(tree.groups);
                cut.rule = &rules[level];
                cut.build(box);
                add_sources(kernel.table, ramp, cut.list, tree.groups, block);
                const std::size_t wanted = darkness_level(tree, block);
                const bool is_enough = wanted <= level;
                level = wanted;
                if (is_enough) break;
            }
            for (std::size_t lane = 0; lane < block.lanes; ++lane) {
                const std::size_t to = order[begin + lane].index;
                for (int c = 0; c < 3; ++c) out.coverage[to][c] = block.coverage[c][lane];
                copy_exitance(block, lane, tree.groups, &out.exitance[to * tree.groups]);
            }
            // The same cut once more for every knot of the ramp.
            for (std::size_t k = 0; k < hats.size(); ++k) {
                block.clear(tree.groups);
                add_sources(kernel.table, hats[k], cut.list, tree.groups, block);
                for (std::size_t lane = 0; lane < block.lanes; ++lane) {
                    const std::size_t to = order[begin + lane].index;
                    copy_exitance(block, lane, tree.groups, &out.layers[(to * out.knots + k) * tree.groups]);
                }
            }
        }
    });
    return out;
}

}  // namespace frazil
