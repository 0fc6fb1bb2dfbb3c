#include "frazil/lighting/light_bounds.h"

namespace frazil {
namespace {

constexpr float kLeast = 0.1f;  // of what estimates may vanish to, where something may arrive

float safe_sine(float cosine) {
    return std::sqrt(std::max(0.0f, 1.0f - cosine * cosine));
}

// Cosine of half the angle under which the ball about the box is seen; -1 from inside.
float cos_subtended(float distance2, float radius2) {
    if (distance2 <= radius2) return -1.0f;
    return std::sqrt(std::max(0.0f, 1.0f - radius2 / distance2));
}

struct Cone {
    V3f axis;
    float angle;  // radians
};

// The smallest cone that holds two.
Cone merged(Cone a, Cone b) {
    if (b.angle > a.angle) std::swap(a, b);
    const float between = std::acos(std::clamp(a.axis.dot(b.axis), -1.0f, 1.0f));
    if (std::min(between + b.angle, kPi) <= a.angle) return a;
    const float angle = 0.5f * (a.angle + between + b.angle);
    const V3f pole = a.axis.cross(b.axis);
    if (angle >= kPi || pole.length2() < 1e-12f) return {a.axis, kPi};
    // Turn a's axis towards b's.
    const float turn = angle - a.angle;
    const V3f side = pole.normalized().cross(a.axis);
    return {(a.axis * std::cos(turn) + side * std::sin(turn)).normalized(), angle};
}

}  // namespace

float cos_difference(float cos_a, float cos_b) {
    if (cos_a >= cos_b) return 1.0f;
    return std::min(1.0f, cos_a * cos_b + safe_sine(cos_a) * safe_sine(cos_b));
}

LightBounds scaled(const LightBounds& bounds, float scale) {
    LightBounds result = bounds;
    for (float* part : {&result.power, &result.even, &result.beamed, &result.beam_angle}) *part *= scale;
    result.flow *= scale;
    result.beam *= scale;
    return result;
}

LightBounds merged(const LightBounds& a, const LightBounds& b) {
    if (a.power == 0.0f) return b;
    if (b.power == 0.0f) return a;
    const auto angle = [](float cosine) { return std::acos(std::clamp(cosine, -1.0f, 1.0f)); };
    const Cone cone = merged(Cone{a.axis, angle(a.cos_spread)}, Cone{b.axis, angle(b.cos_spread)});
    LightBounds result = a;
    result.box.extendBy(b.box);
    result.axis = cone.axis;
    // A hair wider, so that rounding cuts nothing off.
    result.cos_spread = std::cos(std::min(kPi, cone.angle + 1e-4f));
    result.cos_emission = std::min(a.cos_emission, b.cos_emission);
    result.power = a.power + b.power;
    result.center = (a.center * a.power + b.center * b.power) / result.power;
    result.even = a.even + b.even;
    result.flow = a.flow + b.flow;
    result.beamed = a.beamed + b.beamed;
    result.beam = a.beam + b.beam;
    result.beam_angle = a.beam_angle + b.beam_angle;
    return result;
}

float receiving_cosine(const Box3f& box, const V3f& position, const V3f& normal) {
    if (normal == V3f(0.0f)) return 1.0f;
    const V3f to_center = (box.min + box.max) * 0.5f - position;
    const float distance2 = to_center.length2(), radius2 = 0.25f * (box.max - box.min).length2();
    const float subtended = cos_subtended(distance2, radius2);
    if (subtended < 0.0f) return 1.0f;
    return std::max(0.0f, cos_difference(normal.dot(to_center) / std::sqrt(distance2), subtended));
}

float importance(const LightBounds& bounds, const V3f& position, const V3f& normal) {
    const V3f to_box = (bounds.box.min + bounds.box.max) * 0.5f - position;
    const float box_distance2 = to_box.length2(), radius2 = 0.25f * (bounds.box.max - bounds.box.min).length2();
    const float subtended = cos_subtended(box_distance2, radius2);
    if (subtended >= 0.0f) {
        // The least angles at which any light can leave, and be received.
        const float inverse = 1.0f / std::sqrt(box_distance2);
        const float off_axis = -bounds.axis.dot(to_box) * inverse;
        const float leaving = cos_difference(cos_difference(off_axis, bounds.cos_spread), subtended);
        if (leaving < bounds.cos_emission) return 0.0f;
        if (normal != V3f(0.0f) && cos_difference(normal.dot(to_box) * inverse, subtended) <= 0.0f) return 0.0f;
    }

    // Seen from the middle; what is near, or mixed, is kept from vanishing.
    const V3f to_light = bounds.center - position;
    const float distance2 = std::max(to_light.length2(), 1e-30f), distance = std::sqrt(distance2);
    const V3f away = to_light * (-1.0f / distance);
    const float size = std::min(1.0f, std::sqrt(radius2 / distance2));
    float leaving = bounds.even;
    if (bounds.flow != V3f(0.0f)) {
        leaving += std::max(bounds.flow.dot(away), kLeast * (bounds.power - bounds.even - bounds.beamed));
    }
    if (bounds.beamed > 0.0f) {
        const float length = std::min(bounds.beam.length() / bounds.beamed, 1.0f);
        const float cosine = bounds.beam.dot(away) / (bounds.beamed * std::max(length, 1e-6f));
        const float off_axis = std::acos(std::clamp(cosine, -1.0f, 1.0f));
        // Axes differ by so much; a share of them points this way.
        const float spread = std::sqrt(2.0f * (1.0f - length)) + size + 1e-3f;
        const float share = (bounds.beam_angle / bounds.beamed + spread - off_axis) / (2.0f * spread);
        leaving += bounds.beamed * std::clamp(share, kLeast, 1.0f);
    }
    float receiving = 1.0f;
    if (normal != V3f(0.0f)) receiving = std::max(-normal.dot(away), kLeast + 0.25f * size);
    return leaving * receiving / std::max(distance2, 0.5f * radius2);
}

float tree_cost(const LightBounds& bounds) {
    const float spread = std::acos(std::clamp(bounds.cos_spread, -1.0f, 1.0f));
    const float emission = std::acos(std::clamp(bounds.cos_emission, -1.0f, 1.0f));
    const float edge = std::min(spread + emission, kPi), sine = safe_sine(bounds.cos_spread);
    const float cone =
        2.0f * kPi * (1.0f - bounds.cos_spread) +
        0.5f * kPi * (2.0f * edge * sine - std::cos(spread - 2.0f * edge) - 2.0f * spread * sine + bounds.cos_spread);
    const V3f size = bounds.box.max - bounds.box.min;
    const float area = size.x * size.y + size.y * size.z + size.z * size.x;
    return bounds.power * std::max(cone, 1e-3f) * std::max(area, 1e-30f);
}

}  // namespace frazil
