// What is done most with a patch and the points near it: throw darts, share the patch out. Eight numbers at a
// time, for the processor that it runs on.
// Model: in the plane of a patch a point p counts by its projection (x, y) and its squared distance s from the patch's
//   centre, as |z - p|² = |z|² + s - 2 z·p for all z in the plane. So the points that are as near as p and as q lie on a line,
//   and what of it is in the patch and not nearer to a third point is the edge between the shares of p and q: all such
//   lines are cut at once, lane by lane. Edges give areas by their line integrals. Where spacing is linear, the gap from a share to
//   its point is largest at a corner.
// Units: the tile's own (see TileFrame).
// Valid: float precision, about 1e-6 spacings; the same bits on every processor. share_patch gives up (returns false) where
//   there are very many points or rounding leaves a share open; exact_shares.h does those.
// Not: placing points.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frazil/points/patch.h"

namespace frazil {

// Float distances between a place and a point err by less than this, in spacings.
inline constexpr float kDistanceError = 2e-5f;

// Random numbers: a stream of 64 bits at a time, from a seed of its own [Steele2014].
struct RandomStream {
    std::uint64_t state = 0;

    std::uint64_t next() {
        std::uint64_t x = state += 0x9e3779b97f4a7c15ULL;
        x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9ULL;
        x = (x ^ x >> 27) * 0x94d049bb133111ebULL;
        return x ^ x >> 31;
    }
    float next_float() { return static_cast<float>(next() >> 40) * 0x1p-24f; }
};

// The points that can matter to a patch, on its side: their places in its plane, and their squared distances from its
// centre. After the last there is room to read a whole group of lanes.
struct Candidates {
    const float *x, *y, *s;
    const std::uint32_t* points;
    int count;
};

// A part of a patch that is nearest to one point.
struct Share {
    std::uint32_t point;
    float weight;  // its area; what it is of the patch's, the sum of all weights tells
};

// Where a patch is farthest from its points: a corner of a share. There, squared distance less squared spacing.
struct Gap {
    V2f corner = V2f(0.0f);
    float excess2 = -1e30f;
    V2f point = V2f(0.0f);   // whose share it is
    V2f middle = V2f(0.0f);  // of the share's corners
    float open = 0.0f;       // by how much rounding has moved corners, at most

    // A place of the share, from the corner to the middle, that is farther from the point than the spacing was at the
    // corner; `random` in [0, 1) says how far in.
    V2f place(float random) const;
};

// A bit for each cell of an 8 x 8 grid over the patch's bounds that the patch may touch.
std::uint64_t cells_of(const Patch& patch);

// The cells of `cells` without those that lie in the ball of one of the candidates from `first` on.
std::uint64_t uncovered_cells(const Patch& patch, const Candidates& candidates, int first, std::uint64_t cells);

// Places of a patch, those of the lanes whose bits are set in `free` where a point can be put.
inline constexpr int kDartsAtOnce = 8;
struct Darts {
    alignas(32) float x[kDartsAtOnce], y[kDartsAtOnce];
    unsigned free = 0;
};

// Throw up to kDartsAtOnce darts into the marked cells, one or more, evenly. Free are those that hit the patch where no
// candidate is nearer than the spacing.
Darts throw_darts(const Patch& patch, const Candidates& candidates, std::uint64_t cells, RandomStream& random,
                  int count);

// Those of the darts that are free, where no candidate from `first` on is nearer than the spacing.
unsigned free_darts(const Patch& patch, const Candidates& candidates, int first, const Darts& darts);

// Share the patch among the points nearest to it. False where it gave up. Of `gap` all but excess2 and open are set only
// where excess2 > 0.
bool share_patch(const Patch& patch, const Candidates& candidates, std::vector<Share>& shares, Gap& gap);

}  // namespace frazil
