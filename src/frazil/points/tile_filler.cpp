#include "frazil/points/tile_filler.h"

#include <atomic>
#include <bit>

#include "frazil/base/random.h"
#include "frazil/points/side.h"

namespace frazil {
namespace {

constexpr double kEvenDarts = 2.0;      // per spacing² of surface, over the whole tile in random order
constexpr int kCoarseTries = 256;       // of darts into a gap where floats are coarse
constexpr double kGapTolerance = 1e-9;  // of the spacing

// How far from its walls a tile's points can matter to others, in largest spacings.
constexpr double kWallReach = kPartReach + 1.1;
// What a point may be needed for: a bit for each wall that it is near to, the lower and the upper one of each axis, and
// one for patches of its own tile that wait for later tiles.
constexpr unsigned kForBorder = 1u << 6;

unsigned near_walls(const V3d& local, double size, double reach) {
    unsigned walls = 0;
    for (int axis = 0; axis < 3; ++axis) {
        walls |= unsigned(local[axis] <= reach) << (2 * axis) | unsigned(local[axis] >= size - reach) << (2 * axis + 1);
    }
    return walls;
}

// What points of the tile at that offset are near to if they can matter here.
unsigned walls_between(const V3i& offset) {
    unsigned walls = 0;
    for (int axis = 0; axis < 3; ++axis) {
        if (offset[axis] != 0) walls |= 1u << (2 * axis + (offset[axis] < 0));
    }
    return walls;
}

// Ask the memory for a triangle that is needed soon.
void prefetch(const Mesh& mesh, const std::int32_t* triangles, std::size_t count) {
    if (count > 16) __builtin_prefetch(&mesh.triangles[triangles[16]]);
    if (count > 8) {
        const V3i& soon = mesh.triangles[triangles[8]];
        for (int k = 0; k < 3; ++k) __builtin_prefetch(&mesh.positions[soon[k]]);
    }
}

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
    later_.clear();
    for (const TileGrid::Neighbour& other : around_) {
        if (grid.colour(other.tile) < grid.colour(tile)) continue;
        const Box3f& box = grid.boxes[other.tile];
        later_.push_back({V3f(frame_.to_local(box.min)), V3f(frame_.to_local(box.max))});
    }
    patches_.clear();
}

// Make the lists in which patches find the points around them.
void TileFiller::prepare_neighbourhood() {
    near_.reset(patches_, rounding_, least_cosine(points_.thin_walls));
    entered_.clear();
    placed_.clear();
}

// Enter the points of a tile that are needed for all that is asked, and can matter.
void TileFiller::enter(std::size_t tile, unsigned need) {
    Box3f box;
    for (int axis = 0; axis < 3; ++axis) {
        const double origin = frame_.origin()[axis], unit = frame_.unit;
        box.min[axis] = std::nextafter(float(near_.box_in_reach().min[axis] * unit + origin), -HUGE_VALF);
        box.max[axis] = std::nextafter(float(near_.box_in_reach().max[axis] * unit + origin), HUGE_VALF);
    }
    std::vector<Dart>& darts = points_.darts[tile];
    const std::vector<std::uint8_t>& needs = points_.needs[tile];
    for (std::size_t i = 0; i < darts.size(); ++i) {
        if ((needs[i] & need) != need) continue;
        Dart& dart = darts[i];
        if (!box.intersects(dart.position)) continue;
        near_.add(V3f(frame_.to_local(dart.position)), dart.normal, dart.position);
        entered_.push_back(&dart);
    }
}

void TileFiller::enter_neighbours() {
    for (const TileGrid::Neighbour& other : around_) enter(other.tile, walls_between(other.offset));
}

void TileFiller::fill(std::size_t tile) {
    begin(tile);
    const TileGrid& grid = points_.grid;
    for (std::uint64_t i = grid.starts[tile]; i < grid.starts[tile + 1]; ++i) {
        prefetch(points_.mesh, &grid.triangles[i], grid.starts[tile + 1] - i);
        append_patches(points_.mesh, points_.spacing, frame_, grid.triangles[i], patches_);
    }
    if (patches_.empty()) return;
    states_.clear();
    std::vector<std::int32_t>& border = points_.borders[tile];
    for (const Patch& patch : patches_) {
        states_.push_back({0, 0, 0, 0, 0, points_.with_areas && is_final(patch)});
        if (!states_.back().is_final && (border.empty() || border.back() != patch.triangle)) {
            border.push_back(patch.triangle);
        }
    }
    prepare_neighbourhood();
    enter_neighbours();

    const std::uint64_t key = grid.keys[tile];
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

    std::vector<std::uint8_t>& needs = points_.needs[tile];
    needs.reserve(placed_.size());
    const double reach = kWallReach * points_.spacing.constant / points_.unit + rounding_;
    for (const Dart& dart : placed_) {
        needs.push_back(std::uint8_t(near_walls(frame_.to_local(dart.position), frame_.size(), reach)));
    }
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        if (states_[i].is_final) continue;
        const Candidates near = near_.candidates(i);
        for (int k = 0; k < near.count; ++k) {
            if (near.points[k] >= entered_.size()) needs[near.points[k] - entered_.size()] |= kForBorder;
        }
    }
    // The points keep their places from here on, as others add to their areas.
    points_.darts[tile] = std::vector<Dart>(placed_);
    for (Dart& dart : points_.darts[tile]) entered_.push_back(&dart);
    quanta_.assign(near_.size(), 0);
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        const PatchState& state = states_[i];
        if (state.is_final) add_areas(patches_[i], &all_shares_[state.first_share], state.share_count);
    }
    flush_areas();
}

