#include "frazil/translucency/point_clusters.h"

#include <bit>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"

namespace frazil {
namespace {

constexpr std::uint32_t kLeafPoints = 10;

// By what an extent is shortened so that extent x inverse stays in half's range: cells of slivers, which are long and
// have no area to speak of.
float within_half(float extent, float inverse) {
    constexpr float kMost = 6e4f;
    return extent > kMost / inverse ? kMost / (extent * inverse) : 1.0f;
}

// Octahedral map of a unit vector, 2e-5 rad fine.
std::array<std::int16_t, 2> packed_normal(const V3f& n) {
    const float sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    if (!(sum > 0.0f)) return {0, 0};
    float x = n.x / sum, y = n.y / sum;
    if (n.z < 0.0f) {
        const float folded = (1.0f - std::abs(y)) * (x < 0.0f ? -1.0f : 1.0f);
        y = (1.0f - std::abs(x)) * (y < 0.0f ? -1.0f : 1.0f);
        x = folded;
    }
    return {static_cast<std::int16_t>(std::lround(x * 32767.0f)), static_cast<std::int16_t>(std::lround(y * 32767.0f))};
}

void check_sources(const PointSet& points, const Cells* cells) {
    const std::size_t n = points.size();
    if (n == 0) throw ValueError("PointTree: points must not be empty, got 0 points. Choose a smaller spacing.");
    check_points(points, "PointTree");
    if (cells && cells->size() != n) {
        throw ValueError(str("PointTree: cells must be one per point (", n, "), got ", cells->size(),
                             ". Make them from these points."));
    }
}

// The indices of points that are not left out and their Morton codes, sorted by code.
std::vector<KeyedIndex> sorted_points(const PointSet& points, const std::vector<char>& is_left_out, Box3f& bounds) {
    const std::size_t n = points.size();
    constexpr std::size_t grain = 8192;
    std::vector<std::uint32_t> good((n + grain - 1) / grain, 0);
    std::vector<Box3f> boxes(good.size());
    const auto is_good = [&](std::size_t k) { return is_left_out.empty() || !is_left_out[k]; };
    parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            if (!is_good(k)) continue;
            ++good[begin / grain];
            boxes[begin / grain].extendBy(points.positions[k]);
        }
    });
    std::uint32_t total = 0;
    for (std::size_t chunk = 0; chunk < good.size(); ++chunk) {
        bounds.extendBy(boxes[chunk]);
        const std::uint32_t here = good[chunk];
        good[chunk] = total;
        total += here;
    }
    std::vector<KeyedIndex> keys(total), scratch;
    const MortonGrid grid(bounds);
    parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
        std::uint32_t to = good[begin / grain];
        for (std::size_t k = begin; k < end; ++k) {
            if (is_good(k)) keys[to++] = {grid.code(points.positions[k]), static_cast<std::uint32_t>(k)};
        }
    });
    radix_sort(keys, 3 * kMortonBits, scratch);
    return keys;
}

struct Range {
    std::uint32_t first, count;
};

