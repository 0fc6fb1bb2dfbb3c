#include <algorithm>

#include "frazil/lighting/environment_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/lighting/environment_simd.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include <hwy/highway.h>

#include "frazil/base/trigonometry-inl.h"

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

constexpr std::size_t kBatch = 32;  // so many look-ups wait for memory together
using Float = hn::CappedTag<float, 8>;
using Int = hn::RebindToSigned<Float>;
using FloatV = hn::Vec<Float>;
using IntV = hn::Vec<Int>;

HWY_INLINE FloatV clamp01(FloatV x) {
    const Float d;
    return hn::Min(hn::Max(x, hn::Zero(d)), hn::Set(d, 1.0f));
}

HWY_INLINE bool any(hn::Mask<Int> mask) {
    return !hn::AllFalse(Int(), mask);
}

HWY_INLINE IntV gather(const std::uint32_t* base, IntV index) {
    return hn::GatherIndex(Int(), reinterpret_cast<const std::int32_t*>(base), index);
}

// The bin of a cumulative distribution at cdf[first] that holds u, by the guide at guides[first_guide]; its probability is
// never 0.
HWY_INLINE IntV find_bin(const float* cdf, IntV first, const std::uint32_t* guides, IntV first_guide, FloatV u) {
    const Float d;
    const Int di;
    const IntV one = hn::Set(di, 1);
    const IntV interval = hn::Min(hn::ConvertTo(di, hn::Mul(u, hn::Set(d, float(kEnvironmentGuides)))),
                                  hn::Set(di, kEnvironmentGuides - 1));
    const IntV guide = hn::Add(first_guide, interval);
    IntV bin = gather(guides, guide);
    IntV length = hn::Add(hn::Sub(gather(guides, hn::Add(guide, one)), bin), one);
    while (any(hn::Gt(length, one))) {
        const IntV half = hn::ShiftRight<1>(length), middle = hn::Add(bin, half);
        const auto is_right = hn::Le(hn::GatherIndex(d, cdf, hn::Add(first, middle)), u);
        bin = hn::IfThenElse(hn::RebindMask(di, is_right), middle, bin);
        length = hn::Sub(length, half);
    }
    while (true) {
        const IntV at = hn::Add(first, bin);
        const auto is_empty = hn::Eq(hn::GatherIndex(d, cdf, at), hn::GatherIndex(d, cdf, hn::Add(at, one)));
        const auto moves = hn::And(hn::RebindMask(di, is_empty), hn::Gt(bin, hn::Zero(di)));
        if (!any(moves)) return bin;
        bin = hn::IfThenElse(moves, hn::Sub(bin, one), bin);
    }
}

// The same of one u, by the guide of this distribution: without gathers, which take as long for one as for all lanes.
inline std::int32_t find_bin(const float* cdf, const std::uint32_t* guide, float u) {
    const int interval = HWY_MIN(int(u * float(kEnvironmentGuides)), kEnvironmentGuides - 1);
    auto bin = std::int32_t(guide[interval]), length = std::int32_t(guide[interval + 1]) - bin + 1;
    while (length > 1) {
        const std::int32_t half = length >> 1;
        bin += cdf[bin + half] <= u ? half : 0;
        length -= half;
    }
    while (bin > 0 && cdf[bin] == cdf[bin + 1]) --bin;
    return bin;
}

// x in [0, 1] with density proportional to the line from a to b; a and b >= 0.
HWY_INLINE FloatV sample_line(FloatV u, FloatV a, FloatV b) {
    const Float d;
    const FloatV one = hn::Set(d, 1.0f), sum = hn::Add(a, b);
    const FloatV root = hn::Sqrt(hn::Add(hn::Mul(hn::Mul(a, a), hn::Sub(one, u)), hn::Mul(hn::Mul(b, b), u)));
    const FloatV x = hn::Div(hn::Mul(u, sum), hn::Add(hn::Add(a, root), hn::Set(d, 1e-37f)));
    return hn::IfThenElse(hn::Gt(sum, hn::Zero(d)), hn::Min(x, one), u);
}

struct Color {
    FloatV r, g, b;
};

HWY_INLINE Color mix(const Color& a, const Color& b, FloatV t) {
    const FloatV rest = hn::Sub(hn::Set(Float(), 1.0f), t);
    const auto of = [&](FloatV from, FloatV to) { return hn::Add(hn::Mul(from, rest), hn::Mul(to, t)); };
    return {of(a.r, b.r), of(a.g, b.g), of(a.b, b.b)};
}

