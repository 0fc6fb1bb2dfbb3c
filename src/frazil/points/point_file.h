// Point sets as binary PLY files, which every geometry tool opens.
// Model: one vertex a point with x y z, nx ny nz, area, triangle, u v (barycentrics); the spacing in a comment.
// Units: metres, m².
// Valid: little-endian files with these properties in any order, and others, which are skipped.
// Not: ASCII and big-endian PLY; meshes.
#pragma once

#include <string>

#include "frazil/points/point_set.h"

namespace frazil {

// FileError, naming the path, where the file cannot be written in full.
void save_points(const PointSet& points, const std::string& path);

// FileError where the file cannot be read, is no such PLY, or is shorter than it says.
PointSet load_points(const std::string& path);

}  // namespace frazil
