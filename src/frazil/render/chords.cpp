#include "frazil/render/chords.h"

#include <algorithm>
#include <cmath>

#include "frazil/base/trigonometry.h"

namespace frazil {

ChordFinder::ChordFinder(const RayScene& scene, const Shells* shells, PlacementMask mask, int chords)
    : scene_(scene), shells_(shells), mask_(mask), net_(chords) {}

void ChordFinder::draw(std::uint32_t seed, std::size_t point, std::vector<V2f>& u) const {
    u.resize(net_.size());
    net_.draw(seed, static_cast<std::uint32_t>(point), u);
}

std::vector<Chord> ChordFinder::find(const PointSet& points, std::span<const std::uint32_t> which, std::size_t first,
                                     std::uint32_t seed) const {
    std::vector<Chord> chords;
    std::vector<Ray> rays;
    std::vector<V2f> u(net_.size());
    for (const std::uint32_t point : which) {
        const V3f inward = -points.normals[point], origin = offset_origin(points.positions[point], inward);
        const auto [s, t] = tangent_frame(inward);
        net_.draw_part(seed, static_cast<std::uint32_t>(first++), u);
        for (const V2f& sample : u) {
            const V3f local = cosine_hemisphere(sample);
            rays.push_back({origin, s * local.x + t * local.y + inward * local.z});
            chords.push_back({rays.back(), local.z, 0.0f});
        }
    }
    const std::vector<float> lengths = ways_out(rays);
    for (std::size_t i = 0; i < chords.size(); ++i) chords[i].length = lengths[i];
    return chords;
}

bool ChordFinder::is_closed(std::span<const Chord> chords) const {
    return shells_ ||
           std::all_of(chords.begin(), chords.end(), [](const Chord& chord) { return std::isfinite(chord.length); });
}

std::vector<float> ChordFinder::ways_out(std::span<const Ray> rays) const {
    std::vector<float> ways;
    if (shells_) {
        for (const Ray& ray : rays) ways.push_back(shells_->way_through(ray));
        return ways;
    }
    std::vector<Hit> hits(rays.size());
    scene_.intersect(rays, hits, mask_);
    for (const Hit& hit : hits) ways.push_back(hit.t);
    return ways;
}

std::vector<float> ChordFinder::ways_out_if_inside(std::span<const Ray> rays) const {
    std::vector<float> ways;
    if (shells_) {
        for (const Ray& ray : rays) {
            bool begins_outside = false;
            const float way = shells_->way_through(ray, &begins_outside);
            ways.push_back(begins_outside || std::isinf(way) ? kOutside : way);
        }
        return ways;
    }
    std::vector<Hit> hits(rays.size());
    scene_.intersect(rays, hits, mask_);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const Hit& hit = hits[i];
        // What is met from before it may be another body where none is masked.
        const bool is_front = mask_ && rays[i].direction.dot(hit.geometric_normal) < 0.0f;
        ways.push_back(std::isinf(hit.t) || is_front ? kOutside : hit.t);
    }
    return ways;
}

}  // namespace frazil
