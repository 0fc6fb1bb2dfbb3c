#include <bit>
#include <cmath>

#include "frazil/points/neighbourhood.h"
#include "frazil/points/patch_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "frazil/points/patch_simd.cpp"
#include <hwy/foreach_target.h>
// After foreach_target.h.
#include "frazil/points/eight-inl.h"

HWY_BEFORE_NAMESPACE();
namespace frazil::HWY_NAMESPACE {

int find_patches_here(const PatchSlots& slots, const V3f& place, const V3f& normal, float least_cosine,
                      std::uint32_t* found, float* distances2) {
    const Eight px = splat(place.x), py = splat(place.y), pz = splat(place.z);
    const Eight nx = splat(normal.x), ny = splat(normal.y), nz = splat(normal.z), cosine = splat(least_cosine);
    int from[3], to[3];
    for (int axis = 0; axis < 3; ++axis) {
        from[axis] = slots.cell_along(place[axis] - slots.reach, axis);
        to[axis] = slots.cell_along(place[axis] + slots.reach, axis);
    }
    int count = 0;
    for (int z = from[2]; z <= to[2]; ++z) {
        for (int y = from[1]; y <= to[1]; ++y) {
            const std::uint32_t* row = slots.starts.data() + (z * slots.counts.y + y) * slots.counts.x;
            const std::uint32_t end = row[to[0] + 1];
            for (std::uint32_t i = row[from[0]]; i < end; i += kWide) {
                const Eight dx = px - load(&slots.x[i]), dy = py - load(&slots.y[i]), dz = pz - load(&slots.z[i]);
                const Eight s = dx * dx + dy * dy + dz * dz;
                // Summed in the order of is_same_side, so that both decide alike.
                const Eight dot = nx * load(&slots.nx[i]) + ny * load(&slots.ny[i]) + nz * load(&slots.nz[i]);
                unsigned bits = less(s, load(&slots.reach2[i])) & less(cosine, dot);
                if (end - i < kWide) bits &= (1u << (end - i)) - 1;
                if (bits == 0) continue;
                compress(s, bits, distances2 + count);
                for (; bits != 0; bits &= bits - 1) found[count++] = slots.patches[i + std::countr_zero(bits)];
            }
        }
    }
    return count;
}

std::uint64_t cells_of_here(const Patch& patch) {
    const V2f step = (patch.high - patch.low) * (1.0f / kWide);
    const Eight middle_x = splat(patch.low.x) + (load(kLanes) + splat(0.5f)) * splat(step.x);
    std::uint64_t cells = ~std::uint64_t(0);
    for (int e = 0; e < patch.count; ++e) {
        const int next = e + 1 == patch.count ? 0 : e + 1;
        const float x = patch.x[e], y = patch.y[e], ex = patch.x[next] - x, ey = patch.y[next] - y;
        // How far inside of the edge the innermost corner of each cell of a row lies, and a hair.
        const float half = 0.5005f * (std::abs(ex) * step.y + std::abs(ey) * step.x);
        const Eight along = splat(half) - splat(ey) * (middle_x - splat(x));
        std::uint64_t outside = 0;
        for (int r = 0; r < kWide; ++r) {
            const float middle_y = patch.low.y + (float(r) + 0.5f) * step.y;
            outside |= std::uint64_t(less(along + splat(ex * (middle_y - y)), splat(0.0f))) << (kWide * r);
        }
        cells &= ~outside;
    }
    return cells;
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
#if HWY_ARCH_X86_64 && HWY_TARGET <= HWY_AVX3
    // Where it is quick: some processors with AVX2 alone take hundreds of cycles.
    return std::countr_zero(_pdep_u64(std::uint64_t(1) << rank, bits));
#else
    int at = 0;
    for (int width = 32; width > 0; width /= 2) {
        const int below = std::popcount((bits >> at) & ((std::uint64_t(1) << width) - 1));
        const bool is_above = rank >= below;
        rank -= is_above ? below : 0;
        at += is_above ? width : 0;
    }
    return at;
#endif
}

unsigned free_darts_here(const Patch& patch, const Candidates& candidates, int first, const Darts& darts) {
    // Where spacing varies, the largest is on the safe side.
    const float spacing = patch.largest_spacing * (1.0f + kDistanceError);
    const Eight x = load(darts.x), y = load(darts.y), x2 = x + x, y2 = y + y;
    Eight nearest = splat(1e30f);
    for (int p = first; p < candidates.count; ++p) {
        const Eight to_p = splat(candidates.s[p]) - (splat(candidates.x[p]) * x2 + splat(candidates.y[p]) * y2);
        nearest = least(nearest, to_p);
    }
    return darts.free & ~less(nearest, splat(spacing * spacing) - (x * x + y * y));
}

Darts throw_darts_here(const Patch& patch, const Candidates& candidates, std::uint64_t cells, RandomStream& random,
                       int count) {
    const V2f step = (patch.high - patch.low) * (1.0f / kWide);
    const int marked = std::popcount(cells);
    Darts darts;
    store(splat(patch.low.x), darts.x);
    store(splat(patch.low.y), darts.y);
    for (int i = 0; i < count; ++i) {
        const std::uint64_t bits = random.next();
        const int cell = select_bit(cells, int((bits & 0xffff) * marked >> 16));
        darts.x[i] = patch.low.x + (float(cell % kWide) + float(bits >> 16 & 0xffffff) * 0x1p-24f) * step.x;
        darts.y[i] = patch.low.y + (float(cell / kWide) + float(bits >> 40) * 0x1p-24f) * step.y;
    }
    const Eight x = load(darts.x), y = load(darts.y);
    Eight inside = splat(1e30f);
    for (int e = 0; e < patch.count; ++e) {
        const int next = e + 1 == patch.count ? 0 : e + 1;
        const float ex = patch.x[next] - patch.x[e], ey = patch.y[next] - patch.y[e];
        inside = least(inside, splat(ex) * (y - splat(patch.y[e])) - splat(ey) * (x - splat(patch.x[e])));
    }
    darts.free = ~less(inside, splat(0.0f)) & ((1u << count) - 1);
    if (darts.free != 0) darts.free = free_darts_here(patch, candidates, 0, darts);
    return darts;
}

}  // namespace frazil::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace frazil {

HWY_EXPORT(find_patches_here);
HWY_EXPORT(cells_of_here);
HWY_EXPORT(uncovered_cells_here);
HWY_EXPORT(free_darts_here);
HWY_EXPORT(throw_darts_here);

int find_patches(const PatchSlots& slots, const V3f& place, const V3f& normal, float least_cosine, std::uint32_t* found,
                 float* distances2) {
    return HWY_DYNAMIC_DISPATCH(find_patches_here)(slots, place, normal, least_cosine, found, distances2);
}

std::uint64_t cells_of(const Patch& patch) {
    return HWY_DYNAMIC_DISPATCH(cells_of_here)(patch);
}

std::uint64_t uncovered_cells(const Patch& patch, const Candidates& candidates, int first, std::uint64_t cells) {
    return HWY_DYNAMIC_DISPATCH(uncovered_cells_here)(patch, candidates, first, cells);
}

unsigned free_darts(const Patch& patch, const Candidates& candidates, int first, const Darts& darts) {
    return HWY_DYNAMIC_DISPATCH(free_darts_here)(patch, candidates, first, darts);
}

Darts throw_darts(const Patch& patch, const Candidates& candidates, std::uint64_t cells, RandomStream& random,
                  int count) {
    return HWY_DYNAMIC_DISPATCH(throw_darts_here)(patch, candidates, cells, random, count);
}

}  // namespace frazil
#endif
