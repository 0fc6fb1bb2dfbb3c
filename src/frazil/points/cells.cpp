#include "frazil/points/cells.h"

#include <algorithm>
#include <atomic>
#include <span>

#include "frazil/base/error.h"
#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/base/random.h"
#include "frazil/points/point_lookup.h"

namespace frazil {
namespace {

// Edges of a piece at most, in spacings: a cell then has a dozen of them. And of pieces that threads share among them.
constexpr float kLongestEdge = 0.7f, kLongestCoarseEdge = 16.0f;
// The same over the root of the area of the point that has it, where points are closer than the spacing.
constexpr float kLongestPerRoot = 0.75f;
constexpr std::size_t kPiecesPerCell = 16;  // or a few less
constexpr std::size_t kPiecesPerChunk = 512;
// Of the squared trace, the determinant of a cell in its plane: slivers have no bend across.
constexpr float kThinnest = 1e-4f;
// Spacings may have grown so much; and how many of them a point is looked for (PointLookup::nearest).
constexpr double kMostStretch = 16.0, kFarthestOwner = 2.0;

// A piece of a triangle: its corners' barycentrics.
struct Piece {
    std::uint32_t triangle;
    std::array<V2f, 3> uv;
};

struct Corners {
    V3d p[3];
    V3d at(const V2f& uv) const { return p[0] + (p[1] - p[0]) * double(uv.x) + (p[2] - p[0]) * double(uv.y); }
};

Corners corners_of(const Mesh& mesh, std::uint32_t triangle) {
    const V3i& t = mesh.triangles[triangle];
    return {{V3d(mesh.positions[t.x]), V3d(mesh.positions[t.y]), V3d(mesh.positions[t.z])}};
}

// Squared length of the longest edge, and the corner that is opposite to it.
std::pair<double, int> longest_edge(const V3d p[3]) {
    double longest = -1.0;
    int opposite = 0;
    for (int k = 0; k < 3; ++k) {
        const double length2 = (p[(k + 1) % 3] - p[(k + 2) % 3]).length2();
        if (length2 > longest) longest = length2, opposite = k;
    }
    return {longest, opposite};
}

// Halve a piece at its longest edge until `is_done(piece, corners, longest edge squared)`.
template <class IsDone>
void bisect(const Piece& piece, const Corners& corners, const IsDone& is_done) {
    const V3d p[3] = {corners.at(piece.uv[0]), corners.at(piece.uv[1]), corners.at(piece.uv[2])};
    const auto [longest2, k] = longest_edge(p);
    if (is_done(piece, p, longest2)) return;
    const V2f &a = piece.uv[k], &b = piece.uv[(k + 1) % 3], &c = piece.uv[(k + 2) % 3], middle = (b + c) * 0.5f;
    bisect({piece.triangle, {a, b, middle}}, corners, is_done);
    bisect({piece.triangle, {a, middle, c}}, corners, is_done);
}

using Moments = std::array<double, 6>;  // in a Covariance's order

// The symmetric part of a bᵀ.
Moments product_of(const V3d& a, const V3d& b) {
    return {a.x * b.x,
            a.y * b.y,
            a.z * b.z,
            0.5 * (a.x * b.y + a.y * b.x),
            0.5 * (a.x * b.z + a.z * b.x),
            0.5 * (a.y * b.z + a.z * b.y)};
}

void add(Moments& sum, double weight, const Moments& more) {
    for (std::size_t i = 0; i < 6; ++i) sum[i] += weight * more[i];
}

// What a chunk of pieces adds to one cell, about its point.
struct CellSums {
    double area = 0.0;
    V3d first = V3d(0.0), normal = V3d(0.0);
    Moments second{}, place_by_normal{}, normal_by_normal{};

    // A triangle: its corners and middle hold its moments up to the second.
    void add(double weight, const V3d p[3], const V3d& about, const V3d& its_normal) {
        const V3d middle = (p[0] + p[1] + p[2]) / 3.0 - about;
        area += weight;
        first += middle * weight;
        normal += its_normal * weight;
        frazil::add(second, 0.75 * weight, product_of(middle, middle));
        for (int k = 0; k < 3; ++k) frazil::add(second, weight / 12.0, product_of(p[k] - about, p[k] - about));
        frazil::add(place_by_normal, weight, product_of(middle, its_normal));
        frazil::add(normal_by_normal, weight, product_of(its_normal, its_normal));
    }

