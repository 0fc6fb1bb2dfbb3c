// The layers `occlusion` and `bent_normal`: how much of the hemisphere is open where the camera looks first, and whereto.
// Model: on ice, baked by rays at its points, near those that are looked at, and blended from there, without noise (points/point_blend.h; gathered with a
//   kernel as wide as their spacing where that varies); on other surfaces one ray a sample, drawn by the cosine
//   (lighting/occlusion.h).
// Units: openness 0 (all hidden) to 1; world space.
// Valid: thread-safe after construction, a tile a thread. Whatever the distance, every surface hides.
// Not: sheets of ice thinner than the spacing of their points, where that varies: both sides share what they see.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/occlusion.h"
#include "frazil/points/point_blend.h"
#include "frazil/render/bodies.h"
#include "frazil/render/tile.h"

namespace frazil {

class Openness {
  public:
    // `lit` are the points of each body; `samples` rays are traced at each. The scene must outlive this.
    Openness(const std::vector<LitPoints>& lit, const RayScene& scene, int samples, std::uint32_t seed);

    // Answer what the tile's samples have seen first, and forget it.
    void answer(Tile& tile) const;

  private:
    // Of the points of a body that are spaced alike: what they see, made where it is first asked for.
    class Points {
      public:
        Points(const PointSet& points, const RayScene& scene, const OcclusionOptions& options);

        float reach() const { return blend_.reach(); }
        // The weighted sums of openness and, times openness, of bent normals about a place; returns the sum of weights.
        float add(const V3f& position, const V3f& normal, float& openness, V3f& directions) const;

      private:
        void bake_run(std::uint32_t run) const;

        PointBlend blend_;
        PointSet points_;                    // positions and normals, in the order of the blend
        std::vector<std::uint32_t> order_;   // along the Morton curve, run after run
        std::vector<std::uint32_t> run_of_;  // of each point
        OcclusionBaker baker_;
        mutable Occlusion occlusion_;
        mutable std::vector<std::atomic<bool>> is_baked_;  // by run
        mutable std::vector<std::mutex> mutexes_;
    };
    // Of the points of a body: either.
    struct Baked {
        std::optional<Points> points;
        std::unique_ptr<const PointTree> tree;  // where the spacing varies
    };
    void blend(const Points& points, std::span<const SeenPlace> places, Tile& tile) const;
    // For so many places of a pixel.
    void add_blend(const Points& points, std::uint32_t pixel, const V3f& position, const V3f& normal, float places,
                   Tile& tile) const;
    void gather(const PointTree& tree, std::span<const SeenPlace> places, Tile& tile) const;
    void trace(std::span<const SeenPlace> places, Tile& tile) const;

    const RayScene& scene_;
    std::vector<std::unique_ptr<const Baked>> baked_;  // by object; null for other surfaces
};

}  // namespace frazil
