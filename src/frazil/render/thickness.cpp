#include "frazil/render/thickness.h"

#include "frazil/base/parallel.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"
#include "frazil/translucency/fresnel.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

constexpr int kChords = 16;
// Parts that scatter less of the light have none of it to gain.
constexpr float kThinnest = 1e-3f;
constexpr std::uint32_t kSeed = 0x74686963U;

// The lengths of cosine-distributed chords from a point inwards; false where one finds no other side.
bool find_chords(const V3f& position, const V3f& normal, std::span<const V2f> u, const RayScene& scene,
                 const Shells* shells, PlacementMask mask, std::span<float> lengths) {
    const V3f inward = -normal, origin = offset_origin(position, inward);
    const auto [s, t] = tangent_frame(inward);
    std::size_t k = 0;
    for (const V2f& v : u) {
        const V3f local = cosine_hemisphere(v), direction = s * local.x + t * local.y + inward * local.z;
        Hit hit;
        if (shells) {
            lengths[k++] = shells->way_through({origin, direction});
        } else if (scene.intersect({origin, direction}, hit, mask)) {
            lengths[k++] = hit.t;
        } else {
            return false;
        }
    }
    return true;
}

}  // namespace

std::vector<Rgb> thickness_gain(const PointSet& points, const RayScene& scene, const Medium& medium,
                                const Rgb& traced_once, float seen_through, const Shells* shells, PlacementMask mask) {
    Rgb returned(1.0f);  // A
    for (int c = 0; c < 3; ++c) {
        const double scatter = medium.sigma_s_prime[c];
        returned[c] = static_cast<float>(half_space_albedo(scatter / (scatter + medium.sigma_a[c]), medium.eta).all());
    }
    const float stretch = medium.eta * medium.eta / (1.0f - fresnel_average(medium.eta));
    std::vector<Rgb> gain(points.size(), Rgb(1.0f));
    const ScrambledNet net(kChords);
    parallel_for(points.size(), 256, [&](std::size_t begin, std::size_t end) {
        std::vector<V2f> u(net.size());
        std::vector<float> chords(net.size());
        for (std::size_t k = begin; k < end; ++k) {
            net.draw(kSeed, static_cast<std::uint32_t>(k), u);
            if (!find_chords(points.positions[k], points.normals[k], u, scene, shells, mask, chords)) continue;
            for (int c = 0; c < 3; ++c) {
                const float most = 1.0f - returned[c], plane = returned[c] - traced_once[c];
                if (!(most > 0.0f && plane > 0.0f)) continue;
                const float scatter = medium.sigma_s_prime[c], absorb = medium.sigma_a[c];
                // Sums over the chords of what is absorbed, what goes straight through, and how much of that a white body
                // would let through: the core's light stands for the rest of it.
                float absorbed = 0.0f, straight = 0.0f, clear = 0.0f;
                for (const float chord : chords) {
                    absorbed -= most * std::expm1(-absorb * stretch * chord / most);
                    straight += seen_through * std::exp(-(scatter + absorb) * chord);
                    clear += seen_through * std::exp(-scatter * chord);
                }
                const float all = static_cast<float>(chords.size());
                if (!(all - clear > kThinnest * all)) continue;
                gain[k][c] = ((all - absorbed - straight) / (all - clear) - traced_once[c]) / plane;
            }
        }
    });
    return gain;
}

}  // namespace frazil
