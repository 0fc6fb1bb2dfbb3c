#include "frazil/points/tile_filler.h"

#include "frazil/base/random.h"
#include "frazil/points/side.h"

namespace frazil {
namespace {

constexpr double kLongestEdge = 1.5;       // of a fragment, in spacings
constexpr double kUniformDarts = 3.0;      // per spacing² of surface, before fragments are taken one by one
constexpr float kLeafEdge = 1.0f / 32.0f;  // of the spacing: below it a part is closed exactly
constexpr float kSafe = 1.0f - 2e-5f;      // float distances err by less than this
constexpr double kGapTolerance = 1e-9;     // of the spacing
constexpr int kMostLanes = 32;

}  // namespace

// A part of a fragment and its squared distances to the points around it, a lane per point.
struct TileFiller::Node {
    alignas(32) float d[3][kMostLanes];
    V2f place[3];    // barycentrics in the fragment
    float edge2[3];  // squared lengths of 01, 12, 20
    float radius[3];
    int lanes;

    bool is_covered() const {
        const float limit[3] = {radius[0] * radius[0] * kSafe, radius[1] * radius[1] * kSafe,
                                radius[2] * radius[2] * kSafe};
        int covering = 0;
        for (int i = 0; i < lanes; ++i) {
            covering |= int(d[0][i] <= limit[0]) & int(d[1][i] <= limit[1]) & int(d[2][i] <= limit[2]);
        }
        return covering != 0;
    }

    // Whether a place is surely within the spacing of a point.
    bool is_near(float b1, float b2) const {
        const float b0 = 1.0f - b1 - b2;
        const float bend = b0 * b1 * edge2[0] + b1 * b2 * edge2[1] + b2 * b0 * edge2[2];
        const float r = b0 * radius[0] + b1 * radius[1] + b2 * radius[2];
        const float limit = r * r * kSafe + bend;
        int covering = 0;
        for (int i = 0; i < lanes; ++i) covering |= int(b0 * d[0][i] + b1 * d[1][i] + b2 * d[2][i] <= limit);
        return covering != 0;
    }