    void add(const CellSums& other) {
        area += other.area;
        first += other.first;
        normal += other.normal;
        frazil::add(second, 1.0, other.second);
        frazil::add(place_by_normal, 1.0, other.place_by_normal);
        frazil::add(normal_by_normal, 1.0, other.normal_by_normal);
    }

    // From sums of products, less what their means explain.
    Covariance covariance(const Moments& sums, const V3d& a, const V3d& b) const {
        const Moments explained = product_of(a, b);
        Covariance result;
        for (std::size_t i = 0; i < 6; ++i) result[i] = static_cast<float>(sums[i] / area - explained[i]);
        return result;
    }
};

struct RankedPlace {
    std::uint32_t owner;
    float priority;  // area over a uniform number
    CellPlace place;
};

struct Chunk {
    std::vector<std::pair<std::uint32_t, CellSums>> sums;  // by owner
    std::vector<RankedPlace> places;                       // by owner, the highest priority first
};

bool ranks_before(const RankedPlace& a, const RankedPlace& b) {
    if (a.owner != b.owner) return a.owner < b.owner;
    if (a.priority != b.priority) return a.priority > b.priority;
    if (a.place.triangle != b.place.triangle) return a.place.triangle < b.place.triangle;
    return a.place.barycentrics.x != b.place.barycentrics.x ? a.place.barycentrics.x < b.place.barycentrics.x
                                                            : a.place.barycentrics.y < b.place.barycentrics.y;
}

// Sort by owner, and of each owner keep the `most` places of highest priority.
void keep_first(std::vector<RankedPlace>& places, std::size_t most) {
    std::sort(places.begin(), places.end(), ranks_before);
    std::size_t kept = 0, rank = 0;
    std::uint32_t last_owner = PointLookup::kNone;
    for (std::size_t i = 0; i < places.size(); ++i) {
        rank = places[i].owner == last_owner ? rank + 1 : 0;
        last_owner = places[i].owner;
        if (rank < most) places[kept++] = places[i];
    }
    places.resize(kept);
}

// a C b.
float within(const Covariance& c, const V3f& a, const V3f& b) {
    return a.dot(V3f(c[0] * b.x + c[3] * b.y + c[4] * b.z, c[3] * b.x + c[1] * b.y + c[5] * b.z,
                     c[4] * b.x + c[5] * b.y + c[2] * b.z));
}

// Whether so many points, each of which covers a disc of this radius at most, may cover the mesh: else its pieces could be
// any number.
bool can_be_covered(const Mesh& mesh, std::size_t points, double radius) {
    double area = 0.0, longest2 = 0.0;
    for (std::uint32_t t = 0; t < mesh.triangle_count(); ++t) {
        const Corners corners = corners_of(mesh, t);
        const double here = 0.5 * (corners.p[1] - corners.p[0]).cross(corners.p[2] - corners.p[0]).length();
        if (!(here > 0.0)) continue;
        area += here;
        longest2 = std::max(longest2, longest_edge(corners.p).first);
    }
    const double line = 2.0 * radius * double(points);
    return area <= kPi * radius * radius * double(points) && longest2 <= line * line;
}

std::vector<Piece> coarse_pieces(const Mesh& mesh, double longest) {
    std::vector<Piece> pieces;
    for (std::uint32_t t = 0; t < mesh.triangle_count(); ++t) {
        const Corners corners = corners_of(mesh, t);
        if (!((corners.p[1] - corners.p[0]).cross(corners.p[2] - corners.p[0]).length2() > 0.0)) continue;
        bisect({t, {V2f(0.0f), V2f(1.0f, 0.0f), V2f(0.0f, 1.0f)}}, corners,
               [&](const Piece& piece, const V3d*, double longest2) {
                   if (longest2 > longest * longest) return false;
                   pieces.push_back(piece);
                   return true;
               });
    }
    // Along a Morton curve, so that a chunk has few cells.
    std::vector<V3f> middles;
    for (const auto& [triangle, uv] : pieces) {
        middles.emplace_back(corners_of(mesh, triangle).at((uv[0] + uv[1] + uv[2]) / 3.0f));
    }
    std::vector<Piece> sorted;
    for (const std::uint32_t i : morton_order(middles)) sorted.push_back(pieces[i]);
    return sorted;
}

// Places anywhere in equal parts of a piece, the same whatever else is made.
void add_places(const Piece& piece, std::uint32_t owner, float area, int count, std::uint32_t seed,
                std::vector<RankedPlace>& places) {
    if (count > 1) {
        const auto& uv = piece.uv;
        // At the first corner's edge and the others' in turn: parts stay as wide as they are long.
        const V2f middle = (uv[1] + uv[2]) * 0.5f;
        add_places({piece.triangle, {middle, uv[0], uv[1]}}, owner, 0.5f * area, count / 2, seed, places);
        add_places({piece.triangle, {middle, uv[2], uv[0]}}, owner, 0.5f * area, count / 2, seed, places);
        return;
    }
    const V2f e1 = piece.uv[1] - piece.uv[0], e2 = piece.uv[2] - piece.uv[0],
              corners = piece.uv[0] + piece.uv[1] * 3.0f;
    const std::uint32_t key = hash(piece.triangle, hash(std::uint32_t(corners.x * 0x1p22f)),
                                   hash(seed, std::uint32_t((corners.y + 2.0f * piece.uv[2].y) * 0x1p22f)));
    float u = to_unit_float(hash(key, 1u)), v = to_unit_float(hash(key, 2u));
    if (u + v > 1.0f) u = 1.0f - u, v = 1.0f - v;
    const float w = std::max(0x1p-24f, to_unit_float(hash(key, 3u)));
    places.push_back({owner, area / w, {piece.triangle, piece.uv[0] + e1 * u + e2 * v, area}});
}

// Whether all of the pieces lie near a point.
bool fill_chunk(const PointSet& points, const Mesh& mesh, const PointLookup& lookup, std::span<const Piece> pieces,
                std::size_t most_places, std::uint32_t seed, Chunk& chunk) {
    bool is_covered = true;
    const double longest = kLongestEdge * points.spacing;
    int places_per_piece = 1;
    while (2 * places_per_piece * kPiecesPerCell <= most_places) places_per_piece *= 2;
    std::vector<std::pair<std::uint32_t, CellSums>> sums;
    for (const Piece& coarse : pieces) {
        const Corners corners = corners_of(mesh, coarse.triangle);
        const V3d cross = (corners.p[1] - corners.p[0]).cross(corners.p[2] - corners.p[0]);
        const double triangle_area = 0.5 * cross.length();
        if (!(triangle_area > 0.0)) continue;
        const V3f normal(cross / (2.0 * triangle_area));
        bisect(coarse, corners, [&](const Piece& piece, const V3d p[3], double longest2) {
            if (longest2 > longest * longest) return false;
            const V3d middle = (p[0] + p[1] + p[2]) / 3.0;
            const std::uint32_t owner = lookup.nearest(V3f(middle), normal);
            if (owner == PointLookup::kNone) {
                is_covered = false;
                return true;
            }
            const V2f e1 = piece.uv[1] - piece.uv[0], e2 = piece.uv[2] - piece.uv[0];
            const double area = triangle_area * std::abs(double(e1.x) * e2.y - double(e1.y) * e2.x);
            if (longest2 > kLongestPerRoot * kLongestPerRoot * points.areas[owner] && points.areas[owner] > 0.0f &&
                longest2 > 0.0025 * longest * longest) {
                return false;
            }
            if (!(area > 0.0)) return true;
            if (sums.empty() || sums.back().first != owner) sums.push_back({owner, {}});
            sums.back().second.add(area, p, V3d(points.positions[owner]), V3d(normal));
            add_places(piece, owner, static_cast<float>(area), places_per_piece, seed, chunk.places);
            return true;
        });
    }
    // Bring together what belongs to one cell.
    std::stable_sort(sums.begin(), sums.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [owner, part] : sums) {
        if (chunk.sums.empty() || chunk.sums.back().first != owner) chunk.sums.push_back({owner, {}});
        chunk.sums.back().second.add(part);
    }
    // What has no chance to be kept need not wait for the other chunks.
    if (chunk.places.size() > 2 * most_places * chunk.sums.size()) keep_first(chunk.places, most_places + 1);
    chunk.places.shrink_to_fit();
    chunk.sums.shrink_to_fit();
    return is_covered;
}

}  // namespace

Covariance disc_covariance(float area, const V3f& normal) {
    const float v = 0.25f * area * kInvPi;  // a²/4 along each axis
    const V3f& n = normal;
    return {v * (1.0f - n.x * n.x), v * (1.0f - n.y * n.y), v * (1.0f - n.z * n.z),
            -v * n.x * n.y,         -v * n.x * n.z,         -v * n.y * n.z};
}

Cells cells_of(const PointSet& points, const Mesh& mesh, int most_places, std::uint32_t seed) {
    if (most_places < 1 || most_places > 4096) {
        throw ValueError(str("Cells: places must be in [1, 4096], got ", most_places, ". It is how many a cell has."));
    }
    check_points(points, "Cells");
    const std::size_t n = points.size();
    if (n > 0 && !(points.spacing > 0.0)) {
        throw ValueError(
            str("Cells: spacing of the points must be > 0, got ", points.spacing, ". Make them with poisson_points."));
    }
    Cells cells;
    cells.areas.assign(n, 0.0f);
    cells.centroids = points.positions;
    cells.covariances.assign(n, Covariance{});
    cells.normals.resize(n);
    cells.first.assign(n + 1, 0);
    if (n == 0) return cells;

    const auto refuse = [&] {
        throw ValueError(str("Cells: points must cover the mesh within their spacing (", points.spacing,
                             "), got surface far from all. Make them with poisson_points on this very mesh."));
    };
    if (!can_be_covered(mesh, n, kFarthestOwner * kMostStretch * points.spacing)) refuse();
    const std::vector<Piece> pieces = coarse_pieces(mesh, kLongestCoarseEdge * points.spacing);
    std::vector<Chunk> chunks((pieces.size() + kPiecesPerChunk - 1) / kPiecesPerChunk);
    // Points that moved with a mesh that stretched are farther apart than their spacing says: then look farther.
    std::atomic<bool> is_covered{false};
    PointSet looked_at = points;
    for (double stretch = 1.0; !is_covered; stretch *= 2.0) {
        if (stretch > kMostStretch) refuse();
        is_covered = true;
        looked_at.spacing = stretch * points.spacing;
        const PointLookup lookup(looked_at);
        parallel_for(chunks.size(), 1, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end && is_covered; ++i) {
                const std::size_t first = i * kPiecesPerChunk, last = std::min(pieces.size(), first + kPiecesPerChunk);
                chunks[i] = {};
                if (!fill_chunk(points, mesh, lookup, std::span(pieces).subspan(first, last - first),
                                static_cast<std::size_t>(most_places), seed, chunks[i])) {
                    is_covered = false;
                }
            }
        });
    }

    // Chunk after chunk, so that nothing depends on threads.
    std::vector<CellSums> sums(n);
    std::vector<std::uint32_t> begins(n + 1, 0);
    for (Chunk& chunk : chunks) {
        for (const auto& [owner, part] : chunk.sums) sums[owner].add(part);
        chunk.sums = {};
        for (const RankedPlace& place : chunk.places) ++begins[place.owner + 1];
    }
    for (std::size_t k = 0; k < n; ++k) begins[k + 1] += begins[k];
    std::vector<RankedPlace> places(begins[n]);
    std::vector<std::uint32_t> next(begins.begin(), begins.end() - 1);
    for (Chunk& chunk : chunks) {
        for (const RankedPlace& place : chunk.places) places[next[place.owner]++] = place;
        chunk = {};
    }
    parallel_for(n, 4096, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const CellSums& s = sums[k];
            if (!(s.area > 0.0)) continue;
            const V3d mean = s.first / s.area;
            cells.areas[k] = static_cast<float>(s.area);
            cells.centroids[k] = V3f(V3d(points.positions[k]) + mean);
            cells.covariances[k] = s.covariance(s.second, mean, mean);
            const V3d normal = s.normal / s.area;
            cells.normals[k] = {V3f(normal), s.covariance(s.place_by_normal, mean, normal),
                                s.covariance(s.normal_by_normal, normal, normal)};
        }
    });

    // Where there are too many, those that are kept stand for as much as the first that is not [Duffield2007].
    const auto most = static_cast<std::size_t>(most_places);
    for (std::size_t k = 0; k < n; ++k) {
        cells.first[k + 1] =
            cells.first[k] + static_cast<std::uint32_t>(std::min<std::size_t>(most, begins[k + 1] - begins[k]));
    }
    cells.places.resize(cells.first[n]);
    parallel_for(n, 1024, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const auto first = places.begin() + begins[k], last = places.begin() + begins[k + 1];
            float threshold = 0.0f;
            if (static_cast<std::size_t>(last - first) > most) {
                std::sort(first, last, ranks_before);
                threshold = (first + static_cast<std::ptrdiff_t>(most))->priority;
            }
            CellPlace* to = &cells.places[cells.first[k]];
            for (std::uint32_t i = 0; i < cells.first[k + 1] - cells.first[k]; ++i) {
                to[i] = (first + i)->place;
                to[i].area = std::max(threshold, to[i].area);
            }
        }
    });
    return cells;
}

