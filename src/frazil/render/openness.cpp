#include "frazil/render/openness.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/morton_order.h"
#include "frazil/base/trigonometry.h"
#include "frazil/render/place_cells.h"
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

// Openness, and bent normals times it.
std::unique_ptr<const PointTree> tree_of(const PointSet& points, const Occlusion& occlusion) {
    std::vector<Rgb> values;
    values.reserve(2 * points.size());
    for (std::size_t k = 0; k < points.size(); ++k) {
        values.emplace_back(occlusion.openness[k]);
        values.push_back(occlusion.bent_normals[k] * occlusion.openness[k]);
    }
    return std::make_unique<const PointTree>(points, std::move(values), 2, kernel_of(points.spacing));
}

}  // namespace

Openness::Points::Points(const PointSet& points, const RayScene& scene, const OcclusionOptions& options)
    : blend_(points, kReach), baker_(scene, options) {
    for (const std::uint32_t k : blend_.order()) {
        points_.positions.push_back(points.positions[k]);
        points_.normals.push_back(points.normals[k]);
    }
    order_ = morton_order(points_.positions);
    run_of_.resize(order_.size());
    const std::size_t size = baker_.run_size(), runs = (order_.size() + size - 1) / size;
    for (std::size_t i = 0; i < order_.size(); ++i) run_of_[order_[i]] = static_cast<std::uint32_t>(i / size);
    occlusion_.openness.resize(order_.size());
    occlusion_.bent_normals.resize(order_.size());
    is_baked_ = std::vector<std::atomic<bool>>(runs);
    mutexes_ = std::vector<std::mutex>(runs);
}

float Openness::Points::add(const V3f& position, const V3f& normal, float& openness, V3f& directions) const {
    return blend_.visit(position, normal, [&](std::uint32_t k, float weight) {
        const std::uint32_t run = run_of_[k];
        if (!is_baked_[run].load(std::memory_order_acquire)) bake_run(run);
        openness += occlusion_.openness[k] * weight;
        directions += occlusion_.bent_normals[k] * (occlusion_.openness[k] * weight);
    });
}

void Openness::Points::bake_run(std::uint32_t run) const {
    const std::lock_guard lock(mutexes_[run]);
    if (is_baked_[run].load(std::memory_order_relaxed)) return;
    const std::size_t begin = run * baker_.run_size(), end = std::min(order_.size(), begin + baker_.run_size());
    baker_.bake(points_, std::span(order_).subspan(begin, end - begin), begin, occlusion_);
    is_baked_[run].store(true, std::memory_order_release);
}

Openness::Openness(const std::vector<LitPoints>& lit, const RayScene& scene, int samples, std::uint32_t seed)
    : scene_(scene), baked_(lit.size()) {
    OcclusionOptions options;
    options.samples = samples;
    options.seed = seed;
    for (std::size_t i = 0; i < lit.size(); ++i) {
        if (lit[i].points.size() == 0) continue;
        const PointSet points = lit[i].points.in_world();
        auto baked = std::make_unique<Baked>();
        if (PointBlend::suits(points)) {
            baked->points.emplace(points, scene, options);
        } else {
            baked->tree = tree_of(points, bake_occlusion(points, scene, options));
        }
        baked_[i] = std::move(baked);
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
            blend(*baked_[object]->points, places, tile);
        }
    }
    tile.places.clear();
}

void Openness::blend(const Points& points, std::span<const SeenPlace> places, Tile& tile) const {
    // Places of a pixel by the cell that they lie in; the first of each that is not served yet has a blend, which serves
    // those that look the same way.
    struct Key {
        std::uint64_t cell;
        std::uint32_t place;
    };
    const float size = kCell / kReach * points.reach();
    std::vector<Key> keys;
    keys.reserve(places.size());
    // Pixel by pixel: their places lie side by side.
    for (std::uint32_t begin = 0, end = 0; begin < places.size(); begin = end) {
        const std::uint32_t pixel = places[begin].pixel;
        Box3f box;
        for (end = begin; end < places.size() && places[end].pixel == pixel; ++end) box.extendBy(places[end].position);
        const PlaceCells cells(box, size);
        for (std::uint32_t i = begin; i < end; ++i) {
            keys.push_back({std::uint64_t(pixel) << 32 | cells.cell(places[i].position), i});
        }
        std::sort(keys.begin() + begin, keys.end(),
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
            add_blend(points, places[keys[begin].place].pixel, sum / served, normals.normalized(), served, tile);
            left = others;
        }
    }
}

void Openness::add_blend(const Points& points, std::uint32_t pixel, const V3f& position, const V3f& normal,
                         float places, Tile& tile) const {
    for (const V3f& side : {normal, -normal}) {  // a sheet may have points on its other side alone
        float openness = 0.0f;
        V3f directions(0.0f);
        const float weights = points.add(position, side, openness, directions);
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
