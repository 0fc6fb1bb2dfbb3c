// Poisson points in one tile, and the surface that is nearest to each of them.
// Model: darts at random, first evenly over the tile, then patch by patch where no ball of a point covers the surface yet.
//   Then every patch is shared out among its nearest points: where a corner of a share is farther from its point than the
//   spacing, a point is put into that corner, where it conflicts with nobody. A patch is left only when there is none: so it
//   is covered by construction, and its shares are the areas.
// Units: darts in metres; inside, the tile's own unit.
// Valid: sees the points that neighbouring tiles have already; a result is a function of those and the seed alone.
// Not: thread-safe; one filler per thread, which keeps its memory from tile to tile.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/points/exact_shares.h"
#include "frazil/points/neighbourhood.h"
#include "frazil/points/patch_kernel.h"
#include "frazil/points/tile_grid.h"

namespace frazil {

// A point while points are made: what a PointSet keeps, its area in quanta.
struct Dart {
    V3f position;
    V3f normal;
    std::int32_t triangle;
    V2f uv;
    // Many tiles add to it: in whole numbers, so that their order does not matter.
    std::int64_t quanta;
};

// What the points of a mesh are made from, and those of each tile that there are already.
struct PointsInTiles {
    const Mesh& mesh;
    SpacingField spacing;
    bool thin_walls;
    std::uint32_t seed;
    double unit;          // the reference spacing, metres
    double area_quantum;  // m²
    bool with_areas;      // as soon as they are known; else all patches wait as those at borders do
    TileGrid grid;
    std::vector<std::vector<Dart>> darts;
    // For each of them, what can need it beside its own tile's final patches: see near_walls() and kForBorder.
    std::vector<std::vector<std::uint8_t>> needs;
    std::vector<std::vector<std::int32_t>> borders;  // triangles with patches that wait for later tiles
};

class TileFiller {
  public:
    explicit TileFiller(PointsInTiles& points) : points_(points) {}

    // Place the tile's points, and add to all points the areas of those patches that no later tile can change.
    void fill(std::size_t tile);

    // Once all tiles are filled: add the areas of the other patches of the tile.
    void share_border(std::size_t tile);

  private:
    struct PatchState {
        std::uint64_t cells;  // those that the first `known` points of its list do not cover
        std::uint32_t known;
        std::uint32_t shared_count;  // of its list when it was shared out
        std::uint32_t first_share, share_count;
        bool is_final;  // no tile that is filled later can change it
    };

    void begin(std::size_t tile);
    void prepare_neighbourhood();
    void enter(std::size_t tile, unsigned need);
    void enter_neighbours();
    bool is_final(const Patch& patch) const;
    void throw_evenly(double density);
    void throw_into_gaps();
    void take_covered(std::size_t patch);
    void cover(std::size_t patch);
    int place_free(std::size_t patch, std::uint64_t cells, int darts, int most_steps);
    bool place_somewhere(std::size_t patch);
    void share_again(std::size_t patch);
    void share(std::size_t patch);
    void keep_shares(std::size_t patch);
    void add_areas(const Patch& patch, const Share* shares, std::size_t count);
    void flush_areas();
    bool place(std::size_t patch, double x, double y, int most_steps);
    bool is_free(const Candidates& near, const V3f& world, double x, double y, double shift, double spacing) const;

    PointsInTiles& points_;
    std::size_t tile_ = 0;
    TileFrame frame_;
    double rounding_ = 0.0;  // how far a place can be from where it is stored
    RandomStream random_;
    std::vector<TileGrid::Neighbour> around_;
    std::vector<Box3f> later_;  // what the patches of those around it lie in that are filled later
    std::vector<Patch> patches_;
    std::vector<PatchState> states_;
    std::vector<std::uint32_t> order_;
    Neighbourhood near_;
    std::vector<Dart*> entered_;  // the points in near_ that other tiles, or a filled one, have
    std::vector<Dart> placed_;    // those after them
    std::vector<Share> shares_, all_shares_;
    std::vector<ExactGap> gaps_;
    std::vector<std::int64_t> quanta_;  // for each point in near_
};

}  // namespace frazil
