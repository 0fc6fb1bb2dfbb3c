// What a body's trees sum at places, a row per place.
// Model: a row has the light that is summed where it is scattered first and, of bodies with such trees, the same on the
//   surface, what thin parts gain, and what overlays take. Sums are linear in the light: rows are blended as they are, before
//   anything is made of them, and lie in memory as they are blended.
// Units: as Gathered.
// Not: compensation, which makes exitance of them (gathering.cpp).
#pragma once

#include <memory>
#include <vector>

#include "frazil/render/thin_field.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

// Trees stand where a body's points do.
struct CoreTrees {
    std::shared_ptr<const PointTree> light;  // none where the object has no surface; one for a translucency set
    // The same light on the surface itself, where sums are asked for that are not divided by their coverage.
    std::shared_ptr<const PointTree> on_surface;
    std::shared_ptr<const ThinField> thin;
    std::shared_ptr<const PointTree> overlays;  // plant_overlay_trees, where such layers are asked for
};

// Each place where light is scattered first, and on the surface; and where what it lacks is absorbed, nowhere if all of them lie
// inside.
struct CorePlaces {
    std::vector<V3f> below, on_surface;
    AbsorbingPlaces absorbing = {};
};

// What a row consists of, in this order. Overlays come last: rows without them are the beginning of those that have some.
struct SumColumns {
    std::size_t groups = 1, knots = 0;
    bool has_surface = false, has_thin = false;
    std::size_t overlays = 0;  // layers times groups

    std::size_t of_tree() const { return 1 + groups * (1 + knots); }
    std::size_t thin() const { return has_surface ? 2 * of_tree() : of_tree(); }
    std::size_t first_overlay() const { return has_thin ? thin() + 2 : thin(); }
    std::size_t count() const { return first_overlay() + overlays; }
};

// Without columns of overlays.
SumColumns columns_of(const CoreTrees& trees, std::size_t groups, std::size_t knots);

// What a tree of light sums at a place.
struct TreeSums {
    const Rgb* columns;
    std::size_t groups, knots;

    const Rgb& coverage() const { return columns[0]; }
    const Rgb& exitance(std::size_t group) const { return columns[1 + group]; }
    // Of one knot of the ramp; all of the exitance where there is none.
    const Rgb& knot(std::size_t knot, std::size_t group) const {
        return knots > 0 ? columns[1 + groups * (1 + knot) + group] : exitance(group);
    }
};

class CoreSums {
  public:
    explicit CoreSums(const SumColumns& columns) : columns_(columns) {}

    const SumColumns& columns() const { return columns_; }
    std::size_t size() const { return values_.size() / columns_.count(); }

    const Rgb* row(std::size_t i) const { return &values_[i * columns_.count()]; }
    TreeSums below(std::size_t i) const { return {row(i), columns_.groups, columns_.knots}; }
    // Where there are none, those below.
    TreeSums on_surface(std::size_t i) const {
        return {columns_.has_surface ? row(i) + columns_.of_tree() : row(i), columns_.groups, columns_.knots};
    }
    // Of ThinField, both; null without.
    const Rgb* thin(std::size_t i) const { return columns_.has_thin ? row(i) + columns_.thin() : nullptr; }
    // (layers, groups); null without.
    const Rgb* overlays(std::size_t i) const {
        return columns_.overlays > 0 ? row(i) + columns_.first_overlay() : nullptr;
    }

    // Of zeros, to be filled.
    Rgb* add_row();
    // Rows of the same columns.
    void append(const CoreSums& more);

  private:
    friend CoreSums gather_core(const CoreTrees& trees, const CorePlaces& places, const GatherOptions& options);

    SumColumns columns_;
    std::vector<Rgb> values_;
};

// Sums at places, where the trees stand.
CoreSums gather_core(const CoreTrees& trees, const CorePlaces& places, const GatherOptions& options);

// Add the first `count` columns of a row, weighted, to those of another.
inline void add_weighted(Rgb* sum, const Rgb* row, std::size_t count, float weight) {
    for (std::size_t k = 0; k < count; ++k) sum[k] += row[k] * weight;
}

}  // namespace frazil
