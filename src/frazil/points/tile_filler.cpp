#include "frazil/points/tile_filler.h"

#include <atomic>

#include "frazil/base/random.h"
#include "frazil/points/side.h"

namespace frazil {
namespace {

constexpr double kEvenDarts = 2.0;      // per spacing² of surface, over the whole tile in random order
constexpr int kMostMisses = 8;          // of darts into the gaps of a patch, until they are left to the shares
constexpr int kCoarseTries = 256;       // of darts into a gap where floats are coarse
constexpr double kGapTolerance = 1e-9;  // of the spacing
constexpr double kCellWidth = 1.0;      // of the cells of points, beside the reach of look-ups
constexpr float kReachSlack = 1.0f + 1e-4f;

// The float that many floats above.
float stepped(float x, int steps) {
    for (; steps > 0; --steps) x = std::nextafter(x, HUGE_VALF);
    for (; steps < 0; ++steps) x = std::nextafter(x, -HUGE_VALF);
    return x;
}

}  // namespace

void TileFiller::begin(std::size_t tile) {
    tile_ = tile;
    const TileGrid& grid = points_.grid;
    frame_ = grid.frame(tile, points_.unit);
    around_ = grid.neighbours(tile);
    const V3d origin = frame_.origin();
    double farthest = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        farthest = std::max(farthest, std::max(std::abs(origin[axis]), std::abs(origin[axis] + grid.size)));
    }
    rounding_ = farthest * 0x1p-21 / points_.unit;
    patches_.clear();
    for (std::uint64_t i = grid.starts[tile]; i < grid.starts[tile + 1]; ++i) {
        append_patches(points_.mesh, points_.spacing, frame_, grid.triangles[i], patches_);
    }
}

// Make the lists in which patches find the points around them.
void TileFiller::prepare_neighbourhood() {
    float reach = 0.0f;
    for (const Patch& patch : patches_) reach = std::max(reach, patch.radius + patch.largest_spacing);
    reach = reach * kReachSlack * kReachSlack + float(rounding_);
    near_.reset(frame_.size(), kCellWidth * reach, reach);
    entered_.clear();
    placed_.clear();
    states_.clear();
    for (const Patch& patch : patches_) states_.push_back({near_.mark(patch.center), 0, 0, 0, 0});
}

void TileFiller::enter(std::vector<Dart>& darts) {
    for (Dart& dart : darts) {
        const V3f local(frame_.to_local(dart.position));
        if (near_.is_in_reach(local)) {
            near_.add(local, dart.normal, dart.position);
            entered_.push_back(&dart);
        }
    }
}

void TileFiller::fill(std::size_t tile) {
    begin(tile);
    prepare_neighbourhood();
    for (const TileGrid::Neighbour& other : around_) enter(points_.darts[other.tile]);

    const std::uint64_t key = points_.grid.keys[tile];
    random_ = {(std::uint64_t(points_.seed) << 32 | hash(points_.seed, std::uint32_t(key >> 32))) ^ key};
    random_.next();
    order_.resize(patches_.size());
    for (std::uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
    for (std::size_t i = order_.size(); i > 1; --i) {
        std::swap(order_[i - 1], order_[std::size_t((random_.next() >> 32) * i >> 32)]);
    }
    throw_evenly(kEvenDarts);
    throw_into_gaps();
    all_shares_.clear();
    for (const std::uint32_t patch : order_) cover(patch);
    for (std::size_t patch = 0; patch < patches_.size(); ++patch) share_again(patch);

    // The points keep their places from here on, as others add to their areas.
    points_.darts[tile] = std::vector<Dart>(placed_);
    for (Dart& dart : points_.darts[tile]) entered_.push_back(&dart);
    quanta_.assign(near_.size(), 0);
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        const PatchState& state = states_[i];
        if (is_final(patches_[i])) add_areas(patches_[i], &all_shares_[state.first_share], state.share_count);
    }
    flush_areas();
}

void TileFiller::share_border(std::size_t tile) {
    begin(tile);
    std::size_t left = 0;
    for (const Patch& patch : patches_) {
        if (!is_final(patch)) patches_[left++] = patch;
    }
    patches_.resize(left);
    if (left == 0) return;
    prepare_neighbourhood();
    enter(points_.darts[tile]);
    for (const TileGrid::Neighbour& other : around_) enter(points_.darts[other.tile]);
    quanta_.assign(near_.size(), 0);
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        find(i);
        share(i);
        add_areas(patches_[i], shares_.data(), shares_.size());
    }
    flush_areas();
}