// Split nodes at the bits of their codes, level by level, and give every node its points. Returns where levels begin.
std::vector<std::uint32_t> split_nodes(const std::vector<KeyedIndex>& keys, std::vector<TreeNode>& nodes,
                                       std::vector<Range>& ranges) {
    std::vector<std::uint32_t> level_begin{0};
    ranges.assign(1, {0, static_cast<std::uint32_t>(keys.size())});
    nodes.resize(1);
    std::vector<std::array<std::uint32_t, 9>> cuts;  // where the children of a node begin and end
    std::vector<std::uint32_t> child_counts;
    for (std::uint32_t begin = 0; begin < nodes.size();) {
        const auto end = static_cast<std::uint32_t>(nodes.size());
        cuts.resize(end - begin);
        child_counts.assign(end - begin, 0);
        parallel_for(end - begin, 256, [&](std::size_t from, std::size_t to) {
            for (std::size_t i = from; i < to; ++i) {
                const std::uint32_t first = ranges[begin + i].first, last = first + ranges[begin + i].count;
                const std::uint64_t differing = keys[first].key ^ keys[last - 1].key;
                if (last - first <= kLeafPoints || differing == 0) continue;
                // Skip the levels on which all points lie in one octant.
                const int shift = 3 * ((63 - std::countl_zero(differing)) / 3);
                auto& cut = cuts[i];
                std::uint32_t children = 0;
                for (std::uint32_t p = first; p < last; ++children) {
                    cut[children] = p;
                    const std::uint64_t octant = keys[p].key >> shift;
                    p = static_cast<std::uint32_t>(
                        std::partition_point(keys.begin() + p, keys.begin() + last,
                                             [&](const KeyedIndex& k) { return k.key >> shift == octant; }) -
                        keys.begin());
                }
                cut[children] = last;
                child_counts[i] = children;
            }
        });
        std::uint32_t next = end;
        for (std::uint32_t i = 0; i < end - begin; ++i) {
            TreeNode& node = nodes[begin + i];
            if (child_counts[i] == 0) {
                node.first = ranges[begin + i].first;
                node.count = ranges[begin + i].count | TreeNode::kLeafBit;
            } else {
                node.first = next;
                node.count = child_counts[i];
                next += child_counts[i];
            }
        }
        nodes.resize(next);
        ranges.resize(next);
        parallel_for(end - begin, 256, [&](std::size_t from, std::size_t to) {
            for (std::size_t i = from; i < to; ++i) {
                for (std::uint32_t k = 0; k < child_counts[i]; ++k) {
                    ranges[nodes[begin + i].first + k] = {cuts[i][k], cuts[i][k + 1] - cuts[i][k]};
                }
            }
        });
        begin = end;
        level_begin.push_back(begin);
    }
    return level_begin;
}

// Sums over the parts of a node, points of a leaf or children, about a place near them.
struct AreaSums {
    double area = 0.0, footprint = 0.0;
    V3d first{0.0};
    std::array<double, 6> second{};

    void add(double weight, const V3d& d) {
        area += weight;
        first += d * weight;
        second[0] += weight * d.x * d.x;
        second[1] += weight * d.y * d.y;
        second[2] += weight * d.z * d.z;
        second[3] += 2.0 * weight * d.x * d.y;
        second[4] += 2.0 * weight * d.x * d.z;
        second[5] += 2.0 * weight * d.y * d.z;
    }
};

void finish(const AreaSums& sums, const V3d& about, TreeNode& node, NodeArea& moments) {
    const double inverse = sums.area > 0.0 ? 1.0 / sums.area : 0.0;
    const V3d mean = sums.first * inverse;
    node.center = V3f(about + mean);
    moments.area = static_cast<float>(sums.area);
    const double product[6] = {mean.x * mean.x,       mean.y * mean.y,       mean.z * mean.z,
                               2.0 * mean.x * mean.y, 2.0 * mean.x * mean.z, 2.0 * mean.y * mean.z};
    for (int i = 0; i < 6; ++i) moments.covariance[i] = static_cast<float>(sums.second[i] * inverse - product[i]);
    node.trace = std::max(0.0f, moments.covariance[0] + moments.covariance[1] + moments.covariance[2]);
    node.footprint = static_cast<float>(sums.footprint * inverse);
}

// Area and moments of a leaf from its points.
void sum_leaf(PointClusters& tree, std::uint32_t n) {
    TreeNode& node = tree.nodes[n];
    const V3d about(tree.positions[node.first]);
    AreaSums sums;
    for (std::uint32_t p = node.first; p < node.first + node.size(); ++p) {
        const float area = tree.areas[p];
        const auto& c = tree.footprints[p].covariance;
        sums.add(area, V3d(tree.positions[p]) - about);
        sums.footprint += double(area) * 0.5 * area * (float(c[0]) + float(c[1]) + float(c[2]));
    }
    finish(sums, about, node, tree.areas_of_nodes[n]);
    float squared = 0.0f;
    for (std::uint32_t p = node.first; p < node.first + node.size(); ++p) {
        squared = std::max(squared, (tree.positions[p] - node.center).length2());
    }
    node.radius = std::sqrt(squared);
}

