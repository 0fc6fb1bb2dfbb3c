#include <bit>
#include <atomic>
#include <cstdlib>
#include <cstdio>
#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/morton.h"
#include "frazil/base/parallel.h"
#include "frazil/translucency/gather_kernel.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

// How large a cluster may be at a distance: a table over octaves of u = 1 + q/z0², four a piece.
class OpeningRule {
  public:
    OpeningRule(const Profile& profile, const KernelTable& table, float tolerance)
        : inverse_z0_squared_(table.inverse_z0_squared) {
        const double z0 = 1.0 / std::sqrt(double(inverse_z0_squared_));
        for (int i = 0; i < kEntries; ++i) {
            const double u = std::ldexp(1.0 + (i % 4) / 4.0, i / 4), r = z0 * std::sqrt(u - 1.0);
            double limit = 1e30;
            for (int c = 0; c < 3; ++c) {
                const double total = albedo(profile, c), f = reflectance(profile, c, r);
                if (!(total > 0.0 && f > 0.0)) continue;
                const double step = 0.01 * (r + z0);
                const double decay = std::log(f / std::max(1e-300, reflectance(profile, c, r + step))) / step;
                const double bend = 1.5 / std::hypot(r, mean_free_path(profile, c)) + decay;
                const double share = std::min(1.0, 6.0 * r * r * f / total + 6.0 * z0 * z0 * f / total);
                const double allowed = tolerance / std::sqrt(std::max(share, 1e-12));
                limit = std::min(limit, std::cbrt(4.0 * allowed) / bend);
            }
            largest_[i] = static_cast<float>(limit);
        }
    }

    // The largest radius of a cluster at squared distance q.
    float largest_radius(float q) const {
        const float u = 1.0f + q * inverse_z0_squared_;
        const std::uint32_t bits = std::bit_cast<std::uint32_t>(u) - std::bit_cast<std::uint32_t>(1.0f);
        return largest_[std::min<std::uint32_t>(bits >> 21, kEntries - 1)];
    }

  private:
    static constexpr int kEntries = 128;
    float inverse_z0_squared_;
    std::array<float, kEntries> largest_;
};

float squared_distance(const Box3f& box, const V3f& p) {
    float q = 0.0f;
    for (int i = 0; i < 3; ++i) {
        const float d = std::max(0.0f, std::max(box.min[i] - p[i], p[i] - box.max[i]));
        q += d * d;
    }
    return q;
}

struct Cut {
    const PointTree::Impl& tree;
    const OpeningRule& rule;
    Estimator estimator;
    SourceList list;
    std::vector<std::uint32_t> stack;

    void add_powers(const float* powers, float scale) {
        for (std::size_t c = 0; c < 3 * tree.groups; ++c) list.powers.push_back(powers[c] * scale);
    }

    void add_cluster(std::uint32_t index) {
        const TreeNode& node = tree.nodes[index];
        const float trace = node.covariance[0] + node.covariance[1] + node.covariance[2];
        float scale = 1.0f;
        if (estimator == Estimator::noise_free && trace > 0.0f) scale += 2.0f * node.footprint / trace;
        Source source;
        source.center = {node.center.x, node.center.y, node.center.z};
        for (int i = 0; i < 6; ++i) source.covariance[i] = node.covariance[i] * (i < 3 ? scale : 2.0f * scale);
        source.trace = trace * scale;
        source.power_offset = {2.0f * node.power_offset.x, 2.0f * node.power_offset.y, 2.0f * node.power_offset.z};
        source.area = node.area;
        list.sources.push_back(source);
        add_powers(&tree.node_powers[index * 3 * tree.groups], 1.0f);
    }

    // A disc of surface of area A * share about a point.
    void add_disc(std::uint32_t p, const V3f& center, float share) {
        const float area = tree.areas[p] * share;
        const V3f& n = tree.normals[p];
        const float v = estimator == Estimator::noise_free ? 0.25f * area * kInvPi : 0.0f;
        list.sources.push_back({{center.x, center.y, center.z},
                                {v * (1.0f - n.x * n.x), v * (1.0f - n.y * n.y), v * (1.0f - n.z * n.z),
                                 -2.0f * v * n.x * n.y, -2.0f * v * n.x * n.z, -2.0f * v * n.y * n.z},
                                2.0f * v,
                                {0.0f, 0.0f, 0.0f},
                                area});
        add_powers(&tree.irradiance[p * tree.groups].x, area);
    }

