#include "frazil/render/point_gathers.h"

#include "frazil/render/bodies.h"

namespace frazil {
namespace {

constexpr float kReach = 1.5f;  // of the kernel, in spacings

// Of a row of sums, and of the point's place in the lookup.
std::size_t bytes_per_point(const SumColumns& columns) {
    return sizeof(Rgb) * columns.count() + sizeof(V3f) * 2 + 12;
}

}  // namespace

GatherOptions PointGatherPlan::options_for(const Body& body) const {
    GatherOptions options = gather;
    options.ramp_layers = keeps_knots && !body.material->ramp.is_empty();
    return options;
}

AbsorbingPlaces absorbing_below(const Body& body, const PointSet& points) {
    const Rgb depth = body.absorbed_at(kMeanCosine);
    AbsorbingPlaces places{points.positions, points.normals, std::vector<Rgb>(points.size(), depth)};
    for (std::size_t k = 0; k < points.size(); ++k) {
        places.positions[k] -= points.normals[k] * (mean_component(depth) / body.sigma_t());
    }
    return places;
}

std::shared_ptr<const PointGathers> PointGathers::make(const Body& body, const PointCloud& cloud, std::size_t groups,
                                                       PointGatherPlan& plan) {
    const PointSet& points = cloud.points();
    if (plan.paths < double(points.size()) || !PointBlend::suits(points)) return nullptr;
    const GatherOptions options = plan.options_for(body);
    CoreTrees trees = body.trees;
    trees.overlays = nullptr;
    const SumColumns columns =
        columns_of(trees, groups, options.ramp_layers ? body.material->ramp.distances.size() : 0);
    const std::size_t bytes = points.size() * bytes_per_point(columns);
    if (bytes > plan.bytes) return nullptr;
    plan.bytes -= bytes;
    plan.paths -= double(points.size());
    std::shared_ptr<PointGathers> result(new PointGathers(PointBlend(points, kReach), columns));
    const std::vector<V3f> inwards = cloud.inward_positions();
    CorePlaces places;
    PointSet seen;
    for (const std::uint32_t i : result->blend_.order()) {
        places.below.push_back(inwards[i]);
        seen.positions.push_back(points.positions[i]);
        seen.normals.push_back(points.normals[i]);
    }
    places.on_surface = seen.positions;
    places.absorbing = absorbing_below(body, seen);
    result->at_points_ = gather_core(trees, places, options);
    return result;
}

bool PointGathers::append(const V3f& position, const V3f& normal, CoreSums& rows) const {
    if (normal == V3f(0.0f)) return false;
    const std::size_t count = columns().count();
    Rgb* row = nullptr;
    const auto add = [&](std::uint32_t point, float weight) {
        if (!row) row = rows.add_row();
        add_weighted(row, at_points_.row(point), count, weight);
    };
    // Rows of a run lie side by side.
    const auto ask = [&](std::uint32_t point, std::uint32_t points) {
        const auto* bytes = reinterpret_cast<const char*>(at_points_.row(point));
        for (std::size_t at = 0; at < points * count * sizeof(Rgb); at += 64) __builtin_prefetch(bytes + at);
    };
    const float sum = blend_.visit(position, normal, add, ask);
    if (!row) return false;
    const float scale = 1.0f / sum;
    for (std::size_t k = 0; k < count; ++k) row[k] *= scale;
    return true;
}

}  // namespace frazil
