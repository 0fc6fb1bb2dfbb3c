// Paths: what lights give them, and what light path expressions keep of it.
#include <algorithm>
#include <cmath>

#include "frazil/lighting/shadow.h"
#include "frazil/render/path.h"
#include "frazil/render/path_state.h"

namespace frazil {
namespace {

// What a light is asked for by chance only below: of what a white diffuse surface in front of the camera gets from it.
constexpr float kFaintLight = 0.02f;

// Multipliers may be negative.
float magnitude(const Rgb& value) {
    return std::max(std::abs(value.x), std::max(std::abs(value.y), std::abs(value.z)));
}

// Whether a light is worth a shadow ray, and what it counts for then; 0 where it is not asked. `brought` is lobes times what
// they are worth to the camera.
float shadow_weight(float brought, float u) {
    const float chance = brought * kPi / kFaintLight;
    if (chance >= 1.0f) return 1.0f;
    return u < chance ? 1.0f / chance : 0.0f;
}

}  // namespace

void PathTracer::add_light(const Path& path, Component component, std::size_t group, const Rgb& radiance,
                           Tile& tile) const {
    tile.add(path.pixel, component, group, radiance);
    for (const OverlayShare& overlay : path.overlays) {
        const std::size_t plane = layout_.overlay_plane(layout_.overlay_of[path.first_material][overlay.overlay]);
        if (component == Component::diffuse) {
            tile.add_to_plane(path.pixel, plane + FilmLayout::kDiffuse, group, radiance * overlay.diffuse);
        }
        if (component == Component::refraction) {
            tile.add_to_plane(path.pixel, plane + FilmLayout::kRefraction, group, radiance * overlay.seen_through);
        }
        if (component == Component::volume) {
            tile.add_to_plane(path.pixel, plane + FilmLayout::kVolume, group, radiance * overlay.seen_through);
        }
    }
}

void PathTracer::deliver(const Path& path, Component primary, const Scattering& weights, std::size_t group,
                         const Rgb& radiance, Tile& tile) const {
    if (path.bounce == 0) {
        tile.add(path.pixel, primary, group, weights.refraction * radiance);
        return;
    }
    const auto add = [&](Component component, const Rgb& weight) {
        if (weight != Rgb(0.0f)) add_light(path, component, group, weight * radiance, tile);
    };
    add(Component::diffuse, weights.diffuse);
    add(Component::specular, weights.specular);
    add(primary == Component::volume ? Component::volume : Component::refraction, weights.refraction);
}

// Light that the ray runs into: domes for camera rays, every light with an extent after that, weighted against
// add_direct_light's choice of the same direction.
void PathTracer::add_lights_on_ray(const Path& path, const Hit* surface, Tile& tile) const {
    thread_local std::vector<LightHit> hits;
    hits.clear();
    const float t_max = surface ? surface->t : std::numeric_limits<float>::infinity();
    lights_.intersect(path.receiver, path.ray.origin, path.ray.direction, t_max, hits, path.use);
    if (LightHit mesh; surface && lights_.hit_object(path.receiver, surface->placement, surface->triangle,
                                                     path.ray.direction, t_max, mesh, path.use)) {
        hits.push_back(mesh);
    }
    for (LightHit& hit : hits) {
        const Light& light = lights_.lights()[std::size_t(hit.light)];
        if (path.bounce > 0 && !path.sees_lamps && !std::holds_alternative<DomeLight>(light.shape)) continue;
        const bool is_mesh = std::holds_alternative<MeshLight>(light.shape);
        const std::size_t group = group_of_light_[std::size_t(hit.light)];
        if (path.bounce == 0) {
            if (t_max < hit.distance) continue;
            if (is_mesh ? !lights_.is_material(hit.light) : std::holds_alternative<DomeLight>(light.shape)) {
                add_lpes_of_light(path, Rgb(1.0f), hit.light, hit.radiance, tile);
            }
            if (is_mesh && !lights_.is_material(hit.light)) {
                deliver(path, Component::emission, path.weights(), group, hit.radiance, tile);
            } else if (std::holds_alternative<DomeLight>(light.shape)) {
                deliver(path, Component::background, path.weights(), group, hit.radiance, tile);
            }
            continue;
        }
        // Lights whose shadows are not plain may shine through what the ray has met: they are asked once, from the vertex.
        if (!lights_.has_plain_shadow(hit.light) && !is_mesh) {
            if (path.inside.is_empty() ? path.has_passed : t_max < hit.distance) continue;
            const Ray shadow{path.ray.origin, path.ray.direction, 0.0f, hit.distance * (1.0f - 1e-4f)};
            if (path.inside.is_empty()) hit.radiance *= shadow_factor(ray_scene_, lights_, hit.light, shadow);
        }
        const float mis = path.is_delta ? 1.0f : path.last.pdf / (path.last.pdf + hit.pdf);
        const Scattering weights =
            path.weights(multiplier(light, LightComponent::diffuse), multiplier(light, LightComponent::specular),
                         multiplier(light, LightComponent::refraction));
        deliver(path, Component::background, weights, group, hit.radiance * path.light_share * mis, tile);
        const Rgb lobes(multiplier(light, LightComponent::diffuse), multiplier(light, LightComponent::specular),
                        multiplier(light, LightComponent::refraction));
        add_lpes_of_light(path, lobes, hit.light, hit.radiance * path.light_share * mis, tile);
    }
}

void PathTracer::add_direct_light(const Path& path, const Surface& surface, const Shader& shader, const V3f& wo,
                                  Sampler& sampler, Tile& tile) const {
    if (lights_.is_empty()) return;
    thread_local std::vector<LightSample> samples;
    const float u_pick = sampler.next_1d();
    const LightReceiver receiver{surface.position, surface.horizon, surface.object, path.light_picks()};
    lights_.sample(receiver, u_pick, sampler.next_2d(), samples);
    const float u_shadow = sampler.next_1d();
    for (const LightSample& sample : samples) add_light_sample(path, surface, shader, wo, sample, u_shadow, tile);
}

void PathTracer::add_light_sample(const Path& path, const Surface& surface, const Shader& shader, const V3f& wo,
                                  const LightSample& sample, float u_shadow, Tile& tile) const {
    if (!(sample.pdf > 0.0f)) return;
    const Scattering value = shader.eval(wo, sample.direction);
    const Light& light = lights_.lights()[std::size_t(sample.light)];
    Rgb diffuse_lobe = value.diffuse * multiplier(light, LightComponent::diffuse);
    Rgb specular_lobe = value.specular * multiplier(light, LightComponent::specular);
    if (diffuse_lobe == Rgb(0.0f) && specular_lobe == Rgb(0.0f)) return;
    // Where the path ends here no lobe finds the light.
    const bool is_last = sample.is_delta || path.scattered >= max_bounces_;
    const float straight_mis = is_last ? 1.0f : sample.pdf / (sample.pdf + value.pdf);
    const float brought =
        magnitude(diffuse_lobe) + magnitude(specular_lobe) * (shader.is_glossy() ? straight_mis : 1.0f);
    const float asked = shadow_weight(brought * path.worth(), u_shadow);
    if (asked == 0.0f) return;

    Ray shadow;
    shadow.origin = offset_origin(surface.lifted, surface.geometric_normal);
    shadow.direction = sample.direction;
    shadow.t_max = sample.distance * (1.0f - 1e-4f) - (surface.lifted - surface.position).length();
    if (!(shadow.t_max > 0.0f)) return;
    bool is_straight = true;
    const Rgb visible = visibility(path, sample.light, shadow, path.inside, tile, is_straight);
    if (visible == Rgb(0.0f)) return;
    // Through a boundary broad lobes take light along a straight line; what is seen in a glossy one is refracted.
    if (!is_straight && shader.is_glossy()) specular_lobe = Rgb(0.0f);

    const float mis = is_straight ? straight_mis : 1.0f;
    const Rgb light_over_pdf = sample.radiance * visible * (asked * mis / sample.pdf);
    const std::size_t group = group_of_light_[std::size_t(sample.light)];
    Scattering weights{diffuse_lobe, specular_lobe, Rgb(0.0f), 0.0f};
    if (path.bounce > 0) {
        weights = path.weights();
        weights.scale(diffuse_lobe + specular_lobe);
    } else {
        weights.scale(path.last.refraction);
    }
    add_light(path, Component::diffuse, group, weights.diffuse * light_over_pdf, tile);
    add_light(path, Component::specular, group, weights.specular * light_over_pdf, tile);
    add_light(path, Component::refraction, group, weights.refraction * light_over_pdf, tile);
    add_lpes_beyond(path, LpeKind::diffuse, surface.object, sample.light, diffuse_lobe * light_over_pdf, tile);
    add_lpes_beyond(path, LpeKind::glossy, surface.object, sample.light, specular_lobe * light_over_pdf, tile);
}

// What is left of a light along a ray; `is_straight` becomes false where a boundary would bend it. Inside ice shadows are
// plain.
Rgb PathTracer::visibility(const Path& path, int light, const Ray& ray, const InsideOf& inside, Tile& tile,
                           bool& is_straight) const {
    if (lights_.has_plain_shadow(light) || !inside.is_empty()) {
        // Overlays on the way of light need no detail.
        return interiors_.visibility(ray, inside, tile.rays, true, &is_straight, path.shadow_footprint());
    }
    ++tile.rays;
    return shadow_factor(ray_scene_, lights_, light, ray);
}

// One light of the outside, seen from inside through the rough boundary, weighted against the path that goes on.
void PathTracer::add_light_beyond(const Path& path, const Surface& surface, const Crossing& crossing, float alpha,
                                  Sampler& sampler, Tile& tile) const {
    const float u_pick = sampler.next_1d();
    const V2f u = sampler.next_2d();
    const Rgb light_share = path.light_share_beyond();
    if (lights_.is_empty() || light_share == Rgb(0.0f)) return;
    const LightReceiver receiver{surface.position, -surface.geometric_normal, surface.object};
    const LightSample sample = lights_.sample(receiver, u_pick, u, LightUse::refraction);
    if (!(sample.pdf > 0.0f) || sample.direction.dot(surface.geometric_normal) >= 0.0f) return;
    const Frame frame(surface.normal);
    const float eta = interiors_.eta(crossing.to) / interiors_.eta(crossing.from);
    const float value =
        inner_transmission(frame.to_local(-path.ray.direction), frame.to_local(sample.direction), alpha, eta);
    if (!(value > 0.0f)) return;
    const float mis = sample.is_delta ? 1.0f : sample.pdf / (sample.pdf + value);
    const float asked = shadow_weight(value * mis * path.worth(), sampler.next_1d());
    if (asked == 0.0f) return;

    const Ray shadow{offset_origin(surface.position, -surface.geometric_normal), sample.direction, 0.0f,
                     sample.distance * (1.0f - 1e-4f)};
    bool is_straight = true;
    const Rgb visible = visibility(path, sample.light, shadow, crossing.beyond, tile, is_straight);
    if (visible == Rgb(0.0f) || !is_straight) return;
    const Light& light = lights_.lights()[std::size_t(sample.light)];
    if (!path.sees_lamps && !std::holds_alternative<DomeLight>(light.shape)) return;
    Scattering weights = path.weights();
    const Rgb lobe =
        bodies_[surface.object]->material->refraction_tint * (value * multiplier(light, LightComponent::refraction));
    weights.scale(lobe);
    // Before the first lobe the boundary itself is the first.
    const std::size_t group = group_of_light_[std::size_t(sample.light)];
    const Rgb radiance = sample.radiance * visible * light_share * (asked * mis / sample.pdf);
    deliver(path, Component::refraction, weights, group, radiance, tile);
    add_lpes_beyond(path, LpeKind::refraction, surface.object, sample.light, radiance * lobe, tile);
}

// Note where light enters for the compensation that fills up: it is asked for once the gather tells how much that fills.
void PathTracer::note_entering(IceCore& core, const Path& path, const Surface& surface, const Body& body,
                               Tile& tile) const {
    if (body.material->compensation.mode != CompensationMode::fill && !layout_.needs_fill()) return;
    core.entering_place = static_cast<std::uint32_t>(tile.entering_places.size());
    EnteringPlace& place = tile.entering_places.emplace_back();
    place.object = surface.object;
    place.position = surface.position, place.normal = surface.normal, place.geometric_normal = surface.geometric_normal;
    place.roughness = surface.covering.roughness;
    place.bare = 1.0f - surface.covering.scattered;
    // Numbers of its own: neither the mode nor a layer that is asked for may change another one.
    Sampler own = path.sampler;
    own.set_dimension(kFillDimensions + 4U * path.vertex);
    place.u_pick = own.next_1d();
    place.u = own.next_2d();
    place.u_ask = own.next_1d();
}

// A light that the path ran into, its lobes weighted by the light's multipliers.
void PathTracer::add_lpes_of_light(const Path& path, const Rgb& lobes, int light, const Rgb& radiance,
                                   Tile& tile) const {
    for (const LpeTracks::Track& track : path.lpe.tracks) {
        if (!layout_.lpes[track.lpe].ends_in_light(track.state, std::size_t(light))) continue;
        const Rgb weight = track.lobes[0] * lobes.x + track.lobes[1] * lobes.y + track.lobes[2] * lobes.z;
        tile.add_lpe(path.pixel, track.lpe, weight * radiance);
    }
}

// A light by way of one more event, at a vertex that the path has come to.
void PathTracer::add_lpes_beyond(const Path& path, LpeKind kind, std::size_t object, int light, const Rgb& radiance,
                                 Tile& tile) const {
    for (const LpeTracks::Track& track : path.lpe.tracks) {
        const LpeAutomaton& lpe = layout_.lpes[track.lpe];
        if (!lpe.ends_in_light(lpe.next(track.state, kind, object), std::size_t(light))) continue;
        tile.add_lpe(path.pixel, track.lpe, track.sum() * radiance);
    }
}

}  // namespace frazil
