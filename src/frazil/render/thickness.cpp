#include "frazil/render/thickness.h"

#include <algorithm>
#include <cmath>

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

// A place on a chord where light is scattered once.
struct ScatteringPlace {
    float way = 0.0f;     // from the chord's beginning, and on from there in any direction to where the body ends
    float metres = 0.0f;  // that it stands for: 1 / its density
};

V3f uniform_sphere(const V2f& u) {
    const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
    return {r * std::cos(phi), r * std::sin(phi), z};
}

// Drawn by the free path of one channel in three, cut off at the chord's end.
ScatteringPlace draw_place(const Chord& chord, const Rgb& sigma_s, const V2f& u, const V2f& u_away,
                           const ChordFinder& finder) {
    const int drawn = std::min(static_cast<int>(3.0f * u.x), 2);
    const auto reach = [&](int c) { return -std::expm1(-sigma_s[c] * chord.length); };
    if (!(reach(drawn) > 0.0f)) return {};
    const float depth = std::min(-std::log1p(-u.y * reach(drawn)) / sigma_s[drawn], chord.length);
    float density = 0.0f;
    for (int c = 0; c < 3; ++c) {
        if (reach(c) > 0.0f) density += sigma_s[c] * std::exp(-sigma_s[c] * depth) / reach(c) / 3.0f;
    }
    const float on = finder.way_out({chord.ray.origin + chord.ray.direction * depth, uniform_sphere(u_away)});
    return {depth + on, 1.0f / density};
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
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        std::vector<Chord> chords;
        std::vector<V2f> u, u_away;
        for (std::size_t k = begin; k < end; ++k) {
            if (!finder.find(points, k, kSeed, chords)) continue;
            std::vector<ScatteringPlace> places(chords.size());
            if (traced > 0.0f) {
                finder.draw(kSeed + 1, k, u);
                finder.draw(kSeed + 2, k, u_away);
                for (std::size_t i = 0; i < chords.size(); ++i) {
                    places[i] = draw_place(chords[i], medium.sigma_s_prime, u[i], u_away[i], finder);
                }
            }
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
