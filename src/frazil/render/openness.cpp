#include "frazil/render/openness.h"

#include <algorithm>

#include "frazil/base/trigonometry.h"
#include "frazil/translucency/normalized_diffusion.h"

namespace frazil {
namespace {

constexpr float kReach = 2.5f;  // of the blend, in spacings
// Places of a pixel within so much of the spacing, whose normals agree, share a blend.
constexpr float kClose = 0.25f, kLeastCosine = 0.9f;

// A profile whose mean radius is about `spacing`.
Profile kernel_of(double spacing) {
    const auto sigma = static_cast<float>(0.25 / spacing);
    return NormalizedDiffusion(Medium{Rgb(sigma), Rgb(sigma), 1.0f});
}

}  // namespace

Openness::Baked::Baked(const PointSet& points, const Occlusion& occlusion) {
    if (!PointBlend::suits(points)) {
        std::vector<Rgb> values;
        values.reserve(2 * points.size());
        for (std::size_t k = 0; k < points.size(); ++k) {
            values.emplace_back(occlusion.openness[k]);
            values.push_back(occlusion.bent_normals[k] * occlusion.openness[k]);
        }
        tree = std::make_unique<const PointTree>(points, std::move(values), 2, kernel_of(points.spacing));
        return;
    }
    blend.emplace(points, kReach);
    for (const std::uint32_t k : blend->order()) {
        openness.push_back(occlusion.openness[k]);
        directions.push_back(occlusion.bent_normals[k] * occlusion.openness[k]);
    }
}

Openness::Openness(const std::vector<LitPoints>& lit, const RayScene& scene, int samples, std::uint32_t seed)
    : scene_(scene), baked_(lit.size()) {
    OcclusionOptions options;
    options.samples = samples;
    options.seed = seed;
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        const PointSet points = lit[i].points.in_world();
        baked_[i] = std::make_unique<const Baked>(points, bake_occlusion(points, scene, options));
    }
}

void Openness::answer(Tile& tile) const {
    std::stable_sort(tile.places.begin(), tile.places.end(),
                     [](const SeenPlace& a, const SeenPlace& b) { return a.object < b.object; });
    for (std::size_t begin = 0, end = 0; begin < tile.places.size(); begin = end) {
        const std::uint32_t object = tile.places[begin].object;
        while (end < tile.places.size() && tile.places[end].object == object) ++end;
        const std::span<const SeenPlace> places(&tile.places[begin], end - begin);
        if (!baked_[object]) {
            trace(places, tile);
        } else if (baked_[object]->tree) {
            gather(*baked_[object]->tree, places, tile);
        } else {
            blend(*baked_[object], places, tile);
        }
    }
    tile.places.clear();
}

void Openness::blend(const Baked& baked, std::span<const SeenPlace> places, Tile& tile) const {
    const float close = kClose / kReach * baked.blend->reach();
    const SeenPlace* last = nullptr;
    float openness = 0.0f, weights = 0.0f;
    V3f directions(0.0f);
    for (const SeenPlace& place : places) {
        const bool is_close = last && last->pixel == place.pixel &&
                              (last->position - place.position).length2() < close * close &&
                              last->normal.dot(place.normal) > kLeastCosine;
        if (!is_close) {
            const auto blend_at = [&](const V3f& normal) {
                openness = 0.0f;
                directions = V3f(0.0f);
                weights = baked.blend->visit(place.position, normal, [&](std::uint32_t k, float weight) {
                    openness += baked.openness[k] * weight;
                    directions += baked.directions[k] * weight;
                });
            };
            blend_at(place.normal);
            if (weights == 0.0f) blend_at(-place.normal);  // a sheet with points on its other side alone
            last = &place;
        }
        if (weights > 0.0f) tile.add_openness(place.pixel, openness / weights, directions / weights);
    }
}

void Openness::gather(const PointTree& tree, std::span<const SeenPlace> places, Tile& tile) const {
    std::vector<V3f> positions;
    for (const SeenPlace& place : places) positions.push_back(place.position);
    const Gathered sums = tree.gather(positions.data(), positions.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
        const float coverage = sums.coverage[i].x;
        if (!(coverage > 0.0f)) continue;
        const Rgb* sum = &sums.exitance[2 * i];
        tile.add_openness(places[i].pixel, std::clamp(sum[0].x / coverage, 0.0f, 1.0f), sum[1] / coverage);
    }
}

void Openness::trace(std::span<const SeenPlace> places, Tile& tile) const {
    std::vector<Ray> rays;
    for (const SeenPlace& place : places) {
        const auto [s, t] = tangent_frame(place.normal);
        const V3f local = cosine_hemisphere(place.u);
        rays.push_back(
            {offset_origin(place.position, place.normal), s * local.x + t * local.y + place.normal * local.z});
    }
    std::vector<std::uint8_t> is_hidden(rays.size());
    scene_.are_occluded(rays, is_hidden);
    tile.rays += rays.size();
    for (std::size_t i = 0; i < places.size(); ++i) {
        if (!is_hidden[i]) tile.add_openness(places[i].pixel, 1.0f, rays[i].direction);
    }
}

}  // namespace frazil
