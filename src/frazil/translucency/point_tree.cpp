#include "frazil/translucency/point_tree.h"

#include <bit>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/base/radix_sort.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

constexpr std::uint32_t kLeafPoints = 8;

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

V3f unpacked_normal(const std::array<std::int16_t, 2>& packed) {
    V3f n(packed[0] / 32767.0f, packed[1] / 32767.0f, 0.0f);
    n.z = 1.0f - std::abs(n.x) - std::abs(n.y);
    if (n.z < 0.0f) {
        const float x = (1.0f - std::abs(n.y)) * (n.x < 0.0f ? -1.0f : 1.0f);
        n.y = (1.0f - std::abs(n.x)) * (n.y < 0.0f ? -1.0f : 1.0f);
        n.x = x;
    }
    return n.normalized();
}

// From a cell's centroid to its centre of power, all groups together, in magnitude.
V3f power_offset(const Rgb* irradiance, const V3f* moments, std::size_t groups) {
    V3f moment(0.0f);
    float power = 0.0f;
    for (std::size_t g = 0; g < groups; ++g) {
        const float sum = irradiance[g].x + irradiance[g].y + irradiance[g].z;
        power += std::abs(sum);
        moment += sum < 0.0f ? -moments[g] : moments[g];
    }
    return power > 0.0f ? moment / power : V3f(0.0f);
}

// By what a cell's extent is shortened so that extent x inverse stays in half's range: cells of slivers, which are long
// and have no area to speak of.
float within_half(float extent, float inverse) {
    constexpr float kMost = 6e4f;
    return extent > kMost / inverse ? kMost / (extent * inverse) : 1.0f;
}

void check_cells(const PointSet& points, const Cells& cells, const std::vector<V3f>& moments, std::size_t values) {
    if (cells.size() != points.size()) {
        throw ValueError(str("PointTree: cells must be one per point (", points.size(), "), got ", cells.size(),
                             ". Make them from these points."));
    }
    if (!moments.empty() && moments.size() != values) {
        throw ValueError(
            str("PointTree: moments must be one per irradiance (", values, "), got ", moments.size(), "."));
    }
}

void check_points(const PointSet& points, std::size_t irradiance_count, std::size_t groups) {
    const std::size_t n = points.size();
    if (n == 0) throw ValueError("PointTree: points must not be empty, got 0 points. Choose a smaller spacing.");
    if (points.areas.size() != n || points.normals.size() != n) {
        throw ValueError(str("PointTree: points must have a normal and an area each, got ", n, " positions, ",
                             points.normals.size(), " normals, ", points.areas.size(), " areas."));
    }
    if (groups == 0) throw ValueError("PointTree: irradiance must have at least one light group, got 0.");
    if (irradiance_count != n * groups) {
        throw ValueError(str("PointTree: irradiance must have one row per point (", n, " x ", groups, " groups), got ",
                             irradiance_count, " values."));
    }
    parallel_for(n, 8192, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            if (!is_finite(points.positions[k])) {
                throw ValueError(str("PointTree: positions must be finite, got NaN or infinity at point ", k, "."));
            }
            if (!(points.areas[k] >= 0.0f && std::isfinite(points.areas[k]))) {
                throw ValueError(
                    str("PointTree: areas must be >= 0 and finite, got ", points.areas[k], " at point ", k, "."));
            }
        }
    });
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
struct MomentSums {
    double area = 0.0, footprint = 0.0, power = 0.0;
    V3d first{0.0}, power_first{0.0};
    std::array<double, 6> second{};

    void add_area(double weight, const V3d& d) {
        area += weight;
        first += d * weight;
        second[0] += weight * d.x * d.x;
        second[1] += weight * d.y * d.y;
        second[2] += weight * d.z * d.z;
        second[3] += 2.0 * weight * d.x * d.y;
        second[4] += 2.0 * weight * d.x * d.z;
        second[5] += 2.0 * weight * d.y * d.z;
    }

    void add_power(double weight, const V3d& d) {
        power += weight;
        power_first += d * weight;
    }
};

void finish(const MomentSums& sums, const V3d& about, TreeNode& node, NodeMoments& moments) {
    const double inverse = sums.area > 0.0 ? 1.0 / sums.area : 0.0;
    const V3d mean = sums.first * inverse;
    node.center = V3f(about + mean);
    moments.area = static_cast<float>(sums.area);
    const double product[6] = {mean.x * mean.x,       mean.y * mean.y,       mean.z * mean.z,
                               2.0 * mean.x * mean.y, 2.0 * mean.x * mean.z, 2.0 * mean.y * mean.z};
    for (int i = 0; i < 6; ++i) moments.covariance[i] = static_cast<float>(sums.second[i] * inverse - product[i]);
    node.trace = std::max(0.0f, moments.covariance[0] + moments.covariance[1] + moments.covariance[2]);
    node.footprint = static_cast<float>(sums.footprint * inverse);
    const V3d offset = sums.power > 0.0 ? (sums.power_first / sums.power - mean) * 2.0 : V3d(0.0);
    for (int i = 0; i < 3; ++i) moments.power_offset[i] = static_cast<float>(offset[i]);
}

