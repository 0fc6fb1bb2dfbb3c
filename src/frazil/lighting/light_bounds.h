// Where lights are and where to they shine, for one or many: what a choice among lights goes by.
// Model: box and cone of emission bound what can reach a receiver [ContyEstevez2018]; how much does is not bounded but
//   estimated, from means over the lights: their middle, the sum of their flows, the mean of their cones.
// Units: metres; power in any unit of radiance times area.
// Valid: importance() is 0 only where none of the lights can reach the receiver. Its angles are bounds.
// Not: lights from infinity.
#pragma once

#include "frazil/base/vec.h"

namespace frazil {

struct LightBounds {
    Box3f box;
    V3f axis = V3f(0.0f, 0.0f, 1.0f);
    // Cosines of the half angle of the cone of normals about the axis, and of how far from a normal light leaves. Light
    // to all sides: -1 and 1.
    float cos_spread = -1.0f, cos_emission = 1.0f;
    float power = 0.0f;  // absolute; the sum of the parts below and of what `flow` sums

    V3f center = V3f(0.0f);   // mean by power
    float even = 0.0f;        // power of lights that shine alike to all sides
    V3f flow = V3f(0.0f);     // sum of power times normal of those that shine to one side by the cosine
    float beamed = 0.0f;      // power of those with a narrow cone
    V3f beam = V3f(0.0f);     // sum of their power times axis
    float beam_angle = 0.0f;  // sum of their power times half angle, radians
};

// The same lights, so many times as strong.
LightBounds scaled(const LightBounds& bounds, float scale);

// Both together; a light without power does not widen the other.
LightBounds merged(const LightBounds& a, const LightBounds& b);

// Cosine of max(0, a - b) for angles in [0, pi].
float cos_difference(float cos_a, float cos_b);

// The cosine of the angle between a receiver's normal and the nearest place of the ball about `box`, no less than 0; 1
// where the normal is zero (a receiver of light from all sides).
float receiving_cosine(const Box3f& box, const V3f& position, const V3f& normal);

// An estimate of the light that arrives.
float importance(const LightBounds& bounds, const V3f& position, const V3f& normal);

// The cost of a node of a tree: power, times the measure of its cone, times the area of its box [ContyEstevez2018].
float tree_cost(const LightBounds& bounds);

}  // namespace frazil