    // A disc that is large against the kernel is cut into seven of equal area with the same second moments together.
    void add_split_disc(std::uint32_t p, const V3f& center, float share, float largest) {
        const float radius = footprint_radius(tree.areas[p] * share);
        if (radius <= largest || share < 1e-3f) return add_disc(p, center, share);
        const auto [tangent, bitangent] = tangent_frame(tree.normals[p]);
        add_split_disc(p, center, share / 7.0f, largest);
        for (int k = 0; k < 6; ++k) {
            const float angle = k * kPi / 3.0f, reach = radius * 0.70710678f;
            add_split_disc(p, center + tangent * (reach * std::cos(angle)) + bitangent * (reach * std::sin(angle)),
                           share / 7.0f, largest);
        }
    }

    void build(const Box3f& box) {
        list.clear();
        stack.assign(1, 0);
        while (!stack.empty()) {
            const std::uint32_t index = stack.back();
            stack.pop_back();
            const TreeNode& node = tree.nodes[index];
            const float q = squared_distance(box, node.center);
            const float beyond = node.radius + tree.table.reach;
            if (q > beyond * beyond) continue;
            const float largest = rule.largest_radius(q);
            const float reach = estimator == Estimator::noise_free ? 2.0f * std::sqrt(node.footprint) : 0.0f;
            if (node.point_count > 1 && node.radius + reach <= largest) {
                add_cluster(index);
            } else if (node.child_count > 0) {
                for (std::uint32_t k = node.child_count; k-- > 0;) stack.push_back(node.first_child + k);
            } else {
                for (std::uint32_t p = node.first_point; p < node.first_point + node.point_count; ++p) {
                    if (estimator == Estimator::sum) {
                        add_disc(p, tree.positions[p], 1.0f);
                    } else {
                        const float q = squared_distance(box, tree.positions[p]);
                        add_split_disc(p, tree.positions[p], 1.0f, 0.7f * rule.largest_radius(q));
                    }
                }
            }
        }
    }
};

}  // namespace

Gathered PointTree::gather(const V3f* positions, std::size_t count, const GatherOptions& options) const {
    if (!(options.tolerance > 0.0f && std::isfinite(options.tolerance))) {
        throw ValueError(str("PointTree: tolerance must be > 0, got ", options.tolerance, ". 0.01 is the default."));
    }
    const Impl& tree = *impl_;
    Gathered out;
    out.groups = tree.groups;
    out.exitance.assign(count * tree.groups, Rgb(0.0f));
    out.coverage.assign(count, Rgb(0.0f));
    for (std::size_t i = 0; i < count; ++i) {
        if (!is_finite(positions[i])) {
            throw ValueError(str("PointTree: positions must be finite, got NaN or infinity at row ", i, "."));
        }
    }
    if (tree.nodes.empty() || count == 0) return out;

    // Bring the shading points into Morton order, so that a block of them lies together.
    const MortonGrid grid(tree.bounds);
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
    order.reserve(count);
    const float reach = tree.table.reach + tree.bounds.size().length() * 1e-3f;
    for (std::size_t i = 0; i < count; ++i) {
        if (squared_distance(tree.bounds, positions[i]) > reach * reach) continue;  // exactly zero
        order.emplace_back(grid.code(positions[i]), static_cast<std::uint32_t>(i));
    }
    std::sort(order.begin(), order.end());

    const OpeningRule rule(tree.profile, tree.table, options.tolerance);
    const RampHinges ramp = hinges_of(tree.ramp, tree.ramp_scale);
    constexpr std::size_t block_size = 16;
    parallel_for(order.size(), block_size, [&](std::size_t begin, std::size_t end) {
        Cut cut{tree, rule, options.estimator, {}, {}};
        BlockSums block;
        block.lanes = end - begin;
        block.exitance.assign(3 * tree.groups * kBlockLanes, 0.0f);
        Box3f box;
        for (std::size_t i = begin; i < end; ++i) {
            const V3f& p = positions[order[i].second];
            block.x[i - begin] = p.x;
            block.y[i - begin] = p.y;
            block.z[i - begin] = p.z;
            box.extendBy(p);
        }
        cut.build(box);
        if (getenv("FZDBG")) { static std::atomic<long> n{0}, b{0}; n += cut.list.sources.size(); if (++b % 2000 == 0) fprintf(stderr, "src/block %ld size %g\n", long(n)/long(b), box.size().length()); }
        add_sources(tree.table, ramp, cut.list, tree.groups, block);
        for (std::size_t i = begin; i < end; ++i) {
            const std::size_t lane = i - begin, to = order[i].second;
            for (int c = 0; c < 3; ++c) {
                out.coverage[to][c] = block.coverage[c][lane];
                for (std::size_t g = 0; g < tree.groups; ++g) {
                    out.exitance[to * tree.groups + g][c] = block.exitance[(3 * g + c) * kBlockLanes + lane];
                }
            }
        }
    });
    return out;
}

}  // namespace frazil
