// Procedural masks in the rest space of an object: cracks, frost, bubbles, snow and dirt.
// Model: distances to planes, cell walls and bubbles are drawn as lines of a width; frost, snow and bands are thresholds on
//   noise. Every edge is averaged over the pixel's footprint, so that thin lines fade instead of breaking up.
// Units: metres in rest space: the object's own frame, scaled as the object is, not turned or moved.
// Valid: widths hold on the surface whatever the object's scale; no seams; the same in every frame of a moving object.
// Not: texture masks (texture.h).
#pragma once

#include <string>

#include "frazil/base/sampler.h"
#include "frazil/material/noise.h"

namespace frazil {

enum class PatternKind {
    solid,     // everywhere
    fracture,  // planes through the body, some of each left out
    cells,     // walls of cells, at several scales
    frost,     // fractal growth
    bubbles,   // round spots
    snow,      // dust on what faces up
    bands,     // layers across `direction`
};

struct Pattern {
    PatternKind kind = PatternKind::solid;
    float size = 0.3f;       // of a cell, distance of planes and bands, widest feature of frost; metres
    float width = 0.004f;    // of lines, bubbles (diameter) and bands, metres
    float feather = 0.004f;  // over which a line's edge fades, metres
    float warp = 0.2f;       // how much lines are bent, of `size`
    int scales = 2;          // of cells; octaves of frost and snow beyond the first
    float amount = 0.5f;     // 0..1: how much of it there is
    float slope = 0.0f;      // -1..1: more where the surface faces `direction` (or away from it)
    V3f direction = V3f(0.0f, 1.0f, 0.0f);
    std::uint32_t seed = 0;
};

// Where a pattern is read.
struct PatternPoint {
    V3f position = V3f(0.0f);   // rest space, metres
    V3f normal = V3f(0, 1, 0);  // unit length, rest space; zero = inside a body: widths are across the sheet
    float footprint = 0.0f;     // radius of what a pixel sees, metres
};

// Refuse what is out of range: ValueError beginning with `path`.
void check_pattern(const Pattern& pattern, const std::string& path);

// The mask, 0..1.
float eval_pattern(const Pattern& pattern, const PatternPoint& point);

// A ray in rest space, and the cone that it stands for.
struct FractureRay {
    V3f origin = V3f(0.0f), direction = V3f(0.0f);
    float t_min = 0.0f, t_max = 0.0f;
    float radius = 0.0f, spread = 0.0f;  // of the cone at the origin, and per metre
};

// The first fracture plane between t_min and t_max that stops the ray, each by the chance of its mask times `opacity`, and
// its normal; false where none does. One number of `coins` a plane. Only for PatternKind::fracture.
bool find_fracture(const Pattern& pattern, float opacity, const FractureRay& ray, Sampler& coins, float& t,
                   V3f& normal);

// The part of a line of full width `width`, at `distance` from its middle, that a footprint sees: exact for a box of
// radius footprint + feather / 2.
float line_mask(float distance, float width, float feather, float footprint);

}  // namespace frazil
