#include "frazil/render/receivers.h"

#include "frazil/base/sampler.h"
#include "frazil/base/trigonometry.h"

namespace frazil {
namespace {

constexpr int kColumns = 32, kRows = 18;
constexpr std::uint32_t kSeed = 0x72656376U;

// The receiver that the ray meets, on the side that it comes from; false where it meets nothing.
bool meet(const RayScene& scene, const Ray& ray, LightReceiver& receiver) {
    Hit hit;
    if (!scene.intersect(ray, hit)) return false;
    const bool is_front = hit.geometric_normal.dot(ray.direction) < 0.0f;
    receiver = {ray.origin + ray.direction * hit.t, is_front ? hit.geometric_normal : -hit.geometric_normal,
                hit.placement};
    return true;
}

}  // namespace

std::vector<LightReceiver> receivers_in_view(const Camera& camera, float aspect, const RayScene& scene) {
    std::vector<LightReceiver> receivers;
    for (int i = 0; i < kColumns * kRows; ++i) {
        Sampler random(kSeed, std::uint32_t(i), 0);
        const V2f jitter = random.next_2d();
        LightReceiver first, second;
        const float x = (float(i % kColumns) + jitter.x) / kColumns, y = (float(i / kColumns) + jitter.y) / kRows;
        if (!meet(scene, camera_ray(camera, x, y, aspect), first)) continue;
        receivers.push_back(first);

        const V3f local = cosine_hemisphere(random.next_2d());
        const auto [s, t] = tangent_frame(first.normal);
        const V3f direction = s * local.x + t * local.y + first.normal * local.z;
        if (meet(scene, {offset_origin(first.position, first.normal), direction}, second)) receivers.push_back(second);
    }
    return receivers;
}

}  // namespace frazil
