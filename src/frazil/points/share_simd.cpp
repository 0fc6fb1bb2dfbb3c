#include <cmath>
#include <limits>

#include "frazil/points/patch_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/points/share_simd.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "frazil/points/eight-inl.h"

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

// More than these are left to share_exactly.
constexpr int kMostCandidates = 256, kMostOwners = 32;
constexpr int kMostLines = kMostOwners * (kMostOwners - 1) / 2;
constexpr float kFar = 1e30f;
// How far the corners of a share may stand open, in spacings, and how far a steep spacing may err.
constexpr float kMostOpen = 1e-3f, kMostSpacingError = 1e-5f;

constexpr int groups_of(int count) {
    return (count + kWide - 1) / kWide * kWide;
}

// Pairs (p, q) of owners with p < q: (0, 1), (0, 2), (1, 2), (0, 3) ..., the same however many owners there are.
struct PairTable {
    std::uint8_t first[kMostLines + kWide], second[kMostLines + kWide];
};
constexpr PairTable make_pair_table() {
    PairTable table = {};
    int at = 0;
    for (int q = 1; at < kMostLines; ++q) {
        for (int p = 0; p < q; ++p, ++at) {
            table.first[at] = static_cast<std::uint8_t>(p);
            table.second[at] = static_cast<std::uint8_t>(q);
        }
    }
    return table;
}
constexpr PairTable kPairs = make_pair_table();

// For the pairs of up to eight owners: their lanes, and for each owner what is no number where it is one of the pair.
constexpr int kFewLines = 32;
struct FewTable {
    alignas(32) std::int32_t first[kFewLines], second[kFewLines];
    alignas(32) float is_third[kWide][kFewLines];
};
constexpr FewTable make_few_table() {
    FewTable table = {};
    for (int i = 0; i < kFewLines; ++i) {
        table.first[i] = kPairs.first[i] % kWide;
        table.second[i] = kPairs.second[i] % kWide;
        for (int h = 0; h < kWide; ++h) {
            const bool is_one = h == kPairs.first[i] || h == kPairs.second[i];
            table.is_third[h][i] = is_one ? std::numeric_limits<float>::quiet_NaN() : 0.0f;
        }
    }
    return table;
}
constexpr FewTable kFew = make_few_table();

// Of candidates that cannot be told apart the first is kept: by how much it counts as nearer, 0 for those before it.
struct TieTable {
    float tie[2 * kMostCandidates + kWide];
};
constexpr TieTable make_tie_table() {
    TieTable table = {};
    for (int i = kMostCandidates + 1; i < 2 * kMostCandidates + kWide; ++i) table.tie[i] = -1e-30f;
    return table;
}
constexpr TieTable kTies = make_tie_table();

// The points to which a part of the patch can be nearest.
struct Owners {
    int count = 0;
    alignas(32) float x2[kMostOwners + kWide], y2[kMostOwners + kWide], s[kMostOwners + kWide];  // twice the place
    // Squared distance to the patch's corners, less what all have in common.
    alignas(32) float to_corner[kMostCorners][kMostOwners + kWide];
    alignas(32) float candidates[kMostOwners + kWide];
};

// All candidates but those that are farther than one other from all corners, and so from all of the patch. False where
// there are too many.
template <int kCorners>
HWY_INLINE bool find_owners(const Patch& patch, const Candidates& c, Owners& owners) {
    const int corners = kCorners > 0 ? kCorners : patch.count, groups = groups_of(c.count);
    if (c.count > kMostCandidates) return false;
    alignas(32) float to[kMostCorners][kMostCandidates + kWide];
    const Eight lane = load(kLanes), end = splat(float(c.count)), far = splat(kFar), zero = splat(0.0f);
    for (int g = 0; g < groups; g += kWide) {
        const Eight x2 = load(c.x + g) + load(c.x + g), y2 = load(c.y + g) + load(c.y + g), s = load(c.s + g);
        const Eight at = lane + splat(float(g));
        for (int k = 0; k < corners; ++k) {
            store(where_less(at, end, s - (x2 * splat(patch.x[k]) + y2 * splat(patch.y[k])), far), to[k] + g);
        }
    }
    int count = 0;
    for (int g = 0; g < groups; g += kWide) {
        // Without a branch on what is hidden, which nobody can predict.
        Eight nearest = far;
        const float* tie = kTies.tie + kMostCandidates + g;
        for (int q = 0; q < c.count; ++q) {
            Eight farthest = splat(to[0][q]) - load(to[0] + g);
            for (int k = 1; k < corners; ++k) farthest = most(farthest, splat(to[k][q]) - load(to[k] + g));
            nearest = least(nearest, farthest + load(tie - q));
        }
        const unsigned bits = ~less(nearest, zero) & 0xffu;
        compress(load(c.x + g) + load(c.x + g), bits, owners.x2 + count);
        compress(load(c.y + g) + load(c.y + g), bits, owners.y2 + count);
        compress(load(c.s + g), bits, owners.s + count);
        compress(lane + splat(float(g)), bits, owners.candidates + count);
        for (int k = 0; k < corners; ++k) compress(load(to[k] + g), bits, owners.to_corner[k] + count);
        count += std::popcount(bits);
        if (count > kMostOwners) return false;
    }
    owners.count = count;
    return true;
}

