#include "frazil/translucency/point_tree.h"

#include <numeric>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

constexpr std::uint32_t kLeafPoints = 8;

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
    for (std::size_t k = 0; k < n; ++k) {
        if (!is_finite(points.positions[k])) {
            throw ValueError(str("PointTree: positions must be finite, got NaN or infinity at point ", k, "."));
        }
        if (!(points.areas[k] >= 0.0f && std::isfinite(points.areas[k]))) {
            throw ValueError(
                str("PointTree: areas must be >= 0 and finite, got ", points.areas[k], " at point ", k, "."));
        }
    }
}

struct Keyed {
    std::uint64_t code;
    std::uint32_t index;
};

// Sort by code; equal codes keep the order of their indices.
void sort_by_code(std::vector<Keyed>& keys) {
    std::sort(keys.begin(), keys.end(),
              [](const Keyed& a, const Keyed& b) { return a.code != b.code ? a.code < b.code : a.index < b.index; });
}

// Split nodes at the bits of their codes, level by level. Returns where each level begins.
std::vector<std::uint32_t> split_nodes(const std::vector<Keyed>& keys, std::vector<TreeNode>& nodes) {
    std::vector<std::uint32_t> level_begin{0};
    nodes.resize(1);
    nodes[0].point_count = static_cast<std::uint32_t>(keys.size());
    std::vector<std::uint8_t> depth{0};
    for (std::uint32_t begin = 0; begin < nodes.size();) {
        const auto end = static_cast<std::uint32_t>(nodes.size());
        for (std::uint32_t n = begin; n < end; ++n) {
            const std::uint32_t first = nodes[n].first_point, last = first + nodes[n].point_count;
            if (nodes[n].point_count <= kLeafPoints) continue;
            // Skip the levels on which all points lie in one octant.
            const std::uint64_t differing = keys[first].code ^ keys[last - 1].code;
            if (differing == 0) continue;
            const int shift = 3 * ((63 - __builtin_clzll(differing)) / 3);
            nodes[n].first_child = static_cast<std::uint32_t>(nodes.size());
            for (std::uint32_t p = first; p < last;) {
                const std::uint64_t octant = keys[p].code >> shift;
                const auto next = std::partition_point(keys.begin() + p, keys.begin() + last,
                                                       [&](const Keyed& k) { return k.code >> shift == octant; });
                TreeNode child;
                child.first_point = p;
                child.point_count = static_cast<std::uint32_t>(next - keys.begin()) - p;
                nodes.push_back(child);
                ++nodes[n].child_count;
                p += child.point_count;
            }
        }
        begin = end;
        level_begin.push_back(begin);
    }
    return level_begin;
}

// Area, power and moments of a node from its parts: points of a leaf, or children.
struct Moments {
    double area = 0.0, footprint = 0.0, power = 0.0;
    V3d first{0.0}, power_first{0.0};
    std::array<double, 6> second{};  // about the origin `about`

    void add(double weight, const V3d& d) {
        area += weight;
        first += d * weight;
        second[0] += weight * d.x * d.x;
        second[1] += weight * d.y * d.y;
        second[2] += weight * d.z * d.z;
        second[3] += weight * d.x * d.y;
        second[4] += weight * d.x * d.z;
        second[5] += weight * d.y * d.z;
    }
};

void finish(const Moments& m, const V3d& about, TreeNode& node) {
    const double inverse = m.area > 0.0 ? 1.0 / m.area : 0.0;
    const V3d mean = m.first * inverse;
    node.center = V3f(about + mean);
    node.area = static_cast<float>(m.area);
    const double product[6] = {mean.x * mean.x, mean.y * mean.y, mean.z * mean.z,
                               mean.x * mean.y, mean.x * mean.z, mean.y * mean.z};
    for (int i = 0; i < 6; ++i) node.covariance[i] = static_cast<float>(m.second[i] * inverse - product[i]);
    node.footprint = static_cast<float>(m.footprint * inverse);
    node.power_offset = m.power > 0.0 ? V3f(m.power_first / m.power - mean) : V3f(0.0f);
}

}  // namespace