    // The halves at the middle of the edge that goes from corner a to b; c is the third.
    void halve(int a, int b, int c, Node& first, Node& second) const {
        const float ab = edge2[a], bc = edge2[b], ca = edge2[c];
        const float quarter = 0.25f * ab, median2 = 0.5f * (bc + ca) - quarter;
        const V2f middle = (place[a] + place[b]) * 0.5f;
        const float middle_radius = 0.5f * (radius[a] + radius[b]);
        // first = (a, middle, c), second = (middle, b, c)
        first.lanes = second.lanes = lanes;
        for (int i = 0; i < lanes; ++i) {
            const float m = 0.5f * (d[a][i] + d[b][i]) - quarter;
            first.d[0][i] = d[a][i];
            first.d[1][i] = m;
            first.d[2][i] = d[c][i];
            second.d[0][i] = m;
            second.d[1][i] = d[b][i];
            second.d[2][i] = d[c][i];
        }
        first.place[0] = place[a];
        first.place[1] = second.place[0] = middle;
        second.place[1] = place[b];
        first.place[2] = second.place[2] = place[c];
        first.radius[0] = radius[a];
        first.radius[1] = second.radius[0] = middle_radius;
        second.radius[1] = radius[b];
        first.radius[2] = second.radius[2] = radius[c];
        first.edge2[0] = second.edge2[0] = quarter;
        first.edge2[1] = second.edge2[2] = std::max(0.0f, median2);
        first.edge2[2] = ca;
        second.edge2[1] = bc;
    }
};

float TileFiller::next_random() {
    return to_unit_float(hash(tile_seed_, drawn_++));
}

double TileFiller::spacing_at(std::int32_t triangle, const V2f& uv) const {
    if (!spacing_.per_vertex) return spacing_.constant;
    const V3i& t = mesh_.triangles[triangle];
    return spacing_.at_vertex(t.x) * (1.0 - uv.x - uv.y) + spacing_.at_vertex(t.y) * uv.x +
           spacing_.at_vertex(t.z) * uv.y;
}

void TileFiller::fill(const TileFrame& frame, const std::int32_t* triangles, std::size_t triangle_count,
                      const std::vector<const std::vector<Dart>*>& around, std::uint64_t key,
                      std::vector<Dart>& darts) {
    frame_ = frame;
    tile_seed_ = hash(seed_, hash(std::uint32_t(key), std::uint32_t(key >> 32)));
    drawn_ = 0;
    darts_ = &darts;
    fragments_.clear();
    for (std::size_t i = 0; i < triangle_count; ++i) {
        append_fragments(mesh_, spacing_, frame, triangles[i], kLongestEdge, fragments_);
    }

    float reach = 0.0f;
    for (const Fragment& fragment : fragments_) reach = std::max(reach, fragment_reach(fragment));
    near_.reset(frame.size, kCellWidth * reach, reach, least_cosine(thin_walls_));
    for (const Fragment& fragment : fragments_) {
        V3f low = fragment.corners[0], high = low;
        for (const V3f& corner : fragment.corners) {
            for (int axis = 0; axis < 3; ++axis) {
                low[axis] = std::min(low[axis], corner[axis]);
                high[axis] = std::max(high[axis], corner[axis]);
            }
        }
        near_.mark(low, high);
    }
    for (const std::vector<Dart>* tile : around) {
        for_each_around(frame, reach, *tile, [&](std::size_t i, const V3f& local) {
            near_.add(local, (*tile)[i].normal, (*tile)[i].position);
        });
    }

    throw_darts();
    order_.resize(fragments_.size());
    for (std::uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
    for (std::size_t i = order_.size(); i > 1; --i) {
        std::swap(order_[i - 1], order_[std::size_t(std::uint64_t(hash(tile_seed_, drawn_++)) * i >> 32)]);
    }
    for (const std::uint32_t i : order_) cover(fragments_[i]);
}

// Throw darts uniformly over the tile's surface (by its spacing where that varies): most points come from here.
void TileFiller::throw_darts() {
    cumulative_.clear();
    double total = 0.0;
    for (const Fragment& f : fragments_) {
        const float r = (f.radii[0] + f.radii[1] + f.radii[2]) / 3.0f;
        total += 0.5 * (f.corners[1] - f.corners[0]).cross(f.corners[2] - f.corners[0]).length() / (r * r);
        cumulative_.push_back(total);
    }
    const auto count = static_cast<std::uint64_t>(std::ceil(total * kUniformDarts));
    for (std::uint64_t i = 0; i < count; ++i) {
        const double at = random() * total;
        const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), at);
        if (found == cumulative_.end()) continue;
        const Fragment& fragment = fragments_[found - cumulative_.begin()];
        float u = random(), v = random();
        if (u + v > 1.0f) {
            u = 1.0f - u;
            v = 1.0f - v;
        }
        const V3f place = fragment.corners[0] * (1.0f - u - v) + fragment.corners[1] * u + fragment.corners[2] * v;
        const float r = fragment.radii[0] * (1.0f - u - v) + fragment.radii[1] * u + fragment.radii[2] * v;
        if (!near_.any_near(place, fragment.normal, r * r * kSafe, [](std::uint32_t) { return true; }))
            try_place(fragment, u, v, false);
    }
}

void TileFiller::cover(const Fragment& fragment) {
    Node root;
    while (!gather(fragment, root) && cover_node(fragment, root) == Outcome::placed) {
    }
}

