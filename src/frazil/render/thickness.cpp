#include "frazil/render/thickness.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"
#include "frazil/render/chords.h"
#include "frazil/render/drift.h"
#include "frazil/render/rays_each.h"
#include "frazil/translucency/fresnel.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

// Parts that scatter less of the light have none of it to gain.
constexpr float kThinnest = 1e-3f;
// Free paths; from nearer to the surface the slope of what it adds itself is that of a plane, without limit.
constexpr float kOnSurface = 2e-3f;
constexpr std::uint32_t kSeed = 0x74686963U;

// Light that is scattered once, at a place on a chord.
struct OnceScattered {
    float way = 0.0f;     // from the chord's beginning, and on from there in any direction to where the body ends
    float metres = 0.0f;  // of the chord that the place stands for: 1 / its density; 0: there is none
};

V3f uniform_sphere(const V2f& u) {
    const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

// A depth, as `way`, drawn by the free path of one channel in three, cut off at the chord's end.
OnceScattered draw_place(const Chord& chord, const Rgb& sigma_s, const V2f& u) {
    const int drawn = std::min(static_cast<int>(3.0f * u.x), 2);
    const auto reach = [&](int c) { return -std::expm1(-sigma_s[c] * chord.length); };
    if (!(reach(drawn) > 0.0f)) return {};
    const float depth = std::min(-std::log1p(-u.y * reach(drawn)) / sigma_s[drawn], chord.length);
    float density = 0.0f;
    for (int c = 0; c < 3; ++c) {
        if (reach(c) > 0.0f) density += sigma_s[c] * std::exp(-sigma_s[c] * depth) / reach(c) / 3.0f;
    }
    return {depth, 1.0f / density};
}

// One place on every chord of some points. Of points that are of no closed body none is asked.
std::vector<OnceScattered> scatter_once(std::span<const Chord> chords, std::span<const std::uint32_t> which,
                                        const Rgb& sigma_s, const ChordFinder& finder) {
    std::vector<OnceScattered> places(chords.size());
    std::vector<Ray> rays;
    std::vector<std::size_t> index;  // of each ray
    std::vector<V2f> u, u_away;
    for (std::size_t at = 0; at < which.size(); ++at) {
        const std::size_t first = at * finder.chords();
        if (!finder.is_closed(chords.subspan(first, finder.chords()))) continue;
        finder.draw(kSeed + 1, which[at], u);
        finder.draw(kSeed + 2, which[at], u_away);
        for (std::size_t i = 0; i < finder.chords(); ++i) {
            const Chord& chord = chords[first + i];
            OnceScattered& place = places[first + i];
            place = draw_place(chord, sigma_s, u[i]);
            if (place.metres == 0.0f) continue;
            rays.push_back({chord.ray.origin + chord.ray.direction * place.way, uniform_sphere(u_away[i])});
            index.push_back(first + i);
        }
    }
    const std::vector<float> on = finder.ways_out(rays);
    for (std::size_t i = 0; i < on.size(); ++i) places[index[i]].way += on[i];
    return places;
}

// Rays all around from below each point, where half of the light is absorbed that enters a half space; an error of what is
// absorbed counts by how much that is, about the root of 1 - alpha.
constexpr int kMostAround = 64, kLeastOfMost = 4, kFewestAround = 4;
constexpr float kRootOfMost = 0.25f;

int rays_around(const PointSet& points, const Medium& medium) {
    float most = 0.0f;  // of 1 - alpha
    for (int c = 0; c < 3; ++c) {
        most = std::max(most, medium.sigma_a[c] / (medium.sigma_a[c] + medium.sigma_s_prime[c]));
    }
    const float many = std::clamp(std::sqrt(most) / kRootOfMost, 1.0f / kLeastOfMost, 1.0f) * kMostAround;
    const float free_path = 1.0f / max_component(medium.sigma_s_prime + medium.sigma_a);
    return rays_each(points, free_path, static_cast<int>(std::bit_ceil(static_cast<unsigned>(many))), kFewestAround);
}

struct Way {
    float length;   // to where the body ends, metres; below zero where it begins outside
    float inwards;  // its cosine to the way inwards
};

// From its centre.
V3f place_in(const std::array<V3f, 2>& axes, std::uint32_t sequence, std::uint32_t sample) {
    Sampler sampler(kSeed + 4, sequence, sample);
    sampler.set_dimension(2);  // whose samples come in another order than directions
    const V2f u = sampler.next_2d();
    const float r = std::sqrt(u.x), phi = 2.0f * kPi * u.y;
    return axes[0] * (r * std::cos(phi)) + axes[1] * (r * std::sin(phi));
}

// `first` is the number of which[0] among all points.
std::vector<Way> ways_around(const PointSet& points, const FirstScattering& below, std::span<const std::uint32_t> which,
                             std::size_t first, const ScrambledNet& net, const ChordFinder& finder) {
    std::vector<Ray> rays;
    std::vector<Way> ways;
    std::vector<V2f> u(net.size());
    for (const std::uint32_t point : which) {
        const auto sequence = static_cast<std::uint32_t>(first++);
        net.draw_part(kSeed + 3, sequence, u);
        for (std::size_t i = 0; i < u.size(); ++i) {
            V3f place = below.centers[point];
            if (!below.axes.empty()) place += place_in(below.axes[point], sequence, static_cast<std::uint32_t>(i));
            rays.push_back({place, uniform_sphere(u[i])});
            ways.push_back({0.0f, -points.normals[point].dot(rays.back().direction)});
        }
    }
    const std::vector<float> lengths = below.axes.empty() ? finder.ways_out(rays) : finder.ways_out_if_inside(rays);
    for (std::size_t i = 0; i < ways.size(); ++i) ways[i].length = lengths[i];
    return ways;
}

}  // namespace

