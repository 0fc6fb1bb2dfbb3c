#include "frazil/render/inner_gathers.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/random.h"
#include "frazil/render/bodies.h"

namespace frazil {
namespace {

constexpr double kCell = 0.4;                             // in mean free paths
constexpr std::int64_t kCells = 4, kNodes = kCells + 1;   // of a brick, along an axis
constexpr std::size_t kMostBytes = std::size_t(1) << 28;  // that a body's bricks take

}  // namespace

std::size_t InnerGathers::PlaceHash::operator()(const Place& place) const {
    return hash(std::uint32_t(place[0]), std::uint32_t(place[1]), std::uint32_t(place[2]));
}

InnerGathers::InnerGathers(const Body& body, std::size_t groups, const GatherOptions& options)
    : tree_(body.tree), thickness_(body.thickness), options_(options) {
    cell_ = kCell / double(max_component(body.medium.sigma_s_prime + body.medium.sigma_a));
    const std::size_t knots = options.ramp_layers ? body.material->ramp.distances.size() : 0;
    const std::size_t colors = groups * (1 + knots) + 2;
    most_bricks_per_shelf_ = kMostBytes / kShelves / (kNodes * kNodes * kNodes * colors * sizeof(Rgb));
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
    auto result = std::make_shared<Brick>();
    result->at_nodes = tree_->gather(nodes.data(), nodes.size(), options_);
    result->thin = thickness_gains(thickness_.get(), nodes.data(), nodes.size(), options_);
    return result;
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

void InnerGathers::append(const V3f& position, Gathered& gathered, std::vector<Rgb>& thin) const {
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
    const Gathered& nodes = here->at_nodes;
    const std::size_t groups = nodes.groups, layers = nodes.knots * groups, row = gathered.coverage.size();
    gathered.exitance.resize((row + 1) * groups, Rgb(0.0f));
    gathered.coverage.resize(row + 1, Rgb(0.0f));
    gathered.layers.resize((row + 1) * layers, Rgb(0.0f));
    if (!here->thin.empty()) thin.resize(row + 1, Rgb(0.0f));
    for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t step[3] = {corner & 1, corner >> 1 & 1, corner >> 2};
        float weight = 1.0f;
        for (int axis = 0; axis < 3; ++axis) weight *= step[axis] ? beyond[axis] : 1.0f - beyond[axis];
        const std::size_t node = ((first[2] + step[2]) * kNodes + first[1] + step[1]) * kNodes + first[0] + step[0];
        for (std::size_t g = 0; g < groups; ++g) {
            gathered.exitance[row * groups + g] += nodes.exitance[node * groups + g] * weight;
        }
        gathered.coverage[row] += nodes.coverage[node] * weight;
        for (std::size_t k = 0; k < layers; ++k) {
            gathered.layers[row * layers + k] += nodes.layers[node * layers + k] * weight;
        }
        if (!here->thin.empty()) thin[row] += here->thin[node] * weight;
    }
}

}  // namespace frazil
