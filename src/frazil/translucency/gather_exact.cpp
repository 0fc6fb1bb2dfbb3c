#include <cmath>

#include "frazil/base/parallel.h"
#include "frazil/translucency/point_tree_data.h"

namespace frazil {
namespace {

// The mean of a kernel over a point's cell, an elliptic disc that is a little thick, by Gauss nodes in radius² and equal
// angles; the value at its centroid where it is small. `kernel(distance, weight, place in the cell's unit frame)`.
template <class Kernel>
void average_over_cell(const V3d& offset, const CellFrame& frame, bool is_small, const Kernel& kernel) {
    if (is_small) return kernel(std::sqrt(offset.length2()), 1.0, V2f(0.0f));
    constexpr int kAngles = 24;
    constexpr double kNode[8] = {0.019855071751232, 0.101666761293187, 0.237233795041836, 0.408282678752175,
                                 0.591717321247825, 0.762766204958164, 0.898333238706813, 0.980144928248768};
    constexpr double kWeight[8] = {0.050614268145188, 0.111190517226687, 0.156853322938944, 0.181341891689181,
                                   0.181341891689181, 0.156853322938944, 0.111190517226687, 0.050614268145188};
    const V3d s(frame.axes[0]), t(frame.axes[1]), n(frame.axes[2]);
    const bool is_flat = n.length2() < 1e-8 * (s.length2() + t.length2());
    for (int i = 0; i < 8; ++i) {
        const double rho = 2.0 * std::sqrt(kNode[i]);
        for (int j = 0; j < kAngles; ++j) {
            const double angle = 2.0 * 3.14159265358979323846 * (j + 0.5 * (i % 2)) / kAngles;
            const double x = rho * std::cos(angle), y = rho * std::sin(angle), weight = kWeight[i] / kAngles;
            const V2f z(static_cast<float>(x), static_cast<float>(y));
            const V3d d = offset + s * x + t * y;
            if (is_flat) {
                kernel(std::sqrt(d.length2()), weight, z);
            } else {
                kernel(std::sqrt((d + n).length2()), 0.5 * weight, z);
                kernel(std::sqrt((d - n).length2()), 0.5 * weight, z);
            }
        }
    }
}

}  // namespace

Gathered PointTree::gather_exact(const V3f* positions, std::size_t count, Estimator estimator) const {
    const Impl& tree = *impl_;
    const PointClusters& clusters = *tree.clusters;
    const TreeKernel& sum = *tree.kernel;
    check_positions(positions, count);
    Gathered out;
    out.groups = tree.groups;
    out.exitance.assign(count * tree.groups, Rgb(0.0f));
    out.coverage.assign(count, Rgb(0.0f));
    const double shortest = shortest_mean_free_path(sum.profile);
    parallel_for(count, 16, [&](std::size_t begin, std::size_t end) {
        std::vector<double> sums(3 * tree.groups);
        std::vector<V2f> leans(tree.groups);
        for (std::size_t i = begin; i < end; ++i) {
            std::fill(sums.begin(), sums.end(), 0.0);
            V3d coverage(0.0);
            for (std::size_t p = 0; p < clusters.positions.size(); ++p) {
                const V3d offset = V3d(clusters.positions[p]) - V3d(positions[i]);
                const PointCell cell(clusters, static_cast<std::uint32_t>(p));
                const double radius = std::sqrt(2.0 * cell.trace), r = offset.length();
                const bool is_small = estimator == Estimator::sum || radius < 1e-4 * std::hypot(r, shortest);
                const CellFrame frame(clusters, static_cast<std::uint32_t>(p), cell);
                for (std::size_t g = 0; g < tree.groups; ++g) {
                    const V3f offset = tree.power_offset(static_cast<std::uint32_t>(p), g, lean_reach(cell.trace));
                    leans[g] = frame.lean_of(offset);
                }
                average_over_cell(offset, frame, is_small, [&](double distance, double weight, const V2f& z) {
                    const Rgb color = eval(sum.ramp, static_cast<float>(distance));
                    for (int c = 0; c < 3; ++c) {
                        const double density = reflectance(sum.profile, c, distance) * clusters.areas[p];
                        coverage[c] += density * weight;
                        const double share = density * weight * color[c] * sum.ramp_scale[c];
                        for (std::size_t g = 0; g < tree.groups; ++g) {
                            sums[3 * g + c] += share * tree.irradiance[p * tree.groups + g][c] * power_at(leans[g], z);
                        }
                    }
                });
            }
            out.coverage[i] = Rgb(coverage);
            for (std::size_t g = 0; g < tree.groups; ++g) {
                for (int c = 0; c < 3; ++c) {
                    out.exitance[i * tree.groups + g][c] = static_cast<float>(sums[3 * g + c]);
                }
            }
        }
    });
    return out;
}

}  // namespace frazil
