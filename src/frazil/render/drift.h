// Light that enters at an angle is scattered first beside the place where it enters: where its flow along the surface
// varies, light gathers or is lost. Profiles, which are round about that place, do not know.
// Model: E' = E - div(l F): F the flow (lighting/irradiance.h), l the mean way along the surface to the first scattering,
//   weighted by what leaves again: (1 + mu a'(mu)/a(mu)) sin/sigma_t, a the directional albedo, which is sin/sigma_t where
//   nothing is absorbed; over all angles 2 a(1)/A - 1 of it. Each point hands its light on along the gradient of what
//   its neighbours weigh there, by a kernel three times as wide as light drifts.
// Units: metres, W/m2.
// Valid: the sum of irradiance times area stays the same; linear in the light; light from all around, whose flow is zero,
//   stays as it is. The same bits for any number of threads.
// Not: parts thinner than a free path, where light passes on the other side.
#pragma once

#include <vector>

#include "frazil/lighting/irradiance.h"
#include "frazil/points/point_set.h"
#include "frazil/render/chords.h"

namespace frazil {

// Carry the light of points on: irradiance and flows (N, groups), `length` metres per channel. `room`, one per point or
// empty, shortens the way.
void carry_on(const PointSet& points, const std::vector<Flow>& flows, const Rgb& length, std::vector<Rgb>& irradiance,
              const std::vector<float>& room = {});

// The mean way to a first scattering, over 1/sigma_t, where light that is not scattered leaves the body after `depth`
// optical depths.
float first_scattering_within(float depth);

// How much of the ways to the first scattering the parts of a body have room for, 0..1 per point: inwards and along the
// surface. Light from one side has half of a part inwards, as that from the other side has the other half.
struct Room {
    std::vector<float> inwards, along;
};
Room room_of(const PointSet& points, const ChordFinder& finder, float sigma_t);

}  // namespace frazil
