#include "frazil/translucency/point_tree.h"

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

// Between knots of a ramp, of the kernel's reach: a hundredth of a mean free path or less.
constexpr float kLeastKnotGap = 1e-4f;

// An offset that reaches farther is shortened.
PowerLean packed_lean(const V3f& offset, float reach) {
    const float longest = std::max(reach, offset.length()), unit = longest > 0.0f ? 32767.0f / longest : 0.0f;
    const auto rounded = [&](float x) { return static_cast<std::int16_t>(std::lround(x * unit)); };
    return {rounded(offset.x), rounded(offset.y), rounded(offset.z)};
}

// From a cell's centroid to its centre of one group's power.
V3f power_offset(const Rgb& irradiance, const V3f& moment) {
    const float power = irradiance.x + irradiance.y + irradiance.z;
    const V3f offset = power != 0.0f ? moment / power : V3f(0.0f);
    return is_finite(offset) ? offset : V3f(0.0f);
}

bool is_light_finite(const std::vector<Rgb>& irradiance, std::size_t point, std::size_t groups) {
    bool all = true;
    for (std::size_t g = 0; g < groups; ++g) all = all && is_finite(irradiance[point * groups + g]);
    return all;
}

void check_light(std::size_t points, std::size_t irradiance, std::size_t groups, std::size_t moments) {
    if (groups == 0)
        throw ValueError("PointTree: irradiance must have at least one light group, got 0. Its shape is (N, G, 3).");
    if (irradiance != points * groups) {
        throw ValueError(str("PointTree: irradiance must have one row per point (", points, " x ", groups,
                             " groups), got ", irradiance,
                             " values. Take it at these points, or at the places of their cells."));
    }
    if (moments > 0 && moments != irradiance) {
        throw ValueError(str("PointTree: moments must be one per irradiance (", irradiance, "), got ", moments, "."));
    }
}

// The points whose light is not finite; empty where it is everywhere.
std::vector<char> unusable(const std::vector<Rgb>& irradiance, std::size_t points, std::size_t groups) {
    std::vector<char> found(points, 0);
    parallel_for(points, 8192, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) found[k] = !is_light_finite(irradiance, k, groups);
    });
    if (std::find(found.begin(), found.end(), 1) == found.end()) found.clear();
    return found;
}

// Where a group's power is centred in a node: the mean over the channels of each one's own centre, so that it does not
// change with the light's colour.
class PowerCentre {
  public:
    void add(const float* power, const V3d& at) {
        for (int c = 0; c < 3; ++c) {
            const double weight = std::abs(power[c]);
            sum_[c] += weight;
            first_[c] += at * weight;
        }
    }
    V3d mean() const {
        V3d result(0.0);
        int channels = 0;
        for (int c = 0; c < 3; ++c) {
            if (!(sum_[c] > 0.0)) continue;
            result += first_[c] / sum_[c];
            ++channels;
        }
        return channels > 0 ? result / double(channels) : result;
    }
    bool is_dark() const { return !(sum_[0] > 0.0 || sum_[1] > 0.0 || sum_[2] > 0.0); }

  private:
    double sum_[3] = {};
    V3d first_[3] = {V3d(0.0), V3d(0.0), V3d(0.0)};
};

// Powers of a node and their centres from its points or children, group by group.
void sum_power(PointTree::Impl& tree, std::uint32_t n) {
    const PointClusters& clusters = *tree.clusters;
    const TreeNode& node = clusters.nodes[n];
    const std::size_t groups = tree.groups;
    for (std::size_t g = 0; g < groups; ++g) {
        auto& [powers, offset] = tree.node_powers[n * groups + g];
        PowerCentre centre;
        for (std::uint32_t k = node.first; k < node.first + node.size(); ++k) {
            Rgb part;
            V3f at;
            if (node.is_leaf()) {
                part = tree.irradiance[k * groups + g] * clusters.areas[k];
                at = clusters.positions[k] + tree.power_offset(k, g, lean_reach(PointCell(clusters, k).trace));
            } else {
                const GroupPower& child = tree.node_powers[k * groups + g];
                part = {child.power[0], child.power[1], child.power[2]};
                at = clusters.nodes[k].center + V3f(child.offset[0], child.offset[1], child.offset[2]) * 0.5f;
            }
            for (int c = 0; c < 3; ++c) powers[c] += part[c];
            centre.add(&part.x, V3d(at) - V3d(node.center));
        }
        if (centre.is_dark()) continue;
        const V3f twice(centre.mean() * 2.0);
        offset = {twice.x, twice.y, twice.z};
    }
}

}  // namespace

void check_positions(const V3f* positions, std::size_t count) {
    parallel_for(count, 8192, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            if (is_finite(positions[i])) continue;
            throw ValueError(str("PointTree: positions must be finite, got NaN or infinity at row ", i,
                                 ". Leave that shading point out."));
        }
    });
}

TreeKernel::TreeKernel(const Profile& of_profile, const Ramp& with_ramp)
    : profile(of_profile),
      ramp(with_ramp),
      ramp_scale(energy_scale(with_ramp, of_profile)),
      table(tabulate(of_profile)) {
    // Knots so near that the slope between them, times a distance, is beyond single precision are moved apart.
    const float least = kLeastKnotGap * table.reach;
    for (std::size_t k = 1; k < ramp.distances.size(); ++k) {
        ramp.distances[k] = std::max(ramp.distances[k], ramp.distances[k - 1] + least);
    }
}

const OpeningRule& TreeKernel::rule(float tolerance) const {
    const std::lock_guard lock(mutex_);
    const auto found = rules_.find(tolerance);
    if (found != rules_.end()) return found->second;
    return rules_.emplace(tolerance, OpeningRule(profile, table, !ramp.is_empty(), tolerance)).first->second;
}