// Whether no tile that is filled later can put a point nearer to the patch than its own are.
bool TileFiller::is_final(const Patch& patch) const {
    const double size = frame_.size(), overhang = points_.grid.overhang / points_.unit;
    const double reach = patch.radius + patch.largest_spacing * kReachSlack + rounding_ + overhang;
    const int colour = points_.grid.colour(tile_);
    for (const TileGrid::Neighbour& other : around_) {
        if (points_.grid.colour(other.tile) < colour) continue;
        double gap2 = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
            const double to_wall = other.offset[axis] > 0   ? size - patch.center[axis]
                                   : other.offset[axis] < 0 ? double(patch.center[axis])
                                                            : 0.0;
            gap2 += to_wall > 0.0 ? to_wall * to_wall : 0.0;
        }
        if (gap2 <= reach * reach) return false;
    }
    return true;
}

void TileFiller::find(std::size_t i) {
    const Patch& patch = patches_[i];
    find_candidates(near_, states_[i].cell, patch,
                    (patch.radius + patch.largest_spacing * kReachSlack) * kReachSlack + float(rounding_),
                    least_cosine(points_.thin_walls), candidates_);
}

// Throw darts evenly over the tile: most points come from here.
void TileFiller::throw_evenly(double density) {
    for (const std::uint32_t i : order_) {
        const Patch& patch = patches_[i];
        const V2f extent = patch.high - patch.low;
        const float spacing = 0.5f * (patch.least_spacing + patch.largest_spacing);
        int tries = int(float(density) * extent.x * extent.y / (spacing * spacing) + random_.next_float());
        if (tries == 0) continue;
        find(i);
        V2f hit;
        while (throw_darts(patch, candidates_, ~std::uint64_t(0), random_, tries, hit)) {
            place(patch, hit.x, hit.y, 0);
        }
    }
}

// Throw darts where no ball covers the surface, until few are left.
void TileFiller::throw_into_gaps() {
    for (const std::uint32_t i : order_) {
        const Patch& patch = patches_[i];
        find(i);
        std::uint64_t cells = uncovered_cells(patch, candidates_, 0, ~std::uint64_t(0));
        int tries = kMostMisses;
        V2f hit;
        while (cells != 0 && throw_darts(patch, candidates_, cells, random_, tries, hit)) {
            const int known = candidates_.count;
            if (place(patch, hit.x, hit.y, 0)) {
                cells = uncovered_cells(patch, candidates_, known, cells);
                tries = kMostMisses;
            }
        }
    }
}

// Share a patch out, with points where it has gaps.
void TileFiller::cover(std::size_t i) {
    const Patch& patch = patches_[i];
    find(i);
    const float band = 4.0f * kDistanceError * patch.largest_spacing * patch.largest_spacing;
    while (true) {
        Gap gap;
        if (share_patch(patch, candidates_, shares_, gap)) {
            if (candidates_.count > 0 && gap.excess2 < -band) break;
            if (gap.excess2 > band) {
                const V2f inside = gap.place(random_.next_float());
                if (place(patch, inside.x, inside.y, 0)) continue;
                if (place(patch, gap.corner.x, gap.corner.y, 0)) continue;
            }
        }
        share_exactly(patch, frame_, candidates_, near_.worlds, kGapTolerance, shares_, gaps_);
        if (gaps_.empty()) break;
        const bool is_placed =
            std::any_of(gaps_.begin(), gaps_.end(), [&](const ExactGap& at) { return place(patch, at.x, at.y, 1); });
        // Where floats are too coarse to place a point in it, the gap stays.
        if (!is_placed && !place_somewhere(patch)) break;
    }
    keep_shares(i);
}

// Try many places of a patch, each with the floats around it.
bool TileFiller::place_somewhere(const Patch& patch) {
    int tries = kCoarseTries;
    V2f hit;
    while (throw_darts(patch, candidates_, uncovered_cells(patch, candidates_, 0, ~std::uint64_t(0)), random_, tries,
                       hit)) {
        if (place(patch, hit.x, hit.y, 2)) return true;
    }
    return false;
}

// Share a patch out once more if points came near it after its turn.
void TileFiller::share_again(std::size_t i) {
    PatchState& state = states_[i];
    if (near_.count(state.cell) == state.cell_count) return;
    find(i);
    bool is_same = true;
    for (int k = 0; k < candidates_.count; ++k) is_same &= candidates_.points[k] < state.point_count;
    if (is_same) return;
    share(i);
    keep_shares(i);
}

void TileFiller::share(std::size_t i) {
    Gap gap;
    if (!share_patch(patches_[i], candidates_, shares_, gap)) {
        share_exactly(patches_[i], frame_, candidates_, near_.worlds, kGapTolerance, shares_, gaps_);
    }
}

void TileFiller::keep_shares(std::size_t i) {
    PatchState& state = states_[i];
    state.cell_count = near_.count(state.cell);
    state.point_count = static_cast<std::uint32_t>(near_.size());
    state.first_share = static_cast<std::uint32_t>(all_shares_.size());
    state.share_count = static_cast<std::uint32_t>(shares_.size());
    all_shares_.insert(all_shares_.end(), shares_.begin(), shares_.end());
}

