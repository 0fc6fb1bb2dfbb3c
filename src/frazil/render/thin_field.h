// What thin parts add to the exponent of what a body absorbs (thickness.h), at places below its surface.
// Model: a place so deep under the plane of a point's surface has there Z of that point, as deep as it is, and Y of that
//   depth (even_light.h); what the points about the place where it lies nearest to the surface tell is averaged over
//   their area, as far as absorption is felt. Edges that are nearer than the plane at which a ray enters are so known. Deep
//   inside, and where the points' spacing varies (PointBlend::suits), Z is a sum like that of light.
// Units: metres, where the body's points stand.
// Valid: thread-safe after construction.
// Not: exponents at the points (thickness.h).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "frazil/points/point_lookup.h"
#include "frazil/render/thickness.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

// Where light is absorbed that would leave towards a viewer.
struct AbsorbingPlaces {
    std::vector<V3f> positions;  // in the space of the body's points, the mean of `depths` below its surface
    std::vector<V3f> normals;    // outwards, where they are seen
    std::vector<Rgb> depths;     // free paths below the surface there: EvenLight::absorbed_at
};

class ThinField {
  public:
    // `cells` of the points, may be null; `tree` sums the exponents.
    ThinField(const PointSet& points, const Cells* cells, const Thinness& known, std::shared_ptr<const PointTree> tree,
              std::shared_ptr<const ThinMedium> medium);

    // (N, 2), as in Thinness, for places below a surface; `below` are those where their light is summed.
    std::vector<Rgb> at(const AbsorbingPlaces& places, const std::vector<V3f>& below,
                        const GatherOptions& options) const;
    // For places that lie inside.
    std::vector<Rgb> inside(const std::vector<V3f>& places, const GatherOptions& options) const;

  private:
    // A point that tells of a place.
    struct Near {
        std::uint32_t index;  // in the order of the lookup
        float weight;
        float under;  // its plane the place is, metres
        V3f beside;   // from the place to where the point tells of: as deep under its plane, below the point
    };
    struct Lean;
    bool near(const V3f& place, const V3f& normal, const Rgb& depth, std::vector<Near>& near_points,
              Rgb* exponents) const;

    std::shared_ptr<const PointTree> tree_;
    std::shared_ptr<const ThinMedium> medium_;
    bool is_empty_ = false;  // nothing is known
    float reach_ = 0.0f;
    std::optional<PointLookup> lookup_;
    std::vector<Rgb> exponents_;  // in the order of the lookup
    std::vector<float> areas_;    // too
};

}  // namespace frazil
