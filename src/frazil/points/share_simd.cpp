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

// The points to which a part of the patch can be nearest.
struct Owners {
    int count = 0;
    alignas(32) float x2[kMostOwners + kWide], y2[kMostOwners + kWide], s[kMostOwners + kWide];  // twice the place
    // Squared distance to the patch's corners, less what all have in common.
    alignas(32) float to_corner[kMostCorners][kMostOwners + kWide];
    int candidates[kMostOwners + 1];
};

// All candidates but those that are farther than one other from all corners, and so from all of the patch. Of candidates
// that cannot be told apart the first is kept. False where there are too many.
HWY_INLINE bool find_owners(const Patch& patch, const Candidates& c, Owners& owners) {
    const int corners = patch.count, groups = groups_of(c.count);
    if (c.count > kMostCandidates) return false;
    alignas(32) float to[kMostCorners][kMostCandidates + kWide];
    for (int g = 0; g < groups; g += kWide) {
        const Eight x2 = load(c.x + g) + load(c.x + g), y2 = load(c.y + g) + load(c.y + g), s = load(c.s + g);
        for (int k = 0; k < corners; ++k) store(s - (x2 * splat(patch.x[k]) + y2 * splat(patch.y[k])), to[k] + g);
    }
    for (int k = 0; k < corners; ++k) {
        for (int i = c.count; i < groups; ++i) to[k][i] = kFar;
    }
    const Eight zero = splat(0.0f);
    int count = 0;
    for (int p = 0; p < c.count; ++p) {
        // Without a branch on what is hidden, which nobody can predict.
        unsigned hiding = 0;
        for (int g = 0; g < groups; g += kWide) {
            Eight farthest = load(to[0] + g) - splat(to[0][p]);
            for (int k = 1; k < corners; ++k) farthest = most(farthest, load(to[k] + g) - splat(to[k][p]));
            const unsigned before = p >= g + kWide ? 0xffu : p <= g ? 0u : (1u << (p - g)) - 1;
            hiding |= less(farthest, zero) | (~less(zero, farthest) & before);
        }
        owners.x2[count] = c.x[p] + c.x[p];
        owners.y2[count] = c.y[p] + c.y[p];
        owners.s[count] = c.s[p];
        for (int k = 0; k < corners; ++k) owners.to_corner[k][count] = to[k][p];
        owners.candidates[count] = p;
        count += hiding == 0 ? 1 : 0;
        if (count > kMostOwners) return false;
    }
    for (int k = 0; k < corners; ++k) {
        for (int i = count; i < groups_of(count); ++i) owners.to_corner[k][i] = kFar;
    }
    owners.count = count;
    return true;
}

// The line between the shares of each two owners: a · z = c, with its normal a away from the first.
struct Lines {
    int count = 0;
    alignas(32) float ax[kMostLines + kWide], ay[kMostLines + kWide], c[kMostLines + kWide];
    alignas(32) float first_x2[kMostLines + kWide], first_y2[kMostLines + kWide], first_s[kMostLines + kWide];
    alignas(32) float second[kMostLines + kWide];  // its number
    std::uint8_t owners[kMostLines + kWide][2];
    alignas(32) float from[kMostLines + kWide], to[kMostLines + kWide];  // what of it is an edge of the two shares
};

HWY_INLINE void make_lines(const Owners& owners, Lines& lines) {
    const Eight lane = load(kLanes);
    int count = 0;
    for (int p = 0; p + 1 < owners.count; ++p) {
        const Eight x = splat(owners.x2[p]), y = splat(owners.y2[p]), s = splat(owners.s[p]);
        const int rest = owners.count - 1 - p;
        for (int i = 0; i < rest; i += kWide) {
            const int at = count + i, q = p + 1 + i;
            store(load(owners.x2 + q) - x, lines.ax + at);
            store(load(owners.y2 + q) - y, lines.ay + at);
            store(load(owners.s + q) - s, lines.c + at);
            store(x, lines.first_x2 + at);
            store(y, lines.first_y2 + at);
            store(s, lines.first_s + at);
            store(lane + splat(float(q)), lines.second + at);
        }
        for (int i = 0; i < rest; ++i) {
            lines.owners[count + i][0] = static_cast<std::uint8_t>(p);
            lines.owners[count + i][1] = static_cast<std::uint8_t>(p + 1 + i);
        }
        count += rest;
    }
    // Lanes past the last hold a line that is nowhere near.
    store(splat(1.0f), lines.ax + count);
    store(splat(0.0f), lines.ay + count);
    store(splat(1e15f), lines.c + count);
    store(splat(0.0f), lines.first_x2 + count);
    store(splat(0.0f), lines.first_y2 + count);
    store(splat(0.0f), lines.first_s + count);
    store(splat(-1.0f), lines.second + count);
    lines.count = count;
}

