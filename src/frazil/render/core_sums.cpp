#include "frazil/render/core_sums.h"

#include <algorithm>

namespace frazil {
namespace {

// Thickness varies slowly: its gathers may be this much coarser.
constexpr float kThicknessTolerance = 4.0f;

}  // namespace

SumColumns columns_of(const CoreTrees& trees, std::size_t groups, std::size_t knots) {
    return {groups, knots, trees.on_surface != nullptr, trees.thickness != nullptr, 0};
}

Rgb* CoreSums::add_row() {
    values_.resize(values_.size() + columns_.count(), Rgb(0.0f));
    return &values_[values_.size() - columns_.count()];
}

void CoreSums::append(const CoreSums& more) {
    values_.insert(values_.end(), more.values_.begin(), more.values_.end());
}

CoreSums gather_core(const CoreTrees& trees, const std::vector<V3f>& below, const std::vector<V3f>& on_surface,
                     const GatherOptions& options) {
    const std::size_t count = below.size();
    const Gathered light = trees.light->gather(below.data(), count, options);
    SumColumns columns = columns_of(trees, light.groups, light.knots);
    Gathered overlays;
    if (trees.overlays) {
        overlays = trees.overlays->gather(below.data(), count, {options.tolerance, options.estimator, false});
        columns.overlays = overlays.groups;
    }
    CoreSums sums(columns);
    sums.values_.resize(count * columns.count());
    const auto fill = [&](std::size_t first, const Rgb* values, std::size_t own) {
        for (std::size_t i = 0; i < count; ++i) {
            std::copy(values + i * own, values + (i + 1) * own, &sums.values_[i * columns.count() + first]);
        }
    };
    const auto fill_tree = [&](std::size_t first, const Gathered& gathered) {
        fill(first, gathered.coverage.data(), 1);
        fill(first + 1, gathered.exitance.data(), columns.groups);
        fill(first + 1 + columns.groups, gathered.layers.data(), columns.knots * columns.groups);
    };
    fill_tree(0, light);
    if (columns.has_surface) fill_tree(columns.of_tree(), trees.on_surface->gather(on_surface.data(), count, options));
    if (columns.has_thin) {
        fill(columns.thin(), thin_exponents(trees.thickness.get(), below.data(), count, options).data(), 1);
    }
    fill(columns.first_overlay(), overlays.exitance.data(), columns.overlays);
    return sums;
}

std::vector<Rgb> thin_exponents(const PointTree* thickness, const V3f* positions, std::size_t count,
                                const GatherOptions& options) {
    if (!thickness) return {};
    const Gathered sums =
        thickness->gather(positions, count, {kThicknessTolerance * options.tolerance, Estimator::sum, false});
    std::vector<Rgb> exponents(count, Rgb(0.0f));
    for (std::size_t i = 0; i < count; ++i) {
        for (int c = 0; c < 3; ++c) {
            if (sums.coverage[i][c] > 0.0f) exponents[i][c] = sums.exitance[i][c] / sums.coverage[i][c];
        }
    }
    return exponents;
}

}  // namespace frazil
