#include "frazil/material/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/material/noise.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include <hwy/highway.h>

// The lattice is hashed eight cells at a time. Every lane does what one cell alone would, so that widths of vectors do not
// show in the bits.
HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Float = hn::CappedTag<float, 8>;
using UInt = hn::RebindToUnsigned<Float>;
using FloatV = hn::Vec<Float>;
using UIntV = hn::Vec<UInt>;
constexpr std::size_t kLanes = 8;

HWY_INLINE UIntV hashes(UIntV x) {
    const UInt d;
    x = hn::Xor(x, hn::ShiftRight<16>(x));
    x = hn::Mul(x, hn::Set(d, 0x7feb352dU));
    x = hn::Xor(x, hn::ShiftRight<15>(x));
    x = hn::Mul(x, hn::Set(d, 0x846ca68bU));
    return hn::Xor(x, hn::ShiftRight<16>(x));
}

HWY_INLINE float fade(float t) {
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

// One of twelve directions to the edges of a cube, dotted with the offset.
HWY_INLINE FloatV gradients(UIntV bits, FloatV x, FloatV y, FloatV z) {
    const UInt d;
    const auto is = [&](std::uint32_t mask, std::uint32_t value) {
        return hn::RebindMask(Float(), hn::Eq(hn::And(bits, hn::Set(d, mask)), hn::Set(d, value)));
    };
    const FloatV u = hn::IfThenElse(is(8U, 0U), x, y);
    const FloatV v = hn::IfThenElse(is(12U, 0U), y, hn::IfThenElse(is(13U, 12U), x, z));
    const UIntV sign = hn::Set(d, 0x80000000U);
    return hn::Add(hn::Xor(u, hn::BitCast(Float(), hn::ShiftLeft<31>(bits))),
                   hn::Xor(v, hn::BitCast(Float(), hn::And(hn::ShiftLeft<30>(bits), sign))));
}

// The corners of a lattice cell: x runs fastest.
alignas(32) constexpr std::uint32_t kStepX[kLanes] = {0, kCellX, 0, kCellX, 0, kCellX, 0, kCellX};
alignas(32) constexpr std::uint32_t kStepY[kLanes] = {0, 0, kCellY, kCellY, 0, 0, kCellY, kCellY};
alignas(32) constexpr std::uint32_t kStepZ[kLanes] = {0, 0, 0, 0, kCellZ, kCellZ, kCellZ, kCellZ};
alignas(32) constexpr float kCornerX[kLanes] = {0, 1, 0, 1, 0, 1, 0, 1};
alignas(32) constexpr float kCornerY[kLanes] = {0, 0, 1, 1, 0, 0, 1, 1};
alignas(32) constexpr float kCornerZ[kLanes] = {0, 0, 0, 0, 1, 1, 1, 1};

// Smoothly between the gradients of the eight corners; component c of `out` takes its bits from `shifts`[c] on.
template <int... shifts>
HWY_INLINE void lattice_noise(const V3f& place, std::uint32_t seed, float* HWY_RESTRICT out) {
    const Float d;
    const UInt du;
    const float fx = std::floor(place.x), fy = std::floor(place.y), fz = std::floor(place.z);
    const float dx = place.x - fx, dy = place.y - fy, dz = place.z - fz;
    const std::uint32_t x = std::uint32_t(int(fx)) * kCellX, y = std::uint32_t(int(fy)) * kCellY,
                        z = std::uint32_t(int(fz)) * kCellZ;
    constexpr std::size_t kComponents = sizeof...(shifts);
    alignas(32) float corners[kComponents][kLanes];
    for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
        const UIntV cell =
            hn::Xor(hn::Xor(hn::Add(hn::Set(du, x), hn::Load(du, kStepX + i)),
                            hn::Add(hn::Set(du, y), hn::Load(du, kStepY + i))),
                    hn::Xor(hn::Add(hn::Set(du, z), hn::Load(du, kStepZ + i)), hn::Set(du, seed * kCellSeed)));
        const UIntV h = hashes(cell);
        const FloatV px = hn::Sub(hn::Set(d, dx), hn::Load(d, kCornerX + i)),
                     py = hn::Sub(hn::Set(d, dy), hn::Load(d, kCornerY + i)),
                     pz = hn::Sub(hn::Set(d, dz), hn::Load(d, kCornerZ + i));
        std::size_t component = 0;
        (hn::Store(gradients(hn::ShiftRight<shifts>(h), px, py, pz), d, corners[component++] + i), ...);
    }
    const float u = fade(dx), v = fade(dy), w = fade(dz);
    const auto mix = [](float a, float b, float t) { return a + (b - a) * t; };
    for (std::size_t c = 0; c < kComponents; ++c) {
        const float* at = corners[c];
        out[c] = mix(mix(mix(at[0], at[1], u), mix(at[2], at[3], u), v),
                     mix(mix(at[4], at[5], u), mix(at[6], at[7], u), v), w);
    }
}