ThinMedium ThinMedium::of(const Medium& medium, float traced) {
    const auto alpha = [&](int c) {
        const double scatter = medium.sigma_s_prime[c];
        return scatter / (scatter + medium.sigma_a[c]);
    };
    ThinMedium thin{medium,
                    {EvenLight(alpha(0), medium.eta), EvenLight(alpha(1), medium.eta), EvenLight(alpha(2), medium.eta)},
                    traced};
    const double white = half_space_albedo(1.0, medium.eta).single;
    for (int c = 0; c < 3; ++c) {
        const HalfSpaceAlbedo albedo = half_space_albedo(alpha(c), medium.eta);
        thin.plane[c] = static_cast<float>((albedo.all() - traced * albedo.single) / (1.0 - traced * white));
    }
    return thin;
}

Rgb thin_gain(const Rgb& exponent, const Rgb& plane) {
    Rgb gain(1.0f);
    for (int c = 0; c < 3; ++c) {
        if (plane[c] > 0.0f && plane[c] < 1.0f) {
            gain[c] = std::max(0.0f, 1.0f - std::exp(-exponent[c]) * (1.0f - plane[c])) / plane[c];
        }
    }
    return gain;
}

Thinness thinness(const PointSet& points, FirstScattering below, const RayScene& scene, const ThinMedium& thin,
                  float seen_through, const Shells* shells, PlacementMask mask) {
    const Medium& medium = thin.medium;
    Rgb once(0.0f);  // light of one scattering that a half space returns and rays trace
    float white_once = 0.0f;
    if (thin.traced > 0.0f) {
        white_once = thin.traced * static_cast<float>(half_space_albedo(1.0, medium.eta).single);
        for (int c = 0; c < 3; ++c) {
            const double scatter = medium.sigma_s_prime[c];
            once[c] = thin.traced *
                      static_cast<float>(half_space_albedo(scatter / (scatter + medium.sigma_a[c]), medium.eta).single);
        }
    }
    // Of light that is scattered once in an index-matched half space, from all around [Chandrasekhar1960].
    const float matched_once = 2.0f / 3.0f * (1.0f - std::log(2.0f));
    Thinness result{std::vector<Rgb>(points.size(), Rgb(1.0f)), std::vector<Rgb>(2 * points.size(), Rgb(0.0f)),
                    std::vector<float>(points.size(), 0.0f)};
    if (medium.sigma_a == Rgb(0.0f)) return result;
    const float free_path = 1.0f / max_component(medium.sigma_s_prime + medium.sigma_a);
    const ChordFinder finder(scene, shells, mask,
                             rays_each(points, free_path, ChordFinder::kMost, ChordFinder::kFewest));
    const ScrambledNet net(rays_around(points, medium));
    const std::size_t around = net.size();
    if (below.centers.empty()) {
        for (std::size_t k = 0; k < points.size(); ++k) {
            below.centers.push_back(offset_origin(points.positions[k], -points.normals[k]));
            below.depths.push_back((below.centers[k] - points.positions[k]).dot(-points.normals[k]));
        }
    }
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        const std::span<const std::uint32_t> which = std::span(order).subspan(begin, end - begin);
        const std::vector<Chord> all_chords = finder.find(points, which, begin, kSeed);
        const std::vector<Way> all_ways = ways_around(points, below, which, begin, net, finder);
        const std::vector<OnceScattered> all_places =
            thin.traced > 0.0f ? scatter_once(all_chords, which, medium.sigma_s_prime, finder)
                               : std::vector<OnceScattered>(all_chords.size());
        for (std::size_t at = 0; at < which.size(); ++at) {
            const std::span chords = std::span(all_chords).subspan(at * finder.chords(), finder.chords());
            const std::span places = std::span(all_places).subspan(at * finder.chords(), finder.chords());
            const std::span ways = std::span(all_ways).subspan(at * around, around);
            const std::size_t k = which[at];
            if (!finder.is_closed(chords)) continue;
            const auto inside =
                std::count_if(ways.begin(), ways.end(), [](const Way& way) { return way.length >= 0.0f; });
            if (inside == 0) continue;
            result.known[k] = float(inside) / float(around);
            const float depth = below.depths[k];
            for (int c = 0; c < 3; ++c) {
                const float scatter = medium.sigma_s_prime[c], all_of = scatter + medium.sigma_a[c];
                if (!(medium.sigma_a[c] > 0.0f && scatter > 0.0f)) continue;
                const EvenLight& light = thin.even_light[std::size_t(c)];
                const bool is_on_surface = depth * all_of < kOnSurface;
                float sum = 0.0f, slope = 0.0f;
                for (const Way& way : ways) {
                    if (way.length < 0.0f) continue;
                    const EvenLight::Exponent there = light.along(way.length * all_of);
                    sum += there.value;
                    if (!is_on_surface || way.inwards > 0.0f) slope += there.slope * way.inwards;
                }
                const EvenLight::Exponent plane_there = light.half_space(depth * all_of);
                slope = slope / float(inside) - (is_on_surface ? 0.0f : plane_there.slope);
                const float at_surface = sum / float(inside) - plane_there.value - slope * depth * all_of;
                // Sums over the chords of what is absorbed, what goes straight through or is scattered once, and how much
                // of these a white body would let through: the core's light stands for the rest of it.
                float absorbed = 0.0f, traced_out = 0.0f, clear = 0.0f, plane = 0.0f, thick = 0.0f, deep = 0.0f;
                // These chords' mean of what a half space sends is what it returns, as the boundary lets it out.
                for (const Chord& chord : chords) thick += light.returned(chord.cosine);
                const float out = light.albedo() * static_cast<float>(chords.size()) / thick;
                for (std::size_t i = 0; i < chords.size(); ++i) {
                    const float length = chords[i].length * all_of, way = places[i].way;
                    const float straight = std::exp(-length), filled = 1.0f - seen_through * straight;
                    const float scattered = scatter * places[i].metres / matched_once;
                    const float cosine = chords[i].cosine * first_scattering_within(length);
                    const float sent = std::min(out * light.returned(cosine), 1.0f);
                    const float at = light.absorbed_at(cosine);
                    const float lost = (1.0f - straight) * std::exp(-at_surface - slope * at) * (1.0f - sent);
                    absorbed += lost;
                    deep += lost * at;
                    plane += filled * sent;
                    traced_out += 1.0f - filled + once[c] * all_of / scatter * scattered * std::exp(-all_of * way);
                    clear += 1.0f - filled + white_once * scattered * std::exp(-scatter * way);
                }
                const float all = static_cast<float>(chords.size());
                if (!(all - clear > kThinnest * all)) continue;
                const float core = std::clamp((all - absorbed - traced_out) / (all - clear), 0.0f, 1.0f);
                result.gain[k][c] = core / thin.plane[c];
                // Against a half space whose chords are as short; all of its light, as far as rays trace none.
                const float as_short = thin.traced > 0.0f ? thin.plane[c] : plane / (all - clear);
                if (core < 1.0f && as_short < 1.0f) {
                    const float mean = std::log((1.0f - as_short) / (1.0f - core));
                    result.exponent[2 * k][c] = absorbed > 0.0f ? mean - slope * deep / absorbed : mean;
                    result.exponent[2 * k + 1][c] = slope;
                }
            }
        }
    });
    return result;
}

}  // namespace frazil
