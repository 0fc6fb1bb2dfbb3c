// Where the rays of a point start: at the point, or spread over the cell that it stands for.
// Model: places of the cell, each of which takes its share of the rays.
// Units: metres.
// Valid: functions of the point, the options and the salt alone.
// Not: rays (irradiance.h, bounce.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frazil/points/cells.h"
#include "frazil/points/point_set.h"

namespace frazil {

struct Place {
    V3f position, normal;
    float share = 1.0f;  // of the cell
};

// The cells of points and the mesh that they are on; none where both are null.
struct CellSource {
    const Cells* cells = nullptr;
    const Mesh* mesh = nullptr;
};

// Fill `places` with those of a point's cell, or with the point itself. Never empty.
void find_places(const PointSet& points, const CellSource& source, std::uint32_t point, std::vector<Place>& places);

// Deal samples begin, begin + 1 ... out to the places by their shares, so that those that follow one another go to different
// places.
void deal(std::span<const Place> places, std::size_t begin, std::uint32_t salt, std::span<std::uint32_t> place_of);

}  // namespace frazil
