#include "frazil/render/drift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/points/point_lookup.h"

namespace frazil {
namespace {

// The kernel's radius: in drift lengths, but so many spacings at least.
constexpr float kReach = 3.0f, kFewestSpacings = 3.0f;
// Light is handed on from places so many to the kernel's radius: points that are nearer to each other go
// together, where several do.
constexpr float kPlaces = 3.0f, kFewestSpacingsTogether = 2.5f;
// Of facing normals, and of the kernel's reach that lies between the surfaces, at least.
constexpr float kGap = 0.1f;
constexpr std::uint32_t kSeed = 0x726f6f6dU;

// Where light is handed on from, and how far it drifts on from there, times area: (places, groups).
struct Sources {
    PointSet places;
    std::vector<Flow> drifts;
};

void add(Flow& sum, const Flow& flow, const Rgb& scale) {
    for (int c = 0; c < 3; ++c) sum[std::size_t(c)] += flow[std::size_t(c)] * scale[c];
}

// Points of one cube of this size whose normals lie in the same octant are one place; with size 0 each is its own.
Sources make_sources(const PointSet& points, const std::vector<Flow>& flows, const Rgb& length,
                     const std::vector<float>& room, float size) {
    using Key = std::array<std::int64_t, 4>;
    const std::size_t n = points.size(), groups = flows.size() / n;
    std::vector<Key> keys(n);
    for (std::size_t k = 0; k < n; ++k) {
        const V3f &p = points.positions[k], &normal = points.normals[k];
        const auto cell = [&](float x) { return static_cast<std::int64_t>(std::floor(double(x) / size)); };
        keys[k] = size > 0.0f ? Key{cell(p.x), cell(p.y), cell(p.z),
                                    (normal.x > 0.0f) + 2 * (normal.y > 0.0f) + 4 * (normal.z > 0.0f)}
                              : Key{static_cast<std::int64_t>(k), 0, 0, 0};
    }
    std::vector<std::uint32_t> order(n);
    std::iota(order.begin(), order.end(), 0U);
    if (size > 0.0f) {
        std::sort(order.begin(), order.end(),
                  [&](std::uint32_t a, std::uint32_t b) { return keys[a] != keys[b] ? keys[a] < keys[b] : a < b; });
    }
    Sources sources;
    for (std::size_t begin = 0, end = 0; begin < n; begin = end) {
        V3d position(0.0), normal(0.0);
        double area = 0.0;
        const std::size_t row = sources.drifts.size();
        sources.drifts.resize(row + groups);
        for (end = begin; end < n && keys[order[end]] == keys[order[begin]]; ++end) {
            const std::uint32_t k = order[end];
            const double own = points.areas[k];
            position += V3d(points.positions[k]) * own;
            normal += V3d(points.normals[k]) * own;
            area += own;
            const float way = points.areas[k] * (room.empty() ? 1.0f : room[k]);
            for (std::size_t g = 0; g < groups; ++g) {
                add(sources.drifts[row + g], flows[k * groups + g], length * way);
            }
        }
        if (end - begin == 1) {
            sources.places.positions.push_back(points.positions[order[begin]]);
            sources.places.normals.push_back(points.normals[order[begin]]);
        } else {
            sources.places.positions.emplace_back(position / std::max(area, 1e-300));
            sources.places.normals.push_back(V3f(normal).normalized());
        }
        sources.places.areas.push_back(static_cast<float>(area));
    }
    return sources;
}

// The kernel (1 - q)² over the squared distance q.
class Kernel {
  public:
    explicit Kernel(float reach) : reach_(reach) {}

    struct Value {
        float weight;
        V3f slope;  // along the first of the two places
    };
    // False beyond its reach, and between surfaces that face each other across what is not the body.
    bool eval(const V3f& from, const V3f& from_normal, const V3f& to, const V3f& to_normal, Value& value) const {
        const V3f way = from - to;
        const float q = way.length2() / (reach_ * reach_), least = kGap * reach_;
        if (q >= 1.0f) return false;
        if (from_normal.dot(to_normal) < -kGap && way.dot(from_normal) < -least && way.dot(to_normal) > least) {
            return false;
        }
        value.weight = (1.0f - q) * (1.0f - q);
        value.slope = way * (-4.0f * (1.0f - q) / (reach_ * reach_));
        return true;
    }

