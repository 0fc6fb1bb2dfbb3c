#include "frazil/render/openness.h"

#include <algorithm>

#include "frazil/base/trigonometry.h"
#include "frazil/lighting/occlusion.h"
#include "frazil/translucency/normalized_diffusion.h"

namespace frazil {
namespace {

// A profile whose mean radius is about `spacing`.
Profile kernel_of(double spacing) {
    const auto sigma = static_cast<float>(0.25 / spacing);
    return NormalizedDiffusion(Medium{Rgb(sigma), Rgb(sigma), 1.0f});
}

}  // namespace

Openness::Openness(const std::vector<LitPoints>& lit, const RayScene& scene, int samples, std::uint32_t seed)
    : scene_(scene), trees_(lit.size()) {
    OcclusionOptions options;
    options.samples = samples;
    options.seed = seed;
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        const PointSet points = lit[i].points.in_world();
        const Occlusion baked = bake_occlusion(points, scene, options);
        std::vector<Rgb> values;
        values.reserve(2 * points.size());
        for (std::size_t k = 0; k < points.size(); ++k) {
            values.emplace_back(baked.openness[k]);
            values.push_back(baked.bent_normals[k] * baked.openness[k]);
        }
        trees_[i] = std::make_unique<const PointTree>(points, std::move(values), 2, kernel_of(points.spacing));
    }
}

void Openness::answer(Tile& tile) const {
    std::stable_sort(tile.places.begin(), tile.places.end(),
                     [](const SeenPlace& a, const SeenPlace& b) { return a.object < b.object; });
    std::vector<V3f> positions;
    std::vector<Ray> rays;
    std::vector<std::uint8_t> is_hidden;
    for (std::size_t begin = 0, end = 0; begin < tile.places.size(); begin = end) {
        const std::uint32_t object = tile.places[begin].object;
        while (end < tile.places.size() && tile.places[end].object == object) ++end;
        if (const PointTree* tree = trees_[object].get()) {
            positions.clear();
            for (std::size_t i = begin; i < end; ++i) positions.push_back(tile.places[i].position);
            const Gathered sums = tree->gather(positions.data(), positions.size());
            for (std::size_t i = begin; i < end; ++i) {
                const float coverage = sums.coverage[i - begin].x;
                if (!(coverage > 0.0f)) continue;
                const Rgb* sum = &sums.exitance[2 * (i - begin)];
                tile.add_openness(tile.places[i].pixel, std::clamp(sum[0].x / coverage, 0.0f, 1.0f), sum[1] / coverage);
            }
            continue;
        }
        rays.clear();
        for (std::size_t i = begin; i < end; ++i) {
            const SeenPlace& place = tile.places[i];
            const auto [s, t] = tangent_frame(place.normal);
            const V3f local = cosine_hemisphere(place.u);
            rays.push_back(
                {offset_origin(place.position, place.normal), s * local.x + t * local.y + place.normal * local.z});
        }
        is_hidden.resize(rays.size());
        scene_.are_occluded(rays, is_hidden);
        tile.rays += rays.size();
        for (std::size_t i = begin; i < end; ++i) {
            if (!is_hidden[i - begin]) tile.add_openness(tile.places[i].pixel, 1.0f, rays[i - begin].direction);
        }
    }
    tile.places.clear();
}

}  // namespace frazil