HWY_INLINE FloatV mix(FloatV a, FloatV b, FloatV t) {
    return hn::Add(hn::Mul(a, hn::Sub(hn::Set(Float(), 1.0f), t)), hn::Mul(b, t));
}

// What sampling counts as light: positive also where a pixel subtracts.
HWY_INLINE FloatV weight_of(const Color& c) {
    const Float d;
    const FloatV red_green =
        hn::Add(hn::Mul(hn::Set(d, 0.2126f), hn::Abs(c.r)), hn::Mul(hn::Set(d, 0.7152f), hn::Abs(c.g)));
    return hn::Add(red_green, hn::Mul(hn::Set(d, 0.0722f), hn::Abs(c.b)));
}

// One batch: inputs and results side by side, in whole vectors.
struct Batch {
    HWY_ALIGN float x[kBatch], y[kBatch], z[kBatch];
    HWY_ALIGN float across[kBatch], down[kBatch];
    HWY_ALIGN std::int32_t row[kBatch], column[kBatch];
    HWY_ALIGN float corner[12][kBatch];  // upper left, upper right, lower left, lower right; three channels each
    HWY_ALIGN float top[kBatch], bottom[kBatch];  // cosines of the cell's upper and lower edge
    HWY_ALIGN float red[kBatch], green[kBatch], blue[kBatch], pdf[kBatch];

    void store(std::size_t i, const Color& color, FloatV density) {
        const Float d;
        hn::Store(color.r, d, red + i);
        hn::Store(color.g, d, green + i);
        hn::Store(color.b, d, blue + i);
        hn::Store(density, d, pdf + i);
    }
    // Fetch the corners' pixels and the edges one by one: that waits for memory once, where gathers would wait for each.
    void fetch_cells(const EnvironmentTables& tables, std::size_t count) {
        const std::size_t width = std::size_t(tables.width);
        for (std::size_t i = 0; i < count; ++i) {
            const std::size_t above = std::size_t(row[i] > 0 ? row[i] - 1 : 0);
            const std::size_t below = std::size_t(HWY_MIN(row[i], tables.height - 1));
            __builtin_prefetch(tables.pixels + above * width + std::size_t(column[i]));
            __builtin_prefetch(tables.pixels + below * width + std::size_t(column[i]));
        }
        for (std::size_t i = 0; i < count; ++i) {
            const std::size_t left = std::size_t(column[i]), right = left + 1 == width ? 0 : left + 1;
            const Rgb* above = tables.pixels + std::size_t(row[i] > 0 ? row[i] - 1 : 0) * width;
            const Rgb* below = tables.pixels + std::size_t(HWY_MIN(row[i], tables.height - 1)) * width;
            const Rgb* from[4] = {above + left, above + right, below + left, below + right};
            for (int k = 0; k < 4; ++k) {
                corner[3 * k][i] = from[k]->x, corner[3 * k + 1][i] = from[k]->y, corner[3 * k + 2][i] = from[k]->z;
            }
            top[i] = tables.row_cosine[row[i]], bottom[i] = tables.row_cosine[row[i] + 1];
        }
    }
};

// The four corners' colours and weights.
struct Cell {
    Color color[4];
    FloatV weight[4];

    Cell(const Batch& batch, std::size_t i) {
        const Float d;
        for (int k = 0; k < 4; ++k) {
            color[k] = {hn::Load(d, batch.corner[3 * k] + i), hn::Load(d, batch.corner[3 * k + 1] + i),
                        hn::Load(d, batch.corner[3 * k + 2] + i)};
            weight[k] = weight_of(color[k]);
        }
    }

    Color radiance(FloatV across, FloatV down) const {
        return mix(mix(color[0], color[1], across), mix(color[2], color[3], across), down);
    }
    // `down_cosine` is the place in the cell linear in the cosine.
    FloatV pdf(FloatV across, FloatV down_cosine, float integral) const {
        const Float d;
        if (integral == 0.0f) return hn::Set(d, 0.25f * kInvPi);
        const FloatV weighed = mix(mix(weight[0], weight[1], across), mix(weight[2], weight[3], across), down_cosine);
        return hn::Div(weighed, hn::Set(d, integral));
    }
};

// The numbers of a batch that draw, and which of the batch each was.
struct Draws {
    HWY_ALIGN float x[kBatch], y[kBatch];
    std::uint8_t from[kBatch];
};

