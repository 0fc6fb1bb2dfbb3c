#include <bit>
#include <cmath>
#include <span>

#include "frazil/base/error.h"
#include "frazil/base/large_pages.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/translucency/gather_kernel.h"
#include "frazil/translucency/local_expansion.h"
#include "frazil/translucency/opening_rule.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

constexpr std::size_t kBlockStep = 16;
constexpr float kWidestBlock = 4.0f;  // in mean free paths, beyond kBlockStep shading points
// Shading points whose blocks one thread chooses, each by the rule of the one before: of many, more.
constexpr std::size_t kChunk = 2048, kLargestChunk = 8192, kChunks = 64;
constexpr std::size_t kBlockPoints = 128;  // at most
// Half a block's diagonal that a source is smooth across, over the radius of a cluster that may stand for it, squared.
constexpr float kSmooth = 1.0f;
constexpr float kNothingIsSmooth = std::numeric_limits<float>::max();
// Of a cluster's largest squared radius, what a single footprint may have before it is cut. Coverage on a plane is the
// same within 3e-4 from 0.05 to 0.6, at a seventh of the time.
constexpr float kDiscShare = 0.6f;
constexpr std::size_t kCacheLine = 64;

float squared_distance(const Box3f& box, const V3f& p) {
    float q = 0.0f;
    for (int i = 0; i < 3; ++i) {
        const float d = std::max(0.0f, std::max(box.min[i] - p[i], p[i] - box.max[i]));
        q += d * d;
    }
    return q;
}

// Power of `area` that is lit so, centred `offset` from the centroid.
GroupPower group_power(const Rgb& irradiance, float area, const V3f& offset) {
    return {{irradiance.x * area, irradiance.y * area, irradiance.z * area},
            {2.0f * offset.x, 2.0f * offset.y, 2.0f * offset.z}};
}

// Chooses the clusters and points that stand for the surface as seen from a block of shading points.
struct Cut {
    // A node that stands for its points, or a leaf that its points stand for.
    struct Pick {
        std::uint32_t node;
        bool is_cluster, is_far;
    };

    const PointTree::Impl& tree;
    const OpeningRule* rule;
    bool has_footprints;
    float smooth_squared =
        0.0f;  // sources that clusters of this squared radius may stand for are smooth across the block
    SourceList near{}, far{};
    SourceList* list = nullptr;  // where sources go just now
    std::vector<std::uint32_t> stack{};
    std::vector<Pick> picks{};
    std::vector<V2f> leans{};  // of each group's power in the cell that is being cut

    const PointClusters& clusters() const { return *tree.clusters; }

    // The magnitude of a source's light, which the rule needs where a ramp hides it.
    void add_magnitude(const GroupPower* powers) {
        if (tree.kernel->ramp.is_empty()) return;
        for (std::size_t g = 0; g < tree.groups; ++g) {
            for (int c = 0; c < 3; ++c) list->sources.back().power[c] += std::abs(powers[g].power[c]);
        }
    }

    void add_cluster(std::uint32_t index) {
        const TreeNode& node = clusters().nodes[index];
        const NodeArea& area = clusters().areas_of_nodes[index];
        const float scale = has_footprints && node.trace > 0.0f ? 1.0f + 2.0f * node.footprint / node.trace : 1.0f;
        Source& source = list->sources.emplace_back();
        source.center = {node.center.x, node.center.y, node.center.z};
        for (int i = 0; i < 6; ++i) source.covariance[i] = area.covariance[i] * scale;
        source.trace = node.trace * scale;
        source.area = area.area;
        source.power = {};
        list->powers.push_back(&tree.node_powers[index * tree.groups]);
        add_magnitude(list->powers.back());
    }

    // A part of a point's cell about `center`: `share` of its area. Its powers are for the caller to add.
    void add_part(std::uint32_t p, const PointCell& cell, const V3f& center, float share, float largest_squared) {
        const float squared = 2.0f * cell.trace * share;
        // Of a part that stays too large for its second moments, those of the largest that they hold for.
        float v = has_footprints ? share : 0.0f;
        if (squared > largest_squared && has_footprints) v *= largest_squared / squared;
        const auto& c = cell.covariance;
        list->sources.push_back({{center.x, center.y, center.z},
                                 {v * c[0], v * c[1], v * c[2], 2.0f * v * c[3], 2.0f * v * c[4], 2.0f * v * c[5]},
                                 v * cell.trace,
                                 clusters().areas[p] * share,
                                 {0.0f, 0.0f, 0.0f}});
    }

