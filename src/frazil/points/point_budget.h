// Whether a point set will fit, told before any work is done on it.
// Model: about 0.7 points per spacing² of surface, times what a point takes at the peak.
// Units: points, bytes.
// Valid: the prediction is for surfaces that do not crowd each other within the spacing; those need fewer points.
// Not: a promise; the number is that of a random process.
#pragma once

#include <cstdint>

namespace frazil {

inline constexpr double kPointsPerSpacing2 = 0.7;
inline constexpr double kBytesPerPoint = 120.0;
// A set is indexed by 32-bit numbers in files and trees.
inline constexpr double kMostPoints = 5e8;

// Bytes that this process may still take: free memory, or less where a container limits it.
double available_memory();

// How many points may be made: `max_points`, or what fits into memory where that is 0.
double point_limit(std::uint64_t max_points);

// ValueError of the form "Mesh: <name> must be >= <the smallest that fits>, got ..." where `points` exceeds the limit. Their
// number goes as 1 / value to the power of `dimension`: 2 on surfaces, 1 along what is much longer than wide.
void check_budget(double points, int dimension, std::uint64_t max_points, const char* name, double value);

}  // namespace frazil
