#include "frazil/material/pattern.h"

#include <array>
#include <cmath>

#include "frazil/base/error.h"
#include "frazil/base/random.h"

namespace frazil {
namespace {

constexpr int kPlaneFamilies = 4;
// No gradient noise is larger: along each axis the corners' weighted mean distance is half a cell at most.
constexpr float kMostNoise = 1.5f;
constexpr float kMostOffset = 0.7f;  // of a plane, in pitches
constexpr int kMostPlanes = 6;       // of a family that are looked at one by one
constexpr int kMostPlanesMet = 256;  // along a ray, of all families
// Lines at a flat angle to the surface are widened no further than this.
constexpr float kLeastSine = 0.25f;
// Area of the walls between cells of unit size in a unit of volume, measured.
constexpr float kWallArea = 2.85f;
// Footprints over the size of cells from which their mean begins to count beside the nearest wall, and that see it alone.
constexpr float kFirstMean = 0.05f, kAllMean = 0.3f;

float smooth_step(float low, float high, float x) {
    const float t = std::clamp((x - low) / std::max(high - low, 1e-9f), 0.0f, 1.0f);
    return t * t * (3.0f - 2.0f * t);
}

// From the distance to a sheet in space to the distance along the surface that cuts it.
float along_surface(float distance, const V3f& sheet_normal, const V3f& surface_normal) {
    if (surface_normal == V3f(0.0f)) return distance;
    const float cosine = sheet_normal.dot(surface_normal);
    return distance / std::max(std::sqrt(std::max(0.0f, 1.0f - cosine * cosine)), kLeastSine);
}

V3f axis_of(const Pattern& pattern) {
    return pattern.direction.length2() > 0.0f ? pattern.direction.normalized() : V3f(0, 1, 0);
}

float facing(const Pattern& pattern, const PatternPoint& at) {
    return at.normal.dot(axis_of(pattern));
}

V3f family_normal(std::uint32_t seed, int family) {
    const std::uint32_t h = hash(seed, std::uint32_t(family), 7U);
    const float z = 2.0f * to_unit_float(h) - 1.0f, phi = 2.0f * kPi * to_unit_float(hash(h));
    const float r = std::sqrt(std::max(0.0f, 1.0f - z * z));
    return {r * std::cos(phi), z, r * std::sin(phi)};
}

// Planes of one family stand `size` times the number of families apart, each moved at random, bent by smooth noise and cut
// off where a noise of its own falls short.
struct PlaneFamily {
    float pitch(const Pattern& pattern) const { return pattern.size * kPlaneFamilies; }
    // Of the unbent plane i along the normal: 0 to kMostOffset pitches beyond i.
    float offset(const Pattern& pattern, int i) const {
        return (float(i) + kMostOffset * to_unit_float(hash(seed, std::uint32_t(i)))) * pitch(pattern);
    }
    // The height over the unbent family, in metres.
    float height(const Pattern& pattern, const V3f& p) const {
        float h = p.dot(normal);
        if (pattern.warp > 0.0f) h += pattern.warp * pattern.size * gradient_noise(p / (1.7f * pattern.size), seed);
        return h;
    }
    // Whether no plane, however it is bent, has a line here: most places are told without any noise.
    bool is_clear_of(const Pattern& pattern, const PatternPoint& at) const {
        const float reach = 1.01f * (pattern.warp * pattern.size * kMostNoise +
                                     0.5f * (pattern.width + pattern.feather) + at.footprint);
        const float h = at.position.dot(normal), scale = 1.0f / pitch(pattern);
        const int first = int(std::ceil((h - reach) * scale - kMostOffset)),
                  last = int(std::floor((h + reach) * scale));
        if (last - first > kMostPlanes) return false;
        for (int i = first; i <= last; ++i) {
            if (std::abs(h - offset(pattern, i)) <= reach) return false;
        }
        return true;
    }
    // How much of the plane i is there at p.
    float extent(const Pattern& pattern, const V3f& p, int i, float footprint) const {
        if (pattern.amount >= 1.0f) return 1.0f;
        const float n = 0.5f + 0.6f * fractal_noise(p / (2.5f * pattern.size), 3, footprint / (2.5f * pattern.size),
                                                    seed + 31U * std::uint32_t(i));
        return smooth_step(1.0f - pattern.amount - 0.04f, 1.0f - pattern.amount + 0.12f, n);
    }

