#include "frazil/points/point_lookup.h"

#include <array>
#include <bit>

namespace frazil {

const std::array<std::array<std::uint8_t, 3>, 27> PointLookup::kNeighbours = [] {
    std::array<std::array<std::uint8_t, 3>, 27> all{};
    std::size_t count = 0;
    for (int steps = 0; steps <= 3; ++steps) {
        for (std::uint8_t i = 0; i < 27; ++i) {
            const std::array<std::uint8_t, 3> at{std::uint8_t(i / 9), std::uint8_t(i / 3 % 3), std::uint8_t(i % 3)};
            if ((at[0] != 1) + (at[1] != 1) + (at[2] != 1) == steps) all[count++] = at;
        }
    }
    return all;
}();

PointLookup::PointLookup(const PointSet& points, double reach) {
    Box3f box;
    for (const V3f& position : points.positions) box.extendBy(position);
    if (!box.isEmpty()) origin_ = box.min;
    // A hair wider than the reach, so that what lies within it is found in the next cell at the farthest.
    inverse_size_ = reach > 0.0 ? 1.0 / (1.01 * reach) : 0.0;
    size2_ =
        inverse_size_ > 0.0 ? (1.0f - kRoundoff) * static_cast<float>(1.0 / (inverse_size_ * inverse_size_)) : 0.0f;
    const std::uint32_t buckets = std::bit_ceil(std::max<std::uint32_t>(16, std::uint32_t(points.size())));
    mask_ = buckets - 1;

    // Counting sort of the points by bucket.
    std::vector<std::uint32_t> bucket_of(points.size());
    first_.assign(std::size_t(buckets) + 1, 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const V3f& p = points.positions[i];
        const auto cell = [&](int axis) {
            return static_cast<std::int64_t>(std::floor((double(p[axis]) - origin_[axis]) * inverse_size_));
        };
        bucket_of[i] = bucket(cell(0), cell(1), cell(2));
        ++first_[bucket_of[i] + 1];
    }
    for (std::size_t b = 0; b < buckets; ++b) first_[b + 1] += first_[b];
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    entries_.resize(points.size());
    normals_.resize(points.normals.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::uint32_t at = next[bucket_of[i]]++;
        entries_[at] = {points.positions[i], std::uint32_t(i)};
        if (!normals_.empty()) normals_[at] = points.normals[i];
    }
}

std::vector<std::uint32_t> PointLookup::order() const {
    std::vector<std::uint32_t> result;
    result.reserve(entries_.size());
    for (const Entry& entry : entries_) result.push_back(entry.index);
    return result;
}

PointLookup::At PointLookup::locate(const V3f& position) const {
    At at;
    for (int axis = 0; axis < 3; ++axis) {
        const double x = (double(position[axis]) - origin_[axis]) * inverse_size_, floor = std::floor(x);
        const float within = static_cast<float>(x - floor);
        at.cell[axis] = static_cast<std::int64_t>(floor);
        at.beyond[axis] = {within * within, 0.0f, (1.0f - within) * (1.0f - within)};
    }
    return at;
}

std::uint32_t PointLookup::nearest(const V3f& position, const V3f& normal) const {
    const At at = locate(position);
    std::uint32_t on_side = kNone, any = kNone;
    // Nothing farther than two cells: distant ones may share a bucket.
    float nearest_on_side = 4.0f * size2_, nearest_any = nearest_on_side;
    for (const auto& neighbour : kNeighbours) {
        if (at.distance2(neighbour) * size2_ > nearest_on_side) continue;
        const std::uint32_t b = bucket(at, neighbour);
        for (std::uint32_t k = first_[b]; k < first_[b + 1]; ++k) {
            const auto& [p, i] = entries_[k];
            const float distance = (p - position).length2();
            const auto keep = [&](float& least, std::uint32_t& best) {
                if (distance < least || (distance == least && i < best)) least = distance, best = i;
            };
            keep(nearest_any, any);
            if (distance <= nearest_on_side && normals_[k].dot(normal) > 0.0f) keep(nearest_on_side, on_side);
        }
    }
    return on_side != kNone ? on_side : any;
}

}  // namespace frazil
