// The points that can matter in one tile, found by place: a small grid of lists.
// Model: a point is entered into every marked cell that its ball of radius `reach` touches, so that a look-up reads one
//   list, eight points at a time, and no neighbouring cells.
// Units: the tile's own (see TileFrame).
// Valid: look-ups within cells that were marked; places outside of the tile fall into the nearest cell.
// Not: removal.
#pragma once

#include <hwy/highway.h>

#include <cstdint>
#include <vector>

#include "frazil/base/vec.h"

namespace frazil {

class Neighbourhood {
  public:
    // Forget everything; `size` is the width of the tile, `cell` the wished width of its cells. Points whose normals
    // make a cosine of at most `least_cosine` with that of a look-up stay unseen.
    void reset(double size, double cell, double reach, float least_cosine);

    // Promise look-ups inside of the box; to be called before any add().
    void mark(const V3f& low, const V3f& high);

    // Enter a point; returns its index. `world` is the position as it will be stored.
    std::uint32_t add(const V3f& local, const V3f& normal, const V3f& world);

    std::size_t count() const { return locals.size(); }

    // visit(index) for every point on the side of `normal` whose squared distance from `place` is at most `distance2`
    // (no more than `reach`²); ends where visit returns true, and says so.
    template <class Visit>
    bool any_near(const V3f& place, const V3f& normal, float distance2, const Visit& visit) const {
        namespace hn = hwy::HWY_NAMESPACE;
        const hn::CappedTag<float, kLanes> tag;
        const auto x = hn::Set(tag, place.x), y = hn::Set(tag, place.y), z = hn::Set(tag, place.z);
        const auto nx = hn::Set(tag, normal.x), ny = hn::Set(tag, normal.y), nz = hn::Set(tag, normal.z);
        const auto limit = hn::Set(tag, distance2), cosine = hn::Set(tag, least_cosine_);
        for (std::int32_t chunk = heads_[cell_of(place)]; chunk >= 0; chunk = chunks_[chunk].next) {
            const Chunk& list = chunks_[chunk];
            for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(tag)) {
                const auto dx = hn::Sub(hn::Load(tag, list.x + lane), x);
                const auto dy = hn::Sub(hn::Load(tag, list.y + lane), y);
                const auto dz = hn::Sub(hn::Load(tag, list.z + lane), z);
                const auto d2 = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
                // In the order of is_same_side, so that both decide alike.
                const auto dot = hn::Add(
                    hn::Add(hn::Mul(hn::Load(tag, list.nx + lane), nx), hn::Mul(hn::Load(tag, list.ny + lane), ny)),
                    hn::Mul(hn::Load(tag, list.nz + lane), nz));
                std::uint8_t bytes[8] = {};
                hn::StoreMaskBits(tag, hn::And(hn::Le(d2, limit), hn::Gt(dot, cosine)), bytes);
                for (unsigned bits = bytes[0]; bits != 0; bits &= bits - 1) {
                    if (visit(list.points[lane + hwy::Num0BitsBelowLS1Bit_Nonzero32(bits)])) return true;
                }
            }
        }
        return false;
    }

    std::vector<V3f> locals;
    std::vector<V3f> normals;
    std::vector<V3f> worlds;

  private:
    static constexpr std::size_t kLanes = 8;
    struct Chunk {
        alignas(32) float x[kLanes], y[kLanes], z[kLanes], nx[kLanes], ny[kLanes], nz[kLanes];
        std::uint32_t points[kLanes];
        std::int32_t next;
        std::int32_t count;
    };

    int cell_along(float place) const { return static_cast<int>(std::clamp(place * scale_, 0.0f, last_cell_)); }
    std::size_t cell_of(const V3f& place) const {
        return (std::size_t(cell_along(place.z)) * cells_ + cell_along(place.y)) * cells_ + cell_along(place.x);
    }

    std::size_t cells_ = 1;  // along each axis
    float last_cell_ = 0.0f;
    float scale_ = 1.0f;
    float width_ = 1.0f;
    float reach_ = 1.0f;
    float least_cosine_ = 0.0f;
    std::vector<std::uint32_t> marked_;  // a bit per cell along x, a word per row
    std::vector<std::int32_t> heads_;
    std::vector<Chunk> chunks_;
};

}  // namespace frazil
