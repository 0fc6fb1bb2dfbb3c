// The points that can matter in one tile, found by place: a small grid of lists.
// Model: a point is entered into every marked cell that its ball of radius `reach` touches, so that a look-up reads one
//   list, eight points at a time, and no neighbouring cells.
// Units: the tile's own (see TileFrame).
// Valid: look-ups within cells that were marked; places outside of the tile fall into the nearest cell.
// Not: removal.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

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
        for (std::int32_t chunk = heads_[cell_of(place)]; chunk >= 0; chunk = chunks_[chunk].next) {
            const Chunk& list = chunks_[chunk];
            for (unsigned bits = seen(list, place, normal, distance2); bits != 0; bits &= bits - 1) {
                if (visit(list.points[std::countr_zero(bits)])) return true;
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

    // A bit for each lane that lies near enough and on the side of the normal; the dot product is summed in the order of
    // is_same_side, so that both decide alike.
    unsigned seen(const Chunk& list, const V3f& place, const V3f& normal, float distance2) const {
#if defined(__SSE2__)
        const __m128 x = _mm_set1_ps(place.x), y = _mm_set1_ps(place.y), z = _mm_set1_ps(place.z);
        const __m128 nx = _mm_set1_ps(normal.x), ny = _mm_set1_ps(normal.y), nz = _mm_set1_ps(normal.z);
        const __m128 limit = _mm_set1_ps(distance2), cosine = _mm_set1_ps(least_cosine_);
        unsigned bits = 0;
        for (int lane = 0; lane < list.count; lane += 4) {
            const __m128 dx = _mm_sub_ps(_mm_load_ps(list.x + lane), x), dy = _mm_sub_ps(_mm_load_ps(list.y + lane), y),
                         dz = _mm_sub_ps(_mm_load_ps(list.z + lane), z);
            const __m128 d2 = _mm_add_ps(_mm_add_ps(_mm_mul_ps(dx, dx), _mm_mul_ps(dy, dy)), _mm_mul_ps(dz, dz));
            const __m128 dot = _mm_add_ps(
                _mm_add_ps(_mm_mul_ps(_mm_load_ps(list.nx + lane), nx), _mm_mul_ps(_mm_load_ps(list.ny + lane), ny)),
                _mm_mul_ps(_mm_load_ps(list.nz + lane), nz));
            const __m128 is_seen = _mm_and_ps(_mm_cmple_ps(d2, limit), _mm_cmpgt_ps(dot, cosine));
            bits |= unsigned(_mm_movemask_ps(is_seen)) << lane;
        }
        return bits;
#else
        unsigned bits = 0;
        for (std::size_t i = 0; i < kLanes; ++i) {
            const float dx = list.x[i] - place.x, dy = list.y[i] - place.y, dz = list.z[i] - place.z;
            const float dot = list.nx[i] * normal.x + list.ny[i] * normal.y + list.nz[i] * normal.z;
            bits |= unsigned((dx * dx + dy * dy + dz * dz <= distance2) & (dot > least_cosine_)) << i;
        }
        return bits;
#endif
    }

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
    float least_cosine_ = 0.0f;
    std::vector<std::uint32_t> marked_;  // a bit per cell along x, a word per row
    std::vector<std::int32_t> heads_;
    std::vector<Chunk> chunks_;
};

}  // namespace frazil
