#include "frazil/render/point_gathers.h"

#include <numeric>

#include "frazil/points/point_budget.h"
#include "frazil/render/bodies.h"

namespace frazil {
namespace {

constexpr float kReach = 1.5f;  // of the kernel, in spacings
// Points that are so many times as dense as their spacing says have one that varies.
constexpr double kVaries = 2.0;

bool is_even(const PointSet& points) {
    const double area = std::accumulate(points.areas.begin(), points.areas.end(), 0.0);
    return double(points.size()) * points.spacing * points.spacing < kVaries * kPointsPerSpacing2 * area;
}

// Sums, coverage, thickness and layers of a point, and its place in the lookup.
std::size_t bytes_per_point(std::size_t groups, std::size_t knots, bool has_thickness) {
    return sizeof(Rgb) * (groups * (1 + knots) + 1 + has_thickness) + sizeof(V3f) * 2 + 12;
}

void add(Rgb* sum, const Rgb* row, std::size_t count, float weight) {
    for (std::size_t k = 0; k < count; ++k) sum[k] += row[k] * weight;
}

}  // namespace

GatherOptions PointGatherPlan::options_for(const Body& body) const {
    GatherOptions options = gather;
    options.ramp_layers = keeps_knots && !body.material->ramp.is_empty();
    return options;
}

std::shared_ptr<const PointGathers> PointGathers::make(const Body& body, const PointCloud& cloud, std::size_t groups,
                                                       PointGatherPlan& plan) {
    const PointSet& points = cloud.points();
    if (body.surface_tree || plan.paths < double(points.size()) || !(points.spacing > 0.0) || !is_even(points)) {
        return nullptr;
    }
    const GatherOptions options = plan.options_for(body);
    const std::size_t knots = options.ramp_layers ? body.material->ramp.distances.size() : 0;
    const std::size_t bytes = points.size() * bytes_per_point(groups, knots, body.thickness != nullptr);
    if (bytes > plan.bytes) return nullptr;
    plan.bytes -= bytes;
    plan.paths -= double(points.size());
    std::shared_ptr<PointGathers> result(new PointGathers(points, kReach * static_cast<float>(points.spacing)));
    const std::vector<V3f> inwards = cloud.inward_positions();
    std::vector<V3f> places;
    for (const std::uint32_t i : result->lookup_.order()) places.push_back(inwards[i]);
    result->at_points_ = body.tree->gather(places.data(), places.size(), options);
    result->thin_ = thickness_gains(body.thickness.get(), places.data(), places.size(), options);
    return result;
}

bool PointGathers::append(const V3f& position, const V3f& normal, Gathered& gathered, std::vector<Rgb>& thin) const {
    const std::size_t groups = at_points_.groups, layers = at_points_.knots * groups;
    const std::size_t row = gathered.coverage.size();
    float sum = 0.0f;
    if (normal == V3f(0.0f)) return false;
    lookup_.visit(position, [&](std::uint32_t, std::uint32_t point, const V3f& p, const V3f& n) {
        const float facing = n.dot(normal), q = 1.0f - (p - position).length2() / (reach_ * reach_);
        if (!(facing > 0.0f && q > 0.0f)) return;
        const float weight = facing * q * q;
        if (sum == 0.0f) {
            gathered.exitance.resize((row + 1) * groups, Rgb(0.0f));
            gathered.coverage.resize(row + 1, Rgb(0.0f));
            gathered.layers.resize((row + 1) * layers, Rgb(0.0f));
            if (!thin_.empty()) thin.resize(row + 1, Rgb(0.0f));
        }
        sum += weight;
        add(&gathered.exitance[row * groups], &at_points_.exitance[point * groups], groups, weight);
        add(&gathered.coverage[row], &at_points_.coverage[point], 1, weight);
        if (layers > 0) add(&gathered.layers[row * layers], &at_points_.layers[point * layers], layers, weight);
        if (!thin_.empty()) add(&thin[row], &thin_[point], 1, weight);
    });
    if (sum == 0.0f) return false;
    const float scale = 1.0f / sum;
    for (std::size_t g = 0; g < groups; ++g) gathered.exitance[row * groups + g] *= scale;
    gathered.coverage[row] *= scale;
    for (std::size_t k = 0; k < layers; ++k) gathered.layers[row * layers + k] *= scale;
    if (!thin_.empty()) thin[row] *= scale;
    return true;
}

}  // namespace frazil
