#include "frazil/points/poisson.h"

#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for_each.h>

#include <atomic>
#include <stdexcept>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/points/point_budget.h"
#include "frazil/points/tile_filler.h"
#include "frazil/points/tile_grid.h"

namespace frazil {
namespace {

// In spacings: wide enough that few points lie at a border, small enough to share out and to stay in the cache.
constexpr double kTileWidth = 32.0;
constexpr double kLeastTileWidth = 6.0;  // in the largest spacings, so that tiles of one colour stay apart
constexpr std::size_t kTriangleGrain = 4096;

// The area, and the integral of 1 / spacing² over it, which tells the number of points; the square of the longest edge,
// in spacings: no point covers more than two of it.
struct Extent {
    double area = 0.0, spacings2 = 0.0, longest2 = 0.0;
    Extent& operator+=(const Extent& other) {
        area += other.area;
        spacings2 += other.spacings2;
        longest2 = std::max(longest2, other.longest2);
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
            const double mean =
                spacing.per_vertex ? 0.75 / (m * m) + (1 / (a * a) + 1 / (b * b) + 1 / (c * c)) / 12.0 : 1.0 / (a * a);
            const V3d corner(mesh.positions[t.x]);
            const double edge2 =
                std::max((V3d(mesh.positions[t.y]) - corner).length2(), (V3d(mesh.positions[t.z]) - corner).length2());
            const double largest = std::max(a, std::max(b, c));
            sum += {area, area * mean, area > 0.0 ? edge2 / (largest * largest) : 0.0};
        }
        return sum;
    });
}

std::size_t point_count(const PointsInTiles& points) {
    std::size_t sum = 0;
    for (const std::vector<Dart>& tile : points.darts) sum += tile.size();
    return sum;
}

using TileFillers = oneapi::tbb::enumerable_thread_specific<TileFiller>;

// Add the areas that wait for later tiles.
void share_borders(PointsInTiles& points, TileFillers& fillers, Progress* progress) {
    const std::size_t count = points.grid.count();
    std::atomic<std::size_t> done = 0;
    parallel_for(count, 4, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) fillers.local().share_border(i);
        if (progress) progress->update("areas", double(done += end - begin) / double(count));
    });
}

// The points and, if `with_areas`, their areas; else share_borders() adds these.
PointsInTiles place_points(const Mesh& mesh, SpacingField spacing, double largest, bool with_areas,
                           const PoissonOptions& options, Progress* progress) {
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
    check_budget(kPointsPerSpacing2 * extent.spacings2, 2, options.max_points, "spacing", asked);
    check_budget(0.5 * std::sqrt(extent.longest2), 1, options.max_points, "spacing", asked);

    const double unit = spacing.per_vertex ? std::sqrt(extent.area / extent.spacings2) : spacing.constant;
    PointsInTiles points = {
        mesh, spacing, options.thin_walls, options.seed, unit, std::ldexp(extent.area, -61), with_areas, {}, {},
        {},   {}};
    try {
        const double pairs = 2.0 * double(mesh.triangles.size()) + 4.0 * point_limit(options.max_points);
        const double width = std::max(kTileWidth * unit, kLeastTileWidth * largest);
        points.grid = make_tile_grid(mesh, spacing, width, static_cast<std::uint64_t>(pairs));
    } catch (const std::length_error&) {
        throw ValueError(str("Mesh: spacing must be large enough for the mesh's long thin triangles, got ", asked,
                             ". Remove them, or use a larger spacing or max_points."));
    }

    const std::size_t count = points.grid.count();
    points.darts.resize(count);
    points.needs.resize(count);
    points.borders.resize(count);
    TileFillers fillers([&] { return TileFiller(points); });
    // A tile's turn comes when all of its neighbours of earlier colours are filled.
    std::vector<std::uint32_t> first;
    std::vector<std::atomic<std::uint8_t>> waits_for(count);
    for (std::uint32_t i = 0; i < count; ++i) {
        std::uint8_t earlier = 0;
        for (const TileGrid::Neighbour& other : points.grid.neighbours(i)) {
            earlier += points.grid.colour(other.tile) < points.grid.colour(i);
        }
        waits_for[i].store(earlier, std::memory_order_relaxed);
        if (earlier == 0) first.push_back(i);
    }
    std::atomic<std::size_t> done = 0;
    oneapi::tbb::parallel_for_each(first, [&](std::uint32_t tile, oneapi::tbb::feeder<std::uint32_t>& feeder) {
        fillers.local().fill(tile);
        for (const TileGrid::Neighbour& other : points.grid.neighbours(tile)) {
            if (points.grid.colour(other.tile) > points.grid.colour(tile) && --waits_for[other.tile] == 0) {
                feeder.add(other.tile);
            }
        }
        if (progress) progress->update("points", double(++done) / double(count));
    });
    if (with_areas) share_borders(points, fillers, progress);
    return points;
}

