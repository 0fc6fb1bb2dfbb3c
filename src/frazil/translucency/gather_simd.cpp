#include "frazil/translucency/gather_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/translucency/gather_simd.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Float = hn::CappedTag<float, kBlockLanes>;
using Int = hn::RebindToSigned<Float>;
using FloatV = hn::Vec<Float>;
using IntV = hn::Vec<Int>;

constexpr std::size_t kTile = 32;  // sources whose shares are summed before they join the totals

// One coefficient of the segment that each lane is in.
HWY_INLINE FloatV look_up(const float* HWY_RESTRICT row, IntV segment) {
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3  // and what goes beyond it
    return FloatV{_mm512_permutex2var_ps(_mm512_load_ps(row), segment.raw, _mm512_load_ps(row + 16))};
#else
    return hn::GatherIndex(Float(), row, segment);
#endif
}

// Mean of a ramp's colour and slope over a uniform spread of distances.
HWY_INLINE void shade(const RampHinges& ramp, int channel, FloatV mean_r, FloatV half_width, FloatV inverse_width,
                      FloatV& color, FloatV& slope) {
    const Float d;
    color = hn::Set(d, ramp.first[channel]);
    slope = hn::Zero(d);
    const FloatV half = hn::Set(d, 0.5f), one = hn::Set(d, 1.0f), zero = hn::Zero(d);
    for (const auto& hinge : ramp.hinges) {
        const FloatV x = hn::Sub(mean_r, hn::Set(d, hinge.distance));
        const FloatV part = hn::Min(one, hn::Max(zero, hn::MulAdd(hn::Mul(x, inverse_width), half, half)));
        const FloatV beyond = hn::Max(zero, hn::Sub(x, half_width));
        const FloatV change = hn::Set(d, hinge.slope_change[channel]);
        color = hn::MulAdd(change, hn::MulAdd(hn::Mul(part, part), half_width, beyond), color);
        slope = hn::MulAdd(change, part, slope);
    }
}

// What the sources of a tile do to each lane: the kernel of each channel, its derivative in squared distance, and the way
// from the shading point to the source.
struct TileShares {
    float kernel[3][kTile * kBlockLanes], slope[3][kTile * kBlockLanes], way[3][kTile * kBlockLanes];
};

// Add the light of kGroups groups from `begin` on.
template <int kGroups>
HWY_INLINE void add_groups(const TileShares& shares, std::size_t sources, const GroupPower* const* HWY_RESTRICT powers,
                           std::size_t begin, float* HWY_RESTRICT lit) {
    const Float d;
    const std::size_t lanes = hn::Lanes(d);
    FloatV sum[3 * kGroups];
    for (FloatV& s : sum) s = hn::Zero(d);
    for (std::size_t i = 0; i < sources; ++i) {
        const FloatV x = hn::Load(d, shares.way[0] + i * lanes), y = hn::Load(d, shares.way[1] + i * lanes),
                     z = hn::Load(d, shares.way[2] + i * lanes);
        const FloatV k0 = hn::Load(d, shares.kernel[0] + i * lanes), k1 = hn::Load(d, shares.kernel[1] + i * lanes),
                     k2 = hn::Load(d, shares.kernel[2] + i * lanes);
        const FloatV s0 = hn::Load(d, shares.slope[0] + i * lanes), s1 = hn::Load(d, shares.slope[1] + i * lanes),
                     s2 = hn::Load(d, shares.slope[2] + i * lanes);
        const GroupPower* HWY_RESTRICT lamps = powers[i] + begin;
        for (int g = 0; g < kGroups; ++g) {
            const auto& [p, o] = lamps[g];
            const FloatV lean =
                hn::MulAdd(z, hn::Set(d, o[2]), hn::MulAdd(y, hn::Set(d, o[1]), hn::Mul(x, hn::Set(d, o[0]))));
            sum[3 * g] = hn::MulAdd(hn::MulAdd(s0, lean, k0), hn::Set(d, p[0]), sum[3 * g]);
            sum[3 * g + 1] = hn::MulAdd(hn::MulAdd(s1, lean, k1), hn::Set(d, p[1]), sum[3 * g + 1]);
            sum[3 * g + 2] = hn::MulAdd(hn::MulAdd(s2, lean, k2), hn::Set(d, p[2]), sum[3 * g + 2]);
        }
    }
    for (int row = 0; row < 3 * kGroups; ++row, lit += kBlockLanes) {
        hn::StoreU(hn::Add(hn::LoadU(d, lit), sum[row]), d, lit);
    }
}

