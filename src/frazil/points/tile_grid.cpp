#include "frazil/points/tile_grid.h"

#include <oneapi/tbb/parallel_sort.h>

#include <stdexcept>

#include "frazil/base/parallel.h"
#include "frazil/points/polygon_clip.h"

namespace frazil {
namespace {

constexpr int kAxisBits = 21;
constexpr std::size_t kTriangleGrain = 4096;
constexpr double kHair = 1e-9;  // of a tile

struct Pair {
    std::uint64_t key;
    std::int32_t triangle;
    bool operator<(const Pair& other) const { return key != other.key ? key < other.key : triangle < other.triangle; }
};

std::uint64_t spread_bits(std::uint64_t x) {
    x &= 0x1fffff;
    x = (x | x << 32) & 0x001f00000000ffffULL;
    x = (x | x << 16) & 0x001f0000ff0000ffULL;
    x = (x | x << 8) & 0x100f00f00f00f00fULL;
    x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
    return (x | x << 2) & 0x1249249249249249ULL;
}

std::uint32_t gather_bits(std::uint64_t x) {
    x &= 0x1249249249249249ULL;
    x = (x | x >> 2) & 0x10c30c30c30c30c3ULL;
    x = (x | x >> 4) & 0x100f00f00f00f00fULL;
    x = (x | x >> 8) & 0x001f0000ff0000ffULL;
    x = (x | x >> 16) & 0x001f00000000ffffULL;
    return static_cast<std::uint32_t>((x | x >> 32) & 0x1fffff);
}

std::uint64_t morton(const V3i& tile) {
    return spread_bits(tile.x) | spread_bits(tile.y) << 1 | spread_bits(tile.z) << 2;
}

V3i tile_of(std::uint64_t key) {
    return V3i(gather_bits(key), gather_bits(key >> 1), gather_bits(key >> 2));
}

// The tiles that one triangle touches: halve the range of tiles, and the triangle with it, until a tile is left.
struct TriangleTiler {
    const TileGrid& grid;
    std::int32_t triangle;
    std::vector<Pair>& pairs;
    std::uint64_t max_pairs;

    using Polygon = ClipPolygon<V3d>;

    // A hair beside the place, so that no rounding leaves a tile out.
    int tile_along(double position, int axis, double hair) const {
        const double t = std::floor((position - grid.origin[axis]) / grid.size + hair);
        return static_cast<int>(std::clamp(t, 0.0, double((1 << kAxisBits) - 1)));
    }