PointSet finish(PointsInTiles& made, double spacing) {
    std::vector<std::vector<Dart>>& darts = made.darts;
    std::vector<std::size_t> first(darts.size() + 1, 0);
    for (std::size_t i = 0; i < darts.size(); ++i) first[i + 1] = first[i] + darts[i].size();
    PointSet points;
    resize(points, first.back());
    points.spacing = spacing;
    parallel_for(darts.size(), 8, [&](std::size_t begin, std::size_t end) {
        for (std::size_t tile = begin; tile < end; ++tile) {
            std::size_t at = first[tile];
            for (const Dart& dart : darts[tile]) {
                points.positions[at] = dart.position;
                points.normals[at] = dart.normal;
                points.areas[at] = static_cast<float>(double(dart.quanta) * made.area_quantum);
                points.triangles[at] = dart.triangle;
                points.barycentrics[at++] = dart.uv;
            }
            std::vector<Dart>().swap(darts[tile]);
        }
    });
    return points;
}

}  // namespace

PointSet poisson_points(const Mesh& mesh, double spacing, const PoissonOptions& options, Progress* progress) {
    if (!(spacing > 0.0) || !std::isfinite(spacing)) {
        throw ValueError(str("poisson_points: spacing must be > 0 and finite, got ", spacing, ". It is in metres."));
    }
    check_mesh(mesh, "Mesh");
    PointsInTiles points = place_points(mesh, {spacing, nullptr}, spacing, true, options, progress);
    return finish(points, spacing);
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
            throw ValueError(
                str("poisson_points: spacing must be > 0 and finite, got ", r, " at vertex ", i, ". It is in metres."));
        }
        largest = std::max<double>(largest, r);
    }
    check_mesh(mesh, "Mesh");
    PointsInTiles points = place_points(mesh, {largest, &vertex_spacing}, largest, true, options, progress);
    return finish(points, largest);
}

PointSet poisson_points_by_count(const Mesh& mesh, std::uint64_t count, const PoissonOptions& options,
                                 Progress* progress) {
    if (count == 0) throw ValueError("poisson_points: count must be > 0, got 0. Ask for one point or more.");
    check_mesh(mesh, "Mesh");
    PoissonOptions bounded = options;
    if (bounded.max_points == 0) bounded.max_points = static_cast<std::uint64_t>(point_limit(0));
    if (double(count) > double(bounded.max_points)) {
        throw ValueError(str("poisson_points: count must be <= ", bounded.max_points, ", got ", count,
                             ". More do not fit into the memory that is free, or max_points."));
    }
    // While looking, a first guess may be off by much where walls crowd each other.
    bounded.max_points = std::max<std::uint64_t>(4 * bounded.max_points, 10000);

    const Extent extent = measure(mesh, {1.0, nullptr});
    double spacing = extent.area > 0.0 ? std::max(std::sqrt(0.71 * extent.area / double(count)),
                                                  0.5 * std::sqrt(extent.longest2) / double(count))
                                       : 1.0;
    double fewer = 0.0, more = 0.0;  // spacings known to give too few and too many points
    std::size_t nearest = 0;
    constexpr int kMostTries = 60;
    for (int attempt = 0; attempt < kMostTries; ++attempt) {
        PointsInTiles points = place_points(mesh, {spacing, nullptr}, spacing, false, bounded, progress);
        const std::size_t got = point_count(points);
        const double error = std::abs(double(got) - double(count));
        if (error <= 0.005 * double(count)) {
            TileFillers fillers([&] { return TileFiller(points); });
            share_borders(points, fillers, progress);
            return finish(points, spacing);
        }
        if (nearest == 0 || error < std::abs(double(nearest) - double(count))) nearest = got;
        // Points go as 1 / spacing²; a guess outside of what is known goes to its middle.
        (got < count ? fewer : more) = spacing;
        spacing *= std::sqrt(double(got) / double(count));
        const double low = std::min(fewer, more), high = std::max(fewer, more);
        if (low > 0.0 && (attempt > 5 || spacing <= low || spacing >= high)) {
            // The count is a random walk in the spacing: once the bracket is narrow, try around it.
            const bool is_narrow = high / low < 1.0 + 1e-3;
            spacing = is_narrow ? low * (0.97 + 0.06 * to_unit_float(hash(options.seed, std::uint32_t(attempt))))
                                : std::sqrt(low * high);
        }
    }
    throw ValueError(str("poisson_points: count must be one that some spacing gives within 0.5 %, got ", count,
                         "; the nearest found is ", nearest, ". Ask for that, or give a spacing."));
}

}  // namespace frazil
