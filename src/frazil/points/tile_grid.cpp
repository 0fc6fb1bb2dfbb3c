#include "frazil/points/tile_grid.h"

#include <oneapi/tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <stdexcept>

#include "frazil/base/parallel.h"
#include "frazil/points/polygon_clip.h"

namespace frazil {
namespace {

constexpr int kAxisBits = 21;
constexpr std::size_t kTriangleGrain = 4096;
constexpr std::size_t kTileGrain = 16;
constexpr double kHair = 1e-9;  // of a tile

struct Pair {
    std::uint64_t key;
    std::int32_t triangle;
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

// What the patches of a tile lie in: its whole triangles, and the larger ones as far as their parts can reach out of it.
Box3f box_of_patches(const Mesh& mesh, const SpacingField& spacing, const TileGrid& grid, std::size_t tile) {
    Box3f box;
    const V3d low = grid.frame(tile, 1.0).origin(), high = low + V3d(grid.size);
    for (std::uint64_t i = grid.starts[tile]; i < grid.starts[tile + 1]; ++i) {
        const V3i& t = mesh.triangles[grid.triangles[i]];
        Box3f corners;
        for (int k = 0; k < 3; ++k) corners.extendBy(mesh.positions[t[k]]);
        // What is not longer than a whole triangle's edge is one.
        const V3d extent = V3d(corners.max) - V3d(corners.min);
        const double least = kLongestEdge * (spacing.per_vertex ? 0.0 : spacing.constant);
        if (extent.length2() > least * least && !shape_of(mesh, spacing, grid.triangles[i]).is_whole) {
            const double largest =
                std::max(spacing.at_vertex(t.x), std::max(spacing.at_vertex(t.y), spacing.at_vertex(t.z)));
            for (int axis = 0; axis < 3; ++axis) {
                const double least = low[axis] - kPartReach * largest, most = high[axis] + kPartReach * largest;
                corners.min[axis] = std::max(corners.min[axis], std::nextafter(float(least), -HUGE_VALF));
                corners.max[axis] = std::min(corners.max[axis], std::nextafter(float(most), HUGE_VALF));
            }
        }
        box.extendBy(corners);
    }
    return box;
}

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
    std::vector<std::vector<std::uint64_t>> chunk_keys(chunks);
    parallel_for(mesh.triangles.size(), kTriangleGrain, [&](std::size_t begin, std::size_t end) {
        std::vector<Pair>& pairs = chunk_pairs[begin / kTriangleGrain];
        pairs.reserve(end - begin);
        for (std::size_t i = begin; i < end; ++i) {
            const TriangleShape shape = shape_of(mesh, spacing, i);
            if (!shape.has_area) continue;
            if (shape.is_whole) {
                pairs.push_back({morton(TileFrame::tile_at(shape.center, grid.origin, grid.size)), std::int32_t(i)});
                continue;
            }
            TriangleTiler::Polygon polygon;
            for (int k = 0; k < 3; ++k) polygon.push(V3d(mesh.positions[mesh.triangles[i][k]]));
            TriangleTiler{grid, std::int32_t(i), pairs, max_pairs}.visit(polygon, V3i(0), V3i((1 << kAxisBits) - 1));
        }
        std::vector<std::uint64_t>& keys = chunk_keys[begin / kTriangleGrain];
        for (const Pair& pair : pairs) {
            if (keys.empty() || keys.back() != pair.key) keys.push_back(pair.key);
        }
        std::sort(keys.begin(), keys.end());
        keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    });

    std::size_t total = 0;
    for (const auto& part : chunk_pairs) total += part.size();
    if (total > max_pairs) throw std::length_error("tiles");

    // The tiles that there are.
    for (const auto& part : chunk_keys) grid.keys.insert(grid.keys.end(), part.begin(), part.end());
    oneapi::tbb::parallel_sort(grid.keys.begin(), grid.keys.end());
    grid.keys.erase(std::unique(grid.keys.begin(), grid.keys.end()), grid.keys.end());

    // Count, then deal out; a run of triangles of one tile at a time.
    std::vector<std::uint64_t> ends(grid.count(), 0);
    const auto for_runs = [&](const auto& visit) {
        parallel_for(chunks, 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t chunk = begin; chunk < end; ++chunk) {
                const std::vector<Pair>& pairs = chunk_pairs[chunk];
                for (std::size_t first = 0, last = 0; first < pairs.size(); first = last) {
                    while (last < pairs.size() && pairs[last].key == pairs[first].key) ++last;
                    const auto tile = std::lower_bound(grid.keys.begin(), grid.keys.end(), pairs[first].key);
                    visit(std::size_t(tile - grid.keys.begin()), &pairs[first], last - first);
                }
            }
        });
    };
    for_runs([&](std::size_t tile, const Pair*, std::size_t count) {
        std::atomic_ref<std::uint64_t>(ends[tile]).fetch_add(count, std::memory_order_relaxed);
    });
    std::uint64_t sum = 0;
    for (std::uint64_t& end : ends) {
        grid.starts.push_back(sum);
        sum += end;
        end = grid.starts.back();
    }
    grid.starts.push_back(sum);
    grid.triangles.resize(total);
    for_runs([&](std::size_t tile, const Pair* pairs, std::size_t count) {
        const std::uint64_t at = std::atomic_ref<std::uint64_t>(ends[tile]).fetch_add(count, std::memory_order_relaxed);
        for (std::size_t i = 0; i < count; ++i) grid.triangles[at + i] = pairs[i].triangle;
    });
    grid.boxes.resize(grid.count());
    parallel_for(grid.count(), kTileGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t tile = begin; tile < end; ++tile) {
            // Whoever came first.
            std::sort(grid.triangles.begin() + grid.starts[tile], grid.triangles.begin() + grid.starts[tile + 1]);
            grid.boxes[tile] = box_of_patches(mesh, spacing, grid, tile);
        }
    });
    return grid;
}

}  // namespace frazil
