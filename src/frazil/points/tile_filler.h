// Poisson points in one tile: darts at random, then every piece of surface taken up until it is covered.
// Model: greedy dart throwing, uniform at first; then each fragment is halved until its parts lie in the ball of one point,
//   with a dart into every part that does not; what is left at 1/32 of the spacing is split exactly among its nearest
//   points, whose farthest corner takes a point where it lies beyond the spacing. So a fragment is done only when it is
//   covered, by construction.
// Units: darts in metres; inside, the tile's own unit.
// Valid: sees the points that neighbouring tiles have already; a result is a function of those and the seed alone.
// Not: thread-safe; one filler per thread, which keeps its memory from tile to tile.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/points/fragment.h"
#include "frazil/points/nearest_piece.h"
#include "frazil/points/neighbourhood.h"

namespace frazil {

// A point while points are made: what a PointSet keeps, but for the area.
struct Dart {
    V3f position;
    V3f normal;
    std::int32_t triangle;
    V2f uv;
};

// How far from a fragment's centroid the points can lie that matter to it.
inline float fragment_reach(const Fragment& f) {
    const V3f centroid = (f.corners[0] + f.corners[1] + f.corners[2]) * (1.0f / 3.0f);
    float extent2 = 0.0f, radius = 0.0f;
    for (int k = 0; k < 3; ++k) {
        extent2 = std::max(extent2, (f.corners[k] - centroid).length2());
        radius = std::max(radius, f.radii[k]);
    }
    return (radius * 1.01f + std::sqrt(extent2)) * 1.001f;
}

inline constexpr double kCellWidth = 1.2;  // of the cells of points, beside the reach of look-ups

class TileFiller {
  public:
    TileFiller(const Mesh& mesh, const SpacingField& spacing, bool thin_walls, std::uint32_t seed)
        : mesh_(mesh), spacing_(spacing), thin_walls_(thin_walls), seed_(seed) {}

    // Cover the fragments of the tile's triangles; `around` are the points of the tiles around it, `key` names the tile.
    void fill(const TileFrame& frame, const std::int32_t* triangles, std::size_t triangle_count,
              const std::vector<const std::vector<Dart>*>& around, std::uint64_t key, std::vector<Dart>& darts);

  private:
    struct Node;
    enum class Outcome { covered, placed };

    float random() { return next_random(); }
    float next_random();
    double spacing_at(std::int32_t triangle, const V2f& uv) const;

    void throw_darts();
    void cover(const Fragment& fragment);
    bool gather(const Fragment& fragment, Node& root);
    Outcome cover_node(const Fragment& fragment, const Node& node);
    Outcome close_gap(const Fragment& fragment, const Node& node);
    bool try_place(const Fragment& fragment, double u, double v, bool may_shift);
    bool is_free(const V3f& world, const V3f& near, const V3f& normal, double radius) const;

    const Mesh& mesh_;
    const SpacingField& spacing_;
    bool thin_walls_;
    std::uint32_t seed_;

    TileFrame frame_;
    std::uint32_t tile_seed_ = 0, drawn_ = 0;
    std::vector<Dart>* darts_ = nullptr;
    std::vector<Fragment> fragments_;
    std::vector<double> cumulative_;
    std::vector<std::uint32_t> order_;
    Neighbourhood near_;
    std::vector<CornerDistances> candidates_;
    std::vector<int> kept_;
};

// The points of neighbouring tiles that lie within `reach` of the tile, entered into `near`.
template <class Enter>
void for_each_around(const TileFrame& frame, double reach, const std::vector<Dart>& darts, const Enter& enter) {
    for (std::size_t i = 0; i < darts.size(); ++i) {
        const V3f local(frame.to_local(darts[i].position));
        double gap2 = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
            const double gap = std::max(0.0, std::max(-double(local[axis]), local[axis] - frame.size));
            gap2 += gap * gap;
        }
        if (gap2 <= reach * reach) enter(i, local);
    }
}

}  // namespace frazil