// Areas, powers and moments of a leaf from its points.
void sum_leaf(PointTree::Impl& tree, std::uint32_t n) {
    TreeNode& node = tree.nodes[n];
    const std::size_t row = 3 * tree.groups;
    float* powers = &tree.node_powers[n * row];
    const V3d about(tree.positions[node.first]);
    MomentSums sums;
    for (std::uint32_t p = node.first; p < node.first + node.size(); ++p) {
        const V3d d = V3d(tree.positions[p]) - about;
        const float area = tree.areas[p];
        const PointCell cell(tree, p);
        const float* e = &tree.irradiance[p * tree.groups].x;
        float power = 0.0f;
        for (std::size_t c = 0; c < row; ++c) {
            powers[c] += e[c] * area;
            power += std::abs(e[c] * area);
        }
        sums.add_area(area, d);
        sums.footprint += double(area) * 0.5 * cell.trace;
        sums.add_power(power, d + V3d(cell.power_offset));
    }
    finish(sums, about, node, tree.moments[n]);
    float squared = 0.0f;
    for (std::uint32_t p = node.first; p < node.first + node.size(); ++p) {
        squared = std::max(squared, (tree.positions[p] - node.center).length2());
    }
    node.radius = std::sqrt(squared);
}

// The same for an inner node, from its children.
void sum_children(PointTree::Impl& tree, std::uint32_t n) {
    TreeNode& node = tree.nodes[n];
    const std::size_t row = 3 * tree.groups;
    float* powers = &tree.node_powers[n * row];
    const V3d about(tree.nodes[node.first].center);
    MomentSums sums;
    for (std::uint32_t k = node.first; k < node.first + node.size(); ++k) {
        const TreeNode& child = tree.nodes[k];
        const NodeMoments& moments = tree.moments[k];
        const V3d d = V3d(child.center) - about;
        float power = 0.0f;
        for (std::size_t c = 0; c < row; ++c) {
            powers[c] += tree.node_powers[k * row + c];
            power += std::abs(tree.node_powers[k * row + c]);
        }
        const double area = moments.area;
        sums.add_area(area, d);
        for (int j = 0; j < 6; ++j) sums.second[j] += area * moments.covariance[j];
        sums.footprint += area * child.footprint;
        const auto& offset = moments.power_offset;
        sums.add_power(power, d + V3d(offset[0], offset[1], offset[2]) * 0.5);
    }
    finish(sums, about, node, tree.moments[n]);
    for (std::uint32_t k = node.first; k < node.first + node.size(); ++k) {
        const TreeNode& child = tree.nodes[k];
        node.radius = std::max(node.radius, (child.center - node.center).length() + child.radius);
    }
}

// The indices of points with finite irradiance and their Morton codes, sorted by code.
std::vector<KeyedIndex> sorted_points(const PointSet& points, const std::vector<Rgb>& irradiance, std::size_t groups,
                                      Box3f& bounds) {
    const std::size_t n = points.size();
    constexpr std::size_t grain = 8192;
    std::vector<std::uint32_t> good((n + grain - 1) / grain, 0);
    std::vector<Box3f> boxes(good.size());
    const auto is_good = [&](std::size_t k) {
        bool all = true;
        for (std::size_t g = 0; g < groups; ++g) all = all && is_finite(irradiance[k * groups + g]);
        return all;
    };
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

}  // namespace

