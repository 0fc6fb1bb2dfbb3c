#include <bit>
#include <cmath>

#include "frazil/points/patch_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/points/patch_simd.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

constexpr int kWide = 8;

// Eight floats with the few operations that are needed: one register where the processor has such, else an array.
#if HWY_ARCH_X86 && HWY_MAX_BYTES >= 32
namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::FixedTag<float, kWide>;
using IntTag = hn::RebindToSigned<Tag>;

struct Eight {
    hn::Vec<Tag> v;
};

HWY_INLINE Eight splat(float x) {
    return {hn::Set(Tag(), x)};
}
HWY_INLINE Eight load(const float* p) {
    return {hn::LoadU(Tag(), p)};
}
HWY_INLINE void store(Eight a, float* p) {
    hn::StoreU(a.v, Tag(), p);
}
HWY_INLINE Eight operator+(Eight a, Eight b) {
    return {hn::Add(a.v, b.v)};
}
HWY_INLINE Eight operator-(Eight a, Eight b) {
    return {hn::Sub(a.v, b.v)};
}
HWY_INLINE Eight operator*(Eight a, Eight b) {
    return {hn::Mul(a.v, b.v)};
}
HWY_INLINE Eight operator/(Eight a, Eight b) {
    return {hn::Div(a.v, b.v)};
}
HWY_INLINE Eight least(Eight a, Eight b) {
    return {hn::Min(a.v, b.v)};
}
// A bit for each lane where a < b.
HWY_INLINE unsigned less(Eight a, Eight b) {
#if HWY_TARGET == HWY_AVX2
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(a.v.raw, b.v.raw, _CMP_LT_OQ)));
#else
    return _mm256_cmp_ps_mask(a.v.raw, b.v.raw, _CMP_LT_OQ);
#endif
}
HWY_INLINE Eight permute(Eight a, const std::int32_t* lanes) {
    return {
        hn::Vec<Tag>{_mm256_permutevar8x32_ps(a.v.raw, _mm256_loadu_si256(reinterpret_cast<const __m256i*>(lanes)))}};
}
HWY_INLINE Eight spread_lane(Eight a, int lane) {
    return {hn::Vec<Tag>{_mm256_permutevar8x32_ps(a.v.raw, _mm256_set1_epi32(lane))}};
}
// Lanes below `count` of a, then b, then c in all that are left.
HWY_INLINE Eight append(Eight a, Eight b, Eight c, int count) {
    const auto lane = hn::Iota(IntTag(), 0), at = hn::Set(IntTag(), count);
    const auto is_kept = hn::RebindMask(Tag(), hn::Lt(lane, at)), is_next = hn::RebindMask(Tag(), hn::Eq(lane, at));
    return {hn::IfThenElse(is_kept, a.v, hn::IfThenElse(is_next, b.v, c.v))};
}
HWY_INLINE float sum(Eight a) {
    const __m128 half = _mm_add_ps(_mm256_castps256_ps128(a.v.raw), _mm256_extractf128_ps(a.v.raw, 1));
    const __m128 pair = _mm_add_ps(half, _mm_movehl_ps(half, half));
    return _mm_cvtss_f32(_mm_add_ss(pair, _mm_movehdup_ps(pair)));
}
HWY_INLINE float greatest(Eight a) {
    const __m128 half = _mm_max_ps(_mm256_castps256_ps128(a.v.raw), _mm256_extractf128_ps(a.v.raw, 1));
    const __m128 pair = _mm_max_ps(half, _mm_movehl_ps(half, half));
    return _mm_cvtss_f32(_mm_max_ss(pair, _mm_movehdup_ps(pair)));
}
// The lanes whose bits are set, one after the other; writes up to eight.
HWY_INLINE void compress(Eight a, unsigned bits, float* p) {
    const std::uint8_t byte = static_cast<std::uint8_t>(bits);
    hn::StoreU(hn::Compress(a.v, hn::LoadMaskBits(Tag(), &byte)), Tag(), p);
}
#else
struct Eight {
    float v[kWide];
};