std::shared_ptr<const TreeKernel> make_tree_kernel(const Profile& profile, const Ramp& ramp) {
    check_ramp(ramp, "Ramp");
    return std::make_shared<const TreeKernel>(profile, ramp);
}

PointTree::PointTree(const PointSet& points, std::vector<Rgb> irradiance, std::size_t groups, const Profile& profile,
                     const Ramp& ramp, const Cells* cells, const std::vector<V3f>& moments) {
    if (points.size() > 0) check_light(points.size(), irradiance.size(), groups, moments.size());
    const auto clusters =
        std::make_shared<PointClusters>(cluster_points(points, cells, unusable(irradiance, points.size(), groups)));
    *this = PointTree(clusters, make_tree_kernel(profile, ramp), irradiance, groups, moments);
    clusters->order = {};  // no other light will come
}

PointTree::PointTree(std::shared_ptr<const PointClusters> of_clusters, std::shared_ptr<const TreeKernel> kernel,
                     const std::vector<Rgb>& irradiance, std::size_t groups, const std::vector<V3f>& moments)
    : impl_(new Impl{std::move(of_clusters), std::move(kernel), groups, 0, {}, {}, {}}) {
    Impl& tree = *impl_;
    const PointClusters& clusters = *tree.clusters;
    check_light(clusters.source_count, irradiance.size(), groups, moments.size());
    const std::size_t n = clusters.size();
    tree.dropped = clusters.source_count - n;
    if (n == 0) return;

    // Bring the light into the clusters' order.
    constexpr std::size_t grain = 4096;
    tree.irradiance.assign(n * groups, Rgb(0.0f));
    if (!moments.empty()) tree.leans.resize(n * groups);
    std::vector<std::uint32_t> unlit((n + grain - 1) / grain, 0);
    parallel_for(n, grain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const std::size_t k = clusters.order[i];
            if (!is_light_finite(irradiance, k, groups)) {
                ++unlit[begin / grain];
                continue;
            }
            const float reach = lean_reach(PointCell(clusters, static_cast<std::uint32_t>(i)).trace);
            for (std::size_t g = 0; g < groups; ++g) {
                tree.irradiance[i * groups + g] = irradiance[k * groups + g];
                if (moments.empty()) continue;
                tree.leans[i * groups + g] =
                    packed_lean(power_offset(irradiance[k * groups + g], moments[k * groups + g]), reach);
            }
        }
    });
    for (const std::uint32_t here : unlit) tree.dropped += here;

    // Sum it upwards.
    tree.node_powers.assign(clusters.nodes.size() * groups, {});
    for (std::size_t level = clusters.level_begin.size() - 1; level-- > 0;) {
        const std::uint32_t first = clusters.level_begin[level];
        parallel_for(clusters.level_begin[level + 1] - first, 512, [&](std::size_t begin, std::size_t end) {
            for (auto k = static_cast<std::uint32_t>(first + begin); k < first + end; ++k) sum_power(tree, k);
        });
    }
}

PointCell::PointCell(const PointClusters& clusters, std::uint32_t point) {
    const float area = clusters.areas[point];
    for (int j = 0; j < 6; ++j) covariance[j] = float(clusters.footprints[point].covariance[j]) * area;
    trace = covariance[0] + covariance[1] + covariance[2];
}

CellFrame::CellFrame(const PointClusters& clusters, std::uint32_t point, const PointCell& cell) {
    const V3f normal = footprint_normal(clusters.footprints[point]);
    const auto [tangent, bitangent] = tangent_frame(normal);
    frame_ = {tangent, bitangent, normal};
    least_ = 1e-4f * std::sqrt(cell.trace);
    const auto& c = cell.covariance;
    const auto through = [&](const V3f& a) {
        return V3f(c[0] * a.x + c[3] * a.y + c[4] * a.z, c[3] * a.x + c[1] * a.y + c[5] * a.z,
                   c[4] * a.x + c[5] * a.y + c[2] * a.z);
    };
    // Cholesky's factor in that frame; what rounding leaves below zero is zero.
    auto& l = factor_;
    for (int i = 0; i < 3; ++i) {
        const V3f row = through(frame_[i]);
        for (int j = 0; j <= i; ++j) {
            float sum = row.dot(frame_[j]);
            for (int k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
            if (i == j)
                l[i][i] = std::sqrt(std::max(0.0f, sum));
            else
                l[i][j] = l[j][j] > least_ ? sum / l[j][j] : 0.0f;
        }
    }
    for (int j = 0; j < 3; ++j) axes[j] = frame_[0] * l[0][j] + frame_[1] * l[1][j] + frame_[2] * l[2][j];
}

V2f CellFrame::lean_of(const V3f& power_offset) const {
    // Forward substitution; flat cells have no lean along their normal.
    const auto& l = factor_;
    V2f lean(0.0f);
    for (int i = 0; i < 2; ++i) {
        float sum = power_offset.dot(frame_[i]);
        for (int k = 0; k < i; ++k) sum -= l[i][k] * lean[k];
        lean[i] = l[i][i] > least_ ? sum / l[i][i] : 0.0f;
    }
    return lean;
}

PointTree::~PointTree() = default;
PointTree::PointTree(PointTree&&) noexcept = default;
PointTree& PointTree::operator=(PointTree&&) noexcept = default;

const Profile& PointTree::profile() const {
    return impl_->kernel->profile;
}
std::size_t PointTree::point_count() const {
    return impl_->clusters->size();
}
std::size_t PointTree::node_count() const {
    return impl_->clusters->nodes.size();
}
std::size_t PointTree::dropped_count() const {
    return impl_->dropped;
}

}  // namespace frazil