// The same for an inner node, from its children.
void sum_children(PointClusters& tree, std::uint32_t n) {
    TreeNode& node = tree.nodes[n];
    const V3d about(tree.nodes[node.first].center);
    AreaSums sums;
    for (std::uint32_t k = node.first; k < node.first + node.size(); ++k) {
        const TreeNode& child = tree.nodes[k];
        const NodeArea& moments = tree.areas_of_nodes[k];
        const double area = moments.area;
        sums.add(area, V3d(child.center) - about);
        for (int j = 0; j < 6; ++j) sums.second[j] += area * moments.covariance[j];
        sums.footprint += area * child.footprint;
    }
    finish(sums, about, node, tree.areas_of_nodes[n]);
    for (std::uint32_t k = node.first; k < node.first + node.size(); ++k) {
        const TreeNode& child = tree.nodes[k];
        node.radius = std::max(node.radius, (child.center - node.center).length() + child.radius);
    }
}

}  // namespace

V3f footprint_normal(const Footprint& footprint) {
    const auto& packed = footprint.normal;
    V3f n(packed[0] / 32767.0f, packed[1] / 32767.0f, 0.0f);
    n.z = 1.0f - std::abs(n.x) - std::abs(n.y);
    if (n.z < 0.0f) {
        const float x = (1.0f - std::abs(n.y)) * (n.x < 0.0f ? -1.0f : 1.0f);
        n.y = (1.0f - std::abs(n.x)) * (n.y < 0.0f ? -1.0f : 1.0f);
        n.x = x;
    }
    return n.normalized();
}

PointClusters cluster_points(const PointSet& points, const Cells* cells, const std::vector<char>& is_left_out) {
    check_sources(points, cells);
    PointClusters tree;
    tree.source_count = points.size();
    tree.spacing = static_cast<float>(points.spacing);

    // Bring the points into Morton order.
    const std::vector<KeyedIndex> keys = sorted_points(points, is_left_out, tree.bounds);
    if (keys.empty()) return tree;
    const std::size_t n = keys.size();
    tree.order.resize(n);
    tree.positions.assign(n, V3f(0.0f));
    tree.footprints.resize(n);
    tree.areas.resize(n);
    parallel_for(n, 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t k = tree.order[i] = keys[i].index;
            const float area = cells ? cells->areas[k] : points.areas[k], inverse = area > 1e-30f ? 1.0f / area : 0.0f;
            tree.positions[i] = cells ? cells->centroids[k] : points.positions[k];
            tree.areas[i] = area;
            const Covariance covariance =
                cells ? cells->covariances[k] : disc_covariance(points.areas[k], points.normals[k]);
            const float scale = inverse * within_half(covariance[0] + covariance[1] + covariance[2], inverse);
            for (int j = 0; j < 6; ++j) tree.footprints[i].covariance[j] = covariance[j] * scale;
            tree.footprints[i].normal = packed_normal(points.normals[k]);
        }
    });

    // Build the nodes downwards, their moments upwards.
    std::vector<Range> ranges;
    {
        std::vector<TreeNode> grown;
        tree.level_begin = split_nodes(keys, grown, ranges);
        tree.nodes.assign(grown.size(), {});
        std::copy(grown.begin(), grown.end(), tree.nodes.begin());
    }
    tree.areas_of_nodes.assign(tree.nodes.size(), {});
    for (std::size_t level = tree.level_begin.size() - 1; level-- > 0;) {
        const std::uint32_t first = tree.level_begin[level];
        parallel_for(tree.level_begin[level + 1] - first, 512, [&](std::size_t begin, std::size_t end) {
            for (auto k = static_cast<std::uint32_t>(first + begin); k < first + end; ++k) {
                tree.nodes[k].is_leaf() ? sum_leaf(tree, k) : sum_children(tree, k);
            }
        });
    }
    return tree;
}

}  // namespace frazil
