#include "frazil/render/thickness.h"

#include "frazil/base/parallel.h"
#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"
#include "frazil/translucency/fresnel.h"
#include "frazil/translucency/half_space.h"

namespace frazil {
namespace {

constexpr int kChords = 16;
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
                                const Rgb& traced_once, const Shells* shells, PlacementMask mask) {
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
        std::vector<float> lengths(net.size());
        for (std::size_t k = begin; k < end; ++k) {
            net.draw(kSeed, static_cast<std::uint32_t>(k), u);
            if (!find_chords(points.positions[k], points.normals[k], u, scene, shells, mask, lengths)) continue;
            if (getenv("FRAZIL_WALK")) {
                const int walks = atoi(getenv("FRAZIL_WALK"));
                for (int c = 0; c < 3; ++c) {
                    Sampler random(kSeed, static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(c));
                    const float sigma_t = medium.sigma_s_prime[c] + medium.sigma_a[c], alpha = medium.sigma_s_prime[c] / sigma_t;
                    const V3f inward = -points.normals[k];
                    const auto [s, t] = tangent_frame(inward);
                    double sum = 0.0;
                    for (int w = 0; w < walks; ++w) {
                        const V3f local = cosine_hemisphere(random.next_2d());
                        V3f d = s * local.x + t * local.y + inward * local.z, o = offset_origin(points.positions[k], inward);
                        float weight = 1.0f;
                        for (int step = 0; step < 3000; ++step) {
                            const float free = -std::log1p(-random.next_1d()) / sigma_t;
                            Ray ray{o, d};
                            ray.t_max = free;
                            Hit hit;
                            if (scene.intersect(ray, hit, mask)) { if (step || !getenv("FRAZIL_CLEAR")) sum += weight; break; }
                            o = o + d * free;
                            weight *= alpha;
                            if (weight < 0.1f) { if (random.next_1d() < 0.5f) break; weight *= 2.0f; }
                            const V2f u = random.next_2d();
                            const float z = 1.0f - 2.0f * u.x, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * u.y;
                            d = V3f(r * std::cos(phi), r * std::sin(phi), z);
                        }
                    }
                    float clear = 0.0f;
                    if (getenv("FRAZIL_CLEAR")) for (const float l : lengths) clear += std::exp(-medium.sigma_s_prime[c] * l) / float(lengths.size());
                    gain[k][c] = static_cast<float>(sum / walks) / (returned[c] * (1.0f - clear));
                }
                continue;
            }
            for (int c = 0; c < 3; ++c) {
                const float most = 1.0f - returned[c], plane = returned[c] - traced_once[c];
                if (!(most > 0.0f && plane > 0.0f)) continue;
                float absorbed = 0.0f;
                for (const float length : lengths) absorbed -= std::expm1(-medium.sigma_a[c] * stretch * length / most);
                absorbed *= most / static_cast<float>(lengths.size());
                if (getenv("FRAZIL_MEAN")) {
                    float m = 0; for (const float length : lengths) m += length / float(lengths.size());
                    absorbed = -most * std::expm1(-medium.sigma_a[c] * stretch * m / most);
                }
                float clear = 0.0f, straight = 0.0f;
                if (getenv("FRAZIL_CLEAR")) for (const float l : lengths) {
                    clear += std::exp(-medium.sigma_s_prime[c] * l) / float(lengths.size());
                    straight += std::exp(-(medium.sigma_a[c] + medium.sigma_s_prime[c]) * l) / float(lengths.size());
                }
                gain[k][c] = ((1.0f - absorbed - straight) / (1.0f - clear) - traced_once[c]) / plane;
            }
        }
    });
    return gain;
}

}  // namespace frazil