float gradient_noise_here(const V3f& place, std::uint32_t seed) {
    float result;
    lattice_noise<16>(place, seed, &result);
    return result;
}

V3f vector_noise_here(const V3f& place, std::uint32_t seed) {
    float result[3];
    lattice_noise<8, 16, 24>(place, seed, result);
    return {result[0], result[1], result[2]};
}

float fractal_noise_here(const V3f& place, int octaves, float footprint, std::uint32_t seed) {
    float sum = 0.0f, strength = 1.0f, frequency = 1.0f;
    for (int octave = 0; octave < octaves; ++octave) {
        const float seen = octave_seen(footprint, frequency);
        if (seen == 0.0f) break;
        float noise;
        lattice_noise<16>(place * frequency, seed + std::uint32_t(octave), &noise);
        sum += seen * strength * noise;
        strength *= 0.5f, frequency *= kLacunarity;
    }
    return sum;
}

// A row of five lattice cells, two to either side along x; the lanes beyond lie infinitely far away.
constexpr int kReach = 2, kRow = 2 * kReach + 1;
constexpr float kNowhere = std::numeric_limits<float>::infinity();
alignas(32) constexpr std::uint32_t kRowX[kLanes] = {0U - 2U * kCellX, 0U - kCellX, 0, kCellX, 2U * kCellX, 0, 0, 0};
alignas(32) constexpr float kAlongX[kLanes] = {-2, -1, 0, 1, 2, 0, 0, 0};
alignas(32) constexpr float kBeyond[kLanes] = {0, 0, 0, 0, 0, kNowhere, kNowhere, kNowhere};
// The rows about a place's own, the near ones first: steps along y and z.
constexpr int kRows = kRow * kRow, kNearRows = 9;
constexpr int kStepsY[kRows] = {0, 1, -1, 0, 0, 1, -1, 1, -1, 2, -2, 2, -2, 2, -2, 0, 0, 1, -1, 1, -1, 2, -2, 2, -2};
constexpr int kStepsZ[kRows] = {0, 0, 0, 1, -1, 1, 1, -1, -1, 0, 0, 1, 1, -1, -1, 2, -2, 2, 2, -2, -2, 2, 2, -2, -2};

// The random points of a row's cells, relative to the place.
struct Row {
    alignas(32) float x[kLanes], y[kLanes], z[kLanes], distance2[kLanes];
    alignas(32) std::uint32_t hash[kLanes];
};