// The edges of the bins that they fall into.
struct Bins {
    HWY_ALIGN float low[kBatch], high[kBatch];
    void fetch(const float* cdf, std::size_t i) { low[i] = cdf[0], high[i] = cdf[1]; }
};

// How many elements the vectors have that hold `count` of a batch.
HWY_INLINE std::size_t in_whole_vectors(std::size_t count) {
    const std::size_t lanes = hn::Lanes(Float());
    return (count + lanes - 1) / lanes * lanes;
}

// step(first lane) for every vector that holds one of `count` elements.
template <class Step>
HWY_INLINE void for_each_vector(std::size_t count, const Step& step) {
    const std::size_t lanes = hn::Lanes(Float());
    for (std::size_t i = 0; i < count; i += lanes) step(i);
}

void eval_here(const EnvironmentTables& tables, std::span<const V3f> directions, std::span<float> pdfs,
               std::span<Rgb> radiances) {
    const Float d;
    const Int di;
    const FloatV zero = hn::Zero(d), half = hn::Set(d, 0.5f);
    const FloatV width = hn::Set(d, float(tables.width)), height = hn::Set(d, float(tables.height));
    Batch batch;
    for (std::size_t begin = 0; begin < directions.size(); begin += kBatch) {
        const std::size_t count = HWY_MIN(kBatch, directions.size() - begin);
        for (std::size_t i = 0; i < in_whole_vectors(count); ++i) {
            const V3f& direction = directions[begin + HWY_MIN(i, count - 1)];
            batch.x[i] = direction.x, batch.y[i] = direction.y, batch.z[i] = direction.z;
        }
        // The cell: longitude is +pi at the left edge and falls to the right; +x has longitude pi/2.
        for_each_vector(count, [&](std::size_t i) {
            const FloatV x = hn::Load(d, batch.x + i), y = hn::Load(d, batch.y + i), z = hn::Load(d, batch.z + i);
            const FloatV theta = fast_atan2(d, hn::Sqrt(hn::Add(hn::Mul(x, x), hn::Mul(z, z))), y);
            const FloatV longitude = hn::Mul(fast_atan2(d, x, z), hn::Set(d, 0.5f * kInvPi));
            FloatV right = hn::Sub(hn::Mul(hn::Sub(half, longitude), width), half);
            right = hn::IfThenElse(hn::Lt(right, zero), hn::Add(right, width), right);
            const FloatV down = hn::Add(hn::Mul(hn::Mul(theta, hn::Set(d, kInvPi)), height), half);
            const IntV column = hn::Max(hn::Zero(di), hn::Min(hn::ConvertTo(di, right), hn::Set(di, tables.width - 1)));
            const IntV row = hn::Max(hn::Zero(di), hn::Min(hn::ConvertTo(di, down), hn::Set(di, tables.height)));
            hn::Store(column, di, batch.column + i);
            hn::Store(row, di, batch.row + i);
            hn::Store(clamp01(hn::Sub(right, hn::ConvertTo(d, column))), d, batch.across + i);
            hn::Store(clamp01(hn::Sub(down, hn::ConvertTo(d, row))), d, batch.down + i);
        });
        batch.fetch_cells(tables, count);
        for_each_vector(count, [&](std::size_t i) {
            const Cell cell(batch, i);
            const FloatV top = hn::Load(d, batch.top + i), bottom = hn::Load(d, batch.bottom + i);
            const FloatV down_cosine = clamp01(hn::Div(hn::Sub(top, hn::Load(d, batch.y + i)), hn::Sub(top, bottom)));
            const FloatV across = hn::Load(d, batch.across + i);
            batch.store(i, cell.radiance(across, hn::Load(d, batch.down + i)),
                        cell.pdf(across, down_cosine, tables.integral));
        });
        for (std::size_t i = 0; i < count; ++i) {
            pdfs[begin + i] = batch.pdf[i];
            radiances[begin + i] = Rgb(batch.red[i], batch.green[i], batch.blue[i]);
        }
    }
}

