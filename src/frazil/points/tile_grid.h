// The surface cut into cubic tiles, so that points can be placed in many tiles at once with a result of its own.
// Model: tiles of the same parity (8 colours) are at least one tile apart; as a tile is wider than the spacing, points in
//   two tiles of one colour never compete. Tiles lie in Morton order, so that neighbours in space are near in memory.
// Units: metres.
// Valid: any number of triangles per tile and of tiles per triangle; triangles without area are left out.
// Not: the clipped geometry, which is made again where it is needed: memory stays a few bytes a triangle.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/geometry/mesh.h"

namespace frazil {

struct TileGrid {
    V3d origin;
    double size = 1.0;
    std::vector<std::uint64_t> keys;    // Morton codes, ascending; the low three bits are the colour
    std::vector<std::uint64_t> starts;  // triangles of tile i: triangles[starts[i] .. starts[i + 1])
    std::vector<std::int32_t> triangles;

    std::size_t count() const { return keys.size(); }
    V3d tile_origin(std::size_t tile) const;
    // The existing tiles around one, itself left out: at most 26.
    std::vector<std::uint32_t> neighbours(std::size_t tile) const;
};

// Cut the mesh into tiles at least `tile_size` wide. std::length_error where there would be more than `max_pairs` pairs of
// a tile and a triangle in it.
TileGrid make_tile_grid(const Mesh& mesh, double tile_size, std::uint64_t max_pairs);

}  // namespace frazil
