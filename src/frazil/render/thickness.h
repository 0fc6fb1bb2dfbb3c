// How much more light leaves a thin part of a body than the thick plane that profiles assume: its paths are shorter.
// Model: where nothing is absorbed, light's paths through a body are 4 V/S long on the mean, however it scatters
//   [BlancoFournier2003]; at a point chords c to the other side stand for that. Absorbed is the mean over chords of
//   a = 2 m t/(2 - m + m t), m = 1 - A, t = tanh(sigma_a l (2 - m)/(2 m)), l = c eta²/T_avg: what diffusion leaves in a slab
//   that is lit from both sides, with sigma_a l where it is thin and the half space's 1 - A where it is thick. Where bodies are seen through, e^{-sigma_t c} of the light goes straight on and is seen as such; what is
//   left, over the 1 - e^{-sigma_s c} of a picture that it fills, is the core's. So is light of one scattering, where rays
//   trace it: what leaves on either side from a place on each chord, against that of a half space.
// Units: metres.
// Valid: bench/truth.py measures it; 1 where nothing is absorbed.
// Not: which way the light goes through the part.
#pragma once

#include <vector>

#include "frazil/geometry/ray_scene.h"
#include "frazil/points/point_set.h"
#include "frazil/render/shells.h"
#include "frazil/translucency/medium.h"

namespace frazil {

// What the core returns over A, per point, both less the part `traced` of the light of one scattering. `seen_through`, 0..1:
// how much of what goes straight through rays trace on (IceMaterial::refraction). `shells` that are one body: chords end
// where the last of them is left. Else they end at what `mask` lets them meet.
std::vector<Rgb> thickness_gain(const PointSet& points, const RayScene& scene, const Medium& medium,
                                float traced = 0.0f, float seen_through = 0.0f, const Shells* shells = nullptr,
                                PlacementMask mask = nullptr);

}  // namespace frazil