template <bool kHasRamp>
void add_sources_simd(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                      BlockSums& block) {
    const Float d;
    const Int di;
    const std::size_t lanes = hn::Lanes(d), count = list.sources.size();
    HWY_ALIGN TileShares shares;

    const IntV one_bits = hn::Set(di, 0x3f800000), exponent_bits = hn::Set(di, 0x7f800000);
    const IntV below_bits = hn::Set(di, (1 << (23 - table.split)) - 1);
    const IntV last_segment = hn::Set(di, KernelTable::kSegments - 1);
    const FloatV u_per_q = hn::Set(d, table.inverse_z0_squared), one = hn::Set(d, 1.0f);
    const FloatV t_per_q = hn::Set(d, table.inverse_z0_squared * static_cast<float>(1 << table.split));

    for (std::size_t first = 0; first < block.lanes; first += lanes) {
        const FloatV x = hn::Load(d, block.x.data() + first), y = hn::Load(d, block.y.data() + first),
                     z = hn::Load(d, block.z.data() + first);
        for (std::size_t tile = 0; tile < count; tile += kTile) {
            const std::size_t tile_size = HWY_MIN(kTile, count - tile);
            FloatV coverage0 = hn::Zero(d), coverage1 = hn::Zero(d), coverage2 = hn::Zero(d);
            for (std::size_t i = 0; i < tile_size; ++i) {
                // Squared distance, and the source's moments along it.
                const Source& source = list.sources[tile + i];
                const FloatV dx = hn::Sub(hn::Set(d, source.center[0]), x);
                const FloatV dy = hn::Sub(hn::Set(d, source.center[1]), y);
                const FloatV dz = hn::Sub(hn::Set(d, source.center[2]), z);
                const FloatV q = hn::MulAdd(dz, dz, hn::MulAdd(dy, dy, hn::Mul(dx, dx)));
                const auto& c = source.covariance;
                const FloatV along_x =
                    hn::MulAdd(dz, hn::Set(d, c[4]), hn::MulAdd(dy, hn::Set(d, c[3]), hn::Mul(dx, hn::Set(d, c[0]))));
                const FloatV along_y = hn::MulAdd(dz, hn::Set(d, c[5]), hn::Mul(dy, hn::Set(d, c[1])));
                const FloatV along_z = hn::Mul(dz, hn::Set(d, c[2]));
                const FloatV along = hn::MulAdd(along_z, dz, hn::MulAdd(along_y, dy, hn::Mul(along_x, dx)));

                hn::Store(dx, d, shares.way[0] + i * lanes);
                hn::Store(dy, d, shares.way[1] + i * lanes);
                hn::Store(dz, d, shares.way[2] + i * lanes);

                // The segment of u = 1 + q/z0², and the place in it.
                const FloatV u = hn::MulAdd(q, u_per_q, one);
                const IntV bits = hn::Sub(hn::BitCast(di, u), one_bits);
                const IntV segment = hn::Min(hn::ShiftRightSame(bits, 23 - table.split), last_segment);
                const IntV below = hn::ShiftLeftSame(hn::And(bits, below_bits), table.split);
                const FloatV t = hn::Sub(hn::BitCast(d, hn::Or(below, one_bits)), hn::Set(d, 1.5f));
                const FloatV slope_scale =
                    hn::Mul(hn::BitCast(d, hn::Sub(one_bits, hn::And(bits, exponent_bits))), t_per_q);
                const FloatV trace = hn::Set(d, source.trace);
                const FloatV by_slope = hn::Mul(slope_scale, trace);
                const FloatV twice = hn::Add(slope_scale, slope_scale);
                const FloatV by_curvature = hn::Mul(hn::Mul(twice, twice), along);
                const FloatV area = hn::Set(d, source.area);

                // Mean and variance of the distance over the source, for the ramp.
                FloatV mean_r = one, half_width = one, inverse_width = one, spread = one, half_per_r = one;
                if constexpr (kHasRamp) {
                    const FloatV tiny = hn::Set(d, 1e-30f);
                    const FloatV variance = hn::Max(hn::Zero(d), hn::Div(along, hn::Add(hn::Add(q, trace), tiny)));
                    mean_r = hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(hn::Add(q, trace), variance)));
                    half_width = hn::Add(hn::MulAdd(mean_r, hn::Set(d, 1e-6f), hn::Set(d, kLeastSpread)),
                                         hn::Sqrt(hn::Mul(variance, hn::Set(d, 3.0f))));
                    inverse_width = hn::Div(one, half_width);
                    half_per_r = hn::Div(hn::Set(d, 0.5f), hn::Add(mean_r, half_width));
                    spread = hn::Mul(hn::Mul(hn::Add(variance, variance), hn::Sqrt(q)), slope_scale);
                }

                for (int channel = 0; channel < 3; ++channel) {
                    // Value, slope and half curvature of the polynomial by Horner's rule.
                    const auto& rows = table.coefficient[channel];
                    const FloatV c5 = look_up(rows[5].data(), segment), c4 = look_up(rows[4].data(), segment),
                                 c3 = look_up(rows[3].data(), segment), c2 = look_up(rows[2].data(), segment),
                                 c1 = look_up(rows[1].data(), segment), c0 = look_up(rows[0].data(), segment);
                    const FloatV v4 = hn::MulAdd(c5, t, c4);
                    const FloatV v3 = hn::MulAdd(v4, t, c3), s3 = hn::MulAdd(c5, t, v4);
                    const FloatV v2 = hn::MulAdd(v3, t, c2), s2 = hn::MulAdd(s3, t, v3), h2 = hn::MulAdd(c5, t, s3);
                    const FloatV v1 = hn::MulAdd(v2, t, c1), s1 = hn::MulAdd(s2, t, v2), h1 = hn::MulAdd(h2, t, s2);
                    const FloatV value = hn::MulAdd(v1, t, c0), slope = hn::MulAdd(s1, t, v1),
                                 bend = hn::MulAdd(h1, t, s1);
                    const FloatV even = hn::MulAdd(bend, by_curvature, hn::MulAdd(slope, by_slope, value));
                    // The kernel with its ramp, and its derivative in q.
                    FloatV lit = even, lit_slope = hn::Mul(slope, slope_scale);
                    if constexpr (kHasRamp) {
                        FloatV color, color_slope;
                        shade(ramp, channel, mean_r, half_width, inverse_width, color, color_slope);
                        lit = hn::MulAdd(even, color, hn::Mul(hn::Mul(slope, spread), color_slope));
                        lit_slope = hn::MulAdd(lit_slope, color, hn::Mul(hn::Mul(value, color_slope), half_per_r));
                    }
                    hn::Store(lit, d, shares.kernel[channel] + i * lanes);
                    hn::Store(lit_slope, d, shares.slope[channel] + i * lanes);
                    FloatV& coverage = channel == 0 ? coverage0 : channel == 1 ? coverage1 : coverage2;
                    coverage = hn::MulAdd(even, area, coverage);
                }
            }
            float* covered = block.coverage[0].data() + first;
            hn::Store(hn::Add(hn::Load(d, covered), coverage0), d, covered);
            covered += kBlockLanes;
            hn::Store(hn::Add(hn::Load(d, covered), coverage1), d, covered);
            covered += kBlockLanes;
            hn::Store(hn::Add(hn::Load(d, covered), coverage2), d, covered);

            // Every group's three channels from the same kernels.
            const GroupPower* const* powers = list.powers.data() + tile;
            float* lit = block.exitance.data() + first;
            std::size_t g = 0;
            for (; g + 4 <= groups; g += 4) add_groups<4>(shares, tile_size, powers, g, lit + 3 * g * kBlockLanes);
            for (; g < groups; ++g) add_groups<1>(shares, tile_size, powers, g, lit + 3 * g * kBlockLanes);
        }
    }
}

void add_sources_here(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                      BlockSums& block) {
    if (ramp.is_flat) {
        add_sources_simd<false>(table, ramp, list, groups, block);
    } else {
        add_sources_simd<true>(table, ramp, list, groups, block);
    }
}

std::string target_here() {
    return hwy::TargetName(HWY_TARGET);
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {

HWY_EXPORT(add_sources_here);
HWY_EXPORT(target_here);

void add_sources(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                 BlockSums& block) {
    HWY_DYNAMIC_DISPATCH(add_sources_here)(table, ramp, list, groups, block);
}

std::string simd_target() {
    return HWY_DYNAMIC_DISPATCH(target_here)();
}

}  // namespace frazil
#endif