template <class F>
HWY_INLINE Eight each(const F& f) {
    Eight r;
    for (int i = 0; i < kWide; ++i) r.v[i] = f(i);
    return r;
}
HWY_INLINE Eight splat(float x) {
    return each([&](int) { return x; });
}
HWY_INLINE Eight load(const float* p) {
    return each([&](int i) { return p[i]; });
}
HWY_INLINE void store(Eight a, float* p) {
    for (int i = 0; i < kWide; ++i) p[i] = a.v[i];
}
HWY_INLINE Eight operator+(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] + b.v[i]; });
}
HWY_INLINE Eight operator-(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] - b.v[i]; });
}
HWY_INLINE Eight operator*(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] * b.v[i]; });
}
HWY_INLINE Eight operator/(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] / b.v[i]; });
}
HWY_INLINE Eight least(Eight a, Eight b) {
    return each([&](int i) { return a.v[i] < b.v[i] ? a.v[i] : b.v[i]; });
}
HWY_INLINE unsigned less(Eight a, Eight b) {
    unsigned bits = 0;
    for (int i = 0; i < kWide; ++i) bits |= unsigned(a.v[i] < b.v[i]) << i;
    return bits;
}
HWY_INLINE Eight permute(Eight a, const std::int32_t* lanes) {
    return each([&](int i) { return a.v[lanes[i]]; });
}
HWY_INLINE Eight spread_lane(Eight a, int lane) {
    return splat(a.v[lane]);
}
HWY_INLINE Eight append(Eight a, Eight b, Eight c, int count) {
    return each([&](int i) { return i < count ? a.v[i] : i == count ? b.v[i] : c.v[i]; });
}
HWY_INLINE float sum(Eight a) {
    const float* v = a.v;
    return ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]));
}
HWY_INLINE float greatest(Eight a) {
    float most = a.v[0];
    for (int i = 1; i < kWide; ++i) most = a.v[i] > most ? a.v[i] : most;
    return most;
}
HWY_INLINE void compress(Eight a, unsigned bits, float* p) {
    for (; bits != 0; bits &= bits - 1) *p++ = a.v[std::countr_zero(bits)];
}
#endif

// Corners of a convex polygon, counter-clockwise; lanes past the last hold the last once more.
struct Polygon {
    Eight x, y, spacing;
    int count;
};

// Lanes of a ring of `count` corners, turned so that lane 0 holds corner `first`.
struct RingTable {
    std::int32_t turned[kWide + 1][kWide][kWide];
    std::int32_t next[kWide + 1][kWide];  // of the lanes past the last: the last, so that they make edges of no length
};
constexpr RingTable make_ring_table() {
    RingTable table = {};
    for (int count = 1; count <= kWide; ++count) {
        for (int first = 0; first < kWide; ++first) {
            for (int lane = 0; lane < kWide; ++lane) table.turned[count][first][lane] = (first + lane) % count;
        }
        for (int lane = 0; lane < kWide; ++lane)
            table.next[count][lane] = lane < count ? (lane + 1) % count : count - 1;
    }
    return table;
}
constexpr RingTable kRing = make_ring_table();

HWY_INLINE Polygon polygon_of(const Patch& patch) {
    return {load(patch.x), load(patch.y), load(patch.spacing), patch.count};
}

// Cut away the corners of `out`, where heights are above 0. False where they do not lie in a row, or too many come.
template <bool kVaries>
HWY_INLINE bool cut(Polygon& polygon, Eight heights, unsigned out) {
    const int n = polygon.count;
    const unsigned full = (1u << n) - 1, in = full & ~out;
    // The corners that are kept begin where the one before is out.
    const unsigned starts = in & ~((in << 1) | (in >> (n - 1)));
    const int kept = std::popcount(in);
    if ((starts & (starts - 1)) != 0 || kept + 2 > kWide) return false;
    const int first = std::countr_zero(starts);
    int last = first + kept - 1, before = first - 1;
    last -= last >= n ? n : 0;
    before += before < 0 ? n : 0;

    const std::int32_t* next = kRing.next[n];
    const Eight t = heights / (heights - permute(heights, next));
    const std::int32_t* turned = kRing.turned[n][first];
    const auto mix = [&](Eight& corner) {
        const Eight on_edge = corner + (permute(corner, next) - corner) * t;
        corner = append(permute(corner, turned), spread_lane(on_edge, last), spread_lane(on_edge, before), kept);
    };
    mix(polygon.x);
    mix(polygon.y);
    if constexpr (kVaries) mix(polygon.spacing);
    polygon.count = kept + 2;
    return true;
}