// Both owners of a group of lines: twice their places, and their squared distances.
struct LineOwners {
    Eight first_x2, first_y2, first_s, second_x2, second_y2, second_s;
};

// Those of all lines between more than eight owners.
struct ManyLines {
    alignas(32) float first_x2[kMostLines + kWide], first_y2[kMostLines + kWide], first_s[kMostLines + kWide];
    alignas(32) float second_x2[kMostLines + kWide], second_y2[kMostLines + kWide], second_s[kMostLines + kWide];
    alignas(32) float second[kMostLines + kWide];  // its number

    HWY_INLINE void make(const Owners& owners) {
        int at = 0;
        for (int q = 1; q < owners.count; ++q) {
            const Eight x2 = splat(owners.x2[q]), y2 = splat(owners.y2[q]), s = splat(owners.s[q]);
            for (int p = 0; p < q; p += kWide) {
                store(load(owners.x2 + p), first_x2 + at + p);
                store(load(owners.y2 + p), first_y2 + at + p);
                store(load(owners.s + p), first_s + at + p);
                store(x2, second_x2 + at + p);
                store(y2, second_y2 + at + p);
                store(s, second_s + at + p);
                store(splat(float(q)), second + at + p);
            }
            at += q;
        }
    }
    HWY_INLINE LineOwners at(int g) const {
        return {load(first_x2 + g),  load(first_y2 + g),  load(first_s + g),
                load(second_x2 + g), load(second_y2 + g), load(second_s + g)};
    }
    // No number where h is the second; where it is the first, its slope and room are 0.
    HWY_INLINE Eight is_third(int h, int g) const {
        const Eight no_number = splat(std::numeric_limits<float>::quiet_NaN());
        return where_equal(load(second + g), splat(float(h)), no_number, splat(0.0f));
    }
};

// Those between up to eight owners, which fit into a register.
struct FewLines {
    Eight x2, y2, s;

    HWY_INLINE void make(const Owners& owners) { x2 = load(owners.x2), y2 = load(owners.y2), s = load(owners.s); }
    HWY_INLINE LineOwners at(int g) const {
        const std::int32_t *first = kFew.first + g, *second = kFew.second + g;
        return {permute(x2, first),  permute(y2, first),  permute(s, first),
                permute(x2, second), permute(y2, second), permute(s, second)};
    }
    HWY_INLINE Eight is_third(int h, int g) const { return load(kFew.is_third[h] + g); }
};

// What is left of lines z = o + t d, from <= t <= to.
struct Spans {
    Eight from, to;

    // Keep where t · slope <= room. A slope that is not a number keeps all, as do a slope and a room of 0. A slope must not
    // be -0.
    HWY_INLINE void keep(Eight slope, Eight room) {
        const Eight t = room / slope;
        to = least(where_negative(slope, splat(kFar), t), to);
        from = most(where_negative(slope, t, splat(-kFar)), from);
    }
};

// Shares while their edges are collected: twice their areas, and the ways around them, which end where they began.
struct Outlines {
    alignas(32) float twice[kMostOwners + kWide], x[kMostOwners + kWide], y[kMostOwners + kWide];
};

