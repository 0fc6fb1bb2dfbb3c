// Reflection of unpolarised light at a smooth dielectric boundary, and its averages.
// Model: Fresnel's equations; eta = index of the side that the light would enter / index of the side it is on.
// Units: none (fractions of energy).
// Valid: eta > 0, cosine in [0, 1].
#pragma once

namespace frazil {

// Reflected fraction; 1 under total internal reflection.
float fresnel_dielectric(float cos_theta, float eta);

// 2 ∫ F(cos) cos dcos: the reflected fraction of light that comes from all around. 32-point Gauss-Legendre.
float fresnel_average(float eta);
// The same in double precision.
double fresnel_average_exact(double eta);
// 3 ∫ F(cos) cos² dcos.
double fresnel_second_moment(double eta);

}  // namespace frazil
