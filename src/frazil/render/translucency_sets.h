// Sets of bodies that share their light as one: formations made of many shells that run into each other.
// Model: the points of all members make one cloud for one tree. A point that lies inside another member is not on the
//   surface of the union: it is left out, with its area and light. Where surfaces coincide the first member has the
//   points. Each object stands for itself unless its `translucency_set` names a set.
// Units: metres, world space.
// Valid: members whose meshes are closed (interior.h) and whose media agree; others stand for themselves, with a warning.
// Not: the seam: points beside it stand for a little area that lies inside.
#pragma once

#include <string>
#include <type_traits>
#include <vector>

#include "frazil/render/bodies.h"
#include "frazil/render/shells.h"

namespace frazil {

class TranslucencySets {
  public:
    // `lit` has the points; all must outlive this.
    TranslucencySets(const Scene& scene, const RayScene& ray_scene, const std::vector<std::unique_ptr<Body>>& bodies,
                     const std::vector<LitPoints>& lit);

    // Each begins with an object's path.
    const std::vector<std::string>& warnings() const { return warnings_; }

    // The object that stands for the set of this one: itself where it has none.
    std::size_t leader(std::size_t object) const { return leader_[object]; }
    bool is_leader(std::size_t object) const { return leader_[object] == object; }

    // The points of a leader's set that lie on the union's surface; with cells where all members have some.
    const PlacedPoints& points(std::size_t leader) const;
    // Their values, (N, columns), from those of each member's own points; empty where a member has none.
    // `values(object)` points to these.
    template <class OfObject>
    auto united(std::size_t leader, std::size_t columns, const OfObject& values) const {
        using Values = std::remove_cvref_t<decltype(*values(leader))>;
        const Union* set = find(leader);
        if (!set) return Values(*values(leader));
        for (const std::size_t member : set->members) {
            if (values(member)->empty()) return Values();
        }
        Values result;
        result.reserve(set->sources.size() * columns);
        for (const auto& [object, point] : set->sources) {
            const Values& own = *values(object);
            for (std::size_t c = 0; c < columns; ++c) result.push_back(own[point * columns + c]);
        }
        return result;
    }
    // Null for a body by itself.
    const Shells* shells(std::size_t leader) const;

  private:
    struct Union {
        std::size_t leader = 0;
        std::vector<std::size_t> members;
        Shells shells;
        PlacedPoints points;
        std::vector<std::pair<std::size_t, std::size_t>> sources;  // object and its point
    };
    const Union* find(std::size_t leader) const;
    void unite(Union& set) const;

    const std::vector<LitPoints>& lit_;
    std::vector<std::size_t> leader_;
    std::vector<Union> unions_;
    std::vector<std::string> warnings_;
};

}  // namespace frazil