// What of lines and of the patch's edges is an edge of shares, and the farthest place on them.
struct Edges {
    alignas(32) float from[kMostLines + kWide], to[kMostLines + kWide];
    alignas(32) float edge_from[kMostCorners][kMostOwners + kWide], edge_to[kMostCorners][kMostOwners + kWide];
    int gap_line = -1;
    bool is_gap_at_end = false;
};

template <bool kVaries>
HWY_INLINE Eight excess2(Eight distance2, Eight x, Eight y, const Patch& patch) {
    Eight spacing = splat(patch.least_spacing);
    if constexpr (kVaries) {
        spacing = splat(patch.center_spacing) + (splat(patch.spacing_slope.x) * x + splat(patch.spacing_slope.y) * y);
    }
    return distance2 - spacing * spacing;
}

// Along the lines between two owners' shares: what is not nearer to a third, and inside of the patch.
template <bool kVaries, int kCorners, class Lines>
HWY_INLINE void cut_lines(const Patch& patch, const Owners& owners, Edges& edges, Outlines& outlines, Gap& gap) {
    const int corners = kCorners > 0 ? kCorners : patch.count, count = owners.count;
    const int line_count = count * (count - 1) / 2;
    const Eight zero = splat(0.0f);
    Lines lines;
    lines.make(owners);
    alignas(32) float way_x[kWide], way_y[kWide], twice[kWide];
    for (int g = 0; g < line_count; g += kWide) {
        const LineOwners at = lines.at(g);
        const Eight ax = at.second_x2 - at.first_x2, ay = at.second_y2 - at.first_y2, c = at.second_s - at.first_s;
        const Eight length2 = ax * ax + ay * ay, k = c / length2;
        const Eight ox = ax * k, oy = ay * k, dx = zero - ay, dy = ax;
        const Eight first_o = (at.first_x2 * ox + at.first_y2 * oy) - at.first_s;
        const Eight first_d = at.first_x2 * dx + at.first_y2 * dy;
        Spans spans = {splat(-kFar), splat(kFar)};
        for (int h = 0; h < count; ++h) {
            const Eight x2 = splat(owners.x2[h]), y2 = splat(owners.y2[h]);
            const Eight h_o = (x2 * ox + y2 * oy) - splat(owners.s[h]), h_d = x2 * dx + y2 * dy;
            spans.keep((h_d - first_d) + lines.is_third(h, g), first_o - h_o);
        }
        for (int e = 0; e < corners; ++e) {
            const int next = e + 1 == corners ? 0 : e + 1;
            const float ex = patch.x[next] - patch.x[e], ey = patch.y[next] - patch.y[e];
            const Eight nx = splat(ey), ny = splat(-ex), room = splat(patch.x[e] * ey - patch.y[e] * ex);
            spans.keep((nx * dx + ny * dy) + zero, room - (nx * ox + ny * oy));
        }
        const unsigned is_line = line_count - g >= kWide ? 0xffu : (1u << (line_count - g)) - 1;
        const unsigned bits = less(spans.from, spans.to) & is_line;
        store(spans.from, edges.from + g);
        store(spans.to, edges.to + g);
        if (bits == 0) continue;

        const Eight o2 = (ox * ox + oy * oy) - first_o;
        const auto excess_at = [&](Eight t) {
            return excess2<kVaries>(o2 + t * (t * length2 - first_d), ox + t * dx, oy + t * dy, patch);
        };
        const Eight at_from = excess_at(spans.from), at_to = excess_at(spans.to), farther = most(at_from, at_to);
        const Eight part = spans.to - spans.from;
        const unsigned beyond = less(splat(gap.excess2), farther) & bits;
        if (beyond != 0) {
            alignas(32) float excess[kWide];
            store(farther, excess);
            int farthest = std::countr_zero(beyond);
            for (unsigned left = beyond & (beyond - 1); left != 0; left &= left - 1) {
                const int lane = std::countr_zero(left);
                if (excess[lane] > excess[farthest]) farthest = lane;
            }
            gap.excess2 = excess[farthest];
            edges.gap_line = g + farthest;
            edges.is_gap_at_end = (~less(at_to, farther) >> farthest & 1) != 0;
        }
        store(part * dx, way_x);
        store(part * dy, way_y);
        store(part * c, twice);
        for (unsigned left = bits; left != 0; left &= left - 1) {
            const int lane = std::countr_zero(left), p = kPairs.first[g + lane], q = kPairs.second[g + lane];
            outlines.twice[p] += twice[lane];
            outlines.x[p] += way_x[lane];
            outlines.y[p] += way_y[lane];
            outlines.twice[q] -= twice[lane];
            outlines.x[q] -= way_x[lane];
            outlines.y[q] -= way_y[lane];
        }
    }
}

