#include "frazil/material/noise.h"

#include "frazil/base/random.h"

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

float mix(float a, float b, float t) {
    return a + (b - a) * t;
}

}  // namespace

std::uint32_t cell_hash(int x, int y, int z, std::uint32_t seed) {
    return hash(hash(std::uint32_t(x) * 0x8da6b343U ^ std::uint32_t(y) * 0xd8163841U ^ std::uint32_t(z) * 0xcb1ab31fU) +
                seed * 0x9e3779b9U);
}

V3f cell_point(int x, int y, int z, std::uint32_t seed) {
    const std::uint32_t h = cell_hash(x, y, z, seed);
    return V3f(float(x), float(y), float(z)) +
           V3f(to_unit_float(h), to_unit_float(hash(h)), to_unit_float(hash(h + 1U)));
}

float gradient_noise(const V3f& place, std::uint32_t seed) {
    const float fx = std::floor(place.x), fy = std::floor(place.y), fz = std::floor(place.z);
    const int x = int(fx), y = int(fy), z = int(fz);
    const float dx = place.x - fx, dy = place.y - fy, dz = place.z - fz;
    const float u = fade(dx), v = fade(dy), w = fade(dz);
    const auto corner = [&](int i, int j, int k) {
        return gradient(cell_hash(x + i, y + j, z + k, seed) >> 16, dx - float(i), dy - float(j), dz - float(k));
    };
    return mix(mix(mix(corner(0, 0, 0), corner(1, 0, 0), u), mix(corner(0, 1, 0), corner(1, 1, 0), u), v),
               mix(mix(corner(0, 0, 1), corner(1, 0, 1), u), mix(corner(0, 1, 1), corner(1, 1, 1), u), v), w);
}

float fractal_noise(const V3f& place, int octaves, float footprint, std::uint32_t seed) {
    float sum = 0.0f, strength = 1.0f, frequency = 1.0f;
    for (int octave = 0; octave < octaves; ++octave) {
        // A footprint wider than half a cell sees the octave's mean, which is 0.
        const float seen = std::clamp(2.0f - 4.0f * footprint * frequency, 0.0f, 1.0f);
        if (seen == 0.0f) break;
        sum += seen * strength * gradient_noise(place * frequency, seed + std::uint32_t(octave));
        strength *= 0.5f, frequency *= 2.03f;
    }
    return sum;
}

CellWall nearest_cell_wall(const V3f& place, std::uint32_t seed) {
    const int x = int(std::floor(place.x)), y = int(std::floor(place.y)), z = int(std::floor(place.z));
    V3f points[125];
    std::uint32_t ids[125];
    int count = 0, nearest = 0;
    float best = 1e30f;
    for (int k = -2; k <= 2; ++k) {
        for (int j = -2; j <= 2; ++j) {
            for (int i = -2; i <= 2; ++i) {
                if (i * i + j * j + k * k > 8) continue;  // corners are too far to matter
                points[count] = cell_point(x + i, y + j, z + k, seed) - place;
                ids[count] = cell_hash(x + i, y + j, z + k, seed);
                const float distance2 = points[count].length2();
                if (distance2 < best) best = distance2, nearest = count;
                ++count;
            }
        }
    }
    CellWall wall;
    wall.distance = 1e30f;
    for (int i = 0; i < count; ++i) {
        if (i == nearest) continue;
        const V3f across = points[i] - points[nearest];
        const float length = across.length();
        if (!(length > 1e-6f)) continue;
        // The wall stands half way between the two points.
        const float distance = (points[i] + points[nearest]).dot(across) / (2.0f * length);
        if (distance < wall.distance) wall = {distance, across / length, ids[i] ^ ids[nearest]};
    }
    return wall;
}

}  // namespace frazil