void TileFiller::add_areas(const Patch& patch, const Share* shares, std::size_t count) {
    double total = 0.0;
    for (std::size_t i = 0; i < count; ++i) total += shares[i].weight;
    const double quanta = patch.area / points_.area_quantum;
    if (total > 0.0) {
        for (std::size_t i = 0; i < count; ++i) {
            quanta_[shares[i].point] += static_cast<std::int64_t>(quanta * (shares[i].weight / total));
        }
        return;
    }
    // Only where floats are too coarse to place a point or to tell shares apart: the nearest there is takes it.
    std::size_t nearest = 0;
    double least2 = HUGE_VAL;
    for (std::size_t i = 0; i < near_.size(); ++i) {
        const double d2 = (frame_.to_local(near_.worlds[i]) - V3d(patch.center)).length2();
        if (d2 < least2) least2 = d2, nearest = i;
    }
    if (near_.size() > 0) quanta_[nearest] += static_cast<std::int64_t>(quanta);
}

void TileFiller::flush_areas() {
    for (std::size_t i = 0; i < quanta_.size(); ++i) {
        if (quanta_[i] != 0) {
            std::atomic_ref<std::int64_t>(entered_[i]->quanta).fetch_add(quanta_[i], std::memory_order_relaxed);
        }
    }
}

// Place a point at (x, y) of the patch if it is still free once rounded to what is stored. The floats up
// to `most_steps` from it are tried as well, so that a gap is closed even where floats are coarse.
bool TileFiller::place(const Patch& patch, double x, double y, int most_steps) {
    // The nearest place of the triangle.
    const V3d local = V3d(patch.center) + V3d(patch.axes[0]) * x + V3d(patch.axes[1]) * y;
    const V3i& t = points_.mesh.triangles[patch.triangle];
    const V3d a(points_.mesh.positions[t.x]);
    const V3d ab = V3d(points_.mesh.positions[t.y]) - a, ac = V3d(points_.mesh.positions[t.z]) - a;
    const V3d from_a = local * frame_.unit + frame_.origin() - a, cross = ab.cross(ac);
    const double inverse = 1.0 / cross.length2();
    const double u = std::clamp(from_a.cross(ac).dot(cross) * inverse, 0.0, 1.0);
    const double v = std::clamp(ab.cross(from_a).dot(cross) * inverse, 0.0, 1.0 - u);
    const V3d place = a + ab * u + ac * v;
    const SpacingField& field = points_.spacing;
    const double spacing =
        !field.per_vertex ? field.constant
                          : field.at_vertex(t.x) * (1.0 - u - v) + field.at_vertex(t.y) * u + field.at_vertex(t.z) * v;

    V3f world = to_stored(place);
    const auto is_free_at = [&](const V3f& at) {
        return is_free(at, x, y, (frame_.to_local(at) - local).length(), spacing);
    };
    if (!is_free_at(world)) {
        if (most_steps == 0) return false;
        bool is_found = false;
        for (int x_steps = -most_steps; x_steps <= most_steps && !is_found; ++x_steps) {
            for (int y_steps = -most_steps; y_steps <= most_steps && !is_found; ++y_steps) {
                for (int z_steps = -most_steps; z_steps <= most_steps && !is_found; ++z_steps) {
                    const V3f moved(stepped(world.x, x_steps), stepped(world.y, y_steps), stepped(world.z, z_steps));
                    is_found = is_free_at(moved);
                    if (is_found) world = moved;
                }
            }
        }
        if (!is_found) return false;
    }
    V2f uv{float(u), float(v)};
    if (double(uv.x) + uv.y > 1.0) uv.x = std::nextafter(1.0f - uv.y, 0.0f);
    const V3f stored(frame_.to_local(world));
    const std::uint32_t point = near_.add(stored, patch.normal, world);
    const V3f d = stored - patch.center;
    candidates_.add(d.dot(patch.axes[0]), d.dot(patch.axes[1]), d.length2(), point);
    placed_.push_back({world, patch.normal, patch.triangle, uv, 0});
    return true;
}

// Whether no candidate is nearer than the spacing, metres, to a place that is stored `shift` from (x, y).
bool TileFiller::is_free(const V3f& world, double x, double y, double shift, double spacing) const {
    const Candidates& c = candidates_;
    const auto seen = float(spacing / frame_.unit * (1.0 + kDistanceError) + shift);
    const auto near_x = float(x), near_y = float(y);
    const float limit = seen * seen - (near_x * near_x + near_y * near_y);
    const V3d place(world);
    for (int i = 0; i < c.count; ++i) {
        if (c.s[i] - 2.0f * (c.x[i] * near_x + c.y[i] * near_y) >= limit) continue;
        if ((V3d(near_.worlds[c.points[i]]) - place).length2() < spacing * spacing) return false;
    }
    return true;
}

}  // namespace frazil
