// The surface dealt out to cubic tiles, so that points can be placed in many tiles at once with a result of its own.
// Model: tiles of the same parity (8 colours) are at least one tile apart; as a tile is far wider than the spacing, points
//   of two tiles of one colour never compete. Tiles lie in Morton order, so that neighbours in space are near in memory.
// Units: metres.
// Valid: a triangle that stays whole (see patch.h) is in one tile, a larger one in all that it touches; triangles without
//   area are left out.
// Not: the patches, which are made again where they are needed: memory stays a few bytes a triangle.
#pragma once

#include <cstdint>
#include <vector>

#include "frazil/geometry/mesh.h"
#include "frazil/points/patch.h"

namespace frazil {

struct TileGrid {
    V3d origin;
    double size = 1.0;
    std::vector<std::uint64_t> keys;    // Morton codes, ascending; the low three bits are the colour
    std::vector<std::uint64_t> starts;  // triangles of tile i: triangles[starts[i] .. starts[i + 1])
    std::vector<std::int32_t> triangles;
    std::vector<Box3f> boxes;  // what the patches of tile i lie in, world

    std::size_t count() const { return keys.size(); }
    TileFrame frame(std::size_t tile, double unit) const;
    int colour(std::size_t tile) const { return static_cast<int>(keys[tile] & 7); }
    struct Neighbour {
        std::uint32_t tile;
        V3i offset;
    };
    // The existing tiles around one, itself left out: at most 26.
    std::vector<Neighbour> neighbours(std::size_t tile) const;
};

// Cut the mesh into tiles at least `tile_size` wide. std::length_error where there would be more than `max_pairs` pairs of
// a tile and a triangle in it.
TileGrid make_tile_grid(const Mesh& mesh, const SpacingField& spacing, double tile_size, std::uint64_t max_pairs);

}  // namespace frazil
