#include "frazil/render/inner_gathers.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/random.h"
#include "frazil/render/bodies.h"

namespace frazil {
namespace {

constexpr double kCell = 0.4;                             // in mean free paths
constexpr std::int64_t kCells = 4, kNodes = kCells + 1;   // of a brick, along an axis
constexpr float kTolerance = 4.0f;                        // of gathers at the nodes, times the render's
constexpr std::size_t kMostBytes = std::size_t(1) << 28;  // that a body's bricks take

}  // namespace

std::size_t InnerGathers::PlaceHash::operator()(const Place& place) const {
    return hash(std::uint32_t(place[0]), std::uint32_t(place[1]), std::uint32_t(place[2]));
}

InnerGathers::InnerGathers(const Body& body, std::size_t groups, const GatherOptions& options)
    : trees_(body.trees), options_(options) {
    trees_.overlays = nullptr;
    options_.tolerance *= kTolerance;
    columns_ = columns_of(trees_, groups, options.ramp_layers ? body.material->ramp.distances.size() : 0);
    cell_ = kCell * double(body.mean_free_path());
    most_bricks_per_shelf_ = kMostBytes / kShelves / (kNodes * kNodes * kNodes * columns_.count() * sizeof(Rgb));
}

std::shared_ptr<const InnerGathers::Brick> InnerGathers::gather_brick(const Place& place) const {
    std::vector<V3f> nodes;
    for (std::int64_t z = 0; z < kNodes; ++z) {
        for (std::int64_t y = 0; y < kNodes; ++y) {
            for (std::int64_t x = 0; x < kNodes; ++x) {
                const V3d at(double(place[0] * kCells + x), double(place[1] * kCells + y),
                             double(place[2] * kCells + z));
                nodes.emplace_back(at * cell_);
            }
        }
    }
    return std::make_shared<const Brick>(gather_core(trees_, {nodes, nodes}, options_));
}

std::shared_ptr<const InnerGathers::Brick> InnerGathers::brick(const Place& place) const {
    Shelf& shelf = shelves_[PlaceHash()(place) % kShelves];
    {
        const std::lock_guard lock(shelf.mutex);
        const auto found = shelf.bricks.find(place);
        if (found != shelf.bricks.end()) return found->second;
    }
    // Not under the lock: a gather may take up other tasks, which ask for bricks themselves. Who comes second gathers the
    // same again.
    const std::shared_ptr<const Brick> made = gather_brick(place);
    const std::lock_guard lock(shelf.mutex);
    if (shelf.bricks.size() >= most_bricks_per_shelf_) return made;
    return shelf.bricks.try_emplace(place, made).first->second;
}

void InnerGathers::append(const V3f& position, CoreSums& rows) const {
    Place place;
    std::size_t first[3];  // the lower node about the position, within its brick
    float beyond[3];       // of a cell
    for (int axis = 0; axis < 3; ++axis) {
        const double at = double(position[axis]) / cell_, floor = std::floor(at);
        const auto cell = static_cast<std::int64_t>(floor);
        place[axis] = (cell >= 0 ? cell : cell - kCells + 1) / kCells;
        first[axis] = static_cast<std::size_t>(cell - place[axis] * kCells);
        beyond[axis] = static_cast<float>(at - floor);
    }
    const std::shared_ptr<const Brick> here = brick(place);
    Rgb* row = rows.add_row();
    for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t step[3] = {corner & 1, corner >> 1 & 1, corner >> 2};
        float weight = 1.0f;
        for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? beyond[axis] : 1.0f - beyond[axis];
        const std::size_t node = ((first[2] + step[2]) * kNodes + first[1] + step[1]) * kNodes + first[0] + step[0];
        add_weighted(row, here->row(node), columns_.count(), weight);
    }
}

}  // namespace frazil
