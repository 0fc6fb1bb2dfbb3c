// Which part of a fragment is nearest to which point: exact, from nine numbers a pair.
// Model: along a triangle |x-p|² - |x-q|² is linear, so that its values at the corners say where p is nearer than q; the part
//   nearest to p is the triangle clipped by one line per other point. The distance to p is largest at a corner of the part.
// Units: squared distances in the tile's unit; places are barycentrics (of the second and third corner) of the fragment.
// Valid: any triangle, slivers included, as nothing is projected. Points at equal distance all along share as the first takes
//   all.
// Not: more than a few dozen candidates, for which the pairwise clip is slow.
#pragma once

#include <vector>

#include "frazil/base/vec.h"
#include "frazil/points/polygon_clip.h"

namespace frazil {

struct CornerDistances {
    double d[3];  // squared distances from a point to the fragment's corners
};

struct PiecePlace {
    double u, v;
};
using Piece = ClipPolygon<PiecePlace, 64>;

inline PiecePlace mix_places(const PiecePlace& a, const PiecePlace& b, double t) {
    return {a.u + (b.u - a.u) * t, a.v + (b.v - a.v) * t};
}

// Leave out most candidates that are nearest nowhere on the fragment; `kept` holds the indices of the others. One goes
// where another, the nearest to some corner, is as near or nearer at all corners. nearest[k] is the nearest to corner k.
inline void drop_dominated(const CornerDistances* candidates, int count, const int nearest[3], std::vector<int>& kept) {
    kept.clear();
    for (int i = 0; i < count; ++i) {
        const double* a = candidates[i].d;
        bool is_dominated = false;
        for (int k = 0; k < 3 && !is_dominated; ++k) {
            const double* b = candidates[nearest[k]].d;
            is_dominated = nearest[k] != i && b[0] <= a[0] && b[1] <= a[1] && b[2] <= a[2] &&
                           (nearest[k] < i || b[0] < a[0] || b[1] < a[1] || b[2] < a[2]);
        }
        if (!is_dominated) kept.push_back(i);
    }
}

// The nearest candidate to each corner.
inline void find_nearest(const CornerDistances* candidates, int count, int nearest[3]) {
    for (int k = 0; k < 3; ++k) {
        nearest[k] = 0;
        for (int i = 1; i < count; ++i) {
            if (candidates[i].d[k] < candidates[nearest[k]].d[k]) nearest[k] = i;
        }
    }
}

// The part of the fragment that is nearest to candidate `self` among `kept`.
inline void clip_piece(const CornerDistances* candidates, const std::vector<int>& kept, int self, Piece& piece) {
    piece.count = 0;
    piece.push({0.0, 0.0});
    piece.push({1.0, 0.0});
    piece.push({0.0, 1.0});
    const double* p = candidates[self].d;
    for (const int other : kept) {
        if (other == self) continue;
        const double* q = candidates[other].d;
        const double f0 = p[0] - q[0], fu = (p[1] - q[1]) - f0, fv = (p[2] - q[2]) - f0;
        piece.clip([&](const PiecePlace& place) { return f0 + fu * place.u + fv * place.v; }, mix_places);
        if (piece.count < 3) return;
    }
}

// The piece's share of the fragment's area, in [0, 1].
inline double piece_share(const Piece& piece) {
    double twice = 0.0;
    for (int i = 2; i < piece.count; ++i) {
        const PiecePlace &a = piece.vertices[0], &b = piece.vertices[i - 1], &c = piece.vertices[i];
        twice += (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
    }
    return std::abs(twice);
}

// The share of the fragment that is nearest to candidate `self`, in [0, 1], to float precision: what areas need, several
// times as fast. The same clip, on arrays, with a look at all corners at once before anything is cut.
float share_of(const CornerDistances* candidates, const std::vector<int>& kept, int self);

}  // namespace frazil
