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

void add_sources(const KernelTable& table, const RampHinges& ramp, const SourceList& list, std::size_t groups,
                 BlockSums& block) {
    const std::size_t row = 3 * groups;
    for (std::size_t s = 0; s < list.sources.size(); ++s) {
        const Source& source = list.sources[s];
        const auto& cov = source.covariance;
        const auto& off = source.power_offset;
        for (std::size_t lane = 0; lane < block.lanes; ++lane) {
            const float dx = source.center[0] - block.x[lane], dy = source.center[1] - block.y[lane],
                        dz = source.center[2] - block.z[lane];
            const float q = dx * dx + dy * dy + dz * dz;
            const float trace = cov[0] + cov[1] + cov[2];
            const float along = dx * (cov[0] * dx + 2.0f * (cov[3] * dy + cov[4] * dz)) +
                                dy * (cov[1] * dy + 2.0f * cov[5] * dz) + dz * cov[2] * dz;
            const float lean = 2.0f * (dx * off[0] + dy * off[1] + dz * off[2]);
            const float r = ramp.is_flat ? 0.0f : std::sqrt(q);
            for (int c = 0; c < 3; ++c) {
                const KernelTable::Jet f = table.eval(c, q);
                const float even = f.value + f.slope * trace + 2.0f * f.curvature * along;
                float lit = even + f.slope * lean;
                if (!ramp.is_flat) {
                    float color = ramp.first[c];
                    for (const auto& hinge : ramp.hinges) {
                        color += hinge.slope_change[c] * std::max(0.0f, r - hinge.distance);
                    }
                    lit *= color;
                }
                block.coverage[c][lane] += even * source.area;
                for (std::size_t g = 0; g < groups; ++g) {
                    block.exitance[(3 * g + c) * kBlockLanes + lane] += lit * list.powers[s * row + 3 * g + c];
                }
            }
        }
    }
}

}  // namespace frazil