HWY_INLINE void fill(Row& row, const V3f& place, const V3i& cell, std::uint32_t seed) {
    const Float d;
    const UInt du;
    const hn::RebindToSigned<Float> di;
    const std::uint32_t base = std::uint32_t(cell.x) * kCellX,
                        rest = (std::uint32_t(cell.y) * kCellY) ^ (std::uint32_t(cell.z) * kCellZ) ^ (seed * kCellSeed);
    for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
        const UIntV h = hashes(hn::Xor(hn::Add(hn::Set(du, base), hn::Load(du, kRowX + i)), hn::Set(du, rest)));
        const auto coordinate = [&](FloatV corner, UIntV bits, float from) {
            const FloatV tens = hn::ConvertTo(d, hn::BitCast(di, hn::And(bits, hn::Set(du, 1023U))));
            const FloatV within = hn::Mul(hn::Add(tens, hn::Set(d, 0.5f)), hn::Set(d, kTenBits));
            return hn::Sub(hn::Add(corner, within), hn::Set(d, from));
        };
        const FloatV x = coordinate(hn::Add(hn::Set(d, float(cell.x)), hn::Load(d, kAlongX + i)), h, place.x);
        const FloatV y = coordinate(hn::Set(d, float(cell.y)), hn::ShiftRight<10>(h), place.y);
        const FloatV z = coordinate(hn::Set(d, float(cell.z)), hn::ShiftRight<20>(h), place.z);
        const FloatV distance2 = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
        hn::Store(x, d, row.x + i);
        hn::Store(y, d, row.y + i);
        hn::Store(z, d, row.z + i);
        hn::Store(hn::Add(distance2, hn::Load(d, kBeyond + i)), d, row.distance2 + i);
        hn::Store(h, du, row.hash + i);
    }
}

