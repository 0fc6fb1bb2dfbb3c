// The mean of what points have around a place on their surface.
// Model: by a kernel some spacings wide, and by how far normals agree, so that the two sides of a sheet stay apart.
// Units: metres.
// Valid: points of one spacing; thread-safe after construction.
// Not: values at the points: they are the caller's, in the order of the lookup.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/points/point_lookup.h"

namespace frazil {

class PointBlend {
  public:
    // Of a kernel that ends so many spacings from the place.
    PointBlend(const PointSet& points, float spacings)
        : reach_(spacings * static_cast<float>(points.spacing)), lookup_(points, reach_) {}

    // Whether the points are as near to each other all over as their spacing says.
    static bool suits(const PointSet& points);

    float reach() const { return reach_; }  // metres
    // The points' indices as `visit` numbers them.
    std::vector<std::uint32_t> order() const { return lookup_.order(); }

    // visit(k, weight) for each point around a place with this outward normal; returns the sum of weights, 0
    // where there is none.
    template <class Visit>
    float visit(const V3f& position, const V3f& normal, const Visit& visit) const {
        return this->visit(position, normal, visit, [](std::uint32_t, std::uint32_t) {});
    }
    // The same; ahead(k, count) for runs of points before any is visited (PointLookup::visit).
    template <class Visit, class Ahead>
    float visit(const V3f& position, const V3f& normal, const Visit& visit, const Ahead& ahead) const {
        float sum = 0.0f;
        lookup_.visit(
            position,
            [&](std::uint32_t, std::uint32_t point, const V3f& p, const V3f& n) {
                const float facing = n.dot(normal), q = 1.0f - (p - position).length2() / (reach_ * reach_);
                if (!(facing > 0.0f && q > 0.0f)) return;
                const float weight = facing * q * q;
                sum += weight;
                visit(point, weight);
            },
            ahead);
        return sum;
    }

  private:
    float reach_;
    PointLookup lookup_;
};

}  // namespace frazil