std::array<V3f, 2> ellipse_of(const Covariance& covariance, const V3f& normal) {
    const auto [s, t] = tangent_frame(normal);
    const float xx = within(covariance, s, s), xy = within(covariance, s, t), yy = within(covariance, t, t);
    if (!(xx > 0.0f)) return {V3f(0.0f), t * (2.0f * std::sqrt(std::max(0.0f, yy)))};
    // Its Cholesky factor; a disc of radius 1 has the variance 1/4.
    const float root = std::sqrt(xx), across = std::sqrt(std::max(0.0f, yy - xy * xy / xx));
    return {s * (2.0f * root) + t * (2.0f * xy / root), t * (2.0f * across)};
}

CellBend::CellBend(const CellNormals& normals, const Covariance& covariance, float distance) {
    if (!(normals.mean.length2() > 0.0f)) return;
    const auto [s, t] = tangent_frame(normals.mean.normalized());
    const float xx = within(covariance, s, s), xy = within(covariance, s, t), yy = within(covariance, t, t);
    const float determinant = xx * yy - xy * xy;
    if (!(determinant > kThinnest * (xx + yy) * (xx + yy))) return;
    const Covariance& n = normals.with_place;
    const float nxx = within(n, s, s), nxy = within(n, s, t), nyy = within(n, t, t), scale = distance / determinant;
    axes_[0] = s;
    axes_[1] = t;
    change_[0][0] = scale * (nxx * yy - nxy * xy);
    change_[0][1] = scale * (nxy * xx - nxx * xy);
    change_[1][0] = scale * (nxy * yy - nyy * xy);
    change_[1][1] = scale * (nyy * xx - nxy * xy);
}