CellWall nearest_cell_wall_here(const V3f& place, float reach, std::uint32_t seed) {
    const Float d;
    const V3f floor(std::floor(place.x), std::floor(place.y), std::floor(place.z));
    const V3i cell{int(floor.x), int(floor.y), int(floor.z)};
    const V3f inside = place - floor;
    // The squared distance from the place to the next rows, by axis and step.
    const auto gap = [&](int axis, int step) {
        const float g = std::max(0.0f, std::max(float(step) - inside[axis], inside[axis] - float(step + 1)));
        return g * g;
    };
    float gap_y[kRow], gap_z[kRow];
    for (int step = -kReach; step <= kReach; ++step) {
        gap_y[step + kReach] = gap(1, step), gap_z[step + kReach] = gap(2, step);
    }
    const auto side2 = [&](int r) { return gap_z[kStepsZ[r] + kReach] + gap_y[kStepsY[r] + kReach]; };
    Row rows[kRows];
    std::uint32_t is_filled = 0;
    const auto row = [&](int r) -> const Row& {
        if (!(is_filled >> r & 1U)) {
            fill(rows[r], place, cell + V3i(0, kStepsY[r], kStepsZ[r]), seed);
            is_filled |= 1U << r;
        }
        return rows[r];
    };

    // The nearest point: its own row's first, which leaves little to look through.
    float best = kNowhere;
    int best_row = 0, best_lane = 0;
    for (int r = 0; r < kRows; ++r) {
        if (side2(r) > best) continue;
        const Row& here = row(r);
        bool is_better = false;
        for (std::size_t i = 0; i < kRow; i += hn::Lanes(d)) {
            is_better |= !hn::AllFalse(d, hn::Lt(hn::Load(d, here.distance2 + i), hn::Set(d, best)));
        }
        for (int i = 0; is_better && i < kRow; ++i) {
            if (here.distance2[i] < best) best = here.distance2[i], best_row = r, best_lane = i;
        }
    }
    const V3f nearest(rows[best_row].x[best_lane], rows[best_row].y[best_lane], rows[best_row].z[best_lane]);
    const std::uint32_t nearest_hash = rows[best_row].hash[best_lane];

    // A wall stands half way between two points: those within reach are of points not much farther than the nearest.
    CellWall wall;
    float within = std::sqrt(best) + 2.0f * reach;
    within *= within;
    const FloatV nx = hn::Set(d, nearest.x), ny = hn::Set(d, nearest.y), nz = hn::Set(d, nearest.z);
    for (int r = 0; r < kRows; ++r) {
        if (side2(r) > within) continue;
        const Row& here = row(r);
        for (std::size_t i = 0; i < kRow; i += hn::Lanes(d)) {
            const FloatV px = hn::Load(d, here.x + i), py = hn::Load(d, here.y + i), pz = hn::Load(d, here.z + i);
            const FloatV ax = hn::Sub(px, nx), ay = hn::Sub(py, ny), az = hn::Sub(pz, nz);
            const FloatV length = hn::Sqrt(hn::Add(hn::Add(hn::Mul(ax, ax), hn::Mul(ay, ay)), hn::Mul(az, az)));
            const FloatV dot = hn::Add(hn::Add(hn::Mul(hn::Add(px, nx), ax), hn::Mul(hn::Add(py, ny), ay)),
                                       hn::Mul(hn::Add(pz, nz), az));
            const FloatV distance = hn::Div(dot, hn::Add(length, length));
            const auto is_near =
                hn::And(hn::And(hn::Le(distance, hn::Set(d, reach)), hn::Lt(distance, hn::Set(d, wall.distance))),
                        hn::And(hn::Gt(length, hn::Set(d, 1e-6f)),
                                hn::Lt(hn::Load(d, here.distance2 + i), hn::Set(d, kNowhere))));
            if (hn::AllFalse(d, is_near)) continue;
            alignas(32) float distances[kLanes], lengths[kLanes];
            hn::Store(hn::IfThenElse(is_near, distance, hn::Set(d, kNowhere)), d, distances);
            hn::Store(length, d, lengths);
            for (std::size_t k = 0; k < hn::Lanes(d); ++k) {
                if (!(distances[k] < wall.distance)) continue;
                const V3f point(here.x[i + k], here.y[i + k], here.z[i + k]);
                wall = {distances[k], (point - nearest) / lengths[k], here.hash[i + k] ^ nearest_hash};
            }
        }
    }
    return wall;
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {

HWY_EXPORT(gradient_noise_here);
HWY_EXPORT(vector_noise_here);
HWY_EXPORT(fractal_noise_here);
HWY_EXPORT(nearest_cell_wall_here);

float gradient_noise(const V3f& place, std::uint32_t seed) {
    return HWY_DYNAMIC_DISPATCH(gradient_noise_here)(place, seed);
}

V3f vector_noise(const V3f& place, std::uint32_t seed) {
    return HWY_DYNAMIC_DISPATCH(vector_noise_here)(place, seed);
}

float fractal_noise(const V3f& place, int octaves, float footprint, std::uint32_t seed) {
    return HWY_DYNAMIC_DISPATCH(fractal_noise_here)(place, octaves, footprint, seed);
}

CellWall nearest_cell_wall(const V3f& place, float reach, std::uint32_t seed) {
    return HWY_DYNAMIC_DISPATCH(nearest_cell_wall_here)(place, reach, seed);
}

V3f cell_point(int x, int y, int z, std::uint32_t seed) {
    const std::uint32_t h = cell_hash(x, y, z, seed);
    return V3f(float(x), float(y), float(z)) +
           V3f(float(h & 1023U) + 0.5f, float((h >> 10) & 1023U) + 0.5f, float((h >> 20) & 1023U) + 0.5f) * kTenBits;
}

float fractal_variance_left_out(int octaves, float footprint) {
    constexpr float kGradientVariance = 0.0729f;  // of gradient_noise over space
    float sum = 0.0f, strength = 1.0f, frequency = 1.0f;
    for (int octave = 0; octave < octaves; ++octave) {
        const float seen = octave_seen(footprint, frequency);
        sum += (1.0f - seen * seen) * strength * strength;
        strength *= 0.5f, frequency *= kLacunarity;
    }
    return sum * kGradientVariance;
}

}  // namespace frazil
#endif
