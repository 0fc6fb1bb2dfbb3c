// The points that can matter in one tile, found by place: a small grid of lists.
// Model: a point is entered into every marked cell that its ball of radius `reach` touches, so that a look-up reads one
//   list, eight points at a time (see patch_kernel.h), and no neighbouring cells.
// Units: the tile's own (see TileFrame).
// Valid: look-ups at places that were marked; places outside of the tile fall into the nearest cell.
// Not: removal.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

class Neighbourhood {
  public:
    static constexpr std::size_t kLanes = 8;
    // Lanes without a point lie too far away for any look-up.
    struct Chunk {
        alignas(32) float x[kLanes], y[kLanes], z[kLanes], nx[kLanes], ny[kLanes], nz[kLanes];
        alignas(32) std::uint32_t points[kLanes];
        std::int32_t next;  // a chunk of older points, or -1
        std::int32_t count;
    };

    // Forget everything; `size` is the width of the tile, `cell` the wished width of its cells.
    void reset(double size, double cell, double reach);

    // Promise look-ups at the place, which begin at the cell returned; to be called before any add().
    std::uint32_t mark(const V3f& place);

    // Whether a point can be within reach of any marked place.
    bool is_in_reach(const V3f& local) const {
        float gap2 = 0.0f;
        for (int axis = 0; axis < 3; ++axis) {
            const float gap = std::max(0.0f, std::max(marks_.min[axis] - local[axis], local[axis] - marks_.max[axis]));
            gap2 += gap * gap;
        }
        return gap2 <= reach_ * reach_ * 1.0001f;
    }

    // Enter a point; returns its index. `world` is the position as it is stored.
    std::uint32_t add(const V3f& local, const V3f& normal, const V3f& world);

    // The points entered into a cell so far: their number, and their first chunk or -1.
    std::uint32_t count(std::uint32_t cell) const { return cells_[cell].count; }
    std::int32_t first_chunk(std::uint32_t cell) const { return cells_[cell].chunk; }
    const Chunk* chunks() const { return chunks_.data(); }

    std::size_t size() const { return worlds.size(); }
    std::vector<V3f> worlds;

  private:
    struct Cell {
        std::int32_t chunk = -1;
        std::uint32_t count = 0;
    };

    int cell_along(float place) const { return static_cast<int>(std::clamp(place * scale_, 0.0f, last_cell_)); }

    std::size_t side_ = 1;  // cells along each axis
    float last_cell_ = 0.0f;
    float scale_ = 1.0f;
    float width_ = 1.0f;
    float reach_ = 1.0f;
    Box3f marks_;                        // bounds of the marked places
    std::vector<std::uint32_t> marked_;  // a bit per cell along x, a word per row
    std::vector<Cell> cells_;
    std::vector<Chunk> chunks_;
};

}  // namespace frazil
