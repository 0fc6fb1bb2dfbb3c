#include "frazil/points/point_lookup.h"

#include <bit>

#include "frazil/base/random.h"

namespace frazil {

PointLookup::PointLookup(const PointSet& points) : points_(points) {
    Box3f box;
    for (const V3f& position : points.positions) box.extendBy(position);
    if (!box.isEmpty()) origin_ = box.min;
    // A hair wider than the spacing, so that what lies within it is found in the next cell at the farthest.
    inverse_size_ = points.spacing > 0.0 ? 1.0 / (1.01 * points.spacing) : 0.0;
    const std::uint32_t buckets = std::bit_ceil(std::max<std::uint32_t>(16, std::uint32_t(points.size())));
    mask_ = buckets - 1;

    // Counting sort of the points by bucket.
    std::vector<std::uint32_t> bucket_of(points.size());
    first_.assign(std::size_t(buckets) + 1, 0);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const V3f& p = points.positions[i];
        bucket_of[i] = bucket(cell(p.x, 0), cell(p.y, 1), cell(p.z, 2));
        ++first_[bucket_of[i] + 1];
    }
    for (std::size_t b = 0; b < buckets; ++b) first_[b + 1] += first_[b];
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    indices_.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) indices_[next[bucket_of[i]]++] = std::uint32_t(i);
}

std::int64_t PointLookup::cell(float coordinate, int axis) const {
    return static_cast<std::int64_t>(std::floor((double(coordinate) - origin_[axis]) * inverse_size_));
}

std::uint32_t PointLookup::bucket(std::int64_t x, std::int64_t y, std::int64_t z) const {
    return hash(std::uint32_t(x), std::uint32_t(y), std::uint32_t(z)) & mask_;
}

std::uint32_t PointLookup::nearest(const V3f& position, const V3f& normal) const {
    const std::int64_t x = cell(position.x, 0), y = cell(position.y, 1), z = cell(position.z, 2);
    std::uint32_t on_side = kNone, any = kNone;
    // Nothing farther: distant cells may share a bucket.
    const float farthest = inverse_size_ > 0.0 ? static_cast<float>(2.0 / inverse_size_) : 0.0f;
    float nearest_on_side = farthest * farthest, nearest_any = nearest_on_side;
    for (std::int64_t dx = -1; dx <= 1; ++dx) {
        for (std::int64_t dy = -1; dy <= 1; ++dy) {
            for (std::int64_t dz = -1; dz <= 1; ++dz) {
                const std::uint32_t b = bucket(x + dx, y + dy, z + dz);
                for (std::uint32_t k = first_[b]; k < first_[b + 1]; ++k) {
                    const std::uint32_t i = indices_[k];
                    const float distance = (points_.positions[i] - position).length2();
                    const auto keep = [&](float& least, std::uint32_t& best) {
                        if (distance < least || (distance == least && i < best)) least = distance, best = i;
                    };
                    keep(nearest_any, any);
                    if (points_.normals[i].dot(normal) > 0.0f) keep(nearest_on_side, on_side);
                }
            }
        }
    }
    return on_side != kNone ? on_side : any;
}

}  // namespace frazil