// Row and column of the cell that each u falls into, for `count` of them.
void find_cells(const EnvironmentTables& tables, Draws& draws, Batch& batch, std::size_t count) {
    if (count == 1) {
        const std::uint32_t* of_rows = tables.guides + std::size_t(tables.height + 1) * (kEnvironmentGuides + 1);
        const std::int32_t row = find_bin(tables.marginal_cdf, of_rows, draws.y[0]);
        const std::int32_t column =
            find_bin(tables.conditional_cdf + std::size_t(row) * (std::size_t(tables.width) + 1),
                     tables.guides + std::size_t(row) * (kEnvironmentGuides + 1), draws.x[0]);
        std::fill_n(batch.row, in_whole_vectors(count), row);
        std::fill_n(batch.column, in_whole_vectors(count), column);
        return;
    }
    const Float d;
    const Int di;
    const IntV columns = hn::Set(di, tables.width + 1), guide_row = hn::Set(di, kEnvironmentGuides + 1);
    const IntV no_offset = hn::Zero(di), marginal_guide = hn::Set(di, (tables.height + 1) * (kEnvironmentGuides + 1));
    for_each_vector(count, [&](std::size_t i) {
        hn::Store(find_bin(tables.marginal_cdf, no_offset, tables.guides, marginal_guide, hn::Load(d, draws.y + i)), di,
                  batch.row + i);
    });
    const std::uint32_t* guides[kBatch];
    for (std::size_t i = 0; i < count; ++i) {
        guides[i] = tables.guides + std::size_t(batch.row[i]) * (kEnvironmentGuides + 1) +
                    std::size_t(draws.x[i] * kEnvironmentGuides);
        __builtin_prefetch(guides[i]);
    }
    for (std::size_t i = 0; i < count; ++i) {
        __builtin_prefetch(tables.conditional_cdf + std::size_t(batch.row[i]) * (std::size_t(tables.width) + 1) +
                           *guides[i]);
    }
    for_each_vector(count, [&](std::size_t i) {
        const IntV row = hn::Load(di, batch.row + i);
        hn::Store(find_bin(tables.conditional_cdf, hn::Mul(row, columns), tables.guides, hn::Mul(row, guide_row),
                           hn::Load(d, draws.x + i)),
                  di, batch.column + i);
    });
}

// Of `count` cells keep those that rise above the plane of `normal`, in front of the others; how many.
std::size_t keep_above(const EnvironmentTables& tables, const V3f& normal, Draws& draws, Batch& batch,
                       std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) draws.from[i] = std::uint8_t(i);
    if (normal == V3f(0.0f)) return count;
    const Float d;
    const Int di;
    // Half a cell's diagonal, at most 2.3 over this number of rows, and what its middle is off by.
    const float reach = 3.2f / HWY_MIN(float(tables.height), 0.5f * float(tables.width)) + 1e-4f;
    const FloatV one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f);
    for_each_vector(count, [&](std::size_t i) {
        const IntV row = hn::Load(di, batch.row + i);
        const FloatV cosine = hn::Mul(
            half, hn::Add(hn::GatherIndex(d, tables.row_cosine, row), hn::GatherIndex(d, tables.row_cosine + 1, row)));
        const FloatV sine = hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(one, hn::Mul(cosine, cosine))));
        FloatV turns =
            hn::Div(hn::Add(hn::ConvertTo(d, hn::Load(di, batch.column + i)), one), hn::Set(d, float(tables.width)));
        FloatV turn_x, turn_y;
        cos_sin_turns(d, turns, turn_x, turn_y);
        const FloatV flat = hn::Sub(hn::Mul(turn_y, hn::Set(d, normal.x)), hn::Mul(turn_x, hn::Set(d, normal.z)));
        hn::Store(hn::Add(hn::Mul(sine, flat), hn::Mul(cosine, hn::Set(d, normal.y))), d, batch.down + i);
    });
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
        draws.x[kept] = draws.x[i], draws.y[kept] = draws.y[i], draws.from[kept] = std::uint8_t(i);
        batch.row[kept] = batch.row[i], batch.column[kept] = batch.column[i];
        kept += batch.down[i] > -reach ? 1 : 0;
    }
    // Whole vectors: what follows the last one holds valid cells.
    for (std::size_t i = kept; i < kBatch; ++i) batch.row[i] = batch.column[i] = 0;
    return kept;
}

