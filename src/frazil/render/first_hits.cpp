#include "frazil/render/first_hits.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/random.h"

namespace frazil {
namespace {

// Samples that see alike: angle between their normals, and how far one lies off the other's tangent plane, in footprints.
constexpr float kLeastCosine = 0.8f, kFarthestOff = 4.0f;
constexpr std::size_t kMostGroups = 8;  // further samples join the last group of their object

bool is_alike(const FirstHit& a, const FirstHit& b) {
    return a.hit.placement == b.hit.placement && a.normal.dot(b.normal) >= kLeastCosine &&
           std::abs((b.position - a.position).dot(a.normal)) <= kFarthestOff * a.footprint;
}

}  // namespace

void choose_shaded(std::span<const FirstHit> hits, int wanted, std::uint32_t seed, std::vector<ShadedSample>& shaded) {
    shaded.clear();
    thread_local std::vector<std::uint32_t> first, group_of, size, ordered;
    first.clear(), size.clear();
    group_of.assign(hits.size(), 0);
    for (std::uint32_t i = 0; i < hits.size(); ++i) {
        if (!hits[i].is_noted) {
            shaded.push_back({i, 1.0f});
            continue;
        }
        std::uint32_t group = 0;
        while (group < first.size() && !is_alike(hits[first[group]], hits[i])) ++group;
        if (group == first.size() && group >= kMostGroups) {
            // No more groups: any of the same object, else one more.
            for (std::uint32_t g = 0; g < first.size(); ++g) {
                if (hits[first[g]].hit.placement == hits[i].hit.placement) group = g;
            }
        }
        if (group == first.size()) first.push_back(i), size.push_back(0);
        group_of[i] = group;
        ++size[group];
    }
    const std::size_t grouped = hits.size() - shaded.size();
    if (grouped == 0) return;

    // Runs of a group's samples, as even as may be; of each the sample that chance picks.
    std::uint32_t run = 0;
    for (std::uint32_t group = 0; group < first.size(); ++group) {
        ordered.clear();
        for (std::uint32_t i = first[group]; i < hits.size(); ++i) {
            if (hits[i].is_noted && group_of[i] == group) ordered.push_back(i);
        }
        const auto share = static_cast<std::uint32_t>(std::lround(double(wanted) * size[group] / double(grouped)));
        const std::uint32_t runs = std::clamp<std::uint32_t>(share, 1U, size[group]);
        for (std::uint32_t k = 0; k < runs; ++k, ++run) {
            const std::uint32_t begin = k * size[group] / runs, end = (k + 1) * size[group] / runs;
            const float u = to_unit_float(hash(seed, run));
            const auto picked = std::min(end - 1, begin + static_cast<std::uint32_t>(u * float(end - begin)));
            shaded.push_back({ordered[picked], float(end - begin)});
        }
    }
}

}  // namespace frazil