void TileFiller::share_border(std::size_t tile) {
    std::vector<std::int32_t> border;
    border.swap(points_.borders[tile]);
    if (border.empty()) return;
    begin(tile);
    for (std::size_t i = 0; i < border.size(); ++i) {
        prefetch(points_.mesh, &border[i], border.size() - i);
        append_patches(points_.mesh, points_.spacing, frame_, border[i], patches_);
    }
    if (points_.with_areas) std::erase_if(patches_, [&](const Patch& patch) { return is_final(patch); });
    if (patches_.empty()) return;
    prepare_neighbourhood();
    enter(tile, kForBorder);
    enter_neighbours();
    quanta_.assign(near_.size(), 0);
    for (std::size_t i = 0; i < patches_.size(); ++i) {
        share(i);
        add_areas(patches_[i], shares_.data(), shares_.size());
    }
    flush_areas();
}

// Whether no tile that is filled later can put a point nearer to the patch than its own are.
bool TileFiller::is_final(const Patch& patch) const {
    const float reach = reach_of(patch, rounding_);
    for (const Box3f& box : later_) {
        float gap2 = 0.0f;
        for (int axis = 0; axis < 3; ++axis) {
            const float at = patch.center[axis];
            const float gap = std::max(0.0f, std::max(box.min[axis] - at, at - box.max[axis]));
            gap2 += gap * gap;
        }
        if (gap2 <= reach * reach) return false;
    }
    return true;
}

// Throw darts evenly over the tile: most points come from here.
void TileFiller::throw_evenly(double density) {
    for (const std::uint32_t i : order_) {
        const Patch& patch = patches_[i];
        PatchState& state = states_[i];
        state.cells = cells_of(patch);
        const V2f extent = patch.high - patch.low;
        const float spacing = 0.5f * (patch.least_spacing + patch.largest_spacing);
        const float area = extent.x * extent.y * (float(std::popcount(state.cells)) / 64.0f);
        int tries = int(float(density) * area / (spacing * spacing) + random_.next_float());
        for (; tries > 0; tries -= kDartsAtOnce) place_free(i, state.cells, std::min(tries, kDartsAtOnce), 0);
    }
}

// Throw darts where no ball covers the surface, until none is free.
void TileFiller::throw_into_gaps() {
    for (const std::uint32_t i : order_) {
        do take_covered(i);
        while (place_free(i, states_[i].cells, kDartsAtOnce, 0) > 0);
    }
}

