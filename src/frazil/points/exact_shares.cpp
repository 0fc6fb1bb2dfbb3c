#include "frazil/points/exact_shares.h"

namespace frazil {

PlanePart nearest_part(const PlanePart& polygon, const std::vector<PlanePoint>& points, std::size_t self) {
    const auto mix = [](const PlaneCorner& a, const PlaneCorner& b, double t) {
        return PlaneCorner{a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t, a.spacing + (b.spacing - a.spacing) * t};
    };
    const PlanePoint& p = points[self];
    PlanePart part = polygon;
    for (std::size_t other = 0; other < points.size() && part.count > 2; ++other) {
        const PlanePoint& q = points[other];
        if (p.x == q.x && p.y == q.y && p.s == q.s) {
            if (other < self) part.count = 0;
            continue;
        }
        const double a = 2.0 * (q.x - p.x), b = 2.0 * (q.y - p.y), c = p.s - q.s;
        part.clip([&](const PlaneCorner& z) { return a * z.x + b * z.y + c; }, mix);
    }
    if (part.count < 3) part.count = 0;
    return part;
}

double twice_area(const PlanePart& part) {
    double twice = 0.0;
    for (int k = 0; k < part.count; ++k) {
        const PlaneCorner &z = part.vertices[k], &next = part.vertices[k + 1 == part.count ? 0 : k + 1];
        twice += z.x * next.y - next.x * z.y;
    }
    return std::max(0.0, twice);
}

void share_exactly(const Patch& patch, const TileFrame& frame, const Candidates& candidates,
                   const std::vector<V3f>& worlds, double tolerance, std::vector<Share>& shares,
                   std::vector<ExactGap>& gaps) {
    std::vector<PlanePoint> points(candidates.count);
    const V3d u(patch.axes[0]), v(patch.axes[1]);
    for (int i = 0; i < candidates.count; ++i) {
        const V3d d = frame.to_local(worlds[candidates.points[i]]) - V3d(patch.center);
        points[i] = {d.dot(u), d.dot(v), d.length2()};
    }
    PlanePart whole;
    for (int k = 0; k < patch.count; ++k) whole.push({patch.x[k], patch.y[k], patch.spacing[k]});

    shares.clear();
    gaps.clear();
    if (candidates.count == 0) {
        ExactGap middle = {0.0, 0.0, HUGE_VAL};
        for (int k = 0; k < patch.count; ++k) {
            middle.x += patch.x[k] / double(patch.count);
            middle.y += patch.y[k] / double(patch.count);
        }
        gaps.push_back(middle);
        return;
    }
    for (int i = 0; i < candidates.count; ++i) {
        const PlanePoint& p = points[i];
        const PlanePart part = nearest_part(whole, points, std::size_t(i));
        if (part.count == 0) continue;
        for (int k = 0; k < part.count; ++k) {
            const PlaneCorner& z = part.vertices[k];
            const double distance2 = p.s + z.x * (z.x - 2.0 * p.x) + z.y * (z.y - 2.0 * p.y);
            const double excess = std::sqrt(std::max(0.0, distance2)) / z.spacing - 1.0;
            if (excess > tolerance) gaps.push_back({z.x, z.y, excess});
        }
        shares.push_back({candidates.points[i], float(twice_area(part))});
    }
    std::stable_sort(gaps.begin(), gaps.end(),
                     [](const ExactGap& a, const ExactGap& b) { return a.excess > b.excess; });
}

}  // namespace frazil