    void visit(const Polygon& polygon, V3i low, V3i high) const {
        for (int axis = 0; axis < 3; ++axis) {
            double least = polygon.vertices[0][axis], most = least;
            for (int i = 1; i < polygon.count; ++i) {
                least = std::min(least, polygon.vertices[i][axis]);
                most = std::max(most, polygon.vertices[i][axis]);
            }
            low[axis] = std::clamp(tile_along(least, axis, -kHair), low[axis], high[axis]);
            high[axis] = std::clamp(tile_along(most, axis, kHair), low[axis], high[axis]);
        }
        const V3i extent = high - low;
        const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
        if (extent[axis] == 0) {
            if (pairs.size() >= max_pairs) throw std::length_error("tiles");
            pairs.push_back({morton(low), triangle});
            return;
        }
        const int middle = low[axis] + extent[axis] / 2;
        const double plane = grid.origin[axis] + grid.size * (middle + 1);
        const auto mix = [](const V3d& a, const V3d& b, double t) { return a + (b - a) * t; };
        Polygon below = polygon, above = polygon;
        below.clip([&](const V3d& v) { return v[axis] - plane; }, mix);
        above.clip([&](const V3d& v) { return plane - v[axis]; }, mix);
        V3i below_high = high, above_low = low;
        below_high[axis] = middle;
        above_low[axis] = middle + 1;
        if (below.count > 2) visit(below, low, below_high);
        if (above.count > 2) visit(above, above_low, high);
    }
};

}  // namespace

TileFrame TileGrid::frame(std::size_t tile, double unit) const {
    return {origin, size, tile_of(keys[tile]), unit};
}

std::vector<TileGrid::Neighbour> TileGrid::neighbours(std::size_t tile) const {
    const V3i center = tile_of(keys[tile]);
    std::vector<Neighbour> found;
    for (int dz = -1; dz <= 1; ++dz) {
        for (int dy = -1; dy <= 1; ++dy) {
            for (int dx = -1; dx <= 1; ++dx) {
                const V3i place = center + V3i(dx, dy, dz);
                if ((dx == 0 && dy == 0 && dz == 0) || place.x < 0 || place.y < 0 || place.z < 0) continue;
                if (std::max(place.x, std::max(place.y, place.z)) >= 1 << kAxisBits) continue;
                const std::uint64_t key = morton(place);
                const auto at = std::lower_bound(keys.begin(), keys.end(), key);
                if (at != keys.end() && *at == key) {
                    found.push_back({std::uint32_t(at - keys.begin()), V3i(dx, dy, dz)});
                }
            }
        }
    }
    return found;
}

TileGrid make_tile_grid(const Mesh& mesh, const SpacingField& spacing, double tile_size, std::uint64_t max_pairs) {
    const Box3f box = bounds(mesh);
    const V3d extent = V3d(box.max) - V3d(box.min);
    const double widest = std::max(extent.x, std::max(extent.y, extent.z));
    TileGrid grid;
    grid.size = std::max(tile_size, widest / double((1 << kAxisBits) - 4));
    // Walls of boxes would lie on tile walls if the grid began at the mesh's own corner.
    grid.origin = V3d(box.min) - V3d(0.37, 0.41, 0.43) * grid.size;

    const std::size_t chunks = (mesh.triangles.size() + kTriangleGrain - 1) / kTriangleGrain;
    std::vector<std::vector<Pair>> chunk_pairs(chunks);
    std::vector<double> overhangs(chunks, 0.0);
    parallel_for(mesh.triangles.size(), kTriangleGrain, [&](std::size_t begin, std::size_t end) {
        std::vector<Pair>& pairs = chunk_pairs[begin / kTriangleGrain];
        pairs.reserve(end - begin);
        for (std::size_t i = begin; i < end; ++i) {
            if (unit_normal(mesh, i) == V3f(0.0f)) continue;
            double& overhang = overhangs[begin / kTriangleGrain];
            if (is_whole(mesh, spacing, i)) {
                overhang = std::max(overhang, kWholeReach * longest_edge(mesh, i));
                const V3i tile = TileFrame::tile_at(circle_center(mesh, i), grid.origin, grid.size);
                pairs.push_back({morton(tile), std::int32_t(i)});
                continue;
            }
            const V3i& t = mesh.triangles[i];
            overhang =
                std::max(overhang, kPartReach * std::max(spacing.at_vertex(t.x),
                                                         std::max(spacing.at_vertex(t.y), spacing.at_vertex(t.z))));
            TriangleTiler::Polygon polygon;
            for (int k = 0; k < 3; ++k) polygon.push(V3d(mesh.positions[mesh.triangles[i][k]]));
            TriangleTiler{grid, std::int32_t(i), pairs, max_pairs}.visit(polygon, V3i(0), V3i((1 << kAxisBits) - 1));
        }
    });

    for (const double overhang : overhangs) grid.overhang = std::max(grid.overhang, overhang);
    std::size_t total = 0;
    for (const auto& part : chunk_pairs) total += part.size();
    if (total > max_pairs) throw std::length_error("tiles");
    std::vector<Pair> pairs;
    pairs.reserve(total);
    for (auto& part : chunk_pairs) {
        pairs.insert(pairs.end(), part.begin(), part.end());
        std::vector<Pair>().swap(part);
    }
    oneapi::tbb::parallel_sort(pairs.begin(), pairs.end());

    grid.triangles.resize(total);
    for (std::size_t i = 0; i < total; ++i) {
        if (i == 0 || pairs[i].key != pairs[i - 1].key) {
            grid.keys.push_back(pairs[i].key);
            grid.starts.push_back(i);
        }
        grid.triangles[i] = pairs[i].triangle;
    }
    grid.starts.push_back(total);
    return grid;
}

}  // namespace frazil