// Throw darts into cells of a patch, and place points where they are free: how many.
int TileFiller::place_free(std::size_t i, std::uint64_t cells, int count, int most_steps) {
    if (cells == 0) return 0;
    const Patch& patch = patches_[i];
    int placed = 0;
    Darts darts = throw_darts(patch, near_.candidates(i), cells, random_, count);
    while (darts.free != 0) {
        const int known = int(near_.count(i)), lane = std::countr_zero(darts.free);
        darts.free &= darts.free - 1;
        if (!place(i, darts.x[lane], darts.y[lane], most_steps)) continue;
        ++placed;
        darts.free = free_darts(patch, near_.candidates(i), known, darts);
    }
    return placed;
}

// Take the cells from a patch that points have covered since it was looked at.
void TileFiller::take_covered(std::size_t i) {
    PatchState& state = states_[i];
    state.cells = uncovered_cells(patches_[i], near_.candidates(i), int(state.known), state.cells);
    state.known = near_.count(i);
}

// Share a patch out, with points where it has gaps.
void TileFiller::cover(std::size_t i) {
    const Patch& patch = patches_[i];
    take_covered(i);
    if (states_[i].cells == 0) return;
    const float band = 4.0f * kDistanceError * patch.largest_spacing * patch.largest_spacing;
    while (true) {
        Gap gap;
        if (share_patch(patch, near_.candidates(i), shares_, gap)) {
            const float least_band = band + 2.0f * patch.largest_spacing * gap.open;
            if (near_.count(i) > 0 && gap.excess2 < -least_band) break;
            if (gap.excess2 > band) {
                const V2f inside = gap.place(random_.next_float());
                if (place(i, inside.x, inside.y, 0)) continue;
                if (place(i, gap.corner.x, gap.corner.y, 0)) continue;
            }
        }
        share_exactly(patch, frame_, near_.candidates(i), near_.worlds, kGapTolerance, shares_, gaps_);
        if (gaps_.empty()) break;
        const bool is_placed =
            std::any_of(gaps_.begin(), gaps_.end(), [&](const ExactGap& at) { return place(i, at.x, at.y, 1); });
        // Where floats are too coarse to place a point in it, the gap stays.
        if (!is_placed && !place_somewhere(i)) break;
    }
    keep_shares(i);
}

// Try many places of a patch, each with the floats around it.
bool TileFiller::place_somewhere(std::size_t i) {
    const std::uint64_t cells = uncovered_cells(patches_[i], near_.candidates(i), 0, cells_of(patches_[i]));
    for (int tries = 0; tries < kCoarseTries; tries += kDartsAtOnce) {
        if (place_free(i, cells, kDartsAtOnce, 2) > 0) return true;
    }
    return false;
}

// Share a covered patch out, if that was not done with the points that are near it now.
void TileFiller::share_again(std::size_t i) {
    const PatchState& state = states_[i];
    if (!state.is_final || near_.count(i) == state.shared_count) return;
    share(i);
    keep_shares(i);
}

void TileFiller::share(std::size_t i) {
    Gap gap;
    if (!share_patch(patches_[i], near_.candidates(i), shares_, gap)) {
        share_exactly(patches_[i], frame_, near_.candidates(i), near_.worlds, kGapTolerance, shares_, gaps_);
    }
}

void TileFiller::keep_shares(std::size_t i) {
    PatchState& state = states_[i];
    if (!state.is_final) return;
    state.shared_count = near_.count(i);
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
bool TileFiller::place(std::size_t i, double x, double y, int most_steps) {
    const Patch& patch = patches_[i];
    const Candidates near = near_.candidates(i);
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
        return is_free(near, at, x, y, (frame_.to_local(at) - local).length(), spacing);
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
    near_.add(stored, patch.normal, world);
    placed_.push_back({world, patch.normal, patch.triangle, uv, 0});
    return true;
}

// Whether no candidate is nearer than the spacing, metres, to a place that is stored `shift` from (x, y).
bool TileFiller::is_free(const Candidates& c, const V3f& world, double x, double y, double shift,
                         double spacing) const {
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