template <bool kVaries>
bool share_patch_as(const Patch& patch, Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    const int count = candidates.count;
    const float *px = candidates.x.data(), *py = candidates.y.data(), *ps = candidates.s.data();
    const Polygon whole = polygon_of(patch);
    gap = Gap();
    shares.clear();
    for (int p = 0; p < count; ++p) {
        Polygon part = whole;
        const Eight x_p = splat(px[p]), y_p = splat(py[p]), s_p = splat(ps[p]);
        Eight twice_x = part.x + part.x, twice_y = part.y + part.y;
        Eight to_p = s_p - (twice_x * x_p + twice_y * y_p);
        bool is_empty = false;
        for (int q = 0; q < count; ++q) {
            const Eight to_q = splat(ps[q]) - (twice_x * splat(px[q]) + twice_y * splat(py[q]));
            const unsigned out = less(to_q, to_p);
            if (out == 0) continue;
            const unsigned full = (1u << part.count) - 1;
            if ((out & full) == full) {
                is_empty = true;
                break;
            }
            if (!cut<kVaries>(part, to_p - to_q, out)) return false;
            twice_x = part.x + part.x;
            twice_y = part.y + part.y;
            to_p = s_p - (twice_x * x_p + twice_y * y_p);
        }
        if (is_empty) continue;
        const std::int32_t* next = kRing.next[part.count];
        const float twice = sum(part.x * permute(part.y, next) - permute(part.x, next) * part.y);
        if (twice > 0.0f) shares.push_back({candidates.points[p], twice});
        const Eight excess2 = (part.x * part.x + part.y * part.y + to_p) - part.spacing * part.spacing;
        const float most = greatest(excess2);
        if (most > gap.excess2) {
            float x[kWide], y[kWide];
            store(part.x, x);
            store(part.y, y);
            const int corner = std::countr_zero(~less(excess2, splat(most)));
            const float more = float(kWide - part.count), inverse = 1.0f / float(part.count);
            const V2f middle((sum(part.x) - more * x[kWide - 1]) * inverse,
                             (sum(part.y) - more * y[kWide - 1]) * inverse);
            gap = {V2f(x[corner], y[corner]), most, V2f(px[p], py[p]), middle};
        }
    }
    return true;
}

// Put the candidates into the order of their distance from the centre, and leave out those of which one is there twice.
void sort_candidates(Candidates& c) {
    const int count = c.count;
    if (count < 2) return;
    const std::size_t room = count + kWide;
    thread_local std::vector<float> x, y, s;
    thread_local std::vector<std::uint32_t> points;
    if (x.size() < room) {
        x.resize(2 * room);
        y.resize(2 * room);
        s.resize(2 * room);
        points.resize(2 * room);
    }
    for (int i = 0; i < kWide; ++i) c.s[count + i] = 1e30f;
    for (int i = 0; i < count; ++i) {
        // How many are nearer, or as near and before it.
        const Eight s_i = splat(c.s[i]);
        int rank = 0;
        for (int j = 0; j < count; j += kWide) {
            const Eight s_j = load(c.s.data() + j);
            const unsigned is_nearer = less(s_j, s_i), is_farther = less(s_i, s_j);
            const unsigned before = i >= j + kWide ? 0xffu : i <= j ? 0u : (1u << (i - j)) - 1;
            rank += std::popcount(is_nearer | (~is_farther & before));
        }
        x[rank] = c.x[i];
        y[rank] = c.y[i];
        s[rank] = c.s[i];
        points[rank] = c.points[i];
    }
    int kept = 0;
    for (int i = 0; i < count; ++i) {
        const bool is_twice = kept > 0 && c.s[kept - 1] == s[i] && c.x[kept - 1] == x[i] && c.y[kept - 1] == y[i];
        if (is_twice) continue;
        c.x[kept] = x[i];
        c.y[kept] = y[i];
        c.s[kept] = s[i];
        c.points[kept++] = points[i];
    }
    c.count = kept;
}

