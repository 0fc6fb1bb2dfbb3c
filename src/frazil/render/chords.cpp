#include "frazil/render/chords.h"

#include <cmath>
#include <limits>

#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

constexpr int kChords = 16;

}  // namespace

ChordFinder::ChordFinder(const RayScene& scene, const Shells* shells, PlacementMask mask)
    : scene_(scene), shells_(shells), mask_(mask), net_(kChords) {}

void ChordFinder::draw(std::uint32_t seed, std::size_t point, std::vector<V2f>& u) const {
    u.resize(net_.size());
    net_.draw(seed, static_cast<std::uint32_t>(point), u);
}

bool ChordFinder::find(const PointSet& points, std::size_t point, std::uint32_t seed,
                       std::vector<Chord>& chords) const {
    const V3f inward = -points.normals[point], origin = offset_origin(points.positions[point], inward);
    const auto [s, t] = tangent_frame(inward);
    std::vector<V2f> u;
    draw(seed, point, u);
    chords.resize(u.size());
    bool all = true;
    for (std::size_t k = 0; k < u.size(); ++k) {
        const V3f local = cosine_hemisphere(u[k]);
        chords[k].ray = {origin, s * local.x + t * local.y + inward * local.z};
        chords[k].cosine = local.z;
        chords[k].length = way_out(chords[k].ray);
        all = all && std::isfinite(chords[k].length);
    }
    return all || shells_;
}

float ChordFinder::way_out(const Ray& ray) const {
    if (shells_) return shells_->way_through(ray);
    Hit hit;
    return scene_.intersect(ray, hit, mask_) ? hit.t : std::numeric_limits<float>::infinity();
}

}  // namespace frazil