// What is left of lines z = o + t d, from <= t <= to.
struct Spans {
    Eight from, to;

    // Keep where t · slope <= room. A slope that is not a number keeps all, as do a slope and a room of 0.
    HWY_INLINE void keep(Eight slope, Eight room) {
        const Eight zero = splat(0.0f);
        slope = slope + zero;  // no -0
        const Eight t = room / slope;
        to = least(where_at_most(zero, slope, t, splat(kFar)), to);
        from = most(where_less(slope, zero, t, splat(-kFar)), from);
    }
};

// A share while its edges are collected: twice its area, and the way around it, which ends where it began.
struct Outline {
    float twice, x, y;
};

template <bool kVaries>
HWY_INLINE Eight excess2(Eight distance2, Eight x, Eight y, const Patch& patch) {
    Eight spacing = splat(patch.least_spacing);
    if constexpr (kVaries) {
        spacing = splat(patch.center_spacing) + (splat(patch.spacing_slope.x) * x + splat(patch.spacing_slope.y) * y);
    }
    return distance2 - spacing * spacing;
}

template <bool kVaries>
bool share_patch_as(const Patch& patch, const Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    gap = Gap();
    shares.clear();
    if (candidates.count == 0) return true;
    if constexpr (kVaries) {
        const float slope = std::abs(patch.spacing_slope.x) + std::abs(patch.spacing_slope.y);
        if (!(slope * 1e-6f * (1.0f + patch.radius) < kMostSpacingError * patch.least_spacing)) return false;
    }
    Owners owners;
    if (!find_owners(patch, candidates, owners)) return false;
    const int count = owners.count, corners = patch.count;
    const Eight zero = splat(0.0f), no_number = splat(std::numeric_limits<float>::quiet_NaN());

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
    int gap_line = -1, gap_corner = 0;
    bool is_gap_at_end = false;

    if (count == 1) {
        float twice = 0.0f;
        for (int e = 2; e < corners; ++e) {
            const V2f a(patch.x[0], patch.y[0]);
            twice += (V2f(patch.x[e - 1], patch.y[e - 1]) - a).cross(V2f(patch.x[e], patch.y[e]) - a);
        }
        if (twice > 0.0f) shares.push_back({candidates.points[owners.candidates[0]], twice});
    }
    Lines lines;
    lines.count = 0;
    alignas(32) float edge_from[kMostCorners][kMostOwners + kWide], edge_to[kMostCorners][kMostOwners + kWide];
    Outline outlines[kMostOwners];
    alignas(32) float way_x[kWide], way_y[kWide], twice[kWide];
    if (count > 1) {
        // Along the line between two owners' shares: what is not nearer to a third, and inside of the patch.
        make_lines(owners, lines);
        for (int p = 0; p < count; ++p) outlines[p] = {0.0f, 0.0f, 0.0f};
        for (int g = 0; g < lines.count; g += kWide) {
            const Eight ax = load(lines.ax + g), ay = load(lines.ay + g), c = load(lines.c + g);
            const Eight length2 = ax * ax + ay * ay, k = c / length2;
            const Eight ox = ax * k, oy = ay * k, dx = zero - ay, dy = ax;
            const Eight first_x2 = load(lines.first_x2 + g), first_y2 = load(lines.first_y2 + g);
            const Eight first_o = (first_x2 * ox + first_y2 * oy) - load(lines.first_s + g);
            const Eight first_d = first_x2 * dx + first_y2 * dy;
            const Eight second = load(lines.second + g);
            Spans spans = {splat(-kFar), splat(kFar)};
            for (int h = 0; h < count; ++h) {
                const Eight x2 = splat(owners.x2[h]), y2 = splat(owners.y2[h]);
                const Eight h_o = (x2 * ox + y2 * oy) - splat(owners.s[h]), h_d = x2 * dx + y2 * dy;
                spans.keep(where_equal(second, splat(float(h)), no_number, h_d - first_d), first_o - h_o);
            }
            for (int e = 0; e < corners; ++e) {
                const int next = e + 1 == corners ? 0 : e + 1;
                const float ex = patch.x[next] - patch.x[e], ey = patch.y[next] - patch.y[e];
                const Eight nx = splat(ey), ny = splat(-ex), room = splat(patch.x[e] * ey - patch.y[e] * ex);
                spans.keep(nx * dx + ny * dy, room - (nx * ox + ny * oy));
            }
            const unsigned bits = less(spans.from, spans.to);
            store(spans.from, lines.from + g);
            store(spans.to, lines.to + g);
            if (bits == 0) continue;

            const Eight o2 = (ox * ox + oy * oy) - first_o;
            const auto excess_at = [&](Eight t) {
                return excess2<kVaries>(o2 + t * (t * length2 - first_d), ox + t * dx, oy + t * dy, patch);
            };
            const Eight at_from = excess_at(spans.from), at_to = excess_at(spans.to);
            const Eight excess = where_less(spans.from, spans.to, most(at_from, at_to), splat(-kFar));
            const float farthest = greatest(excess);
            if (farthest > gap.excess2) {
                gap.excess2 = farthest;
                const int lane = std::countr_zero(~less(excess, splat(farthest)));
                gap_line = g + lane;
                is_gap_at_end = (~less(at_to, splat(farthest)) >> lane & 1) != 0;
            }
            const Eight part = spans.to - spans.from;
            store(part * dx, way_x);
            store(part * dy, way_y);
            store(part * c, twice);
            for (unsigned left = bits; left != 0; left &= left - 1) {
                const int lane = std::countr_zero(left);
                Outline &p = outlines[lines.owners[g + lane][0]], &q = outlines[lines.owners[g + lane][1]];
                p.twice += twice[lane];
                p.x += way_x[lane];
                p.y += way_y[lane];
                q.twice -= twice[lane];
                q.x -= way_x[lane];
                q.y -= way_y[lane];
            }
        }
        // Along the patch's own edges.
        for (int e = 0; e < corners; ++e) {
            const int next = e + 1 == corners ? 0 : e + 1;
            const float ex = patch.x[next] - patch.x[e], ey = patch.y[next] - patch.y[e];
            const float cross = patch.x[e] * ey - patch.y[e] * ex;
            const float *at_e = owners.to_corner[e], *at_next = owners.to_corner[next];
            for (int g = 0; g < count; g += kWide) {
                const Eight p_e = load(at_e + g), p_next = load(at_next + g);
                Spans spans = {zero, splat(1.0f)};
                for (int h = 0; h < count; ++h) {
                    const Eight room = splat(at_e[h]) - p_e, slope = room - (splat(at_next[h]) - p_next);
                    spans.keep(slope, room);
                }
                store(spans.from, edge_from[e] + g);
                store(spans.to, edge_to[e] + g);
                store(spans.to - spans.from, way_x);
                for (unsigned left = less(spans.from, spans.to); left != 0; left &= left - 1) {
                    const int lane = std::countr_zero(left);
                    Outline& p = outlines[g + lane];
                    p.twice += way_x[lane] * cross;
                    p.x += way_x[lane] * ex;
                    p.y += way_x[lane] * ey;
                }
            }
        }
        for (int p = 0; p < count; ++p) {
            gap.open = std::max(gap.open, std::abs(outlines[p].x) + std::abs(outlines[p].y));
            if (outlines[p].twice > 0.0f) {
                shares.push_back({candidates.points[owners.candidates[p]], outlines[p].twice});
            }
        }
        if (!(gap.open <= kMostOpen * patch.least_spacing)) return false;
    }
    if (gap.excess2 <= 0.0f) return true;

    // Whose share the gap is in, and its middle.
    int owner = 0;
    V2f corner(0.0f);
    if (gap_line < 0) {
        gap_corner = std::countr_zero(~less(at_corners, splat(gap.excess2)));
        for (int h = 1; h < count; ++h) {
            if (owners.to_corner[gap_corner % corners][h] < owners.to_corner[gap_corner % corners][owner]) owner = h;
        }
        corner = V2f(patch.x[gap_corner], patch.y[gap_corner]);
    } else {
        owner = lines.owners[gap_line][0];
    }
    V2f ends(0.0f);
    int end_count = 0;
    for (int i = 0; i < lines.count; ++i) {
        if ((lines.owners[i][0] != owner && lines.owners[i][1] != owner) || !(lines.from[i] < lines.to[i])) continue;
        const V2f a(lines.ax[i], lines.ay[i]), d(-a.y, a.x), o = a * (lines.c[i] / a.length2());
        ends += o * 2.0f + d * (lines.from[i] + lines.to[i]);
        end_count += 2;
        if (i == gap_line) corner = o + d * (is_gap_at_end ? lines.to[i] : lines.from[i]);
    }
    for (int e = 0; e < corners; ++e) {
        const V2f a(patch.x[e], patch.y[e]), b(patch.x[(e + 1) % corners], patch.y[(e + 1) % corners]);
        const float from = count > 1 ? edge_from[e][owner] : 0.0f, to = count > 1 ? edge_to[e][owner] : 1.0f;
        if (!(from < to)) continue;
        ends += a * 2.0f + (b - a) * (from + to);
        end_count += 2;
    }
    gap.corner = corner;
    gap.point = V2f(0.5f * owners.x2[owner], 0.5f * owners.y2[owner]);
    gap.middle = end_count > 0 ? ends / float(end_count) : corner;
    return true;
}

bool share_patch_here(const Patch& patch, const Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    return patch.least_spacing == patch.largest_spacing ? share_patch_as<false>(patch, candidates, shares, gap)
                                                        : share_patch_as<true>(patch, candidates, shares, gap);
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
