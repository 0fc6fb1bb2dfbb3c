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

// The mean length of cosine-distributed chords from a point inwards; infinite where one finds no other side.
float mean_chord(const V3f& position, const V3f& normal, std::span<const V2f> u, const RayScene& scene,
                 const Shells* shells, PlacementMask mask) {
    const V3f inward = -normal, origin = offset_origin(position, inward);
    const auto [s, t] = tangent_frame(inward);
    float sum = 0.0f;
    for (const V2f& v : u) {
        const V3f local = cosine_hemisphere(v), direction = s * local.x + t * local.y + inward * local.z;
        Hit hit;
        if (shells) {
            sum += shells->way_through({origin, direction});
        } else if (scene.intersect({origin, direction}, hit, mask)) {
            sum += hit.t;
        } else {
            return std::numeric_limits<float>::infinity();
        }
    }
    return sum / static_cast<float>(u.size());
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
        for (std::size_t k = begin; k < end; ++k) {
            net.draw(kSeed, static_cast<std::uint32_t>(k), u);
            const float length = stretch * mean_chord(points.positions[k], points.normals[k], u, scene, shells, mask);
            if (!std::isfinite(length)) continue;
            for (int c = 0; c < 3; ++c) {
                const float most = 1.0f - returned[c], plane = returned[c] - traced_once[c];
                if (!(most > 0.0f && plane > 0.0f)) continue;
                const float absorbed = -most * std::expm1(-medium.sigma_a[c] * length / most);
                gain[k][c] = (1.0f - absorbed - traced_once[c]) / plane;
            }
        }
    });
    return gain;
}

}  // namespace frazil
