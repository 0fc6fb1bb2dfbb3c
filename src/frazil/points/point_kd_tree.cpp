#include "frazil/points/point_kd_tree.h"

#include <algorithm>

namespace frazil {

PointKdTree::PointKdTree(const PointSet& points) : points_(points), order_(points.size()), axes_(points.size()) {
    for (std::size_t i = 0; i < order_.size(); ++i) order_[i] = static_cast<std::uint32_t>(i);
    build(0, order_.size());
}

void PointKdTree::build(std::size_t begin, std::size_t end) {
    if (end - begin < 2) return;
    Box3f box;
    for (std::size_t i = begin; i < end; ++i) box.extendBy(points_.positions[order_[i]]);
    const auto axis = static_cast<std::uint8_t>(box.majorAxis());
    const std::size_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](std::uint32_t a, std::uint32_t b) {
                         const float x = points_.positions[a][axis], y = points_.positions[b][axis];
                         return x != y ? x < y : a < b;
                     });
    axes_[middle] = axis;
    build(begin, middle);
    build(middle + 1, end);
}

void PointKdTree::search(std::size_t begin, std::size_t end, const Query& query, std::uint32_t self,
                         Nearest& best) const {
    if (begin == end) return;
    const std::size_t middle = begin + (end - begin) / 2;
    const std::uint32_t point = order_[middle];
    const V3d offset = query.place - V3d(points_.positions[point]);
    const double distance2 = offset.length2();
    if (point != self && distance2 < best.distance2 && is_seen(query, point)) best = {point, distance2};
    if (end - begin == 1) return;
    const double side = offset[axes_[middle]];
    const bool is_below = side < 0.0;
    is_below ? search(begin, middle, query, self, best) : search(middle + 1, end, query, self, best);
    if (side * side >= best.distance2) return;
    is_below ? search(middle + 1, end, query, self, best) : search(begin, middle, query, self, best);
}

bool PointKdTree::collect(std::size_t begin, std::size_t end, const Query& query, double distance2, std::size_t most,
                          std::vector<std::uint32_t>& found) const {
    if (begin == end) return true;
    const std::size_t middle = begin + (end - begin) / 2;
    const std::uint32_t point = order_[middle];
    const V3d offset = query.place - V3d(points_.positions[point]);
    if (offset.length2() <= distance2 && is_seen(query, point)) {
        if (found.size() == most) return false;
        found.push_back(point);
    }
    if (end - begin == 1) return true;
    const double side = offset[axes_[middle]];
    const bool is_near = side * side <= distance2;
    if ((side < 0.0 || is_near) && !collect(begin, middle, query, distance2, most, found)) return false;
    if (side < 0.0 && !is_near) return true;
    return collect(middle + 1, end, query, distance2, most, found);
}

}  // namespace frazil
