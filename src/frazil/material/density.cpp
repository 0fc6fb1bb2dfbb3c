#include "frazil/material/density.h"

#include <cmath>

#include "frazil/base/error.h"
#include "frazil/material/noise.h"

namespace frazil {
namespace {

constexpr float kFarAway = 1e18f;  // metres; finite, so that 0 times it is 0
constexpr float kStepsPerFeature = 4.0f;
constexpr int kMostSteps = 1024;

constexpr std::size_t kPlaces = 65536;  // of a body that tell its mean
constexpr float kThinnest = 1e-3f;      // mean density that diffusion still knows

constexpr int kProbes = 16384;  // places that tell the mean and the spread of noise

// A low-discrepancy sequence in the unit cube [Roberts2018].
V3f probe(int i) {
    const auto part = [i](double rate) { return float(std::fmod(0.5 + rate * i, 1.0)); };
    return {part(0.8191725133961645), part(0.6710436067037893), part(0.5497004779019703)};
}

// The integral over [begin, end] by two Gauss points: exact for cubics.
template <class Value>
float integral(float begin, float end, const Value& value) {
    constexpr float kNode = 0.57735026918962576f;
    const float middle = 0.5f * (begin + end), half = 0.5f * (end - begin);
    return half * (value(middle - kNode * half) + value(middle + kNode * half));
}

}  // namespace

void check_density(const Density& density, const std::string& path) {
    const auto require = [&](bool holds, const char* rule, double value) {
        if (!holds) throw ValueError(str(path, ": ", rule, ", got ", value, ". Mend the density's input."));
    };
    require(std::isfinite(density.scale) && density.scale >= 0.0f, "density scale must be >= 0", density.scale);
    require(density.absorption >= 0.0f && density.absorption <= 1.0f, "density absorption must be in 0..1",
            density.absorption);
    require(density.contrast >= 0.0f && density.contrast <= 4.0f, "density contrast must be in 0..4", density.contrast);
    require(std::isfinite(density.size) && density.size > 0.0f, "density size must be > 0", density.size);
    require(density.octaves >= 1 && density.octaves <= 8, "density octaves must be in 1..8", density.octaves);
    if (!density.grid) return;
    const DensityGrid& grid = *density.grid;
    require(density.contrast == 0.0f, "density contrast must be 0 beside a grid", density.contrast);
    for (int axis = 0; axis < 3; ++axis)
        require(grid.size[axis] >= 2, "density grid must have >= 2 voxels along each axis", grid.size[axis]);
    for (const float value : grid.values)
        require(std::isfinite(value) && value >= 0.0f, "density grid must be >= 0 and finite", value);
    require(std::isfinite(grid.outside) && grid.outside >= 0.0f, "density outside the grid must be >= 0", grid.outside);
    const float volume = grid.index_to_object.determinant();
    require(std::isfinite(volume) && volume != 0.0f,
            "density grid's matrix must have a finite determinant other than 0", volume);
}

DensityField::DensityField(const Density& density, const M44f& world_to_object, const M44f& world_to_rest)
    : density_(density) {
    if (density.grid) {
        world_to_field_ = world_to_object * density.grid->index_to_object.inverse();
        return;
    }
    M44f to_lattice;
    to_lattice.setScale(V3f(1.0f / density.size));
    world_to_field_ = world_to_rest * to_lattice;
    step_ = density.size / (kStepsPerFeature * std::pow(kLacunarity, float(density.octaves - 1)));
    if (density.contrast == 0.0f) return;
    // Spread 1 before the contrast, mean 1 after it.
    constexpr float kProbed = 512.0f;  // features across
    std::vector<float> noise(kProbes);
    double sum2 = 0.0;
    for (int i = 0; i < kProbes; ++i) {
        noise[std::size_t(i)] = fractal_noise(probe(i) * kProbed, density.octaves, 0.0f, density.seed);
        sum2 += double(noise[std::size_t(i)]) * noise[std::size_t(i)];
    }
    gain_ = density.contrast / float(std::sqrt(sum2 / kProbes));
    double mean = 0.0;
    for (const float n : noise) mean += std::exp(double(gain_) * n);
    offset_ = -float(std::log(mean / kProbes));
}

float mean_density(const Density& density, const Mesh& mesh) {
    if (!density.grid) return density.scale;
    const DensityField field(density, M44f(), M44f());
    const Box3f box = bounds(mesh);
    const V3d center(box.center());
    const int each = int(std::clamp<std::size_t>(kPlaces / std::max<std::size_t>(mesh.triangles.size(), 1), 1, 1024));
    // Tetrahedra from the box's middle to the triangles, by their signed volumes.
    double sum = 0.0, volume = 0.0, whole = 0.0, surface_sum = 0.0, area = 0.0;
    int place = 0;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
        const V3i& t = mesh.triangles[i];
        const V3f& a = mesh.positions[std::size_t(t.x)];
        const V3d cross = triangle_cross(mesh, i);
        const double own_volume = cross.dot(V3d(a) - center) / 6.0, own_area = 0.5 * cross.length();
        double inside = 0.0, on_surface = 0.0;
        for (int k = 0; k < each; ++k) {
            const V3f u = probe(place++);
            const float side = std::sqrt(u.x);
            const V3f on = a * (1.0f - side) + mesh.positions[std::size_t(t.y)] * (side * (1.0f - u.y)) +
                           mesh.positions[std::size_t(t.z)] * (side * u.y);
            inside += field.at(box.center() + (on - box.center()) * std::cbrt(u.z));
            on_surface += field.at(on);
        }
        sum += own_volume * inside / each, volume += own_volume, whole += std::abs(own_volume);
        surface_sum += own_area * on_surface / each, area += own_area;
    }
    if (std::abs(volume) > 1e-3 * whole) return std::max(0.0f, float(sum / volume));
    return area > 0.0 ? float(surface_sum / area) : density.scale;
}

