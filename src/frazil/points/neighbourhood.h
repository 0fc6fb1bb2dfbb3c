// The points that can matter in one tile, found by place: a small grid of lists.
// Model: a point is entered into every marked cell that its ball of radius `reach` touches, so that a look-up reads one list
//   and no neighbours.
// Units: the tile's own (see TileFrame).
// Valid: look-ups within cells that were marked; places outside of the tile fall into the nearest cell.
// Not: removal.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

class Neighbourhood {
  public:
    // Forget everything; `size` is the width of the tile, `cell` the wished width of its cells.
    void reset(double size, double cell, double reach);

    // Promise look-ups inside of the box; to be called before any add().
    void mark(const V3f& low, const V3f& high);

    // Enter a point; returns its index. `world` is the position as it will be stored.
    std::uint32_t add(const V3f& local, const V3f& normal, const V3f& world);

    std::size_t count() const { return locals.size(); }

    // visit(index) for every point within `reach` of `place`, and some beyond; ends where visit returns true, and says so.
    template <class Visit>
    bool any_near(const V3f& place, const Visit& visit) const {
        for (std::int32_t chunk = heads_[cell_of(place)]; chunk >= 0; chunk = chunks_[chunk].next) {
            const Chunk& list = chunks_[chunk];
            for (std::int32_t i = 0; i < list.count; ++i) {
                if (visit(list.points[i])) return true;
            }
        }
        return false;
    }

    std::vector<V3f> locals;
    std::vector<V3f> normals;
    std::vector<V3f> worlds;

  private:
    struct Chunk {
        std::int32_t next;
        std::int32_t count;
        std::uint32_t points[14];
    };

    int cell_along(float place) const {
        return static_cast<int>(std::clamp(place * scale_, 0.0f, last_cell_));
    }
    std::size_t cell_of(const V3f& place) const {
        return (std::size_t(cell_along(place.z)) * cells_ + cell_along(place.y)) * cells_ + cell_along(place.x);
    }

    std::size_t cells_ = 1;  // along each axis
    float last_cell_ = 0.0f;
    float scale_ = 1.0f;
    float width_ = 1.0f;
    float reach_ = 1.0f;
    std::vector<std::uint8_t> marked_;
    std::vector<std::int32_t> heads_;
    std::vector<Chunk> chunks_;
};

}  // namespace frazil
