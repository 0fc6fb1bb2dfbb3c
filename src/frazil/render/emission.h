// Which objects of a scene emit light by their material, and how much: what mesh lights are made of.
// Model: the mean of the material's emission over each triangle, by seven places on it where it has a texture.
// Units: radiance.
// Valid: standard materials; others emit nothing.
// Not: texture within a triangle.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/render/scene.h"

namespace frazil {

std::vector<std::uint32_t> emissive_objects(const Scene& scene);

// One per triangle of the object's mesh; empty where the material emits nothing.
std::vector<Rgb> triangle_emission(const Scene& scene, std::uint32_t object);

}  // namespace frazil
