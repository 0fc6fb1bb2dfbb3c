#include "frazil/render/thickness.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/morton_order.h"
#include "frazil/base/parallel.h"
#include "frazil/base/trigonometry.h"
#include "frazil/render/chords.h"
#include "frazil/translucency/fresnel.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

// Parts that scatter less of the light have none of it to gain.
constexpr float kThinnest = 1e-3f;
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
        const std::size_t first = at * ChordFinder::kChords;
        if (!finder.is_closed(chords.subspan(first, ChordFinder::kChords))) continue;
        finder.draw(kSeed + 1, which[at], u);
        finder.draw(kSeed + 2, which[at], u_away);
        for (std::size_t i = 0; i < ChordFinder::kChords; ++i) {
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

// What is absorbed of light that could go `way` metres, of which a half space absorbs `most`.
float absorbed_part(float sigma_a, float way, float most) {
    const float t = std::tanh(sigma_a * way * (2.0f - most) / (2.0f * most));
    return 2.0f * most * t / (2.0f - most + most * t);
}

}  // namespace

std::vector<Rgb> thickness_gain(const PointSet& points, const RayScene& scene, const Medium& medium, float traced,
                                float seen_through, const Shells* shells, PlacementMask mask) {
    const auto albedo_of = [&](double alpha) { return half_space_albedo(alpha, medium.eta); };
    Rgb returned(1.0f), once(0.0f);  // A, and what of it is traced
    for (int c = 0; c < 3; ++c) {
        const double scatter = medium.sigma_s_prime[c];
        const HalfSpaceAlbedo plane = albedo_of(scatter / (scatter + medium.sigma_a[c]));
        returned[c] = static_cast<float>(plane.all());
        once[c] = traced * static_cast<float>(plane.single);
    }
    const float white_once = traced > 0.0f ? traced * static_cast<float>(albedo_of(1.0).single) : 0.0f;
    // Of light that is scattered once in an index-matched half space, from all around [Chandrasekhar1960].
    const float matched_once = 2.0f / 3.0f * (1.0f - std::log(2.0f));
    const float stretch = medium.eta * medium.eta / (1.0f - fresnel_average(medium.eta));
    std::vector<Rgb> gain(points.size(), Rgb(1.0f));
    const ChordFinder finder(scene, shells, mask);
    const std::vector<std::uint32_t> order = morton_order(points.positions);
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        const std::span<const std::uint32_t> which = std::span(order).subspan(begin, end - begin);
        const std::vector<Chord> all_chords = finder.find(points, which, kSeed);
        const std::vector<OnceScattered> all_places =
            traced > 0.0f ? scatter_once(all_chords, which, medium.sigma_s_prime, finder)
                          : std::vector<OnceScattered>(all_chords.size());
        for (std::size_t at = 0; at < which.size(); ++at) {
            const std::span chords = std::span(all_chords).subspan(at * ChordFinder::kChords, ChordFinder::kChords);
            const std::span places = std::span(all_places).subspan(at * ChordFinder::kChords, ChordFinder::kChords);
            const std::size_t k = which[at];
            if (!finder.is_closed(chords)) continue;
            for (int c = 0; c < 3; ++c) {
                const float most = 1.0f - returned[c], plane = returned[c] - once[c];
                if (!(most > 0.0f && plane > 0.0f)) continue;
                const float scatter = medium.sigma_s_prime[c], absorb = medium.sigma_a[c], all_of = scatter + absorb;
                // Sums over the chords of what is absorbed, what goes straight through or is scattered once, and how much
                // of these a white body would let through: the core's light stands for the rest of it.
                float absorbed = 0.0f, traced_out = 0.0f, clear = 0.0f;
                for (std::size_t i = 0; i < chords.size(); ++i) {
                    const float length = chords[i].length, way = places[i].way;
                    const float scattered = scatter * places[i].metres / matched_once;
                    absorbed += absorbed_part(absorb, stretch * length, most);
                    traced_out += seen_through * std::exp(-all_of * length) +
                                  once[c] * all_of / scatter * scattered * std::exp(-all_of * way);
                    clear +=
                        seen_through * std::exp(-scatter * length) + white_once * scattered * std::exp(-scatter * way);
                }
                const float all = static_cast<float>(chords.size());
                if (!(all - clear > kThinnest * all)) continue;
                const float core = (all - absorbed - traced_out) / (all - clear) * (1.0f - white_once);
                gain[k][c] = std::max(core, 0.0f) / plane;
            }
        }
    });
    return gain;
}

}  // namespace frazil