    V3f normal = V3f(0.0f);
    std::uint32_t seed = 0;
};

// Rays ask for the same few seeds over and over: each thread remembers some.
const std::array<PlaneFamily, kPlaneFamilies>& plane_families(std::uint32_t seed) {
    struct Known {
        bool is_filled = false;
        std::uint32_t seed = 0;
        std::array<PlaneFamily, kPlaneFamilies> families;
    };
    thread_local std::array<Known, 16> known;
    Known& of_seed = known[hash(seed) % known.size()];
    if (!of_seed.is_filled || of_seed.seed != seed) {
        for (int family = 0; family < kPlaneFamilies; ++family)
            of_seed.families[std::size_t(family)] = {family_normal(seed, family), hash(seed, std::uint32_t(family))};
        of_seed.seed = seed, of_seed.is_filled = true;
    }
    return of_seed.families;
}

float fracture_mask(const Pattern& pattern, const PatternPoint& at) {
    const float widest =
        0.5f * (pattern.width + pattern.feather) + at.footprint;  // of a line, however the plane stands
    float left = 1.0f;
    for (const PlaneFamily& planes : plane_families(pattern.seed)) {
        if (planes.is_clear_of(pattern, at)) continue;
        const float h = planes.height(pattern, at.position);
        const int nearest = int(std::floor(h / planes.pitch(pattern)));
        for (int i = nearest - 1; i <= nearest + 1; ++i) {
            const float away = std::abs(h - planes.offset(pattern, i));
            if (away > widest) continue;
            const float distance = along_surface(away, planes.normal, at.normal);
            const float line = line_mask(distance, pattern.width, pattern.feather, at.footprint);
            if (line > 0.0f) left *= 1.0f - line * planes.extent(pattern, at.position, i, at.footprint);
        }
    }
    return 1.0f - left;
}

// The mean of smooth_step(low, low + wide, u) over u in 0..1.
float mean_step(float low, float wide) {
    const auto sum = [&](float u) {  // from where the step begins
        const float t = std::clamp((u - low) / wide, 0.0f, 1.0f);
        return wide * t * t * t * (1.0f - 0.5f * t) + std::max(0.0f, u - low - wide);
    };
    return sum(1.0f) - sum(0.0f);
}

// What cell walls of one scale cover on average: their area in a unit of volume, cut by a surface.
float mean_cells(const Pattern& pattern, float size, float width, bool on_surface) {
    const float walls = kWallArea * (on_surface ? 0.25f * kPi : 1.0f) / size, sum = std::min(2.0f, walls * width);
    return sum * (1.0f - 0.25f * sum) * mean_step(1.0f - pattern.amount - 0.2f, 0.4f);  // less where walls meet
}

float cells_mask(const Pattern& pattern, const PatternPoint& at) {
    float left = 1.0f, size = pattern.size, width = pattern.width, feather = pattern.feather;
    for (int scale = 0; scale < std::max(1, pattern.scales); ++scale) {
        // A footprint as wide as the cells sees their mean.
        const float mean = smooth_step(kFirstMean, kAllMean, at.footprint / size);
        if (mean > 0.0f) left *= 1.0f - mean * mean_cells(pattern, size, width, at.normal != V3f(0.0f));
        if (mean >= 1.0f) {
            size /= 2.3f, width /= 1.7f, feather /= 1.7f;
            continue;
        }
        const std::uint32_t seed = pattern.seed + 101U * std::uint32_t(scale);
        V3f place = at.position / size;
        if (pattern.warp > 0.0f) {
            const V3f bent = vector_noise(place * 1.3f, seed + 1U), fine = vector_noise(place * 5.1f, seed + 4U);
            place += (bent + fine * 0.25f) * pattern.warp;
        }
        // Flat angles widen a line, and the footprint its edge.
        const float reach = (0.5f * (width + feather) + at.footprint) / size;
        const CellWall wall = nearest_cell_wall(place, reach, seed);
        if (!(wall.distance < 1e30f)) {
            size /= 2.3f, width /= 1.7f, feather /= 1.7f;
            continue;
        }
        const float distance = along_surface(wall.distance * size, wall.normal, at.normal);
        const float line = line_mask(distance, width, feather, at.footprint);
        if (line > 0.0f) {
            // Some walls are open cracks, some are closed.
            const float chance = to_unit_float(hash(wall.id, 5U));
            const float open = smooth_step(1.0f - pattern.amount - 0.2f, 1.0f - pattern.amount + 0.2f, chance);
            left *= 1.0f - (1.0f - mean) * line * open;
        }
        size /= 2.3f, width /= 1.7f, feather /= 1.7f;
    }
    return 1.0f - left;
}

constexpr float kFolded = 0.63661977f;  // the square of a normal variable's mean magnitude: 2 / pi

// A smooth step about a level that is uncertain by a variance: the mean of the steps. A step's slope over +-width has the
// variance width² / 5.
float soft_step(float level, float width, float variance, float value) {
    width = std::sqrt(width * width + 5.0f * variance);
    return smooth_step(level - width, level + width, value);
}

float frost_mask(const Pattern& pattern, const PatternPoint& at) {
    const V3f place = at.position / pattern.size;
    const float footprint = at.footprint / pattern.size;
    const int octaves = 1 + std::max(0, pattern.scales);
    V3f bent = place;
    if (pattern.warp > 0.0f) {
        bent += vector_noise(place, pattern.seed + 11U) * pattern.warp;
    }
    const float growth = fractal_noise(bent, octaves + 2, footprint, pattern.seed);
    // What the footprint leaves out of the growth softens the edge; of the crystals it also leaves the mean of their folds.
    const float growth_variance = fractal_variance_left_out(octaves + 2, footprint);
    const float fine_variance = fractal_variance_left_out(octaves, 6.0f * footprint);
    const float threshold = 1.15f - 1.1f * pattern.amount,
                left_out = 0.55f * 0.55f * growth_variance + 0.36f * 0.36f * (1.0f - kFolded) * fine_variance;
    const float slope = 0.5f * pattern.slope * facing(pattern, at);
    const auto mask = [&](float fine) {
        const float ridge = 1.0f - 2.0f * std::sqrt(fine * fine + kFolded * fine_variance);
        return soft_step(threshold, 0.16f, left_out, 0.5f + 0.55f * growth + 0.18f * ridge + slope);
    };
    // Crystals: fine ridges within the growth, where their crests would reach.
    if (mask(0.0f) == 0.0f) return 0.0f;
    return mask(fractal_noise(bent * 6.0f, octaves, 6.0f * footprint, pattern.seed + 50U));
}

float bubbles_mask(const Pattern& pattern, const PatternPoint& at) {
    const V3f place = at.position / pattern.size;
    const int x = int(std::floor(place.x)), y = int(std::floor(place.y)), z = int(std::floor(place.z));
    float left = 1.0f;
    for (int k = -1; k <= 1; ++k) {
        for (int j = -1; j <= 1; ++j) {
            for (int i = -1; i <= 1; ++i) {
                const std::uint32_t h = cell_hash(x + i, y + j, z + k, pattern.seed + 77U);
                if (to_unit_float(hash(h, 3U)) > pattern.amount) continue;
                const V3f center = cell_point(x + i, y + j, z + k, pattern.seed) * pattern.size;
                const float diameter = pattern.width * (0.35f + 0.65f * to_unit_float(hash(h, 4U)));
                // A spot fades in both directions across a footprint that is wider than it.
                const float blur = at.footprint + 0.5f * pattern.feather;
                const float fading = std::min(1.0f, diameter / std::max(2.0f * blur, 1e-9f));
                left *=
                    1.0f - fading * line_mask((center - at.position).length(), diameter, pattern.feather, at.footprint);
            }
        }
    }
    return 1.0f - left;
}

float snow_mask(const Pattern& pattern, const PatternPoint& at) {
    const V3f place = at.position / pattern.size;
    const int octaves = 2 + std::max(0, pattern.scales);
    const float footprint = at.footprint / pattern.size;
    const float n = fractal_noise(place, octaves, footprint, pattern.seed);
    return soft_step(1.0f - pattern.amount, 0.12f, 0.35f * 0.35f * fractal_variance_left_out(octaves, footprint),
                     facing(pattern, at) + 0.35f * n);
}

float bands_mask(const Pattern& pattern, const PatternPoint& at) {
    const V3f axis = axis_of(pattern);
    float height = at.position.dot(axis);
    if (pattern.warp > 0.0f) {
        height +=
            pattern.warp * pattern.size *
            fractal_noise(at.position / (4.0f * pattern.size), 4, at.footprint / (4.0f * pattern.size), pattern.seed);
    }
    const int nearest = int(std::floor(height / pattern.size));
    const float widest = 0.86f * pattern.width + 0.5f * pattern.feather + at.footprint;
    float left = 1.0f;
    for (int i = nearest - 1; i <= nearest + 1; ++i) {
        const std::uint32_t h = hash(pattern.seed, std::uint32_t(i), 9U);
        if (to_unit_float(h) > pattern.amount) continue;
        const float middle = (float(i) + to_unit_float(hash(h))) * pattern.size;
        if (std::abs(height - middle) > widest) continue;
        const float width = pattern.width * (0.3f + 1.4f * to_unit_float(hash(h, 2U)));
        const float line =
            line_mask(along_surface(std::abs(height - middle), axis, at.normal), width, pattern.feather, at.footprint);
        left *= 1.0f - line * (0.4f + 0.6f * to_unit_float(hash(h, 3U)));
    }
    return 1.0f - left;
}

}  // namespace

float line_mask(float distance, float width, float feather, float footprint) {
    const float half = 0.5f * width, reach = std::max(footprint + 0.5f * feather, 1e-9f);
    const float overlap = std::min(distance + reach, half) - std::max(distance - reach, -half);
    return std::clamp(overlap / (2.0f * reach), 0.0f, 1.0f);
}

void check_pattern(const Pattern& pattern, const std::string& path) {
    const auto require = [&](bool holds, const char* rule, double value) {
        if (!holds) throw ValueError(str(path, ": ", rule, ", got ", value, ". Mend the overlay's input."));
    };
    require(std::isfinite(pattern.size) && pattern.size > 0.0f, "size must be > 0", pattern.size);
    require(std::isfinite(pattern.width) && pattern.width >= 0.0f, "width must be >= 0", pattern.width);
    require(std::isfinite(pattern.feather) && pattern.feather >= 0.0f, "feather must be >= 0", pattern.feather);
    require(pattern.warp >= 0.0f && pattern.warp <= 4.0f, "warp must be in 0..4", pattern.warp);
    require(pattern.scales >= 0 && pattern.scales <= 8, "scales must be in 0..8", pattern.scales);
    require(pattern.amount >= 0.0f && pattern.amount <= 1.0f, "amount must be in 0..1", pattern.amount);
    require(pattern.slope >= -1.0f && pattern.slope <= 1.0f, "slope must be in -1..1", pattern.slope);
    require(is_finite(pattern.direction), "direction must be finite", pattern.direction.x);
}

float eval_pattern(const Pattern& pattern, const PatternPoint& point) {
    switch (pattern.kind) {
        case PatternKind::solid:
            return 1.0f;
        case PatternKind::fracture:
            return fracture_mask(pattern, point);
        case PatternKind::cells:
            return cells_mask(pattern, point);
        case PatternKind::frost:
            return frost_mask(pattern, point);
        case PatternKind::bubbles:
            return bubbles_mask(pattern, point);
        case PatternKind::snow:
            return snow_mask(pattern, point);
        case PatternKind::bands:
            return bands_mask(pattern, point);
    }
    return 0.0f;
}

bool find_fracture(const Pattern& pattern, float opacity, const FractureRay& ray, Sampler& coins, float& t,
                   V3f& normal) {
    // The planes of each family in their order along the ray; a bent one is met within `margin` of where it would be straight.
    struct Walk {
        const PlaneFamily* planes = nullptr;
        float base = 0.0f, speed = 0.0f, margin = 0.0f;
        int plane = 0, step = 1;
        float straight = 0.0f;
        float earliest() const { return straight - margin; }
        void go_to(const Pattern& pattern, int i) {
            plane = i;
            straight = (planes->offset(pattern, i) - base) / speed;
        }
    };
    std::array<Walk, kPlaneFamilies> walks;
    std::size_t count = 0;
    const float bend = pattern.warp * pattern.size;
    for (const PlaneFamily& planes : plane_families(pattern.seed)) {
        Walk walk;
        walk.planes = &planes;
        walk.speed = ray.direction.dot(planes.normal);
        if (std::abs(walk.speed) < 1e-3f) continue;
        walk.base = ray.origin.dot(planes.normal);
        walk.margin = bend / std::abs(walk.speed);
        walk.step = walk.speed > 0.0f ? 1 : -1;
        const float pitch = planes.pitch(pattern), from = (walk.base + walk.speed * ray.t_min) / pitch;
        const float reach = bend / pitch + 1e-3f;
        const int first = int(std::floor(walk.step > 0 ? from - reach - kMostOffset : from + reach));
        walk.go_to(pattern, walk.step > 0 ? first + 1 : first);
        while (walk.straight + walk.margin <= ray.t_min) walk.go_to(pattern, walk.plane + walk.step);
        walks[count++] = walk;
    }

    // Every plane that may be met tosses its coin before it is looked at: most are not worth a noise.
    bool is_found = false;
    for (int k = 0; k < kMostPlanesMet && count > 0; ++k) {
        Walk* walk = &walks[0];
        for (std::size_t i = 1; i < count; ++i) {
            if (walks[i].earliest() < walk->earliest()) walk = &walks[i];
        }
        const float limit = is_found ? t : ray.t_max;
        if (walk->earliest() >= limit) break;
        const PlaneFamily& planes = *walk->planes;
        const int i = walk->plane;
        const float straight = walk->straight, coin = coins.next_1d();
        walk->go_to(pattern, i + walk->step);
        if (coin >= opacity) continue;
        float s = straight;
        for (int refine = 0; refine < (pattern.warp > 0.0f ? 4 : 0); ++refine) {
            s += (planes.offset(pattern, i) - planes.height(pattern, ray.origin + ray.direction * s)) / walk->speed;
        }
        if (s <= ray.t_min || s >= limit) continue;
        const float there = planes.extent(pattern, ray.origin + ray.direction * s, i, ray.radius + ray.spread * s);
        if (coin >= there * opacity) continue;
        t = s, normal = planes.normal, is_found = true;
    }
    return is_found;
}

}  // namespace frazil
