// Choosing directions towards lights, with their densities, for direct light and multiple importance sampling.
// Model: as many lights per receiver as it asks for: their groups by shares that no group's strength changes
//   (group_picker.h), in these by the irradiance that a light can give (light_picker.h), then a direction on each
//   (world_light.h).
// Units: pdf per steradian, the pick included.
// Valid: thread-safe. Nothing is clamped; negative lights are sampled by absolute power; a light whose multipliers of the
//   wanted use are 0, or that is not linked to the receiver's object, is never picked.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "frazil/base/vec.h"
#include "frazil/lighting/group_picker.h"
#include "frazil/lighting/light.h"
#include "frazil/lighting/linking.h"
#include "frazil/lighting/world_light.h"

namespace frazil {

// What the light is wanted for: which multipliers weigh in the pick.
enum class LightUse { surface, translucency, refraction, volume };  // surface = diffuse and specular
inline constexpr std::size_t kLightUseCount = 4;

class LightSampler {
  public:
    // ValueError where check_light refuses a light.
    explicit LightSampler(const std::vector<Light>& lights);

    bool is_empty() const { return lights_.empty(); }
    const std::vector<Light>& lights() const { return lights_; }
    const WorldLight& world_light(int light) const { return world().lights[std::size_t(light)]; }

    // One light for the receiver, without a direction.
    LightPick pick(const LightReceiver& receiver, float u, LightUse use = LightUse::surface) const;
    // A direction to each of the lights that the receiver asks for; `u_pick` chooses them, `u` serves all. Their pdfs are
    // densities of the expected number of samples.
    void sample(const LightReceiver& receiver, float u_pick, const V2f& u, std::vector<LightSample>& samples,
                LightUse use = LightUse::surface) const;
    // One direction for the receiver.
    LightSample sample(const LightReceiver& receiver, float u_pick, const V2f& u,
                       LightUse use = LightUse::surface) const;
    // One direction for each of many receivers, as sample() has it: those towards a dome wait for memory together.
    void sample_many(std::span<const LightReceiver> receivers, std::span<const float> u_pick, std::span<const V2f> u,
                     std::span<LightSample> out, LightUse use = LightUse::surface) const;
    LightSample sample(const V3f& position, float u_pick, const V2f& u) const {
        return sample(LightReceiver{position, V3f(0.0f), kNoObject}, u_pick, u);
    }
    // A direction towards one given light, so that every light (group) can be served on its own; its pdf has no pick.
    LightSample sample_one(int light, const V3f& position, const V2f& u) const;
    // Many at once: out[i] from u[i].
    void sample_many(int light, const V3f& position, std::span<const V2f> u, std::span<LightSample> out) const;

    // Every light along the ray that has a finite extent or is a dome, in front of t_max: appended to `hits` in the order
    // of the lights. Light from infinity (dome, distant) is seen only where t_max is infinite; lights whose shadows are
    // not plain are seen whatever t_max. pdf includes the pick that sample() makes for the receiver; lights that are not
    // linked to it are left out. Mesh lights are met by their object's triangles instead: see hit_object().
    void intersect(const LightReceiver& receiver, const V3f& origin, const V3f& direction, float t_max,
                   std::vector<LightHit>& hits, LightUse use = LightUse::surface) const;
    void intersect(const V3f& origin, const V3f& direction, float t_max, std::vector<LightHit>& hits) const {
        intersect({origin, V3f(0.0f), kNoObject}, origin, direction, t_max, hits);
    }
    // The mesh light that an object shows, if the ray meets its bright side on this triangle at distance t.
    bool hit_object(const LightReceiver& receiver, std::uint32_t object, std::uint32_t triangle, const V3f& direction,
                    float t, LightHit& hit, LightUse use = LightUse::surface) const;
    // The mesh light that an object shows; -1 for none.
    int light_of_object(std::uint32_t object) const;
    // Whether a mesh light stands for its object's material, which camera rays see itself.
    bool is_material(int light) const { return std::get<MeshLight>(lights_[std::size_t(light)].shape).is_material; }

    // Dome radiance alone (the background of camera rays).
    Rgb background(const V3f& direction) const;

    bool is_linked(int light, std::uint32_t object) const {
        return world().table.has(world().link_of_light[std::size_t(light)], object);
    }
    // Opaque shadows of every object: one ray tells.
    bool has_plain_shadow(int light) const { return world().is_plain[std::size_t(light)]; }
    // The objects that cast a light's shadows, one byte each; null = all.
    const std::vector<std::uint8_t>* casters(int light) const {
        return world().table.members(world().casters_of_light[std::size_t(light)]);
    }
    // The choice for a use; uses that weigh the lights alike share one. Scales may be set before the sampler is used.
    GroupPicker& picker(LightUse use) { return *world_->pickers[std::size_t(use)]; }
    const GroupPicker& picker(LightUse use) const { return *world().pickers[std::size_t(use)]; }
    // A picker of its own for some of the lights; it lives no longer than this.
    LightPicker make_picker(std::span<const PickEntry> entries) const {
        return {world().lights, entries, world().table, world().link_of_light};
    }

  private:
    // What does not move when the sampler does.
    struct World {
        std::vector<WorldLight> lights;
        LinkTable table;
        std::vector<std::uint32_t> link_of_light, casters_of_light;
        std::vector<std::uint8_t> is_plain;
        std::vector<int> odd_shadows;  // the lights with extent that are not plain
        std::vector<int> light_of_object;
        std::array<std::shared_ptr<GroupPicker>, kLightUseCount> pickers;
        std::unique_ptr<const LightPicker> all;  // whatever the multipliers: for rays that run into lights
    };
    const World& world() const { return *world_; }
    // Until the thread's next call.
    const std::vector<LightPick>& pick_all(const LightReceiver& receiver, float u, LightUse use) const;

    std::vector<Light> lights_;
    std::shared_ptr<World> world_;
};

}  // namespace frazil
