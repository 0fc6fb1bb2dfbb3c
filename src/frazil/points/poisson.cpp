#include "frazil/points/poisson.h"

#include <oneapi/tbb/enumerable_thread_specific.h>

#include <atomic>
#include <stdexcept>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/nearest_areas.h"
#include "frazil/points/point_budget.h"
#include "frazil/points/tile_filler.h"
#include "frazil/points/tile_grid.h"

namespace frazil {
namespace {

constexpr double kTileWidth = 8.0;  // in spacings: wide enough that few points lie at a border, small enough to share out
constexpr std::size_t kTriangleGrain = 4096;

// The area, and the integral of 1 / spacing² over it, which tells the number of points.
struct Extent {
    double area = 0.0, spacings2 = 0.0;
    Extent& operator+=(const Extent& other) {
        area += other.area;
        spacings2 += other.spacings2;
        return *this;
    }
};

Extent measure(const Mesh& mesh, const SpacingField& spacing) {
    return parallel_sum(mesh.triangles.size(), kTriangleGrain, Extent(), [&](std::size_t begin, std::size_t end) {
        Extent sum;
        for (std::size_t i = begin; i < end; ++i) {
            const double area = 0.5 * triangle_cross(mesh, i).length();
            const V3i& t = mesh.triangles[i];
            const double a = spacing.at_vertex(t.x), b = spacing.at_vertex(t.y), c = spacing.at_vertex(t.z);
            // Exact for constant spacing, the mean of 1/r² over corners and centre otherwise.
            const double m = (a + b + c) / 3.0;
            const double mean = spacing.per_vertex ? 0.75 / (m * m) + (1 / (a * a) + 1 / (b * b) + 1 / (c * c)) / 12.0
                                                   : 1.0 / (a * a);
            sum += {area, area * mean};
        }
        return sum;
    });
}

PointSet assemble(std::vector<std::vector<Dart>>& darts, std::vector<float> areas) {
    std::vector<std::size_t> first(darts.size() + 1, 0);
    for (std::size_t i = 0; i < darts.size(); ++i) first[i + 1] = first[i] + darts[i].size();
    PointSet points;
    points.areas = std::move(areas);
    points.positions.resize(first.back());
    points.normals.resize(first.back());
    points.triangles.resize(first.back());
    points.barycentrics.resize(first.back());
    parallel_for(darts.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t tile = begin; tile < end; ++tile) {
            std::size_t at = first[tile];
            for (const Dart& dart : darts[tile]) {
                points.positions[at] = dart.position;
                points.normals[at] = dart.normal;
                points.triangles[at] = dart.triangle;
                points.barycentrics[at++] = dart.uv;
            }
            std::vector<Dart>().swap(darts[tile]);
        }
    });
    return points;
}

PointSet make_points(const Mesh& mesh, SpacingField spacing, double largest, const PoissonOptions& options,
                     Progress* progress) {
    const Box3f box = bounds(mesh);
    // A spacing beyond the mesh's size asks for the same points as its size does, and keeps numbers tame.
    const double diagonal = mesh.positions.empty() ? 0.0 : (V3d(box.max) - V3d(box.min)).length();
    const double asked = largest;
    spacing.constant = std::min(spacing.constant, 2.0 * diagonal);
    largest = std::min(largest, 2.0 * diagonal);

    const Extent extent = spacing.constant > 0.0 ? measure(mesh, spacing) : Extent();
    if (!(extent.area > 0.0)) {
        throw ValueError(str("Mesh: area must be > 0, got ", mesh.triangles.size(),
                             " triangles without area. Points need a surface."));
    }
    check_budget(kPointsPerSpacing2 * extent.spacings2, options.max_points, "spacing", asked);

    const double unit = spacing.per_vertex ? std::sqrt(extent.area / extent.spacings2) : spacing.constant;
    TileGrid grid;
    try {
        const double pairs = 2.0 * double(mesh.triangles.size()) + 4.0 * point_limit(options.max_points);
        grid = make_tile_grid(mesh, std::max(kTileWidth * unit, 1.05 * largest), static_cast<std::uint64_t>(pairs));
    } catch (const std::length_error&) {
        throw ValueError(str("Mesh: spacing must be large enough for the mesh's long thin triangles, got ", asked,
                             ". Remove them, or use a larger spacing or max_points."));
    }

    std::vector<std::uint32_t> colours[8];
    for (std::size_t i = 0; i < grid.count(); ++i) colours[grid.keys[i] & 7].push_back(std::uint32_t(i));
    std::vector<std::vector<Dart>> darts(grid.count());
    oneapi::tbb::enumerable_thread_specific<TileFiller> fillers(mesh, spacing, options.thin_walls, options.seed);
    std::atomic<std::size_t> done = 0;
    for (const std::vector<std::uint32_t>& tiles : colours) {
        parallel_for(tiles.size(), 4, [&](std::size_t begin, std::size_t end) {
            TileFiller& filler = fillers.local();
            std::vector<const std::vector<Dart>*> around;
            std::vector<Dart> placed;
            for (std::size_t i = begin; i < end; ++i) {
                const std::uint32_t tile = tiles[i];
                around.clear();
                for (const std::uint32_t other : grid.neighbours(tile)) around.push_back(&darts[other]);
                placed.clear();
                filler.fill({grid.tile_origin(tile), unit, grid.size / unit}, &grid.triangles[grid.starts[tile]],
                            grid.starts[tile + 1] - grid.starts[tile], around, grid.keys[tile], largest / unit, placed);
                darts[tile] = std::vector<Dart>(placed);
            }
            if (progress) progress->update("points", double(done += end - begin) / double(grid.count()));
        });
    }
    fillers.clear();

    std::vector<float> areas =
        nearest_areas(mesh, spacing, grid, unit, largest / unit, options.thin_walls, darts, progress);
    PointSet points = assemble(darts, std::move(areas));
    points.spacing = asked;
    return points;
}

}  // namespace

PointSet poisson_points(const Mesh& mesh, double spacing, const PoissonOptions& options, Progress* progress) {
    if (!(spacing > 0.0) || !std::isfinite(spacing)) {
        throw ValueError(str("poisson_points: spacing must be > 0 and finite, got ", spacing, ". It is in metres."));
    }
    check_mesh(mesh, "Mesh");
    return make_points(mesh, {spacing, nullptr}, spacing, options, progress);
}

PointSet poisson_points(const Mesh& mesh, const std::vector<float>& vertex_spacing, const PoissonOptions& options,
                        Progress* progress) {
    if (vertex_spacing.size() != mesh.positions.size()) {
        throw ValueError(str("poisson_points: spacing must have one value or one per vertex (", mesh.positions.size(),
                             "), got ", vertex_spacing.size(), " values."));
    }
    double largest = 0.0;
    for (std::size_t i = 0; i < vertex_spacing.size(); ++i) {
        const float r = vertex_spacing[i];
        if (!(r > 0.0f) || !std::isfinite(r)) {
            throw ValueError(str("poisson_points: spacing must be > 0 and finite, got ", r, " at vertex ", i,
                                 ". It is in metres."));
        }
        largest = std::max<double>(largest, r);
    }
    check_mesh(mesh, "Mesh");
    return make_points(mesh, {largest, &vertex_spacing}, largest, options, progress);
}

}  // namespace frazil
