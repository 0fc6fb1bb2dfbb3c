#include "frazil/translucency/gather_kernel.h"

#include <cmath>

namespace frazil {

RampHinges hinges_of(const Ramp& ramp, const Rgb& scale) {
    RampHinges out;
    if (ramp.is_empty()) return out;
    out.is_flat = false;
    for (int c = 0; c < 3; ++c) out.first[c] = ramp.colors.front()[c] * scale[c];
    const std::size_t n = ramp.distances.size();
    Rgb slope(0.0f);
    for (std::size_t k = 0; k < n && n > 1; ++k) {
        Rgb next(0.0f);
        if (k + 1 < n) {
            next = (ramp.colors[k + 1] - ramp.colors[k]) * scale / (ramp.distances[k + 1] - ramp.distances[k]);
        }
        const Rgb change = next - slope;
        out.hinges.push_back({ramp.distances[k], {change.x, change.y, change.z}});
        slope = next;
    }
    return out;
}

void add_sources_scalar(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                        BlockSums& block) {
    const std::size_t row = 3 * groups;
    std::vector<double> exitance(row);
    for (std::size_t lane = 0; lane < block.lanes; ++lane) {
        std::fill(exitance.begin(), exitance.end(), 0.0);
        double coverage[3] = {0.0, 0.0, 0.0};
        for (std::size_t s = 0; s < list.sources.size(); ++s) {
            const Source& source = list.sources[s];
            const auto& cov = source.covariance;
            const float dx = source.center[0] - block.x[lane], dy = source.center[1] - block.y[lane],
                        dz = source.center[2] - block.z[lane];
            const float q = dx * dx + dy * dy + dz * dz;
            const float trace = source.trace;
            const float along =
                dx * (cov[0] * dx + cov[3] * dy + cov[4] * dz) + dy * (cov[1] * dy + cov[5] * dz) + dz * cov[2] * dz;
            // Mean and variance of the distance over the source.
            const float variance = std::max(0.0f, along / (q + trace + 1e-30f));
            const float mean_r = std::sqrt(std::max(0.0f, q + trace - variance));
            const float half_width = std::sqrt(3.0f * variance) + 1e-6f * mean_r + kLeastSpread;
            for (int c = 0; c < 3; ++c) {
                const KernelTable::Jet f = table.eval(c, q);
                const float even = f.value + f.slope * trace + 2.0f * f.curvature * along;
                // The kernel with its ramp, and its derivative in q.
                float lit = even, lit_slope = f.slope;
                if (!ramp.is_flat) {
                    // Average each hinge over a uniform spread of distances.
                    float color = ramp.first[c], slope = 0.0f;
                    for (const auto& hinge : ramp.hinges) {
                        const float x = mean_r - hinge.distance;
                        const float part = std::clamp(0.5f + 0.5f * x / half_width, 0.0f, 1.0f);
                        color += hinge.slope_change[c] * (part * part * half_width + std::max(0.0f, x - half_width));
                        slope += hinge.slope_change[c] * part;
                    }
                    lit = even * color + 2.0f * std::sqrt(q) * f.slope * variance * slope;
                    lit_slope = f.slope * color + f.value * slope * 0.5f / (mean_r + half_width);
                }
                coverage[c] += double(even) * source.area;
                for (std::size_t g = 0; g < groups; ++g) {
                    const GroupPower& lamp = list.powers[s][g];
                    const float lean = dx * lamp.offset[0] + dy * lamp.offset[1] + dz * lamp.offset[2];
                    exitance[3 * g + c] += double(lit + lit_slope * lean) * lamp.power[c];
                }
            }
        }
        for (int c = 0; c < 3; ++c) block.coverage[c][lane] += static_cast<float>(coverage[c]);
        for (std::size_t c = 0; c < row; ++c) {
            block.exitance[c * kBlockLanes + lane] += static_cast<float>(exitance[c]);
        }
    }
}

}  // namespace frazil
