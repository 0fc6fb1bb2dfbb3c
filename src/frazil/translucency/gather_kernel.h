// The inner loop of a gather: a list of sources against a block of shading points.
// Model: each source is a patch of surface of known centroid and second moments C; its kernel is the profile averaged
//   over the patch to second order, f + f' tr C + 2 f'' d.C d, with f' and f'' the derivatives in q = |d|²; light of a
//   group whose power is centred elsewhere adds 2 f' d.offset.
// Units: metres.
// Valid: sums run over the sources in order, one shading point a lane: the same bits however blocks are spread.
// Not: which sources are in the list: gather.cpp.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/translucency/kernel_table.h"
#include "frazil/translucency/ramp.h"

namespace frazil {

inline constexpr std::size_t kBlockLanes = 64;  // shading points of a block, at most

// Of distances over a source, in metres: its inverse times the steepest ramp stays in float's range.
inline constexpr float kLeastSpread = 1e-12f;

struct Source {
    std::array<float, 3> center;
    std::array<float, 6> covariance;  // xx, yy, zz, and twice xy, xz, yz
    float trace;                      // of the covariance
    float area;
};

// One light group's power of a source.
struct GroupPower {
    std::array<float, 3> power;
    std::array<float, 3> offset;  // twice the way from the source's center to the centre of this power
};

// Sources of one block with their powers.
struct SourceList {
    std::vector<Source> sources;
    std::vector<const GroupPower*> powers;  // of each source, one a group; null: the next of the list's own
    std::vector<GroupPower> own;

    void clear() {
        sources.clear();
        powers.clear();
        own.clear();
    }
    // Room in the list for the powers of the last source, until the next call.
    GroupPower* add_own(std::size_t groups) {
        powers.push_back(nullptr);
        own.resize(own.size() + groups);
        return &own[own.size() - groups];
    }
    // Find the list's own powers, now that they stay where they are.
    void settle(std::size_t groups) {
        const GroupPower* next = own.data();
        for (const GroupPower*& at : powers) {
            if (at) continue;
            at = next;
            next += groups;
        }
    }
};

// Shading points and their sums. Rows of kBlockLanes floats: exitance has 3 groups of them.
struct BlockSums {
    alignas(64) std::array<float, kBlockLanes> x{}, y{}, z{};
    std::size_t lanes = 0;  // in use; the rest is padding, which must hold finite positions
    alignas(64) std::array<std::array<float, kBlockLanes>, 3> coverage{};
    std::vector<float> exitance;

    void clear(std::size_t groups) {
        for (auto& row : coverage) row.fill(0.0f);
        exitance.assign(3 * groups * kBlockLanes, 0.0f);
    }
    // Take shading points, at most kBlockLanes.
    void place(const V3f* positions, std::size_t count) {
        lanes = count;
        for (std::size_t lane = 0; lane < kBlockLanes; ++lane) {
            const V3f& p = positions[lane < count ? lane : 0];
            x[lane] = p.x;
            y[lane] = p.y;
            z[lane] = p.z;
        }
    }
};

// The sums of shading points, one row each: exitance (groups, 3), coverage (3), and zeros up to the stride.
class SumRows {
  public:
    static constexpr std::size_t kStep = 16;  // strides are multiples of it

    void reset(std::size_t count, std::size_t groups) {
        count_ = count;
        row_ = 3 * groups;
        values_.assign(count * stride(), 0.0f);
    }
    std::size_t size() const { return count_; }
    std::size_t used() const { return row_ + 3; }
    std::size_t stride() const { return (used() + kStep - 1) / kStep * kStep; }
    float* data() { return values_.data(); }
    const float* data() const { return values_.data(); }
    const float* exitance(std::size_t i) const { return &values_[i * stride()]; }
    const float* coverage(std::size_t i) const { return exitance(i) + row_; }

    // The lanes' sums join the rows from `first`.
    void add(std::size_t first, const BlockSums& lanes) {
        for (std::size_t lane = 0; lane < lanes.lanes; ++lane) {
            float* to = &values_[(first + lane) * stride()];
            for (std::size_t k = 0; k < row_; ++k) to[k] += lanes.exitance[k * kBlockLanes + lane];
            for (std::size_t c = 0; c < 3; ++c) to[row_ + c] += lanes.coverage[c][lane];
        }
    }

  private:
    std::size_t count_ = 0, row_ = 0;
    std::vector<float> values_;
};

// Piecewise-linear ramp as a sum of hinges: colour at 0 plus slope changes times max(0, r - distance).
struct RampHinges {
    std::array<float, 3> first{1.0f, 1.0f, 1.0f};
    struct Hinge {
        float distance;
        std::array<float, 3> slope_change;
    };
    std::vector<Hinge> hinges;
    bool is_flat = true;
};
RampHinges hinges_of(const Ramp& ramp, const Rgb& scale);

// Add every source's share to the block's sums, with the widest SIMD instructions that the processor has.
void add_sources(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                 BlockSums& block);

// The same one value after the other, summed in double precision: what tests compare with.
void add_sources_scalar(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                        BlockSums& block);

// The instruction set that add_sources uses here, e.g. "AVX3".
std::string simd_target();

}  // namespace frazil
