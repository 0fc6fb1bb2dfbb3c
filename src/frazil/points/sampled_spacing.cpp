#include "frazil/points/sampled_spacing.h"

#include <array>
#include <atomic>

#include "frazil/base/error.h"
#include "frazil/base/parallel.h"
#include "frazil/points/point_budget.h"

namespace frazil {
namespace {

constexpr double kLongestEdge = 2.0;   // of a piece, in the smallest of its spacings
constexpr double kLongestBent = 1.0;   // of one on which the spacing is not linear
constexpr double kMostBend = 0.05;     // of the spacing, that it departs from linear
constexpr std::size_t kAtOnce = 4096;  // triangles that a thread takes, pieces that are looked at together

// A part of a triangle: its corners, their barycentrics and spacings.
struct Piece {
    std::uint32_t triangle;
    std::array<V3f, 3> corners;
    std::array<V2f, 3> uv;
    std::array<float, 3> spacing;

    int longest_edge() const {
        const auto length2 = [&](int k) { return (V3d(corners[(k + 1) % 3]) - V3d(corners[k])).length2(); };
        int longest = 0;
        for (int k = 1; k < 3; ++k) longest = length2(k) > length2(longest) ? k : longest;
        return longest;
    }
};

class Cutter {
  public:
    Cutter(const Mesh& mesh, const SpacingFunction& spacing, std::atomic<std::size_t>& count, double most)
        : mesh_(mesh), spacing_(spacing), count_(count), most_(most) {}

    std::vector<Piece> done;

    void cut(std::size_t begin, std::size_t end) {
        const std::array<V2f, 3> uv = {V2f(0.0f), V2f(1.0f, 0.0f), V2f(0.0f, 1.0f)};
        places_.clear();
        for (std::size_t i = begin; i < end; ++i) {
            if (triangle_cross(mesh_, i) == V3d(0.0)) continue;
            const V3i& t = mesh_.triangles[i];
            const auto triangle = static_cast<std::uint32_t>(i);
            todo_.push_back({triangle, {mesh_.positions[t.x], mesh_.positions[t.y], mesh_.positions[t.z]}, uv, {}});
            for (int k = 0; k < 3; ++k) places_.push_back({triangle, uv[k]});
        }
        ask();
        for (std::size_t i = 0; i < todo_.size(); ++i) {
            for (int k = 0; k < 3; ++k) todo_[i].spacing[k] = spacings_[3 * i + k];
        }
        while (!todo_.empty()) look_at_last();
    }

  private:
    // Ask for the spacings at all places.
    void ask() {
        spacings_.resize(places_.size());
        if (places_.empty()) return;
        spacing_(places_, spacings_);
        for (std::size_t i = 0; i < places_.size(); ++i) {
            const float value = spacings_[i];
            if (value > 0.0f && std::isfinite(value)) continue;
            throw ValueError(str("poisson_points: spacing must be > 0 and finite, got ", value, " on triangle ",
                                 places_[i].triangle, ". It is in metres."));
        }
    }

    // Halve the last pieces that there are to do, or take them as they are.
    void look_at_last() {
        const std::size_t first = todo_.size() - std::min(todo_.size(), kAtOnce);
        looked_at_.assign(todo_.begin() + std::ptrdiff_t(first), todo_.end());
        todo_.resize(first);
        places_.clear();
        for (const Piece& piece : looked_at_) {
            const int a = piece.longest_edge(), b = (a + 1) % 3;
            places_.push_back({piece.triangle, (piece.uv[0] + piece.uv[1] + piece.uv[2]) / 3.0f});
            places_.push_back({piece.triangle, (piece.uv[a] + piece.uv[b]) * 0.5f});
        }
        ask();
        for (std::size_t i = 0; i < looked_at_.size(); ++i) {
            halve_or_keep(looked_at_[i], spacings_[2 * i], spacings_[2 * i + 1]);
        }
    }

    void halve_or_keep(const Piece& piece, float at_center, float at_half) {
        const int a = piece.longest_edge(), b = (a + 1) % 3, c = (a + 2) % 3;
        const V3f half = (piece.corners[a] + piece.corners[b]) * 0.5f;
        const auto& s = piece.spacing;
        const double least = std::min({at_center, at_half, s[0], s[1], s[2]});
        const bool is_bent = std::abs(at_center - (s[0] + s[1] + s[2]) / 3.0f) > kMostBend * at_center ||
                             std::abs(at_half - (s[a] + s[b]) * 0.5f) > kMostBend * at_half;
        const double longest = (is_bent ? kLongestBent : kLongestEdge) * least;
        const bool is_short = (V3d(piece.corners[b]) - V3d(piece.corners[a])).length2() <= longest * longest;
        if (is_short || half == piece.corners[a] || half == piece.corners[b]) {
            if (double(count_.fetch_add(1, std::memory_order_relaxed)) > most_) {
                throw ValueError(str("Mesh: spacing must be large enough for ", most_,
                                     " pieces of the mesh, got less. Use a larger spacing or max_points."));
            }
            done.push_back(piece);
            return;
        }
        const V2f uv = (piece.uv[a] + piece.uv[b]) * 0.5f;
        todo_.push_back({piece.triangle,
                         {piece.corners[a], half, piece.corners[c]},
                         {piece.uv[a], uv, piece.uv[c]},
                         {s[a], at_half, s[c]}});
        todo_.push_back({piece.triangle,
                         {half, piece.corners[b], piece.corners[c]},
                         {uv, piece.uv[b], piece.uv[c]},
                         {at_half, s[b], s[c]}});
    }

    const Mesh& mesh_;
    const SpacingFunction& spacing_;
    std::atomic<std::size_t>& count_;
    double most_;
    std::vector<Piece> todo_, looked_at_;
    std::vector<SpacingPlace> places_;
    std::vector<float> spacings_;
};

}  // namespace

PointSet poisson_points(const Mesh& mesh, const SpacingFunction& spacing, const PoissonOptions& options,
                        Progress* progress) {
    check_mesh(mesh, "Mesh");
    const std::size_t count = mesh.triangles.size();
    std::vector<std::vector<Piece>> chunks((count + kAtOnce - 1) / kAtOnce);
    std::atomic<std::size_t> piece_count = 0;
    const double most = double(count) + 4.0 * point_limit(options.max_points);
    parallel_for(count, kAtOnce, [&](std::size_t begin, std::size_t end) {
        Cutter cutter(mesh, spacing, piece_count, most);
        cutter.cut(begin, end);
        chunks[begin / kAtOnce] = std::move(cutter.done);
    });

    Mesh pieces;
    std::vector<float> spacings;
    std::vector<std::uint32_t> triangles;
    std::vector<std::array<V2f, 3>> uvs;
    for (std::vector<Piece>& chunk : chunks) {
        for (const Piece& piece : chunk) {
            const auto first = static_cast<std::int32_t>(pieces.positions.size());
            pieces.triangles.emplace_back(first, first + 1, first + 2);
            pieces.positions.insert(pieces.positions.end(), piece.corners.begin(), piece.corners.end());
            spacings.insert(spacings.end(), piece.spacing.begin(), piece.spacing.end());
            uvs.push_back(piece.uv);
            triangles.push_back(piece.triangle);
        }
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
