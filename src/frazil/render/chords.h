// Chords of a body: ways from a point of its surface inwards to where the body ends.
// Model: cosine-distributed, quasi-random; of a body by itself, or of several that are one (shells.h).
// Units: metres.
// Valid: thread-safe; the same chords for the same point and seed.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frazil/base/sampler.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/points/point_set.h"
#include "frazil/render/shells.h"

namespace frazil {

struct Chord {
    Ray ray;              // inwards
    float cosine = 1.0f;  // to the normal
    float length = 0.0f;  // infinite where there is no other side
};

class ChordFinder {
  public:
    static constexpr int kMost = 16, kFewest = 4;  // chords from each point

    // `shells` that are one body: chords end where the last of them is left. Else they end at what `mask` lets them meet.
    // Both, and the scene, must outlive this; they may be null. `chords`, from each point, is a power of two.
    ChordFinder(const RayScene& scene, const Shells* shells, PlacementMask mask, int chords = kMost);

    // Chords from each point.
    std::size_t chords() const { return net_.size(); }
    // Those of which[0], then of which[1] ...: more at a time take less time each. which[0] is the `first` of all points along
    // a curve on which neighbours are near each other in space: they share one sequence.
    std::vector<Chord> find(const PointSet& points, std::span<const std::uint32_t> which, std::size_t first,
                            std::uint32_t seed) const;
    // Whether chords of a point tell of a closed body: one by itself has another side on all of them.
    bool is_closed(std::span<const Chord> chords) const;
    // How far it is along rays from inside to where the body ends; infinite where it does not.
    std::vector<float> ways_out(std::span<const Ray> rays) const;
    // The same along rays that may begin outside, as far as what they meet, or that they meet nothing, tells so: kOutside.
    static constexpr float kOutside = -1.0f;
    std::vector<float> ways_out_if_inside(std::span<const Ray> rays) const;
    // Quasi-random numbers, one per chord, of which points' are independent.
    void draw(std::uint32_t seed, std::size_t point, std::vector<V2f>& u) const;

  private:
    const RayScene& scene_;
    const Shells* shells_;
    PlacementMask mask_;
    ScrambledNet net_;
};

}  // namespace frazil
