#include "frazil/render/entering_light.h"

#include "frazil/lighting/shadow.h"

namespace frazil {

void EnteringLight::sample(std::span<const EnteringPlace* const> places, std::span<Entering> out) const {
    std::vector<LightReceiver> receivers;
    std::vector<float> u_pick;
    std::vector<V2f> u;
    for (const EnteringPlace* place : places) {
        receivers.push_back({place->position, place->geometric_normal, place->object});
        u_pick.push_back(place->u_pick);
        u.push_back(place->u);
    }
    std::vector<LightSample> samples(places.size());
    lights_.sample_many(receivers, u_pick, u, samples, LightUse::translucency);

    // Rays for those that come from above.
    std::vector<Ray> rays;
    std::vector<int> lights;
    std::vector<std::size_t> asked;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const EnteringPlace& place = *places[i];
        const LightSample& sample = samples[i];
        const float cosine = place.normal.dot(sample.direction);
        out[i] = {};
        if (!(sample.pdf > 0.0f) || cosine <= 0.0f || place.geometric_normal.dot(sample.direction) <= 0.0f) continue;
        const Light& light = lights_.lights()[std::size_t(sample.light)];
        out[i].group = static_cast<std::uint32_t>(group_of_light_[std::size_t(sample.light)]);
        out[i].irradiance = sample.radiance * bodies_[place.object]->enters(cosine, place.roughness) *
                            (place.bare * light.multipliers[int(LightComponent::translucency)] * cosine / sample.pdf);
        rays.push_back({offset_origin(place.position, place.geometric_normal), sample.direction, 0.0f,
                        sample.distance * (1.0f - 1e-4f)});
        lights.push_back(sample.light);
        asked.push_back(i);
    }
    std::vector<Rgb> visible(rays.size());
    shadow_factors(ray_scene_, lights_, lights, rays, visible);
    for (std::size_t k = 0; k < asked.size(); ++k) out[asked[k]].irradiance *= visible[k];
}

}  // namespace frazil
