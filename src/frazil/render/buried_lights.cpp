#include "frazil/render/buried_lights.h"

#include <algorithm>
#include <map>

#include "frazil/base/error.h"
#include "frazil/render/interior.h"

namespace frazil {
namespace {

constexpr int kMostCrossings = 256;

class Burials {
  public:
    Burials(const Scene& scene, const RayScene& ray_scene) : scene_(scene), ray_scene_(ray_scene) {}

    // The objects of closed ice that the place lies in, in their order; `own` never counts.
    std::vector<std::uint32_t> around(const V3f& place, std::uint32_t own) {
        // Crooked, so that no edge of a box or grid lies on the way.
        Ray ray{place, V3f(0.3713906f, 0.7427814f, 0.5570860f).normalized()};
        std::map<std::uint32_t, int> left;
        for (int crossings = 0; crossings < kMostCrossings; ++crossings) {
            Hit hit;
            if (!ray_scene_.intersect(ray, hit)) break;
            const float side = ray.direction.dot(hit.geometric_normal);
            if (hit.placement != own) left[hit.placement] += side * outward(hit.placement) > 0.0f ? 1 : -1;
            ray.origin = offset_origin(ray.origin + ray.direction * hit.t,
                                       side > 0.0f ? hit.geometric_normal : -hit.geometric_normal);
        }
        std::vector<std::uint32_t> result;
        for (const auto& [object, count] : left) {
            if (count > 0 && outward(object) != 0.0f) result.push_back(object);
        }
        return result;
    }

  private:
    // As of Interiors, for ice whether rays enter it or not; 0 for everything else.
    float outward(std::uint32_t object) {
        const Object& item = scene_.objects[object];
        if (!std::holds_alternative<IceMaterial>(scene_.materials[item.material].model)) return 0.0f;
        const auto [found, is_new] = outward_of_mesh_.try_emplace(item.mesh, 0.0f);
        if (is_new) found->second = outward_side(scene_.meshes[item.mesh]);
        return found->second;
    }

    const Scene& scene_;
    const RayScene& ray_scene_;
    std::map<std::uint32_t, float> outward_of_mesh_;
};

}  // namespace

std::vector<std::string> warnings_of_buried_lights(const Scene& scene, const RayScene& ray_scene,
                                                   const LightSampler& lights) {
    std::vector<std::string> warnings;
    Burials burials(scene, ray_scene);
    for (int i = 0; i < int(lights.lights().size()); ++i) {
        const Light& light = lights.lights()[std::size_t(i)];
        if (!lights.world_light(i).is_finite() || light.radiance == Rgb(0.0f)) continue;
        const MeshLight* mesh = std::get_if<MeshLight>(&light.shape);
        const Box3f& box = lights.world_light(i).bounds().box;
        const std::uint32_t own = mesh ? mesh->object : kNoObject;
        std::vector<std::uint32_t> common = burials.around((box.min + box.max) * 0.5f, own);
        for (int corner = 0; corner < 8 && !common.empty(); ++corner) {
            const V3f place(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                            corner & 4 ? box.max.z : box.min.z);
            const std::vector<std::uint32_t> around = burials.around(place, own);
            std::erase_if(common, [&](std::uint32_t object) {
                return std::find(around.begin(), around.end(), object) == around.end();
            });
        }
        if (common.empty()) continue;
        warnings.push_back(str(light.path, ": must lie outside of ice to light its core, got a place inside ",
                               scene.objects[common.front()].path,
                               ". Only scattering that is traced (volume) sees it; move it out."));
    }
    return warnings;
}

}  // namespace frazil
