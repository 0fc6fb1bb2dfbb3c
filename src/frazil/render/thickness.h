// How much more light leaves a thin part of a body than the thick plane that profiles assume: its paths are shorter.
// Model: in even light a place inside scatters J = 1 - exp(-<y>) (translucency/even_light.h), <y> the mean over directions to
//   where the body ends, by rays from below each point's cell. What that is more than in a half space at the same depth,
//   Z = <y> - Y(tau), varies slowly; a ray that leaves towards mu is sent 1 - e^{-Z} (1 - r), r what a half space sends there,
//   Z where the rest is absorbed.
//   Where bodies are seen through, e^{-sigma_t c} of the light goes straight on and is seen as such, c a chord; what is left,
//   over the 1 - e^{-sigma_t c} of a picture that it fills, is the core's. So is light of one scattering, where rays trace it:
//   what leaves on either side from a place on each chord, against that of a half space.
// Units: metres.
// Valid: bench/truth.py measures it; 1 where nothing is absorbed. Where little is, index-matched slabs of 0.015, 0.5 and 5
//   free paths absorb 1.01, 1.3 and 1.6 times what is exact (the first two: tests/cpp/test_thickness.cpp).
// Not: which way the light goes through the part.
#pragma once

#include <array>
#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/points/point_set.h"
#include "frazil/render/shells.h"
#include "frazil/translucency/even_light.h"
#include "frazil/translucency/medium.h"

namespace frazil {

// A medium as thin parts know it.
struct ThinMedium {
    Medium medium;
    std::array<EvenLight, 3> even_light;  // per channel
    float traced = 0.0f;                  // of the light of one scattering, how much rays trace

    static ThinMedium of(const Medium& medium, float traced);
    // What of even light a half space's core returns, less what rays trace, over the part that it fills.
    Rgb plane = Rgb(1.0f);
};

// Where light is scattered first around each point, on the mean.
struct FirstScattering {
    std::vector<V3f> centers;
    std::vector<float> depths;  // below the planes of the points, or of their cells
    // Half axes of the ellipses, evenly filled, that stand for the points' cells; empty where the centers stand for them.
    std::vector<std::array<V3f, 2>> axes;
};

// Per point.
struct Thinness {
    std::vector<Rgb> gain;  // what the core returns over what a half space's does, both less what is traced
    // (N, 2): Z at the surface, and what it grows by per free path inwards; below zero where the surface is hollow.
    std::vector<Rgb> exponent;
    // How much of its cell knows the exponent, 0..1: none where chords do not end, or where it is so thin that the place below
    // is outside.
    std::vector<float> known;
};

// Light is scattered first `below` the points; at the points themselves where there are no such centers.
// `seen_through`, 0..1: how much of what goes straight through rays trace on (IceMaterial::refraction). `shells` that are one
// body: chords end where the last of them is left. Else they end at what `mask` lets them meet.
Thinness thinness(const PointSet& points, FirstScattering below, const RayScene& scene, const ThinMedium& medium,
                  float seen_through = 0.0f, const Shells* shells = nullptr, PlacementMask mask = nullptr);

// What is sent over what a half space sends, `plane`, where thin parts add `exponent`.
Rgb thin_gain(const Rgb& exponent, const Rgb& plane);

}  // namespace frazil