    // A cell in one piece.
    void add_whole(std::uint32_t p, const PointCell& cell, float largest_squared) {
        add_part(p, cell, clusters().positions[p], 1.0f, largest_squared);
        GroupPower* to = list->add_own(tree.groups);
        for (std::size_t g = 0; g < tree.groups; ++g) {
            const V3f offset = has_footprints ? tree.power_offset(p, g, lean_reach(cell.trace)) : V3f(0.0f);
            to[g] = group_power(tree.irradiance[p * tree.groups + g], clusters().areas[p], offset);
        }
        add_magnitude(to);
    }

    // A cell that is large against the kernel is cut into seven parts of equal area with the same second moments together.
    void add_split(std::uint32_t p, const PointCell& cell, const CellFrame& frame, const V2f& z, float share,
                   float largest_squared) {
        if (2.0f * cell.trace * share <= largest_squared || share < 1e-3f) {
            const V3f center = clusters().positions[p] + frame.axes[0] * z.x + frame.axes[1] * z.y;
            add_part(p, cell, center, share, largest_squared);
            GroupPower* to = list->add_own(tree.groups);
            for (std::size_t g = 0; g < tree.groups; ++g) {
                const V2f& lean = leans[g];
                const float weight = power_at(lean, z);
                // The centre of power within the part.
                const float within = weight > 0.25f ? share / weight : 0.0f;
                to[g] = group_power(tree.irradiance[p * tree.groups + g], clusters().areas[p] * share * weight,
                                    (frame.axes[0] * lean.x + frame.axes[1] * lean.y) * within);
            }
            add_magnitude(to);
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

    // What evaluation reads of a node.
    void prefetch(std::uint32_t index) const {
        const auto touch = [](const auto* first, std::size_t count) {
            const auto* bytes = reinterpret_cast<const char*>(first);
            for (std::size_t at = 0; at < count * sizeof(*first); at += kCacheLine) __builtin_prefetch(bytes + at);
            __builtin_prefetch(bytes + count * sizeof(*first) - 1);
        };
        touch(&clusters().areas_of_nodes[index], 1);
        touch(&tree.node_powers[index * tree.groups], tree.groups);
    }

    void build(const Box3f& box) {
        // Choose first, while what the sources are made of comes from memory.
        picks.clear();
        stack.assign(1, 0);
        while (!stack.empty()) {
            const std::uint32_t index = stack.back();
            stack.pop_back();
            const TreeNode& node = clusters().nodes[index];
            const float q = squared_distance(box, node.center);
            const float beyond = node.radius + tree.kernel->table.reach;
            if (q > beyond * beyond) continue;
            const float squared = node.radius * node.radius + (has_footprints ? 4.0f * node.footprint : 0.0f);
            const float largest = rule->largest_squared(q);
            const bool is_cluster = squared <= largest && (!node.is_leaf() || node.size() > 1);
            if (is_cluster || node.is_leaf()) {
                picks.push_back({index, is_cluster, smooth_squared <= largest});
                if (is_cluster) prefetch(index);
            } else {
                for (std::uint32_t k = node.size(); k-- > 0;) stack.push_back(node.first + k);
            }
        }
        near.clear();
        far.clear();
        for (const Pick& pick : picks) {
            list = pick.is_far ? &far : &near;
            pick.is_cluster ? add_cluster(pick.node) : add_points(clusters().nodes[pick.node], box);
        }
        near.settle(tree.groups);
        far.settle(tree.groups);
    }
};

// Which level of darkness a block needs: the darkest channel and shading point decide, all groups' light together.
std::size_t darkness_level(const PointTree::Impl& tree, const SumRows& sums) {
    float darkest = 1.0f;
    for (std::size_t c = 0; c < 3; ++c) {
        float mean = 0.0f;
        for (std::size_t g = 0; g < tree.groups; ++g) mean += std::abs(tree.node_powers[g].power[c]);
        if (!(mean > 0.0f)) continue;
        mean /= tree.clusters->areas_of_nodes[0].area;
        for (std::size_t i = 0; i < sums.size(); ++i) {
            float arrives = std::abs(sums.unshaded(i)[c]);
            if (tree.kernel->ramp.is_empty()) {
                for (std::size_t g = 0; g < tree.groups; ++g) arrives += std::abs(sums.exitance(i)[3 * g + c]);
            }
            const float expected = mean * sums.coverage(i)[c];
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

// How many of the first shading points, at most `most`, lie in a box whose diagonal is no longer than `widest`, at least a
// step of them; and that box.
std::size_t near_points(std::span<const KeyedIndex> order, const V3f* positions, float widest, std::size_t most,
                        Box3f& box) {
    most = std::min(most, order.size());
    box = {};
    std::size_t count = 0;
    while (count < most) {
        const std::size_t next = std::min(most, count + kBlockStep);
        Box3f wider = box;
        for (std::size_t i = count; i < next; ++i) wider.extendBy(positions[order[i].index]);
        if (count > 0 && wider.size().length() > widest) break;
        box = wider;
        count = next;
    }
    return count;
}

}  // namespace

Gathered PointTree::gather(const V3f* positions, std::size_t count, const GatherOptions& options) const {
    if (!(options.tolerance > 0.0f && std::isfinite(options.tolerance))) {
        throw ValueError(str("PointTree: tolerance must be > 0, got ", options.tolerance, ". ",
                             GatherOptions().tolerance, " is the default."));
    }
    const Impl& tree = *impl_;
    const TreeKernel& kernel = *tree.kernel;
    Gathered out;
    out.groups = tree.groups;
    assign_on_large_pages(out.exitance, count * tree.groups, Rgb(0.0f));
    assign_on_large_pages(out.coverage, count, Rgb(0.0f));
    if (options.ramp_layers && kernel.ramp.is_empty()) {
        throw ValueError("PointTree: ramp_layers must be off without a ramp, got on. Give the tree a ramp.");
    }
    if (options.ramp_layers) out.knots = kernel.ramp.distances.size();
    out.layers.assign(count * out.knots * tree.groups, Rgb(0.0f));
    if (count == 0) return out;
    check_positions(positions, count);
    const std::vector<KeyedIndex> order = sorted_positions(tree, positions, count);
    if (tree.clusters->nodes.empty()) return out;

    const std::vector<OpeningRule>& rules = kernel.rules(options.tolerance);
    const RampHinges ramp = hinges_of(kernel.ramp, kernel.ramp_scale);
    std::vector<RampHinges> hats;
    for (std::size_t k = 0; k < out.knots; ++k) hats.push_back(hinges_of(hat(kernel.ramp, k), Rgb(1.0f)));
    const auto widest = static_cast<float>(kWidestBlock * shortest_mean_free_path(kernel.profile));
    const std::size_t chunk = std::clamp(order.size() / kChunks, kChunk, kLargestChunk);
    parallel_for(order.size(), chunk, [&](std::size_t chunk_begin, std::size_t chunk_end) {
        Cut cut{tree, rules.data(), options.estimator == Estimator::noise_free};
        BlockSums lanes;
        LocalExpansion expansion;
        SumRows sums;
        std::vector<V3f> places;
        std::size_t level = 0;
        for (std::size_t begin = chunk_begin; begin < chunk_end; begin += places.size()) {
            // A block of shading points that lie near each other.
            Box3f box;
            const std::span here(order.data() + begin, chunk_end - begin);
            const std::size_t size = near_points(here, positions, widest, kBlockPoints, box);
            places.clear();
            for (std::size_t i = 0; i < size; ++i) places.push_back(positions[here[i].index]);
            const float half = 0.5f * box.size().length();
            cut.smooth_squared = size > LocalExpansion::kNodes ? half * half * kSmooth : kNothingIsSmooth;
            // What is smooth across the block is summed at a few nodes, the rest at every shading point.
            const auto sum_up = [&](const RampHinges& with) {
                sums.reset(size, tree.groups);
                if (!cut.far.sources.empty()) {
                    lanes.clear(tree.groups);
                    expansion.place(box, lanes);
                    add_sources(kernel.table, with, cut.far, tree.groups, lanes);
                    expansion.fit(lanes, tree.groups);
                    expansion.eval(places, sums);
                }
                for (std::size_t at = 0; at < size; at += kBlockLanes) {
                    if (cut.near.sources.empty()) break;
                    lanes.clear(tree.groups);
                    lanes.place(&places[at], std::min(kBlockLanes, size - at));
                    add_sources(kernel.table, with, cut.near, tree.groups, lanes);
                    sums.add(at, lanes);
                }
            };
            // Gather by the rule of the block before; again where it proves too lax here.
            for (;;) {
                cut.rule = &rules[level];
                cut.build(box);
                sum_up(ramp);
                const std::size_t wanted = darkness_level(tree, sums);
                const bool is_enough = wanted <= level;
                level = wanted;
                if (is_enough) break;
            }
            for (std::size_t i = 0; i < size; ++i) {
                const std::size_t to = here[i].index;
                std::copy_n(sums.exitance(i), 3 * tree.groups, &out.exitance[to * tree.groups].x);
                std::copy_n(sums.coverage(i), 3, &out.coverage[to].x);
            }
            // The same cut once more for every knot of the ramp.
            for (std::size_t k = 0; k < hats.size(); ++k) {
                sum_up(hats[k]);
                for (std::size_t i = 0; i < size; ++i) {
                    Rgb* to = &out.layers[(here[i].index * out.knots + k) * tree.groups];
                    std::copy_n(sums.exitance(i), 3 * tree.groups, &to->x);
                }
            }
        }
    });
    return out;
}

}  // namespace frazil