bool share_patch_here(const Patch& patch, Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    sort_candidates(candidates);
    return patch.least_spacing == patch.largest_spacing ? share_patch_as<false>(patch, candidates, shares, gap)
                                                        : share_patch_as<true>(patch, candidates, shares, gap);
}

void find_candidates_here(const Neighbourhood& near, std::uint32_t cell, const Patch& patch, float reach,
                          float least_cosine, Candidates& candidates) {
    // Room for all that there are, and for a whole group behind the last.
    candidates.count = 0;
    candidates.reserve(near.count(cell) + 2 * kWide);
    const Eight cx = splat(patch.center.x), cy = splat(patch.center.y), cz = splat(patch.center.z);
    const Eight nx = splat(patch.normal.x), ny = splat(patch.normal.y), nz = splat(patch.normal.z);
    const V3f &u = patch.axes[0], &v = patch.axes[1];
    const Eight limit = splat(reach * reach), cosine = splat(least_cosine);
    int count = 0;
    const Neighbourhood::Chunk* chunks = near.chunks();
    for (std::int32_t at = near.first_chunk(cell); at >= 0; at = chunks[at].next) {
        const Neighbourhood::Chunk& list = chunks[at];
        const Eight dx = load(list.x) - cx, dy = load(list.y) - cy, dz = load(list.z) - cz;
        const Eight s = dx * dx + dy * dy + dz * dz;
        // Summed in the order of is_same_side, so that both decide alike.
        const Eight dot = load(list.nx) * nx + load(list.ny) * ny + load(list.nz) * nz;
        const unsigned bits = less(s, limit) & less(cosine, dot);
        if (bits == 0) continue;
        compress(dx * splat(u.x) + dy * splat(u.y) + dz * splat(u.z), bits, candidates.x.data() + count);
        compress(dx * splat(v.x) + dy * splat(v.y) + dz * splat(v.z), bits, candidates.y.data() + count);
        compress(s, bits, candidates.s.data() + count);
        for (unsigned left = bits; left != 0; left &= left - 1) {
            candidates.points[count++] = list.points[std::countr_zero(left)];
        }
    }
    candidates.count = count;
}

std::uint64_t uncovered_cells_here(const Patch& patch, const Candidates& candidates, int first, std::uint64_t cells) {
    const V2f step = (patch.high - patch.low) * (1.0f / kWide);
    const float within = patch.least_spacing * (1.0f - kDistanceError) - 0.5f * step.length();
    if (within <= 0.0f) return cells;
    alignas(32) float column[kWide], row[kWide];
    for (int i = 0; i < kWide; ++i) {
        column[i] = patch.low.x + (i + 0.5f) * step.x;
        row[i] = patch.low.y + (i + 0.5f) * step.y;
    }
    const Eight x = load(column), twice_x = x + x, x2 = x * x, limit = splat(within * within);
    for (int p = first; p < candidates.count && cells != 0; ++p) {
        const Eight base = (splat(candidates.s[p]) + x2) - twice_x * splat(candidates.x[p]);
        const float twice_y = 2.0f * candidates.y[p];
        std::uint64_t covered = 0;
        for (int r = 0; r < kWide; ++r) {
            const Eight distance2 = base + splat(row[r] * row[r] - twice_y * row[r]);
            covered |= std::uint64_t(less(distance2, limit)) << (kWide * r);
        }
        cells &= ~covered;
    }
    return cells;
}

// The place of the set bit of that rank.
HWY_INLINE int select_bit(std::uint64_t bits, int rank) {
    int at = 0;
    for (int width = 32; width > 0; width /= 2) {
        const int below = std::popcount((bits >> at) & ((std::uint64_t(1) << width) - 1));
        const bool is_above = rank >= below;
        rank -= is_above ? below : 0;
        at += is_above ? width : 0;
    }
    return at;
}

