// A rectangle as a point sees it: its solid angle, and directions uniform in it.
// Model: [Urena2013], in double precision, so that small and distant rectangles keep their solid angle.
// Units: steradian; coordinates in any one unit of length.
// Valid: the rectangle [x0,x1] × [y0,y1] in the plane z = -height, seen from the origin, height > 0. Below a solid angle
//   of 1e-9 the rectangle is taken as flat on the sphere (sampled by area).
#pragma once

#include <algorithm>
#include <cmath>

#include "frazil/base/vec.h"

namespace frazil {

class SphericalRectangle {
  public:
    SphericalRectangle(double x0, double x1, double y0, double y1, double height)
        : x0_(x0), x1_(x1), y0_(y0), y1_(y1), z0_(-height) {
        // Angles between the four planes through the origin and the edges.
        const double xx0 = std::sqrt(z0_ * z0_ + x0 * x0), xx1 = std::sqrt(z0_ * z0_ + x1 * x1);
        const double yy0 = std::sqrt(z0_ * z0_ + y0 * y0), yy1 = std::sqrt(z0_ * z0_ + y1 * y1);
        const double nz_low = -y0 / yy0, nz_right = x1 / xx1, nz_high = y1 / yy1, nz_left = -x0 / xx0;
        const auto angle = [](double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)); };
        const double g0 = angle(-nz_low * nz_right), g1 = angle(-nz_right * nz_high);
        const double g2 = angle(-nz_high * nz_left), g3 = angle(-nz_left * nz_low);
        b0_ = nz_low, b1_ = nz_high;
        k_ = 2.0 * 3.14159265358979323846 - g2 - g3;
        solid_angle_ = g0 + g1 - k_;
        is_small_ = !(solid_angle_ > 1e-9);
        area_ = (x1 - x0) * (y1 - y0);
    }

    // A point of the rectangle, from the origin.
    V3d sample(const V2f& u) const {
        if (is_small_) return {x0_ + (x1_ - x0_) * double(u.x), y0_ + (y1_ - y0_) * double(u.y), z0_};
        const double au = double(u.x) * solid_angle_ + k_;
        const double fu = (std::cos(au) * b0_ - b1_) / std::sin(au);
        const double cu = std::clamp(std::copysign(1.0 / std::sqrt(fu * fu + b0_ * b0_), fu), -1.0, 1.0);
        const double x = std::clamp(-(cu * z0_) / std::sqrt(std::max(1.0 - cu * cu, 1e-300)), x0_, x1_);
        const double d2 = x * x + z0_ * z0_;
        const double h0 = y0_ / std::sqrt(d2 + y0_ * y0_), h1 = y1_ / std::sqrt(d2 + y1_ * y1_);
        const double h = h0 + double(u.y) * (h1 - h0), h2 = h * h;
        const double y = h2 < 1.0 - 1e-12 ? std::clamp(h * std::sqrt(d2 / (1.0 - h2)), y0_, y1_) : y1_;
        return {x, y, z0_};
    }

    double solid_angle() const {
        return is_small_ ? -z0_ * area_ / std::pow(x0_ * x0_ + y0_ * y0_ + z0_ * z0_, 1.5) : solid_angle_;
    }

    // Density per steradian of the direction to the point p of the rectangle.
    double pdf(const V3d& p) const {
        if (!is_small_) return 1.0 / solid_angle_;
        const double distance2 = p.dot(p);
        return distance2 * std::sqrt(distance2) / (-z0_ * area_);
    }

  private:
    double x0_, x1_, y0_, y1_, z0_, b0_, b1_, k_, solid_angle_, area_;
    bool is_small_;
};

}  // namespace frazil
