#include "frazil/points/neighbourhood.h"

namespace frazil {
namespace {

constexpr std::uint32_t kLanes = 8;
constexpr float kCellWidth = 1.0f;  // beside the largest reach
constexpr float kReachSlack = 1.0f + 1e-4f;
constexpr std::uint32_t kMostFirstRoom = 32;

}  // namespace

float reach_of(const Patch& patch, double rounding) {
    return (patch.radius + patch.largest_spacing * kReachSlack) * kReachSlack + float(rounding);
}

void Neighbourhood::reset(const std::vector<Patch>& patches, double rounding, float least_cosine) {
    patches_ = patches.data();
    least_cosine_ = least_cosine;
    worlds.clear();
    const std::size_t count = patches.size();

    Box3f centers;
    slots_.reach = 0.0f;
    for (const Patch& patch : patches) {
        centers.extendBy(patch.center);
        slots_.reach = std::max(slots_.reach, reach_of(patch, rounding));
    }
    in_reach_ = Box3f(centers.min - V3f(slots_.reach * kReachSlack), centers.max + V3f(slots_.reach * kReachSlack));

    // Cells about as wide as the reach; wider where there would be many more than patches.
    float width = kCellWidth * slots_.reach;
    const V3f extent = centers.max - centers.min;
    std::size_t cells;
    while (true) {
        cells = 1;
        for (int axis = 0; axis < 3; ++axis) {
            slots_.counts[axis] = 1 + static_cast<int>(std::min(1e6f, extent[axis] / width));
            cells *= slots_.counts[axis];
        }
        if (cells <= 27 + 8 * count) break;
        width *= 1.5f;
    }
    slots_.origin = centers.min;
    slots_.last_cell = V3f(slots_.counts - V3i(1));
    slots_.scale = 1.0f / width;

    // Count patches into cells.
    slots_.starts.assign(cells + 1, 0);
    cells_.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        const V3f& c = patches[i].center;
        const int x = slots_.cell_along(c.x, 0), y = slots_.cell_along(c.y, 1), z = slots_.cell_along(c.z, 2);
        cells_[i] = (z * slots_.counts.y + y) * slots_.counts.x + x;
        ++slots_.starts[cells_[i]];
    }
    std::uint32_t sum = 0;
    for (std::uint32_t& start : slots_.starts) sum += start, start = sum;
    for (std::vector<float>* row :
         {&slots_.x, &slots_.y, &slots_.z, &slots_.nx, &slots_.ny, &slots_.nz, &slots_.reach2}) {
        if (row->size() < count + kLanes) row->resize(count + kLanes);
    }
    if (slots_.patches.size() < count) slots_.patches.resize(count);
    lists_.resize(count);
    used_ = 0;
    for (std::size_t i = count; i-- > 0;) {
        const std::uint32_t slot = --slots_.starts[cells_[i]];
        const Patch& patch = patches[i];
        const float reach = reach_of(patch, rounding), spacings = reach / patch.largest_spacing;
        slots_.x[slot] = patch.center.x;
        slots_.y[slot] = patch.center.y;
        slots_.z[slot] = patch.center.z;
        slots_.nx[slot] = patch.normal.x;
        slots_.ny[slot] = patch.normal.y;
        slots_.nz[slot] = patch.normal.z;
        slots_.reach2[slot] = reach * reach;
        slots_.patches[slot] = static_cast<std::uint32_t>(i);
        // Room for most of the points that a flat surface around it has.
        const auto room = std::min(kMostFirstRoom, kLanes * std::uint32_t(1.0f + 0.4f * spacings * spacings));
        lists_[i] = {static_cast<std::uint32_t>(used_), 0, room};
        used_ += room;
    }
    if (points_.size() < used_ + kLanes) {
        points_.resize(used_ + kLanes);
        places_.resize(3 * points_.size());
    }
    if (found_.size() < count + kLanes) {
        found_.resize(count + kLanes);
        distances2_.resize(count + kLanes);
    }
}

void Neighbourhood::grow(List& list) {
    const List old = list;
    list = {static_cast<std::uint32_t>(used_), old.count, 2 * old.capacity};
    used_ += list.capacity;
    if (points_.size() < used_ + kLanes) {
        points_.resize(used_ + used_ / 2 + kLanes);
        places_.resize(3 * points_.size());
    }
    for (int row = 0; row < 3; ++row) {
        const float* from = &places_[3 * std::size_t(old.begin) + row * old.capacity];
        std::copy(from, from + old.count, &places_[3 * std::size_t(list.begin) + row * list.capacity]);
    }
    std::copy(&points_[old.begin], &points_[old.begin] + old.count, &points_[list.begin]);
}

std::uint32_t Neighbourhood::add(const V3f& local, const V3f& normal, const V3f& world) {
    const auto index = static_cast<std::uint32_t>(worlds.size());
    worlds.push_back(world);
    const int count = find_patches(slots_, local, normal, least_cosine_, found_.data(), distances2_.data());
    for (int i = 0; i < count; ++i) {
        List& list = lists_[found_[i]];
        if (list.count == list.capacity) grow(list);
        const Patch& patch = patches_[found_[i]];
        const V3f d = local - patch.center;
        float* x = &places_[3 * std::size_t(list.begin) + list.count];
        x[0] = d.dot(patch.axes[0]);
        x[list.capacity] = d.dot(patch.axes[1]);
        x[2 * list.capacity] = distances2_[i];
        points_[list.begin + list.count++] = index;
    }
    return index;
}

}  // namespace frazil