Medium mean_medium(const Medium& medium, const Density& density, float mean) {
    Medium result = medium;
    result.sigma_s_prime *= std::max(mean, kThinnest);
    result.sigma_a *= 1.0f - density.absorption + density.absorption * mean;
    return result;
}

float DensityField::noise_at(const V3f& rest) const {
    return std::exp(gain_ * fractal_noise(rest, density_.octaves, 0.0f, density_.seed) + offset_);
}

float DensityField::grid_at(const V3f& index, const V3i& cell) const {
    const DensityGrid& grid = *density_.grid;
    const V3f at(index.x - float(cell.x), index.y - float(cell.y), index.z - float(cell.z));
    const std::size_t row = std::size_t(grid.size.z), plane = row * std::size_t(grid.size.y);
    const float* v = &grid.values[std::size_t(cell.x) * plane + std::size_t(cell.y) * row + std::size_t(cell.z)];
    const auto mix = [](float a, float b, float t) { return a + (b - a) * t; };
    const auto along_z = [&](const float* w) { return mix(w[0], w[1], at.z); };
    return std::max(0.0f, mix(mix(along_z(v), along_z(v + row), at.y),
                              mix(along_z(v + plane), along_z(v + plane + row), at.y), at.x));
}

template <class Visit>
void DensityField::march_grid(const V3f& origin, const V3f& direction, float length, const Visit& visit) const {
    const DensityGrid& grid = *density_.grid;
    const float outside = grid.outside;
    const auto is_beyond = [outside](float) { return outside; };
    // The part of the way that lies within the lattice.
    float begin = 0.0f, end = length;
    for (int axis = 0; axis < 3; ++axis) {
        const float last = float(grid.size[axis] - 1);
        if (std::abs(direction[axis]) * length < 1e-6f) {
            if (origin[axis] < 0.0f || origin[axis] > last) end = -1.0f;
            continue;
        }
        const float a = -origin[axis] / direction[axis], b = (last - origin[axis]) / direction[axis];
        begin = std::max(begin, std::min(a, b)), end = std::min(end, std::max(a, b));
    }
    if (!(begin < end)) {
        visit(0.0f, length, is_beyond);
        return;
    }
    if (begin > 0.0f && !visit(0.0f, begin, is_beyond)) return;
    // From cell to cell [AmanatidesWoo1987].
    V3i cell;
    V3f next, pace;
    for (int axis = 0; axis < 3; ++axis) {
        const float at = origin[axis] + direction[axis] * begin;
        cell[axis] = std::clamp(int(std::floor(at)), 0, grid.size[axis] - 2);
        const bool is_still = std::abs(direction[axis]) * length < 1e-6f;
        pace[axis] = is_still ? kFarAway : 1.0f / std::abs(direction[axis]);
        const float wall = float(cell[axis] + (direction[axis] > 0.0f ? 1 : 0));
        next[axis] = is_still ? kFarAway : (wall - origin[axis]) / direction[axis];
    }
    float t = begin;
    while (t < end) {
        const int axis = next.x < next.y ? (next.x < next.z ? 0 : 2) : (next.y < next.z ? 1 : 2);
        const float until = std::min(std::max(next[axis], t), end);
        const auto value = [&](float s) {
            V3f index = origin + direction * s;
            for (int k = 0; k < 3; ++k) index[k] = std::clamp(index[k], float(cell[k]), float(cell[k] + 1));
            return grid_at(index, cell);
        };
        if (until > t && !visit(t, until, value)) return;
        t = until;
        cell[axis] += direction[axis] > 0.0f ? 1 : -1;
        if (cell[axis] < 0 || cell[axis] > grid.size[axis] - 2) break;
        next[axis] += pace[axis];
    }
    t = std::max(t, end);
    if (t < length) visit(t, length, is_beyond);
}

