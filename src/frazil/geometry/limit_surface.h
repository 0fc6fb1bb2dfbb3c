// A Catmull-Clark cage as an Embree geometry that can be evaluated anywhere on its limit surface.
// Model: rtcInterpolate on RTC_GEOMETRY_TYPE_SUBDIVISION; regular patches exactly, others by Embree's approximation.
// Units: those of the cage.
// Valid: cages without repeated vertices in a face and with faces of 3 to 15 corners; thread-safe evaluation.
// Not: holes, which are the caller's not to evaluate: Embree would make boundaries of their edges.
#pragma once

#include <cstdint>

#include "frazil/geometry/embree.h"
#include "frazil/geometry/subdivision.h"

namespace frazil {

class LimitSurface {
  public:
    // Face-varying and vertex uvs follow the surface if `with_uvs`, linear along seams and boundaries.
    LimitSurface(const ControlMesh& cage, bool with_uvs);
    ~LimitSurface();
    LimitSurface(const LimitSurface&) = delete;
    LimitSurface& operator=(const LimitSurface&) = delete;

    // Limit position and unit normal; a zero normal where the tangents vanish.
    void eval(std::uint32_t face, const V2f& at, V3f& position, V3f& normal) const;
    V2f eval_uv(std::uint32_t face, const V2f& at) const;

    // Embree's coordinates of a point: a quad is the unit square from its first corner on; of other faces, the sub-quad
    // of each corner lies in a cell of a 4 x 4 board, shrunk to half so that cells do not touch.
    static V2f in_quad(float u, float v) { return {u, v}; }
    static V2f in_sub_quad(int corner, float u, float v) {
        return {2.0f * float(corner % 4) + 0.5f + u, 2.0f * float(corner / 4) + 0.5f + v};
    }

  private:
    RTCGeometry geometry_ = nullptr;
};

}  // namespace frazil