PointTree::PointTree(const PointSet& points, std::vector<Rgb> irradiance, std::size_t groups, const Profile& profile,
                     const Ramp& ramp, const Cells* cells, const std::vector<V3f>& moments)
    : impl_(new Impl{profile}) {
    check_points(points, irradiance.size(), groups);
    if (cells) check_cells(points, *cells, moments, irradiance.size());
    check_ramp(ramp, "Ramp");
    Impl& tree = *impl_;
    tree.ramp = ramp;
    tree.ramp_scale = energy_scale(ramp, profile);
    tree.table = tabulate(profile);
    tree.groups = groups;
    tree.spacing = points.spacing;

    // Bring the points into Morton order.
    std::vector<KeyedIndex> keys = sorted_points(points, irradiance, groups, tree.bounds);
    tree.dropped = points.size() - keys.size();
    if (keys.empty()) return;
    const std::size_t n = keys.size();
    tree.positions.resize(n);
    tree.footprints.resize(n);
    tree.areas.resize(n);
    if (!moments.empty()) tree.leans.resize(n);
    tree.irradiance.resize(n * groups);
    parallel_for(n, 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t k = keys[i].index;
            const float area = cells ? cells->areas[k] : points.areas[k], inverse = area > 1e-30f ? 1.0f / area : 0.0f;
            tree.positions[i] = cells ? cells->centroids[k] : points.positions[k];
            tree.areas[i] = area;
            const Covariance covariance =
                cells ? cells->covariances[k] : disc_covariance(points.areas[k], points.normals[k]);
            const float scale = inverse * within_half(covariance[0] + covariance[1] + covariance[2], inverse);
            for (int j = 0; j < 6; ++j) tree.footprints[i].covariance[j] = covariance[j] * scale;
            tree.footprints[i].normal = packed_normal(points.normals[k]);
            if (!tree.leans.empty()) {
                const V3f offset = power_offset(&irradiance[k * groups], &moments[k * groups], groups);
                const float root = std::sqrt(inverse) * within_half(offset.length(), std::sqrt(inverse));
                for (int j = 0; j < 3; ++j) tree.leans[i][j] = offset[j] * root;
            }
            for (std::size_t g = 0; g < groups; ++g) tree.irradiance[i * groups + g] = irradiance[k * groups + g];
        }
    });

    // Build the nodes downwards, their moments upwards.
    std::vector<Range> ranges;
    const std::vector<std::uint32_t> level_begin = split_nodes(keys, tree.nodes, ranges);
    tree.nodes.shrink_to_fit();
    tree.moments.resize(tree.nodes.size());
    tree.node_powers.assign(tree.nodes.size() * 3 * groups, 0.0f);
    for (std::size_t level = level_begin.size() - 1; level-- > 0;) {
        const std::uint32_t first = level_begin[level];
        parallel_for(level_begin[level + 1] - first, 512, [&](std::size_t begin, std::size_t end) {
            for (auto k = static_cast<std::uint32_t>(first + begin); k < first + end; ++k) {
                tree.nodes[k].is_leaf() ? sum_leaf(tree, k) : sum_children(tree, k);
            }
        });
    }
}

PointCell::PointCell(const PointTree::Impl& tree, std::uint32_t point) : power_offset(0.0f) {
    const float area = tree.areas[point];
    for (int j = 0; j < 6; ++j) covariance[j] = float(tree.footprints[point].covariance[j]) * area;
    trace = covariance[0] + covariance[1] + covariance[2];
    if (tree.leans.empty()) return;
    const float root = std::sqrt(area);
    for (int j = 0; j < 3; ++j) power_offset[j] = float(tree.leans[point][j]) * root;
}

CellFrame::CellFrame(const PointTree::Impl& tree, std::uint32_t point, const PointCell& cell) {
    const V3f normal = unpacked_normal(tree.footprints[point].normal);
    const auto [tangent, bitangent] = tangent_frame(normal);
    const std::array<V3f, 3> frame = {tangent, bitangent, normal};
    const auto& c = cell.covariance;
    const auto through = [&](const V3f& a) {
        return V3f(c[0] * a.x + c[3] * a.y + c[4] * a.z, c[3] * a.x + c[1] * a.y + c[5] * a.z,
                   c[4] * a.x + c[5] * a.y + c[2] * a.z);
    };
    // Cholesky's factor in that frame; what rounding leaves below zero is zero.
    float l[3][3] = {};
    for (int i = 0; i < 3; ++i) {
        const V3f row = through(frame[i]);
        for (int j = 0; j <= i; ++j) {
            float sum = row.dot(frame[j]);
            for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
            if (i == j)
                l[i][i] = std::sqrt(std::max(0.0f, sum));
            else
                l[i][j] = l[j][j] > 1e-4f * std::sqrt(cell.trace) ? sum / l[j][j] : 0.0f;
        }
    }
    for (int j = 0; j < 3; ++j) axes[j] = frame[0] * l[0][j] + frame[1] * l[1][j] + frame[2] * l[2][j];
    // Forward substitution for the lean; flat cells have none along their normal.
    lean = V3f(0.0f);
    for (int i = 0; i < 3; ++i) {
        float sum = cell.power_offset.dot(frame[i]);
        for (int k = 0; k < i; ++k) sum -= l[i][k] * lean[k];
        lean[i] = i < 2 && l[i][i] > 1e-4f * std::sqrt(cell.trace) ? sum / l[i][i] : 0.0f;
    }
}

PointTree::~PointTree() = default;
PointTree::PointTree(PointTree&&) noexcept = default;
PointTree& PointTree::operator=(PointTree&&) noexcept = default;

const Profile& PointTree::profile() const {
    return impl_->profile;
}
std::size_t PointTree::point_count() const {
    return impl_->positions.size();
}
std::size_t PointTree::node_count() const {
    return impl_->nodes.size();
}
std::size_t PointTree::dropped_count() const {
    return impl_->dropped;
}

}  // namespace frazil
