#include "frazil/points/neighbourhood.h"

namespace frazil {

void Neighbourhood::reset(double size, double cell, double reach, float least_cosine) {
    constexpr double kMostCells = 24.0;
    cells_ = static_cast<std::size_t>(std::clamp(std::ceil(size / cell), 1.0, kMostCells));
    last_cell_ = static_cast<float>(cells_ - 1);
    width_ = static_cast<float>(size / cells_);
    scale_ = 1.0f / width_;
    reach_ = static_cast<float>(reach);
    least_cosine_ = least_cosine;
    marked_.assign(cells_ * cells_, 0);
    heads_.assign(cells_ * cells_ * cells_, -1);
    chunks_.clear();
    locals.clear();
    normals.clear();
    worlds.clear();
}

void Neighbourhood::mark(const V3f& low, const V3f& high) {
    // A hair wider, so that rounding in interpolation stays inside.
    const float slack = 1e-4f;
    int from[3], to[3];
    for (int axis = 0; axis < 3; ++axis) {
        from[axis] = cell_along(low[axis] - slack);
        to[axis] = cell_along(high[axis] + slack);
    }
    for (int z = from[2]; z <= to[2]; ++z) {
        for (int y = from[1]; y <= to[1]; ++y) {
            marked_[z * cells_ + y] |= (2u << to[0]) - (1u << from[0]);
        }
    }
}

std::uint32_t Neighbourhood::add(const V3f& local, const V3f& normal, const V3f& world) {
    // Lanes without a point lie too far away for any look-up.
    static const Chunk empty = [] {
        Chunk chunk = {};
        std::fill(chunk.x, chunk.x + kLanes, 1e30f);
        return chunk;
    }();
    const auto index = static_cast<std::uint32_t>(locals.size());
    locals.push_back(local);
    normals.push_back(normal);
    worlds.push_back(world);

    int from[3], to[3];
    for (int axis = 0; axis < 3; ++axis) {
        from[axis] = cell_along(local[axis] - reach_);
        to[axis] = cell_along(local[axis] + reach_);
    }
    // The distance from the point to a slab of cells; end cells reach outwards without end.
    const auto gap = [&](int cell, int axis) {
        const float low = cell == 0 ? -1e30f : cell * width_,
                    high = cell + 1 == int(cells_) ? 1e30f : (cell + 1) * width_;
        return std::max(0.0f, std::max(low - local[axis], local[axis] - high));
    };
    const float reach2 = reach_ * reach_ * 1.0001f + 1e-6f;
    for (int z = from[2]; z <= to[2]; ++z) {
        const float dz = gap(z, 2);
        for (int y = from[1]; y <= to[1]; ++y) {
            std::uint32_t row = marked_[z * cells_ + y] & ((2u << to[0]) - (1u << from[0]));
            if (row == 0) continue;
            const float dy = gap(y, 1);
            for (; row != 0; row &= row - 1) {
                const int x = std::countr_zero(row);
                const std::size_t cell = (z * cells_ + y) * cells_ + x;
                const float dx = gap(x, 0);
                if (dx * dx + dy * dy + dz * dz > reach2) continue;
                if (heads_[cell] < 0 || chunks_[heads_[cell]].count == int(kLanes)) {
                    chunks_.push_back(empty);
                    chunks_.back().next = heads_[cell];
                    heads_[cell] = static_cast<std::int32_t>(chunks_.size()) - 1;
                }
                Chunk& list = chunks_[heads_[cell]];
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