// Set up the root of a fragment: lanes for the points that can cover some of it. True where one covers all.
bool TileFiller::gather(const Fragment& f, Node& root) {
    root.lanes = 0;
    const V3f centroid = (f.corners[0] + f.corners[1] + f.corners[2]) * (1.0f / 3.0f);
    float limit[3];
    for (int k = 0; k < 3; ++k) {
        const int next = k == 2 ? 0 : k + 1;
        root.place[k] = V2f(k == 1, k == 2);
        root.radius[k] = f.radii[k];
        root.edge2[k] = (f.corners[next] - f.corners[k]).length2();
        limit[k] = f.radii[k] * f.radii[k] * kSafe;
    }
    const float reach = fragment_reach(f);
    const bool is_covered = near_.any_near(centroid, f.normal, reach * reach, [&](std::uint32_t p) {
        const V3f& place = near_.locals[p];
        const float d0 = (f.corners[0] - place).length2(), d1 = (f.corners[1] - place).length2(),
                    d2 = (f.corners[2] - place).length2();
        if (d0 <= limit[0] && d1 <= limit[1] && d2 <= limit[2]) return true;
        // More points than lanes: those left out can only make us look closer than we need.
        if (root.lanes < kMostLanes) {
            root.d[0][root.lanes] = d0;
            root.d[1][root.lanes] = d1;
            root.d[2][root.lanes] = d2;
            ++root.lanes;
        }
        return false;
    });
    // Whole groups of lanes, so that the loops over them need no remainder.
    while (root.lanes % 4 != 0) {
        for (auto& corner : root.d) corner[root.lanes] = 1e30f;
        ++root.lanes;
    }
    return is_covered;
}

TileFiller::Outcome TileFiller::cover_node(const Fragment& fragment, const Node& node) {
    if (node.is_covered()) return Outcome::covered;

    float u = random(), v = random();
    if (u + v > 1.0f) {
        u = 1.0f - u;
        v = 1.0f - v;
    }
    if (!node.is_near(u, v)) {
        const V2f place = node.place[0] * (1.0f - u - v) + node.place[1] * u + node.place[2] * v;
        if (try_place(fragment, place.x, place.y, false)) return Outcome::placed;
    }

    const int longest = node.edge2[0] >= node.edge2[1] && node.edge2[0] >= node.edge2[2] ? 0
                        : node.edge2[1] >= node.edge2[2]                                 ? 1
                                                                                         : 2;
    const float leaf = kLeafEdge * std::min(node.radius[0], std::min(node.radius[1], node.radius[2]));
    if (node.edge2[longest] <= leaf * leaf) return close_gap(fragment, node);

    Node halves[2];
    node.halve(longest, (longest + 1) % 3, (longest + 2) % 3, halves[0], halves[1]);
    const int first = hash(tile_seed_, drawn_++) >> 31;
    if (cover_node(fragment, halves[first]) == Outcome::placed) return Outcome::placed;
    return cover_node(fragment, halves[1 - first]);
}