  private:
    float reach_;
};

// What all points around a place weigh together, by their areas, and the gradient of that.
struct Total {
    float weight = 0.0f;
    V3f slope = V3f(0.0f);
};

std::vector<Total> totals_of(const PointSet& places, const PointSet& points, float reach) {
    const PointLookup lookup(points, reach);
    const Kernel kernel(reach);
    std::vector<Total> totals(places.size());
    parallel_for(places.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            Total& total = totals[k];
            const V3f &place = places.positions[k], &normal = places.normals[k];
            lookup.visit(place, [&](std::uint32_t point, std::uint32_t, const V3f& p, const V3f& n) {
                Kernel::Value value;
                if (!kernel.eval(place, normal, p, n, value)) return;
                total.weight += value.weight * points.areas[point];
                total.slope += value.slope * points.areas[point];
            });
        }
    });
    return totals;
}

}  // namespace

void carry_on(const PointSet& points, const std::vector<Flow>& flows, const Rgb& length, std::vector<Rgb>& irradiance,
              const std::vector<float>& room) {
    const std::size_t n = points.size(), groups = n > 0 ? irradiance.size() / n : 0;
    if (groups == 0) return;
    const float spacing = static_cast<float>(points.spacing);
    const float reach = std::max(kReach * max_component(length), kFewestSpacings * spacing);
    if (!(reach > 0.0f)) return;
    const Sources sources = make_sources(points, flows, length, room,
                                         reach > kFewestSpacingsTogether * kPlaces * spacing ? reach / kPlaces : 0.0f);
    const std::vector<Total> totals = totals_of(sources.places, points, reach);
    const PointLookup lookup(sources.places, reach);
    const Kernel kernel(reach);
    // Each place hands its light on along the gradients of the shares that the points around have of their weight there:
    // these add up to nothing, so that no light is lost.
    parallel_for(n, 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t j = begin; j < end; ++j) {
            lookup.visit(points.positions[j], [&](std::uint32_t k, std::uint32_t, const V3f& place, const V3f& normal) {
                Kernel::Value value;
                if (!kernel.eval(place, normal, points.positions[j], points.normals[j], value)) return;
                const Total& total = totals[k];
                const V3f slope = (value.slope - total.slope * (value.weight / total.weight)) * (1.0f / total.weight);
                for (std::size_t g = 0; g < groups; ++g) {
                    const Flow& drift = sources.drifts[k * groups + g];
                    irradiance[j * groups + g] += Rgb(drift[0].dot(slope), drift[1].dot(slope), drift[2].dot(slope));
                }
            });
        }
    });
}

float first_scattering_within(float depth) {
    if (!(depth > 1e-4f)) return 0.0f;
    return depth < 50.0f ? 1.0f - depth / std::expm1(depth) : 1.0f;
}

Room room_of(const PointSet& points, const ChordFinder& finder, float sigma_t) {
    Room room{std::vector<float>(points.size(), 1.0f), std::vector<float>(points.size(), 1.0f)};
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        const std::span<const std::uint32_t> which = std::span(order).subspan(begin, end - begin);
        const std::vector<Chord> all = finder.find(points, which, begin, kSeed);
        for (std::size_t i = 0; i < which.size(); ++i) {
            float inwards = 0.0f, along = 0.0f, cosines = 0.0f, squares = 0.0f;
            for (const Chord& chord : std::span(all).subspan(i * finder.chords(), finder.chords())) {
                const float square = 1.0f - chord.cosine * chord.cosine;
                cosines += chord.cosine;
                squares += square;
                inwards += chord.cosine * first_scattering_within(0.5f * sigma_t * chord.length);
                along += square * first_scattering_within(sigma_t * chord.length);
            }
            room.inwards[which[i]] = inwards / cosines;
            room.along[which[i]] = along / squares;
        }
    });
    return room;
}

}  // namespace frazil