PointTree::PointTree(const PointSet& points, std::vector<Rgb> irradiance, std::size_t groups, const Profile& profile,
                     const Ramp& ramp)
    : impl_(new Impl{profile}) {
    check_points(points, irradiance.size(), groups);
    check_ramp(ramp, "Ramp");
    Impl& tree = *impl_;
    tree.ramp = ramp;
    tree.ramp_scale = energy_scale(ramp, profile);
    tree.table = tabulate(profile);
    tree.groups = groups;
    tree.spacing = points.spacing;

    // Leave out points whose irradiance is not finite.
    std::vector<Keyed> keys;
    keys.reserve(points.size());
    for (std::uint32_t k = 0; k < points.size(); ++k) {
        bool is_good = true;
        for (std::size_t g = 0; g < groups; ++g) is_good = is_good && is_finite(irradiance[k * groups + g]);
        if (is_good) keys.push_back({0, k});
    }
    tree.dropped = points.size() - keys.size();
    if (keys.empty()) return;

    // Sort into Morton order.
    for (const Keyed& key : keys) tree.bounds.extendBy(points.positions[key.index]);
    const MortonGrid grid(tree.bounds);
    parallel_for(keys.size(), 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) keys[i].code = grid.code(points.positions[keys[i].index]);
    });
    sort_by_code(keys);
    const std::size_t n = keys.size();
    tree.positions.resize(n);
    tree.normals.resize(n);
    tree.areas.resize(n);
    tree.irradiance.resize(n * groups);
    parallel_for(n, 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::uint32_t k = keys[i].index;
            tree.positions[i] = points.positions[k];
            tree.normals[i] = points.normals[k];
            tree.areas[i] = points.areas[k];
            for (std::size_t g = 0; g < groups; ++g) tree.irradiance[i * groups + g] = irradiance[k * groups + g];
        }
    });

    // Build the nodes downwards, their moments upwards.
    const std::vector<std::uint32_t> level_begin = split_nodes(keys, tree.nodes);
    const std::size_t row = 3 * groups;
    tree.node_powers.assign(tree.nodes.size() * row, 0.0f);
    for (std::size_t level = level_begin.size() - 1; level-- > 0;) {
        const std::uint32_t level_first = level_begin[level], count = level_begin[level + 1] - level_first;
        parallel_for(count, 512, [&](std::size_t begin, std::size_t end) {
            std::vector<double> powers(row);
            for (std::size_t i = level_first + begin; i < level_first + end; ++i) {
                TreeNode& node = tree.nodes[i];
                const V3d about(tree.positions[node.first_point]);
                std::fill(powers.begin(), powers.end(), 0.0);
                Moments m;
                if (node.child_count == 0) {
                    for (std::uint32_t p = node.first_point; p < node.first_point + node.point_count; ++p) {
                        const V3d d = V3d(tree.positions[p]) - about;
                        const double area = tree.areas[p];
                        double power = 0.0;
                        for (std::size_t c = 0; c < row; ++c) {
                            const double e = tree.irradiance[p * groups + c / 3][c % 3] * area;
                            powers[c] += e;
                            power += std::abs(e);
                        }
                        m.add(area, d);
                        m.footprint += area * area / (4.0 * kPi);
                        m.power += power;
                        m.power_first += d * power;
                    }
                } else {
                    for (std::uint32_t k = node.first_child; k < node.first_child + node.child_count; ++k) {
                        const TreeNode& child = tree.nodes[k];
                        const V3d d = V3d(child.center) - about;
                        double power = 0.0;
                        for (std::size_t c = 0; c < row; ++c) {
                            const double e = tree.node_powers[k * row + c];
                            powers[c] += e;
                            power += std::abs(e);
                        }
                        m.add(child.area, d);
                        for (int j = 0; j < 6; ++j) m.second[j] += double(child.area) * child.covariance[j];
                        m.footprint += double(child.area) * child.footprint;
                        m.power += power;
                        m.power_first += (d + V3d(child.power_offset)) * power;
                    }
                }
                finish(m, about, node);
                for (std::size_t c = 0; c < row; ++c) tree.node_powers[i * row + c] = static_cast<float>(powers[c]);
                float squared = 0.0f;
                for (std::uint32_t p = node.first_point; p < node.first_point + node.point_count; ++p) {
                    squared = std::max(squared, (tree.positions[p] - node.center).length2());
                }
                node.radius = std::sqrt(squared);
            }
        });
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
