#include "frazil/render/core_sums.h"

#include <algorithm>

namespace frazil {

SumColumns columns_of(const CoreTrees& trees, std::size_t groups, std::size_t knots) {
    return {groups, knots, trees.on_surface != nullptr, trees.thin != nullptr, 0};
}

Rgb* CoreSums::add_row() {
    values_.resize(values_.size() + columns_.count(), Rgb(0.0f));
    return &values_[values_.size() - columns_.count()];
}

void CoreSums::append(const CoreSums& more) {
    values_.insert(values_.end(), more.values_.begin(), more.values_.end());
}

CoreSums gather_core(const CoreTrees& trees, const CorePlaces& places, const GatherOptions& options) {
    const std::size_t count = places.below.size();
    const Gathered light = trees.light->gather(places.below.data(), count, options);
    SumColumns columns = columns_of(trees, light.groups, light.knots);
    Gathered overlays;
    if (trees.overlays) {
        overlays = trees.overlays->gather(places.below.data(), count, {options.tolerance, options.estimator, false});
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
    if (columns.has_surface) {
        fill_tree(columns.of_tree(), trees.on_surface->gather(places.on_surface.data(), count, options));
    }
    if (columns.has_thin) {
        const std::vector<Rgb> thin = places.absorbing.normals.empty()
                                          ? trees.thin->inside(places.below, options)
                                          : trees.thin->at(places.absorbing, places.below, options);
        fill(columns.thin(), thin.data(), 2);
    }
    fill(columns.first_overlay(), overlays.exitance.data(), columns.overlays);
    return sums;
}

}  // namespace frazil
