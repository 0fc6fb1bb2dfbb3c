// A colour for every distance between where light enters and where it leaves: the talk's control over the look inside.
// Model: piecewise linear in knots (distance, colour); constant before the first and after the last [Xie2014].
// Units: metres; colours are factors >= 0.
// Valid: at least one knot, distances >= 0 and strictly increasing.
#pragma once

#include <string>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/translucency/profile.h"

namespace frazil {

struct Ramp {
    std::vector<float> distances;
    std::vector<Rgb> colors;
    // Scale each channel so that the total diffuse reflectance stays what it was: hue shifts, energy does not.
    bool preserve_energy = false;

    bool is_empty() const { return distances.empty(); }
};

// Refuse knots out of order or range: ValueError beginning with `path`.
void check_ramp(const Ramp& ramp, const std::string& path);

// The factor at distance r; (1,1,1) for an empty ramp. preserve_energy is not applied here but in the kernel.
Rgb eval(const Ramp& ramp, float r);

// What preserve_energy multiplies each channel by: ∫ r Rd dr / ∫ r Rd ramp dr, or 1 where it is off.
Rgb energy_scale(const Ramp& ramp, const Profile& profile);

// The hat function of knot k: white there, black at its neighbours, so that colours times hats sum to the ramp.
Ramp hat(const Ramp& ramp, std::size_t k);

// A ramp whose distances were given in mean free paths, in metres.
Ramp in_metres(const Ramp& ramp, double mean_free_path);

}  // namespace frazil