void sample_here(const EnvironmentTables& tables, const V3f& normal, std::span<const V2f> u, std::span<V3f> directions,
                 std::span<float> pdfs, std::span<Rgb> radiances) {
    const Float d;
    const Int di;
    const FloatV zero = hn::Zero(d), half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f);
    Batch batch;
    Draws draws;
    Bins rows, columns;
    for (std::size_t begin = 0; begin < u.size(); begin += kBatch) {
        const std::size_t all = HWY_MIN(kBatch, u.size() - begin);
        for (std::size_t i = 0; i < in_whole_vectors(all); ++i) {
            const V2f& own = u[begin + HWY_MIN(i, all - 1)];
            draws.x[i] = own.x, draws.y[i] = own.y;
        }
        find_cells(tables, draws, batch, all);
        const std::size_t count = keep_above(tables, normal, draws, batch, all);
        if (count < all) std::fill_n(pdfs.data() + begin, all, 0.0f);
        batch.fetch_cells(tables, count);
        for (std::size_t i = 0; i < count; ++i) {
            const std::size_t row = std::size_t(batch.row[i]);
            rows.fetch(tables.marginal_cdf + row, i);
            columns.fetch(tables.conditional_cdf + row * (std::size_t(tables.width) + 1) + std::size_t(batch.column[i]),
                          i);
        }
        for_each_vector(count, [&](std::size_t i) {
            const IntV row = hn::Load(di, batch.row + i), column = hn::Load(di, batch.column + i);
            const Cell cell(batch, i);
            // What is left of u within its bin becomes the place within the cell, by the slope between its corners.
            const auto rest = [&](const float* u, const Bins& bins) {
                const FloatV low = hn::Load(d, bins.low + i), high = hn::Load(d, bins.high + i);
                return clamp01(hn::Div(hn::Sub(hn::Load(d, u + i), low), hn::Sub(high, low)));
            };
            const FloatV* w = cell.weight;
            const FloatV down_cosine = sample_line(rest(draws.y, rows), hn::Add(w[0], w[1]), hn::Add(w[2], w[3]));
            const FloatV across =
                sample_line(rest(draws.x, columns), hn::Add(w[0], hn::Mul(hn::Sub(w[2], w[0]), down_cosine)),
                            hn::Add(w[1], hn::Mul(hn::Sub(w[3], w[1]), down_cosine)));

            const FloatV top = hn::Load(d, batch.top + i), bottom = hn::Load(d, batch.bottom + i);
            const FloatV cosine = hn::Add(top, hn::Mul(down_cosine, hn::Sub(bottom, top)));
            const FloatV sine = hn::Sqrt(hn::Max(zero, hn::Sub(one, hn::Mul(cosine, cosine))));
            // From the left edge, at longitude +pi, to the right, and over the seam.
            FloatV turns =
                hn::Div(hn::Add(hn::Add(hn::ConvertTo(d, column), half), across), hn::Set(d, float(tables.width)));
            turns = hn::IfThenElse(hn::Gt(turns, one), hn::Sub(turns, one), turns);
            FloatV turn_x, turn_y;
            cos_sin_turns(d, turns, turn_x, turn_y);
            const FloatV theta = fast_atan2(d, sine, cosine);
            const FloatV rows_down = hn::Mul(hn::Mul(theta, hn::Set(d, kInvPi)), hn::Set(d, float(tables.height)));
            const FloatV down = clamp01(hn::Sub(hn::Add(rows_down, half), hn::ConvertTo(d, row)));
            hn::Store(hn::Mul(sine, turn_y), d, batch.x + i);
            hn::Store(cosine, d, batch.y + i);
            hn::Store(hn::Neg(hn::Mul(sine, turn_x)), d, batch.z + i);
            batch.store(i, cell.radiance(across, down), cell.pdf(across, down_cosine, tables.integral));
        });
        for (std::size_t i = 0; i < count; ++i) {
            const std::size_t to = begin + draws.from[i];
            directions[to] = V3f(batch.x[i], batch.y[i], batch.z[i]);
            pdfs[to] = batch.pdf[i];
            radiances[to] = Rgb(batch.red[i], batch.green[i], batch.blue[i]);
        }
    }
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {

HWY_EXPORT(eval_here);
HWY_EXPORT(sample_here);

void eval_environment(const EnvironmentTables& tables, std::span<const V3f> directions, std::span<float> pdfs,
                      std::span<Rgb> radiances) {
    HWY_DYNAMIC_DISPATCH(eval_here)(tables, directions, pdfs, radiances);
}

void sample_environment(const EnvironmentTables& tables, const V3f& normal, std::span<const V2f> u,
                        std::span<V3f> directions, std::span<float> pdfs, std::span<Rgb> radiances) {
    HWY_DYNAMIC_DISPATCH(sample_here)(tables, normal, u, directions, pdfs, radiances);
}

}  // namespace frazil
#endif