bool throw_darts_here(const Patch& patch, const Candidates& candidates, std::uint64_t cells, RandomStream& random,
                      int& tries, V2f& hit) {
    const V2f step = (patch.high - patch.low) * (1.0f / kWide);
    const Polygon polygon = polygon_of(patch);
    const std::int32_t* next = kRing.next[polygon.count];
    const Eight edge_x = permute(polygon.x, next) - polygon.x, edge_y = permute(polygon.y, next) - polygon.y;
    const Eight zero = splat(0.0f);
    const int marked = std::popcount(cells);
    for (; tries > 0 && marked > 0; --tries) {
        const std::uint64_t bits = random.next();
        const int cell = marked == 64 ? int(bits & 63) : select_bit(cells, int((bits & 0xffff) * marked >> 16));
        const float x = patch.low.x + (float(cell % kWide) + float(bits >> 16 & 0xffffff) * 0x1p-24f) * step.x;
        const float y = patch.low.y + (float(cell / kWide) + float(bits >> 40) * 0x1p-24f) * step.y;
        const Eight side = edge_x * (splat(y) - polygon.y) - edge_y * (splat(x) - polygon.x);
        if (less(side, zero) != 0) continue;
        // Where spacing varies, the largest is on the safe side.
        const float spacing = patch.largest_spacing * (1.0f + kDistanceError);
        const Eight limit = splat(spacing * spacing - (x * x + y * y)), x2 = splat(2.0f * x), y2 = splat(2.0f * y);
        unsigned taken = 0;
        for (int p = 0; p < candidates.count && taken == 0; p += kWide) {
            const Eight to_p = load(candidates.s.data() + p) -
                               (load(candidates.x.data() + p) * x2 + load(candidates.y.data() + p) * y2);
            taken = less(to_p, limit) & (candidates.count - p >= kWide ? 0xffu : (1u << (candidates.count - p)) - 1);
        }
        if (taken != 0) continue;
        hit = V2f(x, y);
        --tries;
        return true;
    }
    return false;
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {

HWY_EXPORT(find_candidates_here);
HWY_EXPORT(uncovered_cells_here);
HWY_EXPORT(throw_darts_here);
HWY_EXPORT(share_patch_here);

V2f Gap::place(float random) const {
    // |z - p|² along z = corner + f (middle - corner) falls by more than the excess from the smaller root on.
    const V2f way = middle - corner;
    const float a = way.length2(), b = (corner - point).dot(way), root2 = b * b - a * excess2;
    float most = 1.0f;
    if (b < 0.0f && root2 > 0.0f) most = std::min(most, (-b - std::sqrt(root2)) / a);
    return corner + way * (most * random);
}

void Candidates::reserve(std::size_t capacity) {
    if (x.size() >= capacity) return;
    x.resize(2 * capacity);
    y.resize(2 * capacity);
    s.resize(2 * capacity);
    points.resize(2 * capacity);
}

void Candidates::add(float px, float py, float ps, std::uint32_t point) {
    reserve(count + 1 + 2 * 8);
    x[count] = px;
    y[count] = py;
    s[count] = ps;
    points[count++] = point;
}

void find_candidates(const Neighbourhood& near, std::uint32_t cell, const Patch& patch, float reach, float least_cosine,
                     Candidates& candidates) {
    HWY_DYNAMIC_DISPATCH(find_candidates_here)(near, cell, patch, reach, least_cosine, candidates);
}

std::uint64_t uncovered_cells(const Patch& patch, const Candidates& candidates, int first, std::uint64_t cells) {
    return HWY_DYNAMIC_DISPATCH(uncovered_cells_here)(patch, candidates, first, cells);
}

bool throw_darts(const Patch& patch, const Candidates& candidates, std::uint64_t cells, RandomStream& random,
                 int& tries, V2f& hit) {
    return HWY_DYNAMIC_DISPATCH(throw_darts_here)(patch, candidates, cells, random, tries, hit);
}

bool share_patch(const Patch& patch, Candidates& candidates, std::vector<Share>& shares, Gap& gap) {
    return HWY_DYNAMIC_DISPATCH(share_patch_here)(patch, candidates, shares, gap);
}

}  // namespace frazil
#endif
