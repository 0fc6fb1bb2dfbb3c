#include "frazil/material/noise.h"

namespace frazil {
namespace {

float fade(float t) {
    return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}

// One of twelve directions to the edges of a cube, dotted with the offset.
float gradient(std::uint32_t bits, float x, float y, float z) {
    const std::uint32_t h = bits & 15U;
    const float u = h < 8 ? x : y;
    const float v = h < 4 ? y : (h == 12 || h == 14 ? x : z);
    return ((h & 1U) ? -u : u) + ((h & 2U) ? -v : v);
}

// Smoothly between the values that the eight corners of the lattice cell give.
template <class Value, class Corner>
Value interpolate(const V3f& place, std::uint32_t seed, const Corner& corner) {
    const float fx = std::floor(place.x), fy = std::floor(place.y), fz = std::floor(place.z);
    const int x = int(fx), y = int(fy), z = int(fz);
    const float dx = place.x - fx, dy = place.y - fy, dz = place.z - fz;
    const float u = fade(dx), v = fade(dy), w = fade(dz);
    const auto at = [&](int i, int j, int k) {
        return corner(cell_hash(x + i, y + j, z + k, seed), dx - float(i), dy - float(j), dz - float(k));
    };
    const auto mix = [](const Value& a, const Value& b, float t) { return a + (b - a) * t; };
    return mix(mix(mix(at(0, 0, 0), at(1, 0, 0), u), mix(at(0, 1, 0), at(1, 1, 0), u), v),
               mix(mix(at(0, 0, 1), at(1, 0, 1), u), mix(at(0, 1, 1), at(1, 1, 1), u), v), w);
}

constexpr float kGradientVariance = 0.0729f;  // of gradient_noise over space

// How much of an octave is seen: a footprint wider than half a cell sees its mean, which is 0.
float octave_seen(float footprint, float frequency) {
    return std::clamp(2.0f - 4.0f * footprint * frequency, 0.0f, 1.0f);
}

}  // namespace

V3f cell_point(int x, int y, int z, std::uint32_t seed) {
    const std::uint32_t h = cell_hash(x, y, z, seed);
    constexpr float kTenBits = 1.0f / 1024.0f;
    return V3f(float(x), float(y), float(z)) +
           V3f(float(h & 1023U) + 0.5f, float((h >> 10) & 1023U) + 0.5f, float((h >> 20) & 1023U) + 0.5f) * kTenBits;
}

float gradient_noise(const V3f& place, std::uint32_t seed) {
    return interpolate<float>(place, seed,
                              [](std::uint32_t h, float x, float y, float z) { return gradient(h >> 16, x, y, z); });
}

V3f vector_noise(const V3f& place, std::uint32_t seed) {
    return interpolate<V3f>(place, seed, [](std::uint32_t h, float x, float y, float z) {
        return V3f(gradient(h >> 8, x, y, z), gradient(h >> 16, x, y, z), gradient(h >> 24, x, y, z));
    });
}

float fractal_variance_left_out(int octaves, float footprint) {
    float sum = 0.0f, strength = 1.0f, frequency = 1.0f;
    for (int octave = 0; octave < octaves; ++octave) {
        const float seen = octave_seen(footprint, frequency);
        sum += (1.0f - seen * seen) * strength * strength;
        strength *= 0.5f, frequency *= kLacunarity;
    }
    return sum * kGradientVariance;
}

float fractal_noise(const V3f& place, int octaves, float footprint, std::uint32_t seed) {
    float sum = 0.0f, strength = 1.0f, frequency = 1.0f;
    for (int octave = 0; octave < octaves; ++octave) {
        const float seen = octave_seen(footprint, frequency);
        if (seen == 0.0f) break;
        sum += seen * strength * gradient_noise(place * frequency, seed + std::uint32_t(octave));
        strength *= 0.5f, frequency *= kLacunarity;
    }
    return sum;
}

CellWall nearest_cell_wall(const V3f& place, float reach, std::uint32_t seed) {
    const int x = int(std::floor(place.x)), y = int(std::floor(place.y)), z = int(std::floor(place.z));
    const V3f inside(place.x - float(x), place.y - float(y), place.z - float(z));
    // The squared distance from the place to a lattice cell, by axis.
    float gap[3][5];
    for (int axis = 0; axis < 3; ++axis) {
        for (int i = -2; i <= 2; ++i) {
            const float g = std::max(0.0f, std::max(float(i) - inside[axis], inside[axis] - float(i + 1)));
            gap[axis][i + 2] = g * g;
        }
    }
    const auto visit = [&](float& within2, const auto& see) {
        for (int k = -2; k <= 2; ++k) {
            for (int j = -2; j <= 2; ++j) {
                const float side = gap[2][k + 2] + gap[1][j + 2];
                if (side > within2) continue;
                for (int i = -2; i <= 2; ++i) {
                    if (side + gap[0][i + 2] <= within2) see(i, j, k);
                }
            }
        }
    };
    // The nearest point: its own cell's first, which leaves little to look through.
    V3f nearest = cell_point(x, y, z, seed) - place;
    V3i nearest_cell(0);
    float best = nearest.length2();
    visit(best, [&](int i, int j, int k) {
        const V3f point = cell_point(x + i, y + j, z + k, seed) - place;
        if (point.length2() < best) best = point.length2(), nearest = point, nearest_cell = V3i(i, j, k);
    });
    // A wall stands half way between two points: those within reach are of points not much farther than the nearest.
    CellWall wall;
    float within = std::sqrt(best) + 2.0f * reach;
    within *= within;
    visit(within, [&](int i, int j, int k) {
        if (V3i(i, j, k) == nearest_cell) return;
        const V3f point = cell_point(x + i, y + j, z + k, seed) - place, across = point - nearest;
        const float length = across.length();
        if (!(length > 1e-6f)) return;
        const float distance = (point + nearest).dot(across) / (2.0f * length);
        if (distance >= wall.distance || distance > reach) return;
        const V3i& n = nearest_cell;
        const std::uint32_t id = cell_hash(x + i, y + j, z + k, seed) ^ cell_hash(x + n.x, y + n.y, z + n.z, seed);
        wall = {distance, across / length, id};
    });
    return wall;
}

}  // namespace frazil
