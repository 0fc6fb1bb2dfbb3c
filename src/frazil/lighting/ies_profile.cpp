#include "frazil/lighting/ies_profile.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/error.h"

namespace frazil {
namespace {

constexpr float kDegrees = 180.0f / kPi;
constexpr float kSlack = 1e-3f;  // degrees by which a file's angles may miss round ones

void check_angles(const std::vector<float>& angles, float first, float last, const char* field,
                  const std::string& path) {
    if (angles.empty()) throw ValueError(str(path, ": ", field, " must be at least one angle, got none."));
    for (std::size_t i = 0; i < angles.size(); ++i) {
        const bool is_inside = angles[i] >= first - kSlack && angles[i] <= last + kSlack;
        if (is_inside && (i == 0 || angles[i] > angles[i - 1])) continue;
        throw ValueError(str(path, ": ", field, " must rise within ", first, " to ", last, " degrees, got ", angles[i],
                             " as number ", i + 1, "."));
    }
}

bool is_near(float a, float b) {
    return std::abs(a - b) <= kSlack;
}

// The last of the angles that is not above x, and how far x is on the way to the next.
std::size_t find_interval(const std::vector<float>& angles, float x, float& rest) {
    if (angles.size() == 1) {
        rest = 0.0f;
        return 0;
    }
    const auto above = std::upper_bound(angles.begin() + 1, angles.end() - 1, x);
    const std::size_t i = std::size_t(above - angles.begin()) - 1;
    rest = std::clamp((x - angles[i]) / (angles[i + 1] - angles[i]), 0.0f, 1.0f);
    return i;
}

// The integral over the sine of a line from a at angle p to b at angle q, radians.
double integral_over_sine(double p, double q, double a, double b) {
    const double slope = (b - a) / (q - p);
    return a * std::cos(p) - b * std::cos(q) + slope * (std::sin(q) - std::sin(p));
}

}  // namespace

IesProfile::IesProfile(std::vector<float> vertical, std::vector<float> horizontal, std::vector<float> values,
                       const std::string& path)
    : vertical_(std::move(vertical)), horizontal_(std::move(horizontal)), values_(std::move(values)) {
    check_angles(vertical_, 0.0f, 180.0f, "vertical angles", path);
    check_angles(horizontal_, 0.0f, 360.0f, "horizontal angles", path);
    const float first = horizontal_.front(), last = horizontal_.back();
    const bool is_known = (is_near(first, 0.0f) && (horizontal_.size() == 1 || is_near(last, 90.0f) ||
                                                    is_near(last, 180.0f) || is_near(last, 360.0f))) ||
                          (is_near(first, 90.0f) && is_near(last, 270.0f));
    if (!is_known) {
        throw ValueError(str(path,
                             ": horizontal angles must go from 0 to 0, 90, 180 or 360 or from 90 to 270 degrees, got ",
                             first, " to ", last, "."));
    }
    if (values_.size() != vertical_.size() * horizontal_.size()) {
        throw ValueError(str(path, ": intensities must be one for each pair of angles (",
                             vertical_.size() * horizontal_.size(), "), got ", values_.size(), "."));
    }
    for (const float value : values_) {
        if (std::isfinite(value) && value >= 0.0f) continue;
        throw ValueError(str(path, ": intensities must be >= 0 and finite, got ", value, "."));
    }

    // The mean over the horizontal angles for each vertical one, then over the sphere.
    const std::size_t rows = vertical_.size();
    std::vector<double> row(rows, 0.0);
    for (std::size_t v = 0; v < rows; ++v) {
        if (horizontal_.size() == 1) row[v] = double(values_[v]);
        for (std::size_t h = 0; h + 1 < horizontal_.size(); ++h) {
            const double width = double(horizontal_[h + 1]) - double(horizontal_[h]);
            row[v] += 0.5 * width / (double(last) - double(first)) *
                      (double(values_[h * rows + v]) + double(values_[(h + 1) * rows + v]));
        }
    }
    double integral = 0.0;
    for (std::size_t v = 0; v + 1 < rows; ++v) {
        integral += integral_over_sine(double(vertical_[v] / kDegrees), double(vertical_[v + 1] / kDegrees), row[v],
                                       row[v + 1]);
    }
    const bool is_hemisphere = vertical_.back() - vertical_.front() < 95.0f;
    mean_ = static_cast<float>(integral * (is_hemisphere ? 1.0 : 0.5));
}

float IesProfile::at(float vertical, float horizontal) const {
    if (vertical < vertical_.front() - kSlack || vertical > vertical_.back() + kSlack) return 0.0f;
    const float last = horizontal_.back();
    if (is_near(horizontal_.front(), 90.0f)) {
        // Mirrored in the plane of 90 and 270 degrees.
        if (horizontal < 90.0f || horizontal > 270.0f)
            horizontal = horizontal < 90.0f ? 180.0f - horizontal : 540.0f - horizontal;
    } else if (last < 270.0f) {
        if (horizontal > 180.0f) horizontal = 360.0f - horizontal;
        if (last < 135.0f && horizontal > 90.0f) horizontal = 180.0f - horizontal;
    }
    float down, across;
    const std::size_t rows = vertical_.size(), v = find_interval(vertical_, vertical, down);
    const std::size_t h = find_interval(horizontal_, horizontal, across);
    const std::size_t v1 = std::min(v + 1, rows - 1), h1 = std::min(h + 1, horizontal_.size() - 1);
    const auto mix = [](float a, float b, float t) { return a * (1.0f - t) + b * t; };
    return mix(mix(values_[h * rows + v], values_[h * rows + v1], down),
               mix(values_[h1 * rows + v], values_[h1 * rows + v1], down), across);
}

float IesProfile::eval(const V3f& towards, float angle_scale) const {
    float vertical = std::acos(std::clamp(towards.z, -1.0f, 1.0f)) * kDegrees;
    if (angle_scale > 0.0f) vertical = vertical / angle_scale;
    if (angle_scale < 0.0f) vertical = (vertical - 180.0f) / -angle_scale + 180.0f;
    float horizontal = std::atan2(towards.y, towards.x) * kDegrees;
    if (horizontal < 0.0f) horizontal += 360.0f;
    return at(vertical, horizontal);
}

}  // namespace frazil
