#include "frazil/render/openness.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/random.h"
#include "frazil/base/trigonometry.h"
#include "frazil/translucency/normalized_diffusion.h"

namespace frazil {
namespace {

constexpr float kReach = 2.5f;  // of the blend, in spacings
// Places of a pixel in a cell of so many spacings whose normals agree share a blend, at their mean.
constexpr float kCell = 0.5f, kLeastCosine = 0.9f;

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
    const auto by_object = [](const SeenPlace& a, const SeenPlace& b) { return a.object < b.object; };
    if (!std::is_sorted(tile.places.begin(), tile.places.end(), by_object)) {
        std::stable_sort(tile.places.begin(), tile.places.end(), by_object);
    }
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
    // Places of a pixel by the cell that they lie in; the first of each that is not served yet has a blend, which serves
    // those that look the same way.
    struct Key {
        std::uint64_t cell;
        std::uint32_t place;
    };
    const float size = kCell / kReach * baked.blend->reach();
    std::vector<Key> keys;
    keys.reserve(places.size());
    for (std::uint32_t i = 0; i < places.size(); ++i) {
        const V3f at = places[i].position / size;
        const auto bits = [](float x) { return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::floor(x))); };
        keys.push_back({std::uint64_t(places[i].pixel) << 32 | hash(bits(at.x), bits(at.y), bits(at.z)), i});
    }
    // Pixel by pixel: their places lie side by side.
    for (auto first = keys.begin(), last = first; first != keys.end(); first = last) {
        last = std::find_if(first, keys.end(), [&](const Key& key) { return key.cell >> 32 != first->cell >> 32; });
        std::sort(first, last,
                  [](const Key& a, const Key& b) { return a.cell != b.cell ? a.cell < b.cell : a.place < b.place; });
    }
    for (std::size_t begin = 0, end = 0; begin < keys.size(); begin = end) {
        while (end < keys.size() && keys[end].cell == keys[begin].cell) ++end;
        std::size_t left = end;
        while (left > begin) {
            V3f sum(0.0f), normals(0.0f);
            const V3f normal = places[keys[begin].place].normal;
            std::size_t others = begin;
            for (std::size_t k = begin; k < left; ++k) {
                const SeenPlace& place = places[keys[k].place];
                if (k == begin || place.normal.dot(normal) > kLeastCosine) {
                    sum += place.position;
                    normals += place.normal;
                } else {
                    std::swap(keys[others++], keys[k]);
                }
            }
            const auto served = static_cast<float>(left - others);
            add_blend(baked, places[keys[begin].place].pixel, sum / served, normals.normalized(), served, tile);
            left = others;
        }
    }
}

void Openness::add_blend(const Baked& baked, std::uint32_t pixel, const V3f& position, const V3f& normal, float places,
                         Tile& tile) const {
    for (const V3f& side : {normal, -normal}) {  // a sheet may have points on its other side alone
        float openness = 0.0f;
        V3f directions(0.0f);
        const float weights = baked.blend->visit(position, side, [&](std::uint32_t k, float weight) {
            openness += baked.openness[k] * weight;
            directions += baked.directions[k] * weight;
        });
        if (weights == 0.0f) continue;
        tile.add_openness(pixel, openness * (places / weights), directions * (places / weights));
        return;
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