// Share the part exactly among its nearest points; place one at the farthest corner of a share beyond the spacing.
TileFiller::Outcome TileFiller::close_gap(const Fragment& f, const Node& node) {
    V3d corners[3], vertices[3];
    for (int k = 0; k < 3; ++k) vertices[k] = frame_.to_local(mesh_.positions[mesh_.triangles[f.triangle][k]]);
    V3d centroid(0.0);
    for (int k = 0; k < 3; ++k) {
        const double u = node.place[k].x, v = node.place[k].y;
        const V2d uv = f.uv[0] * (1.0 - u - v) + f.uv[1] * u + f.uv[2] * v;
        corners[k] = vertices[0] * (1.0 - uv.x - uv.y) + vertices[1] * uv.x + vertices[2] * uv.y;
        centroid += corners[k] / 3.0;
    }
    double edge2[3], extent2 = 0.0, radius = 0.0;
    for (int k = 0; k < 3; ++k) {
        edge2[k] = (corners[(k + 1) % 3] - corners[k]).length2();
        extent2 = std::max(extent2, (corners[k] - centroid).length2());
        radius = std::max<double>(radius, node.radius[k]);
    }
    const double reach = (radius + std::sqrt(extent2)) * 1.0001;
    candidates_.clear();
    near_.any_near(V3f(centroid), f.normal, float(reach * reach), [&](std::uint32_t p) {
        const V3d place = frame_.to_local(near_.worlds[p]);
        candidates_.push_back(
            {{(corners[0] - place).length2(), (corners[1] - place).length2(), (corners[2] - place).length2()}});
        return false;
    });

    double worst = kGapTolerance;
    PiecePlace gap{1.0 / 3.0, 1.0 / 3.0};
    const int count = static_cast<int>(candidates_.size());
    if (count == 0) worst = 1.0;
    int nearest[3];
    find_nearest(candidates_.data(), count, nearest);
    drop_dominated(candidates_.data(), count, nearest, kept_);
    Piece piece;
    for (const int self : kept_) {
        clip_piece(candidates_.data(), kept_, self, piece);
        const double* d = candidates_[self].d;
        for (int i = 0; i < piece.count; ++i) {
            const double b1 = piece.vertices[i].u, b2 = piece.vertices[i].v, b0 = 1.0 - b1 - b2;
            const double bend = b0 * b1 * edge2[0] + b1 * b2 * edge2[1] + b2 * b0 * edge2[2];
            const double distance = std::sqrt(std::max(0.0, b0 * d[0] + b1 * d[1] + b2 * d[2] - bend));
            const double r = b0 * node.radius[0] + b1 * node.radius[1] + b2 * node.radius[2];
            if (distance - r > worst * r) {
                worst = (distance - r) / r;
                gap = piece.vertices[i];
            }
        }
    }
    if (worst <= kGapTolerance) return Outcome::covered;
    const double b0 = 1.0 - gap.u - gap.v;
    const double u = node.place[0].x * b0 + node.place[1].x * gap.u + node.place[2].x * gap.v;
    const double v = node.place[0].y * b0 + node.place[1].y * gap.u + node.place[2].y * gap.v;
    return try_place(f, u, v, true) ? Outcome::placed : Outcome::covered;
}

// Place a point at barycentrics (u, v) of the fragment if it is still free once rounded to what is stored. With
// may_shift the roundings next to it are tried as well, so that a gap is closed even where floats are coarse.
bool TileFiller::try_place(const Fragment& f, double u, double v, bool may_shift) {
    const V2d exact = f.uv[0] * (1.0 - u - v) + f.uv[1] * u + f.uv[2] * v;
    V2f uv(std::max(0.0f, float(exact.x)), std::max(0.0f, float(exact.y)));
    if (double(uv.x) + uv.y > 1.0) uv.x = std::nextafter(1.0f - uv.y, 0.0f);

    const V3i& t = mesh_.triangles[f.triangle];
    const V3d a(mesh_.positions[t.x]), b(mesh_.positions[t.y]), c(mesh_.positions[t.z]);
    const V3d place = a * (1.0 - uv.x - uv.y) + b * double(uv.x) + c * double(uv.y);
    const V3f near = f.corners[0] * float(1.0 - u - v) + f.corners[1] * float(u) + f.corners[2] * float(v);
    const double radius = spacing_at(f.triangle, uv);
    V3f world(place);
    if (!is_free(world, near, f.normal, radius)) {
        if (!may_shift) return false;
        bool is_found = false;
        for (int shift = 0; shift < 27 && !is_found; ++shift) {
            V3f moved(place);
            for (int axis = 0, s = shift; axis < 3; ++axis, s /= 3) {
                if (s % 3 != 0) moved[axis] = std::nextafter(moved[axis], s % 3 == 1 ? -HUGE_VALF : HUGE_VALF);
            }
            is_found = is_free(moved, near, f.normal, radius);
            if (is_found) world = moved;
        }
        if (!is_found) return false;
    }
    near_.add(V3f(frame_.to_local(world)), f.normal, world);
    darts_->push_back({world, f.normal, f.triangle, uv});
    return true;
}

bool TileFiller::is_free(const V3f& world, const V3f& near, const V3f& normal, double radius) const {
    const V3d place(world);
    // Look a little farther than the spacing, by what rounding may have moved the place.
    const float seen = float(radius / frame_.unit) * 1.005f + float((frame_.to_local(world) - V3d(near)).length());
    return !near_.any_near(near, normal, seen * seen,
                           [&](std::uint32_t p) { return (V3d(near_.worlds[p]) - place).length2() < radius * radius; });
}

}  // namespace frazil
