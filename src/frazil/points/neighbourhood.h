// The patches of one tile, each with the points that can matter to it.
// Model: patches lie in a grid of cells, by their centres. A point is looked up once, when it is entered: it finds the
//   patches in reach of it, eight at a time (see patch_simd.cpp), and is written into the list of each. So whoever works on
//   a patch has its points at hand, and knows by their number whether any has come.
// Units: the tile's own (see TileFrame).
// Valid: points that are farther from a patch's centre than its radius and its largest spacing are not in its list, nor are
//   those on its other side.
// Not: removal.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/points/patch_kernel.h"

namespace frazil {

// Patches in the order of the cells that their centres lie in, row after row; room for a whole group of lanes after the last.
struct PatchSlots {
    std::vector<float> x, y, z, nx, ny, nz;
    std::vector<float> reach2;           // squared distance at which a point counts
    std::vector<std::uint32_t> patches;  // which patch it is
    std::vector<std::uint32_t> starts;   // the first slot of each cell, and the end
    V3f origin, last_cell;
    V3i counts;  // of cells
    float scale = 1.0f;
    float reach = 0.0f;  // the largest

    int cell_along(float place, int axis) const {
        return static_cast<int>(std::clamp((place - origin[axis]) * scale, 0.0f, last_cell[axis]));
    }
};

// How near a point must be to a patch's centre to count for it.
float reach_of(const Patch& patch, double rounding);

// The patches that a point counts for and their squared distances; there must be room for all, and for a group of lanes more.
// Returns their number.
int find_patches(const PatchSlots& slots, const V3f& place, const V3f& normal, float least_cosine, std::uint32_t* found,
                 float* distances2);

class Neighbourhood {
  public:
    // Forget everything. `patches`, one or more, must stay as they are; `rounding` is how far points can be from where they are stored.
    void reset(const std::vector<Patch>& patches, double rounding, float least_cosine);

    // What a point must lie in to count for any patch.
    const Box3f& box_in_reach() const { return in_reach_; }

    // Enter a point; returns its index. `world` is the position as it is stored.
    std::uint32_t add(const V3f& local, const V3f& normal, const V3f& world);

    // The points of a patch, until the next is added.
    Candidates candidates(std::size_t patch) const {
        const List& list = lists_[patch];
        const float* x = places_.data() + 3 * std::size_t(list.begin);
        return {x, x + list.capacity, x + 2 * list.capacity, points_.data() + list.begin, int(list.count)};
    }
    std::uint32_t count(std::size_t patch) const { return lists_[patch].count; }

    std::size_t size() const { return worlds.size(); }
    std::vector<V3f> worlds;

  private:
    struct List {
        std::uint32_t begin, count, capacity;
    };
    void grow(List& list);

    const Patch* patches_ = nullptr;
    float least_cosine_ = 0.0f;
    Box3f in_reach_;
    PatchSlots slots_;
    std::vector<List> lists_;
    // Of a list that begins at b and has room for c: c times x, then y, then s from 3 b on; indices from b on.
    std::vector<float> places_;
    std::vector<std::uint32_t> points_;
    std::size_t used_ = 0;
    std::vector<std::uint32_t> cells_, found_;
    std::vector<float> distances2_;
};

}  // namespace frazil