V3f CellBend::moved(const V3f& v) const {
    const float x = v.dot(axes_[0]), y = v.dot(axes_[1]);
    return v + axes_[0] * (change_[0][0] * x + change_[0][1] * y) + axes_[1] * (change_[1][0] * x + change_[1][1] * y);
}

void move_along_normals(float distance, const CellNormals& normals, V3f& centroid, Covariance& covariance) {
    centroid += normals.mean * distance;
    for (std::size_t i = 0; i < 6; ++i) {
        covariance[i] += distance * (2.0f * normals.with_place[i] + distance * normals.own[i]);
    }
}

V3f position_of(const CellPlace& place, const Mesh& mesh) {
    return V3f(corners_of(mesh, place.triangle).at(place.barycentrics));
}

V3f normal_of(const CellPlace& place, const Mesh& mesh) {
    const Corners corners = corners_of(mesh, place.triangle);
    return V3f((corners.p[1] - corners.p[0]).cross(corners.p[2] - corners.p[0]).normalized());
}

CellMeans cell_means(const Cells& cells, const Mesh& mesh, const std::vector<Rgb>& values, std::size_t groups) {
    if (values.size() != cells.places.size() * groups) {
        throw ValueError(str("cell_means: values must be one per place (", cells.places.size(), " x ", groups,
                             " groups), got ", values.size(), "."));
    }
    CellMeans out;
    out.means.assign(cells.size() * groups, Rgb(0.0f));
    out.moments.assign(cells.size() * groups, V3f(0.0f));
    parallel_for(cells.size(), 1024, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            double area = 0.0;
            V3d middle(0.0);
            for (std::uint32_t i = cells.first[k]; i < cells.first[k + 1]; ++i) {
                area += cells.places[i].area;
                middle += V3d(position_of(cells.places[i], mesh)) * double(cells.places[i].area);
            }
            if (!(area > 0.0)) continue;
            middle /= area;
            for (std::size_t g = 0; g < groups; ++g) {
                V3d sum(0.0), moment(0.0);
                for (std::uint32_t i = cells.first[k]; i < cells.first[k + 1]; ++i) {
                    const V3d value = V3d(values[i * groups + g]) * double(cells.places[i].area);
                    sum += value;
                    moment += (V3d(position_of(cells.places[i], mesh)) - middle) * (value.x + value.y + value.z);
                }
                out.means[k * groups + g] = Rgb(sum / area);
                out.moments[k * groups + g] = V3f(moment / area);
            }
        }
    });
    return out;
}

}  // namespace frazil
