#include "frazil/render/drift.h"

#include <algorithm>

#include "frazil/base/parallel.h"
#include "frazil/points/point_lookup.h"

namespace frazil {
namespace {

// The kernel's radius: in drift lengths, and in spacings at least and at most.
constexpr float kReach = 2.0f, kFewestSpacings = 2.0f, kMostSpacings = 6.0f;
// Of facing normals, and of the kernel's reach that lies between the surfaces, at least.
constexpr float kGap = 0.1f;

// (1 - q)² over the squared distance q, times area: what a neighbour weighs, and its gradient where the light is.
struct Neighbour {
    std::uint32_t point;
    float weight;
    V3f slope;
};

// What all neighbours of a place weigh together, and the gradient of that.
struct Total {
    float weight = 0.0f;
    V3f slope = V3f(0.0f);
};

class Neighbourhoods {
  public:
    Neighbourhoods(const PointSet& points, float reach) : points_(points), reach_(reach), lookup_(points, reach) {}

    // use(neighbour) for what weighs in at `place`, a place of the surface with this normal.
    template <class Use>
    void visit(std::uint32_t place, const Use& use) const {
        const V3f &position = points_.positions[place], &normal = points_.normals[place];
        lookup_.visit(position, [&](std::uint32_t point, const V3f& p, const V3f& n) {
            const V3f way = position - p;
            const float q = way.length2() / (reach_ * reach_);
            if (q >= 1.0f || is_across_a_gap(way, normal, n)) return;
            const float area = points_.areas[point];
            use({point, (1.0f - q) * (1.0f - q) * area, way * (-4.0f * (1.0f - q) / (reach_ * reach_) * area)});
        });
    }

  private:
    // Whether surfaces face each other across what is not the body; the same from either side.
    bool is_across_a_gap(const V3f& way, const V3f& normal, const V3f& other) const {
        const float least = kGap * reach_;
        return normal.dot(other) < -kGap && way.dot(normal) < -least && way.dot(other) > least;
    }

    const PointSet& points_;
    float reach_;
    PointLookup lookup_;
};

}  // namespace

void carry_on(const PointSet& points, const std::vector<Flow>& flows, const Rgb& length, std::vector<Rgb>& irradiance) {
    const std::size_t n = points.size(), groups = n > 0 ? irradiance.size() / n : 0;
    const float spacing = static_cast<float>(points.spacing);
    const float reach = std::clamp(kReach * max_component(length), kFewestSpacings * spacing, kMostSpacings * spacing);
    const Neighbourhoods neighbourhoods(points, reach);
    Rgb way;  // no farther than the kernel can carry
    for (int c = 0; c < 3; ++c) way[c] = std::clamp(length[c], 0.0f, reach / kReach);
    std::vector<Total> totals(n);
    parallel_for(n, 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            Total& total = totals[k];
            neighbourhoods.visit(static_cast<std::uint32_t>(k), [&](const Neighbour& other) {
                total.weight += other.weight;
                total.slope += other.slope;
            });
        }
    });
    // What each point gets from those around it: as they see it, so that nothing is lost.
    parallel_for(n, 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t j = begin; j < end; ++j) {
            neighbourhoods.visit(static_cast<std::uint32_t>(j), [&](const Neighbour& from) {
                const std::uint32_t k = from.point;
                const Total& total = totals[k];
                // The weight of j at k over its area: the kernel is even, its slope odd.
                const float share = points.areas[k] / total.weight, weight = from.weight / points.areas[k];
                const V3f slope =
                    (from.slope * (-1.0f / points.areas[k]) - total.slope * (weight / total.weight)) * share;
                for (std::size_t g = 0; g < groups; ++g) {
                    const Flow& flow = flows[k * groups + g];
                    irradiance[j * groups + g] += Rgb(flow[0].dot(slope), flow[1].dot(slope), flow[2].dot(slope)) * way;
                }
            });
        }
    });
}

}  // namespace frazil
