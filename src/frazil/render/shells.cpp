#include "frazil/render/shells.h"

namespace frazil {
namespace {

constexpr int kMostCrossings = 64;
// Crooked, so that no edge of a box or grid lies on the way.
const V3f kProbe = V3f(0.3713906f, 0.7427814f, 0.5570860f).normalized();

}  // namespace

void Shells::add(std::size_t object, float outward, const Box3f& box) {
    std::vector<std::uint8_t> mask(is_member_.size(), 0);
    mask[object] = is_member_[object] = 1;
    shells_.push_back({object, outward, box, std::move(mask)});
}

bool Shells::contains(const V3f& position, std::size_t except, std::size_t before) const {
    for (const Shell& shell : shells_) {
        if (shell.object == except || shell.object >= before || !shell.box.intersects(position)) continue;
        Hit hit;
        if (ray_scene_->intersect({position, kProbe}, hit, &shell.mask) &&
            kProbe.dot(hit.geometric_normal) * shell.outward > 0.0f) {
            return true;
        }
    }
    return false;
}

float Shells::way_through(Ray ray, bool* begins_outside) const {
    float length = 0.0f;
    for (int crossings = 0; crossings < kMostCrossings; ++crossings) {
        Hit hit;
        if (!ray_scene_->intersect(ray, hit)) break;
        length += hit.t;
        if (!has(hit.placement)) return length;
        const float along = ray.direction.dot(hit.geometric_normal);
        if (begins_outside && crossings == 0) *begins_outside = along < 0.0f && !contains(ray.origin);
        const V3f onward = along > 0.0f ? hit.geometric_normal : -hit.geometric_normal;
        ray.origin = offset_origin(ray.origin + ray.direction * hit.t, onward);
        if (!contains(ray.origin)) return length;
    }
    return std::numeric_limits<float>::infinity();
}

}  // namespace frazil
