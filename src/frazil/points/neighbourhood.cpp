#include "frazil/points/neighbourhood.h"

#include <bit>

namespace frazil {

void Neighbourhood::reset(double size, double cell, double reach) {
    constexpr double kMostCells = 24.0;
    side_ = static_cast<std::size_t>(std::clamp(std::ceil(size / cell), 1.0, kMostCells));
    last_cell_ = static_cast<float>(side_ - 1);
    width_ = static_cast<float>(size / side_);
    marks_.makeEmpty();
    scale_ = 1.0f / width_;
    reach_ = static_cast<float>(reach);
    marked_.assign(side_ * side_, 0);
    cells_.assign(side_ * side_ * side_, Cell());
    chunks_.clear();
    worlds.clear();
}

std::uint32_t Neighbourhood::mark(const V3f& place) {
    marks_.extendBy(place);
    const std::size_t x = cell_along(place.x), row = cell_along(place.z) * side_ + cell_along(place.y);
    marked_[row] |= 1u << x;
    return static_cast<std::uint32_t>(row * side_ + x);
}

std::uint32_t Neighbourhood::add(const V3f& local, const V3f& normal, const V3f& world) {
    static const Chunk empty = [] {
        Chunk chunk = {};
        std::fill(chunk.x, chunk.x + kLanes, 1e15f);
        return chunk;
    }();
    const auto index = static_cast<std::uint32_t>(worlds.size());
    worlds.push_back(world);

    int from[3], to[3];
    for (int axis = 0; axis < 3; ++axis) {
        from[axis] = cell_along(local[axis] - reach_);
        to[axis] = cell_along(local[axis] + reach_);
    }
    // The distance from the point to a slab of cells; end cells reach outwards without end.
    const auto gap = [&](int cell, int axis) {
        const float low = cell == 0 ? -1e30f : cell * width_,
                    high = cell + 1 == int(side_) ? 1e30f : (cell + 1) * width_;
        return std::max(0.0f, std::max(low - local[axis], local[axis] - high));
    };
    const float reach2 = reach_ * reach_ * 1.0001f + 1e-6f;
    for (int z = from[2]; z <= to[2]; ++z) {
        const float dz = gap(z, 2);
        for (int y = from[1]; y <= to[1]; ++y) {
            std::uint32_t row = marked_[z * side_ + y] & ((2u << to[0]) - (1u << from[0]));
            if (row == 0) continue;
            const float dy = gap(y, 1);
            for (; row != 0; row &= row - 1) {
                const int x = std::countr_zero(row);
                Cell& cell = cells_[(z * side_ + y) * side_ + x];
                const float dx = gap(x, 0);
                if (dx * dx + dy * dy + dz * dz > reach2) continue;
                if (cell.count++ % kLanes == 0) {
                    chunks_.push_back(empty);
                    chunks_.back().next = cell.chunk;
                    cell.chunk = static_cast<std::int32_t>(chunks_.size()) - 1;
                }
                Chunk& list = chunks_[cell.chunk];
                const int lane = list.count++;
                list.x[lane] = local.x;
                list.y[lane] = local.y;
                list.z[lane] = local.z;
                list.nx[lane] = normal.x;
                list.ny[lane] = normal.y;
                list.nz[lane] = normal.z;
                list.points[lane] = index;
            }
        }
    }
    return index;
}

}  // namespace frazil
