#include "frazil/points/sampled_spacing.h"

#include <array>
#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/point_budget.h"

namespace frazil {
namespace {

constexpr double kLongestEdge = 2.0;  // of a piece, in the smallest of its spacings
constexpr std::size_t kTriangleGrain = 256;

// A part of a triangle: its corners, their barycentrics and spacings.
struct Piece {
    std::array<V3f, 3> corners;
    std::array<V2f, 3> uv;
    std::array<float, 3> spacing;
};

struct Chunk {
    std::vector<Piece> pieces;
    std::vector<std::uint32_t> triangles;
};

struct Cutter {
    const SpacingFunction& spacing;
    std::uint32_t triangle;
    Chunk& chunk;
    std::atomic<std::size_t>& count;
    double most;

    float at(const V2f& uv) const {
        const float value = spacing(triangle, uv);
        if (value > 0.0f && std::isfinite(value)) return value;
        throw ValueError(str("poisson_points: spacing must be > 0 and finite, got ", value, " on triangle ", triangle,
                             ". It is in metres."));
    }

    void cut(const Piece& piece) const {
        int longest = 0;
        double length2 = -1.0;
        for (int k = 0; k < 3; ++k) {
            const double edge2 = (V3d(piece.corners[(k + 1) % 3]) - V3d(piece.corners[k])).length2();
            if (edge2 > length2) length2 = edge2, longest = k;
        }
        const double middle = at((piece.uv[0] + piece.uv[1] + piece.uv[2]) / 3.0f);
        const double least =
            std::min<double>(middle, std::min(piece.spacing[0], std::min(piece.spacing[1], piece.spacing[2])));
        const int a = longest, b = (longest + 1) % 3, c = (longest + 2) % 3;
        const V3f half = (piece.corners[a] + piece.corners[b]) * 0.5f;
        const bool is_float_step = half == piece.corners[a] || half == piece.corners[b];
        if (length2 <= kLongestEdge * kLongestEdge * least * least || is_float_step) {
            if (double(count.fetch_add(1, std::memory_order_relaxed)) > most) {
                throw ValueError(str("Mesh: spacing must be large enough for ", most,
                                     " pieces of the mesh, got less. Use a larger spacing or max_points."));
            }
            chunk.pieces.push_back(piece);
            chunk.triangles.push_back(triangle);
            return;
        }
        const V2f uv = (piece.uv[a] + piece.uv[b]) * 0.5f;
        const float there = at(uv);
        cut({{piece.corners[a], half, piece.corners[c]},
             {piece.uv[a], uv, piece.uv[c]},
             {piece.spacing[a], there, piece.spacing[c]}});
        cut({{half, piece.corners[b], piece.corners[c]},
             {uv, piece.uv[b], piece.uv[c]},
             {there, piece.spacing[b], piece.spacing[c]}});
    }
};

}  // namespace

PointSet poisson_points(const Mesh& mesh, const SpacingFunction& spacing, const PoissonOptions& options,
                        Progress* progress) {
    check_mesh(mesh, "Mesh");
    const std::size_t count = mesh.triangles.size();
    std::vector<Chunk> chunks((count + kTriangleGrain - 1) / kTriangleGrain);
    std::atomic<std::size_t> piece_count = 0;
    const double most = double(count) + 4.0 * point_limit(options.max_points);
    parallel_for(count, kTriangleGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const auto triangle = static_cast<std::uint32_t>(i);
            if (triangle_cross(mesh, i) == V3d(0.0)) continue;
            const V3i& t = mesh.triangles[i];
            const Cutter cutter = {spacing, triangle, chunks[begin / kTriangleGrain], piece_count, most};
            const std::array<V2f, 3> uv = {V2f(0.0f), V2f(1.0f, 0.0f), V2f(0.0f, 1.0f)};
            cutter.cut({{mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]},
                        uv,
                        {cutter.at(uv[0]), cutter.at(uv[1]), cutter.at(uv[2])}});
        }
    });

    Mesh pieces;
    std::vector<float> spacings;
    std::vector<std::uint32_t> triangles;
    std::vector<std::array<V2f, 3>> uvs;
    for (Chunk& chunk : chunks) {
        for (const Piece& piece : chunk.pieces) {
            const auto first = static_cast<std::int32_t>(pieces.positions.size());
            pieces.triangles.emplace_back(first, first + 1, first + 2);
            pieces.positions.insert(pieces.positions.end(), piece.corners.begin(), piece.corners.end());
            spacings.insert(spacings.end(), piece.spacing.begin(), piece.spacing.end());
            uvs.push_back(piece.uv);
        }
        triangles.insert(triangles.end(), chunk.triangles.begin(), chunk.triangles.end());
        chunk = {};
    }
    PointSet points = poisson_points(pieces, spacings, options, progress);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::int32_t piece = points.triangles[i];
        const auto& uv = uvs[piece];
        const V2f own = points.barycentrics[i];
        V2f& b = points.barycentrics[i];
        b = uv[0] * (1.0f - own.x - own.y) + uv[1] * own.x + uv[2] * own.y;
        b = V2f(std::clamp(b.x, 0.0f, 1.0f), std::clamp(b.y, 0.0f, 1.0f - std::clamp(b.x, 0.0f, 1.0f)));
        points.triangles[i] = static_cast<std::int32_t>(triangles[piece]);
    }
    return points;
}

}  // namespace frazil