// Along the patch's own edges.
template <int kCorners>
HWY_INLINE void cut_edges(const Patch& patch, const Owners& owners, Edges& edges, Outlines& outlines) {
    const int corners = kCorners > 0 ? kCorners : patch.count, count = owners.count;
    constexpr int kStore = kCorners > 0 ? kCorners : kMostCorners;
    const Eight zero = splat(0.0f), lane = load(kLanes), end = splat(float(count));
    for (int g = 0; g < count; g += kWide) {
        Eight to[kStore];
        Spans spans[kStore];
        for (int e = 0; e < corners; ++e) {
            to[e] = where_less(lane + splat(float(g)), end, load(owners.to_corner[e] + g), splat(kFar));
            spans[e] = {zero, splat(1.0f)};
        }
        for (int h = 0; h < count; ++h) {
            const Eight first = splat(owners.to_corner[0][h]) - to[0];
            Eight room = first;
            for (int e = 0; e < corners; ++e) {
                const Eight next = e + 1 == corners ? first : splat(owners.to_corner[e + 1][h]) - to[e + 1];
                spans[e].keep(room - next, room);
                room = next;
            }
        }
        Eight twice = load(outlines.twice + g), x = load(outlines.x + g), y = load(outlines.y + g);
        for (int e = 0; e < corners; ++e) {
            const int next = e + 1 == corners ? 0 : e + 1;
            const float ex = patch.x[next] - patch.x[e], ey = patch.y[next] - patch.y[e];
            store(spans[e].from, edges.edge_from[e] + g);
            store(spans[e].to, edges.edge_to[e] + g);
            const Eight part = where_less(spans[e].from, spans[e].to, spans[e].to - spans[e].from, zero);
            twice = twice + part * splat(patch.x[e] * ey - patch.y[e] * ex);
            x = x + part * splat(ex);
            y = y + part * splat(ey);
        }
        store(twice, outlines.twice + g);
        store(x, outlines.x + g);
        store(y, outlines.y + g);
    }
}

// Whose share the gap is in, and its middle.
void find_gap(const Patch& patch, const Owners& owners, const Edges& edges, int gap_corner, Gap& gap) {
    const int count = owners.count, corners = patch.count;
    int owner = 0;
    if (edges.gap_line < 0) {
        const float* to = owners.to_corner[gap_corner % corners];
        for (int h = 1; h < count; ++h) {
            if (to[h] < to[owner]) owner = h;
        }
        gap.corner = V2f(patch.x[gap_corner], patch.y[gap_corner]);
    } else {
        owner = kPairs.first[edges.gap_line];
    }
    V2f ends(0.0f);
    int end_count = 0;
    for (int other = 0; other < count; ++other) {
        if (other == owner) continue;
        const int p = std::min(owner, other), q = std::max(owner, other), line = q * (q - 1) / 2 + p;
        if (!(edges.from[line] < edges.to[line])) continue;
        const V2f a(owners.x2[q] - owners.x2[p], owners.y2[q] - owners.y2[p]), d(-a.y, a.x);
        const V2f o = a * ((owners.s[q] - owners.s[p]) / a.length2());
        ends += o * 2.0f + d * (edges.from[line] + edges.to[line]);
        end_count += 2;
        if (line == edges.gap_line) gap.corner = o + d * (edges.is_gap_at_end ? edges.to[line] : edges.from[line]);
    }
    for (int e = 0; e < corners; ++e) {
        const V2f a(patch.x[e], patch.y[e]), b(patch.x[(e + 1) % corners], patch.y[(e + 1) % corners]);
        const float from = count > 1 ? edges.edge_from[e][owner] : 0.0f;
        const float to = count > 1 ? edges.edge_to[e][owner] : 1.0f;
        if (!(from < to)) continue;
        ends += a * 2.0f + (b - a) * (from + to);
        end_count += 2;
    }
    gap.point = V2f(0.5f * owners.x2[owner], 0.5f * owners.y2[owner]);
    gap.middle = end_count > 0 ? ends / float(end_count) : gap.corner;
}