template <class Visit>
void DensityField::march(const V3f& world_origin, const V3f& world_direction, float length, const Visit& visit) const {
    length = std::min(length, kFarAway);
    if (!(length > 0.0f)) return;
    const V3f origin = world_origin * world_to_field_;
    V3f direction;
    world_to_field_.multDirMatrix(world_direction, direction);
    if (density_.grid) {
        march_grid(origin, direction, length, visit);
        return;
    }
    const auto is_even = [](float) { return 1.0f; };
    if (gain_ == 0.0f) {
        visit(0.0f, length, is_even);
        return;
    }
    const int steps = int(std::min(std::ceil(length / step_), float(kMostSteps)));
    const float reach = std::min(length, step_ * float(kMostSteps));
    const auto value = [&](float s) { return noise_at(origin + direction * s); };
    for (int i = 0; i < steps; ++i) {
        const float begin = reach * (float(i) / float(steps)), end = reach * (float(i + 1) / float(steps));
        if (!visit(begin, end, value)) return;
    }
    if (reach < length) visit(reach, length, is_even);
}

float DensityField::at(const V3f& position) const {
    const V3f place = position * world_to_field_;
    if (!density_.grid) return density_.scale * (gain_ == 0.0f ? 1.0f : noise_at(place));
    const DensityGrid& grid = *density_.grid;
    V3i cell;
    for (int axis = 0; axis < 3; ++axis) {
        const float last = float(grid.size[axis] - 1);
        if (!(place[axis] >= 0.0f && place[axis] <= last)) return density_.scale * grid.outside;
        cell[axis] = std::min(int(place[axis]), grid.size[axis] - 2);
    }
    return density_.scale * grid_at(place, cell);
}

float DensityField::depth(const V3f& origin, const V3f& direction, float length) const {
    double sum = 0.0;
    march(origin, direction, length, [&](float begin, float end, const auto& value) {
        sum += double(integral(begin, end, value));
        return true;
    });
    return float(sum) * density_.scale;
}

float DensityField::place(const V3f& origin, const V3f& direction, float depth, float most) const {
    double left = density_.scale > 0.0f ? double(depth) / density_.scale : HUGE_VAL;
    float found = most;
    march(origin, direction, most, [&](float begin, float end, const auto& value) {
        const double here = double(integral(begin, end, value));
        if (here < left) {
            left -= here;
            return true;
        }
        // Newton's steps within the bracket [low, high].
        const float wanted = float(left);
        float low = begin, high = end, t = here > 0.0 ? begin + (end - begin) * float(left / here) : begin;
        for (int i = 0; i < 16; ++i) {
            const float off = integral(begin, t, value) - wanted;
            if (std::abs(off) <= 1e-6f * float(here)) break;
            (off > 0.0f ? high : low) = t;
            const float slope = value(t);
            const float next = slope > 0.0f ? t - off / slope : low;
            t = next > low && next < high ? next : 0.5f * (low + high);
        }
        found = t;
        return false;
    });
    return found;
}

}  // namespace frazil