template <bool kVaries, int kCorners>
bool share_patch_as(const Patch& patch, const Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    gap = Gap();
    shares.clear();
    if (candidates.count == 0) return true;
    if constexpr (kVaries) {
        const float slope = std::abs(patch.spacing_slope.x) + std::abs(patch.spacing_slope.y);
        if (!(slope * 1e-6f * (1.0f + patch.radius) < kMostSpacingError * patch.least_spacing)) return false;
    }
    Owners owners;
    if (!find_owners<kCorners>(patch, candidates, owners)) return false;
    const int count = owners.count;

    // The patch's own corners can be the farthest from their owners.
    const Eight corner_x = load(patch.x), corner_y = load(patch.y);
    Eight to_nearest = splat(kFar);
    for (int h = 0; h < count; ++h) {
        to_nearest =
            least(to_nearest, splat(owners.s[h]) - (splat(owners.x2[h]) * corner_x + splat(owners.y2[h]) * corner_y));
    }
    const Eight at_corners =
        excess2<kVaries>((corner_x * corner_x + corner_y * corner_y) + to_nearest, corner_x, corner_y, patch);
    gap.excess2 = greatest(at_corners);
    const int gap_corner = std::countr_zero(~less(at_corners, splat(gap.excess2)));

    Edges edges;
    const auto point = [&](int owner) { return candidates.points[static_cast<int>(owners.candidates[owner])]; };
    if (count == 1) {
        float twice = 0.0f;
        for (int e = 2; e < patch.count; ++e) {
            const V2f a(patch.x[0], patch.y[0]);
            twice += (V2f(patch.x[e - 1], patch.y[e - 1]) - a).cross(V2f(patch.x[e], patch.y[e]) - a);
        }
        if (twice > 0.0f) shares.push_back({point(0), twice});
    } else {
        Outlines outlines;
        const Eight zero = splat(0.0f);
        for (int g = 0; g < count; g += kWide) {
            store(zero, outlines.twice + g);
            store(zero, outlines.x + g);
            store(zero, outlines.y + g);
        }
        if (count <= kWide) {
            cut_lines<kVaries, kCorners, FewLines>(patch, owners, edges, outlines, gap);
        } else {
            cut_lines<kVaries, kCorners, ManyLines>(patch, owners, edges, outlines, gap);
        }
        cut_edges<kCorners>(patch, owners, edges, outlines);
        for (int p = 0; p < count; ++p) {
            gap.open = std::max(gap.open, std::abs(outlines.x[p]) + std::abs(outlines.y[p]));
            if (outlines.twice[p] > 0.0f) shares.push_back({point(p), outlines.twice[p]});
        }
        if (!(gap.open <= kMostOpen * patch.least_spacing)) return false;
    }
    if (gap.excess2 > 0.0f) find_gap(patch, owners, edges, gap_corner, gap);
    return true;
}

bool share_patch_here(const Patch& patch, const Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    if (patch.least_spacing != patch.largest_spacing) return share_patch_as<true, 0>(patch, candidates, shares, gap);
    // Most patches have as many corners.
    if (patch.count == 3) return share_patch_as<false, 3>(patch, candidates, shares, gap);
    if (patch.count == 4) return share_patch_as<false, 4>(patch, candidates, shares, gap);
    return share_patch_as<false, 0>(patch, candidates, shares, gap);
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {

HWY_EXPORT(share_patch_here);

V2f Gap::place(float random) const {
    // |z - p|² along z = corner + f (middle - corner) falls by more than the excess from the smaller root on.
    const V2f way = middle - corner;
    const float a = way.length2(), b = (corner - point).dot(way), root2 = b * b - a * excess2;
    float most = 1.0f;
    if (b < 0.0f && root2 > 0.0f) most = std::min(most, (-b - std::sqrt(root2)) / a);
    return corner + way * (most * random);
}

bool share_patch(const Patch& patch, const Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    return HWY_DYNAMIC_DISPATCH(share_patch_here)(patch, candidates, shares, gap);
}

}  // namespace frazil
#endif
