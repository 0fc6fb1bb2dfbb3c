#include "frazil/render/path.h"

#include <algorithm>
#include <tuple>

#include "frazil/lighting/shadow.h"
#include "frazil/material/microfacet.h"

namespace frazil {
namespace {

// Dimensions that one vertex may draw from the sampler, so that all vertices are stratified alike; a path that was split
// off has vertices of its own.
constexpr std::uint32_t kDimensionsPerVertex = 16;
constexpr std::uint32_t kSplitVertex = 64;
constexpr std::uint32_t kTransparencyDimensions = 4096;
constexpr int kBouncesBeforeRoulette = 3;
constexpr int kMaxTransparentHits = 64;
// Meetings with the boundary from inside, after which the core answers for what is left; of these, how many pieces of the
// path have their single scattering traced.
constexpr int kMaxInnerBounces = 8, kMaxVolumePieces = 2;
// A refracted path that is worth less than this goes on by chance only.
constexpr float kFaint = 0.02f;
// Overlays that cover less than this are not seen from below.
constexpr float kHiding = 0.01f;
// How much wider an opaque surface makes the cone that a path stands for, per metre.
constexpr float kScatteredSpread = 0.05f;
constexpr std::uint32_t kSheetDimensions = 16384;
constexpr int kMaxSheets = 8;  // looked at on one piece of a path

float multiplier(const Light& light, LightComponent component) {
    return light.multipliers[static_cast<int>(component)];
}

// A point's frame of shading.
struct Frame {
    explicit Frame(const V3f& n) : normal(n) { std::tie(tangent, bitangent) = tangent_frame(n); }
    V3f to_local(const V3f& v) const { return {v.dot(tangent), v.dot(bitangent), v.dot(normal)}; }
    V3f to_world(const V3f& v) const { return tangent * v.x + bitangent * v.y + normal * v.z; }
    V3f normal, tangent, bitangent;
};

// The direction on the side of the plane that `sign` tells; one on the wrong side is mirrored at the plane.
V3f on_side(const V3f& direction, const V3f& normal, float sign) {
    const float cosine = direction.dot(normal) * sign;
    return cosine > 0.0f ? direction : (direction - normal * (2.0f * sign * (cosine - 1e-5f))).normalized();
}

// What goes through is blurred at least as the overlays blur the reflection.
float refraction_alpha(const IceMaterial& ice, const Surface& surface) {
    const float roughness = surface.covering.roughness;
    if (ice.refraction_roughness < 0.0f) return alpha_from_roughness(roughness);
    const float bare = eval_float(ice.roughness, surface.st);
    return alpha_from_roughness(ice.refraction_roughness + std::max(0.0f, roughness - bare));
}

// How much wider a lobe makes the cone that a path stands for, per metre.
float lobe_spread(float alpha) {
    return 0.5f * alpha;
}

}  // namespace

// Where a piece of a path inside ice begins, and what its core sends from there.
struct PathTracer::Core {
    int body = InsideOf::kNone;
    V3f position = V3f(0.0f);
    Rgb radiance_per_exitance = Rgb(0.0f);  // over squared index
    bool is_primary = false;                // seen by the camera itself
    bool is_entered = false;                // its light leaves where the path went in: instead of the refraction there
    // Light that enters right here, for the compensation that fills up; its light group.
    Rgb entering = Rgb(0.0f);
    std::uint32_t entering_group = 0;
};

// The state of a path between two vertices.
struct PathTracer::Path {
    std::uint32_t pixel = 0, vertex = 0;
    Ray ray;
    Sampler sampler{0, 0, 0};
    int bounce = 0;     // lobes that it was scattered by so far
    int scattered = 0;  // of these, at surfaces other than boundaries met by refraction
    int inner = 0;      // meetings with boundaries from inside
    int straight = 0;   // surfaces that it went through without a lobe
    // What light from before the last vertex is worth to the camera, by the layer of the first lobe; meaningless before the
    // second vertex.
    Scattering before;
    // The last vertex: lobe values over pdf, and the pdf for MIS. Before the first vertex `refraction` is what ice in front
    // of the camera leaves.
    Scattering last;
    bool is_delta = false;  // lights could not be chosen at the last vertex
    // Who receives light at the last vertex (the camera: everything), and which multipliers weigh in the choice there.
    LightReceiver receiver;
    LightUse use = LightUse::surface;
    bool has_shown = false;   // what is seen through ice
    bool has_passed = false;  // through a surface without a lobe, since then
    // Lights that were chosen at the last opaque vertex shine straight through ice; the part of a refracted path's weight
    // that they have not served.
    bool has_direct_light = false, is_glossy = false;
    bool sees_lamps = true;  // lights other than domes; not after reflections inside ice, where they would be sparks
    Rgb light_share = Rgb(1.0f);

    InsideOf inside;
    Core core;
    float clear = 1.0f, volume = 0.0f;  // how much of the next piece is seen through, and scattered once
    float core_share = 1.0f;            // of what is seen through, how much the core leaves out for it
    float width = 0.0f, spread = 0.0f;  // of the cone that the path stands for: radius at the ray's origin, per metre
    LpeTracks lpe;                      // of the light path expressions that are asked for

    // What the last vertex's lobes are worth, weighted by a light's multipliers, by the layer of the first lobe.
    Scattering weights(float diffuse, float specular, float refraction) const {
        if (bounce <= 1) return {last.diffuse * diffuse, last.specular * specular, last.refraction * refraction, 0.0f};
        const Rgb lobes = last.diffuse * diffuse + last.specular * specular + last.refraction * refraction;
        return {before.diffuse * lobes, before.specular * lobes, before.refraction * lobes, 0.0f};
    }
    Scattering weights() const { return weights(1.0f, 1.0f, 1.0f); }

    // `refracted` is what the lobe of refraction does at the object.
    void scatter(const Scattering& value_over_pdf, std::size_t object, LpeKind refracted = LpeKind::refraction) {
        lpe.scatter({value_over_pdf.diffuse, value_over_pdf.specular, value_over_pdf.refraction}, refracted, object);
        if (bounce > 0) {
            before = weights();
            last = value_over_pdf;
        } else {
            const Rgb attenuation = last.refraction;
            last = value_over_pdf;
            last.scale(attenuation);
        }
        ++bounce;
    }

    void scale(const Rgb& factor) {
        last.scale(factor);
        lpe.scale(factor);
    }

    // Go on with the given chance; false where the path ends.
    bool survives(float chance) {
        if (chance >= 1.0f) return true;
        if (!(sampler.next_1d() < chance)) return false;
        scale(Rgb(1.0f / chance));
        return true;
    }

    // What it left behind when it went through a boundary: lights already served from the last opaque vertex.
    void pass_boundary() {
        if (!has_direct_light) return;
        for (int c = 0; c < 3; ++c) {
            const float all = last.diffuse[c] + last.specular[c] + last.refraction[c];
            const float served = is_glossy ? last.diffuse[c] : last.diffuse[c] + last.specular[c];
            light_share[c] *= all > 0.0f ? 1.0f - served / all : 0.0f;
        }
        has_direct_light = false;
    }

    // `side` is that of the surface which receives.
    void receive(const Surface& surface, const V3f& side, LightUse wanted) {
        receiver = {surface.position, side, surface.object};
        use = wanted;
        has_passed = false;
    }

    void leave_from(const V3f& position, const V3f& side, const V3f& direction) {
        ray.origin = offset_origin(position, side);
        ray.direction = direction;
        ray.t_min = 0.0f;
        ray.t_max = std::numeric_limits<float>::infinity();
    }
    // The next piece of the path begins inside ice at the end of the last.
    void begin_piece(const Core& from, float volume_weight) {
        core = from;
        clear = core_share = 1.0f;
        volume = volume_weight;
    }

    // Straight on through a surface.
    void pass_through(const Surface& surface, float t) {
        ray.origin = offset_origin(surface.position, -surface.geometric_normal);
        ray.t_max -= t;
        ray.t_min = 0.0f;
        has_passed = true;
        ++straight;
    }

    void begin_vertex() { sampler.set_dimension(kDimensionsPerVertex * ++vertex); }
};

// Overlays on the way of light need no detail.
float PathTracer::shadow_footprint(const Path& path) {
    return 4.0f * path.width;
}

PathTracer::PathTracer(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                       const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::size_t>& group_of_light,
                       const FilmLayout& layout, int max_bounces, const PixelCone& pixel)
    : scene_(scene),
      ray_scene_(ray_scene),
      lights_(lights),
      bodies_(bodies),
      group_of_light_(group_of_light),
      layout_(layout),
      resolver_(scene),
      interiors_(scene, ray_scene, resolver_, bodies),
      single_scattering_(lights, interiors_, bodies),
      camera_inside_(interiors_.inside_at(V3f(0.0f) * scene.camera.camera_to_world)),
      max_bounces_(max_bounces),
      pixel_(pixel) {}

void PathTracer::trace(const Ray& camera_ray, const V3f& view_axis, Sampler sampler, std::uint32_t pixel,
                       Tile& tile) const {
    Path path;
    path.pixel = pixel;
    path.ray = camera_ray;
    path.receiver.position = camera_ray.origin;
    path.sampler = sampler;
    path.last.refraction = Rgb(1.0f);
    path.width = pixel_.radius;
    path.spread = pixel_.spread;
    if (!layout_.lpes.empty()) path.lpe.begin(layout_.lpes);
    path.inside = camera_inside_;
    if (const int body = interiors_.filling(path.inside); body != InsideOf::kNone) {
        Surface camera;
        camera.position = camera_ray.origin;
        path.core = core_at(camera, body);
        path.core.is_primary = true;
        path.volume = bodies_[std::size_t(body)]->material->volume;
    }
    Path refracted;
    bool has_split = false;
    follow(path, &view_axis, &refracted, has_split, tile);
    bool has_none = false;
    if (has_split) follow(refracted, nullptr, nullptr, has_none, tile);
}

void PathTracer::follow(Path& path, const V3f* view_axis, Path* split, bool& has_split, Tile& tile) const {
    const V3f eye = path.ray.origin;
    while (true) {
        Hit hit;
        ++tile.rays;
        const bool is_hit = ray_scene_.intersect(path.ray, hit);
        float length = is_hit ? hit.t : std::numeric_limits<float>::infinity();
        path.begin_vertex();
        V3f sheet_normal;
        Rgb sheet_color;
        const bool is_sheet = !path.inside.is_empty() && find_sheet(path, length, length, sheet_normal, sheet_color);
        if (!path.inside.is_empty() && !cross_interior(path, length, path.sampler, tile)) return;
        if (is_sheet) {
            path.width += path.spread * length;
            const V3f position = path.ray.origin + path.ray.direction * length;
            if (!meet_sheet(path, position, sheet_normal, sheet_color, tile)) return;
            continue;
        }
        add_lights_on_ray(path, is_hit ? &hit : nullptr, tile);
        if (!is_hit) return;

        const V3f wo = -path.ray.direction;
        path.width += path.spread * length;
        const Surface surface = resolver_.resolve(hit, path.ray.direction, path.width, path.bounce == 0);
        const auto note_primary = [&](const Rgb& albedo) {
            if (!view_axis) return;
            const float depth = (surface.position - eye).dot(*view_axis);
            tile.add_primary(path.pixel, {depth, surface.position, surface.normal, albedo, surface.object + 1,
                                          surface.st, surface.local_position});
            tile.add_object(path.pixel, surface.object, false);
            view_axis = nullptr;
        };
        const Body* body = bodies_[surface.object].get();

        // Ice that rays may enter: go through where it is no boundary, meet its boundary from inside.
        Crossing crossing;
        const bool is_open = interiors_.is_open_to_rays(surface.object);
        if (is_open) {
            crossing = interiors_.cross(hit, path.ray.direction, path.inside);
            if (path.straight > kMaxTransparentHits) return;
            if (crossing.from != InsideOf::kNone) {
                if (crossing.is_boundary()) {
                    note_primary(Rgb(1.0f));
                    if (!meet_boundary(path, surface, crossing, path.sampler, tile)) return;
                } else {
                    path.inside = crossing.beyond;
                    path.pass_through(surface, hit.t);
                }
                continue;
            }
        }

        // Go straight on where the surface is cut out; every hit in turn tosses its own coin.
        const Shader shader(surface, body);
        if (const float opacity = shader.opacity(); opacity < 1.0f) {
            Sampler coin = path.sampler;
            coin.set_dimension(kTransparencyDimensions + static_cast<std::uint32_t>(path.straight));
            if (path.straight >= kMaxTransparentHits) return;
            if (coin.next_1d() >= opacity) {
                path.pass_through(surface, hit.t);
                continue;
            }
        }
        note_primary(shader.albedo(wo));
        if (path.bounce > 0 && path.scattered == 0 && !path.has_shown) {
            path.has_shown = true;
            tile.add_object(path.pixel, surface.object, true);
        }

        // What the surface itself gives: emission where no mesh light stands for it, and light that diffused through ice.
        const int own_light = lights_.light_of_object(surface.object);
        const bool is_own = own_light < 0 || (path.bounce == 0 && lights_.is_material(own_light));
        if (const Rgb emission = shader.emission(); is_own && emission != Rgb(0.0f)) {
            const std::size_t group = own_light < 0 ? layout_.emission_group : group_of_light_[std::size_t(own_light)];
            deliver(path, Component::emission, path.weights(), group, emission, tile);
            for (const LpeTracks::Track& track : path.lpe.tracks) {
                if (!layout_.lpes[track.lpe].ends_in_emission(track.state, surface.object)) continue;
                tile.add_lpe(path.pixel, track.lpe, track.sum() * emission);
            }
        }
        float reflection_odds = 1.0f;
        if (body) {
            const float leaving = body->transmittance(surface.normal.dot(wo), surface.covering.roughness);
            Core core = core_at(surface, static_cast<int>(surface.object));
            core.is_primary = path.bounce == 0;
            add_entering_light(core, surface, *body, path.sampler);
            if (!is_open || crossing.to == InsideOf::kNone) {
                request_gather(path, core, Rgb(leaving), tile);
            } else if (split) {
                *split = path;
                split->vertex += kSplitVertex;
                split->begin_vertex();
                has_split = enter(*split, surface, crossing, 1.0f / leaving, core, split->sampler);
                split = nullptr;
            } else {
                // Either reflect or enter, by how much goes either way.
                reflection_odds =
                    std::clamp(1.0f - leaving * (1.0f - luminance(surface.covering.reflectance)), 0.05f, 0.95f);
                if (path.sampler.next_1d() >= reflection_odds) {
                    // The light that comes straight from lights is the reflection's, whichever way the path goes.
                    add_direct_light(path, surface, shader, wo, path.sampler, tile);
                    if (!enter(path, surface, crossing, (1.0f - reflection_odds) / leaving, core, path.sampler)) return;
                    continue;
                }
            }
        }

        add_direct_light(path, surface, shader, wo, path.sampler, tile);
        if (path.scattered >= max_bounces_) return;

        // Continue along one lobe.
        V3f wi;
        const float u_lobe = path.sampler.next_1d();
        if (!shader.sample(wo, u_lobe, path.sampler.next_2d(), wi)) return;
        Scattering value = shader.eval(wo, wi);
        if (!(value.pdf > 0.0f)) return;
        value.scale(Rgb(1.0f / (value.pdf * reflection_odds)));
        path.scatter(value, surface.object);
        path.receive(surface, surface.geometric_normal, LightUse::surface);
        ++path.scattered;
        path.is_delta = false;
        path.has_direct_light = path.sees_lamps = true;
        path.is_glossy = shader.is_glossy();
        path.light_share = Rgb(1.0f);
        path.spread += kScatteredSpread;
        split = nullptr;

        // Russian roulette on what the path may still bring.
        if (path.scattered > kBouncesBeforeRoulette) {
            const Scattering w = path.weights();
            if (!path.survives(
                    std::max({max_component(w.diffuse), max_component(w.specular), max_component(w.refraction)}))) {
                return;
            }
        }
        path.leave_from(surface.position, surface.geometric_normal, wi);
        if (const int filled = interiors_.filling(path.inside); filled != InsideOf::kNone) {
            path.begin_piece(core_at(surface, filled), bodies_[std::size_t(filled)]->material->volume);
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
        if (weight != Rgb(0.0f)) tile.add(path.pixel, component, group, weight * radiance);
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
    const float u_pick = sampler.next_1d();
    const LightReceiver receiver{surface.position, surface.geometric_normal, surface.object};
    const LightSample sample = lights_.sample(receiver, u_pick, sampler.next_2d());
    if (!(sample.pdf > 0.0f)) return;
    const Scattering value = shader.eval(wo, sample.direction);
    const Light& light = lights_.lights()[std::size_t(sample.light)];
    Rgb diffuse_lobe = value.diffuse * multiplier(light, LightComponent::diffuse);
    Rgb specular_lobe = value.specular * multiplier(light, LightComponent::specular);
    if (diffuse_lobe == Rgb(0.0f) && specular_lobe == Rgb(0.0f)) return;

    Ray shadow;
    shadow.origin = offset_origin(surface.position, surface.geometric_normal);
    shadow.direction = sample.direction;
    shadow.t_max = sample.distance * (1.0f - 1e-4f);
    bool is_straight = true;
    const Rgb visible = visibility(path, sample.light, shadow, path.inside, tile, is_straight);
    if (visible == Rgb(0.0f)) return;
    // Through a boundary broad lobes take light along a straight line; what is seen in a glossy one is refracted.
    if (!is_straight && shader.is_glossy()) specular_lobe = Rgb(0.0f);

    const float mis = sample.is_delta || !is_straight ? 1.0f : sample.pdf / (sample.pdf + value.pdf);
    const Rgb light_over_pdf = sample.radiance * visible * (mis / sample.pdf);
    const std::size_t group = group_of_light_[std::size_t(sample.light)];
    Scattering weights{diffuse_lobe, specular_lobe, Rgb(0.0f), 0.0f};
    if (path.bounce > 0) {
        weights = path.weights();
        weights.scale(diffuse_lobe + specular_lobe);
    } else {
        weights.scale(path.last.refraction);
    }
    tile.add(path.pixel, Component::diffuse, group, weights.diffuse * light_over_pdf);
    tile.add(path.pixel, Component::specular, group, weights.specular * light_over_pdf);
    tile.add(path.pixel, Component::refraction, group, weights.refraction * light_over_pdf);
    add_lpes_beyond(path, LpeKind::diffuse, surface.object, sample.light, diffuse_lobe * light_over_pdf, tile);
    add_lpes_beyond(path, LpeKind::glossy, surface.object, sample.light, specular_lobe * light_over_pdf, tile);
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

// What is left of a light along a ray; `is_straight` becomes false where a boundary would bend it. Inside ice shadows are
// plain.
Rgb PathTracer::visibility(const Path& path, int light, const Ray& ray, const InsideOf& inside, Tile& tile,
                           bool& is_straight) const {
    if (lights_.has_plain_shadow(light) || !inside.is_empty()) {
        // Overlays on the way of light need no detail.
        return interiors_.visibility(ray, inside, tile.rays, true, &is_straight, shadow_footprint(path));
    }
    ++tile.rays;
    return shadow_factor(ray_scene_, lights_, light, ray);
}

// ---- ice ------------------------------------------------------------------------------------------------------------

PathTracer::Core PathTracer::core_at(const Surface& surface, int body) const {
    Core core;
    core.body = body;
    core.position = surface.position;
    core.radiance_per_exitance = bodies_[std::size_t(body)]->inner_radiance_per_exitance(surface);
    return core;
}

// `odds` is the chance with which the path came here, over what the boundary lets through.
bool PathTracer::enter(Path& path, const Surface& surface, const Crossing& crossing, float odds, const Core& core,
                       Sampler& sampler) const {
    const IceMaterial& ice = *bodies_[surface.object]->material;
    const float eta = interiors_.eta(crossing.to);
    const Frame frame(surface.normal);
    const BoundarySample sample =
        sample_entering(frame.to_local(-path.ray.direction), refraction_alpha(ice, surface), eta,
                        interiors_.transmission(static_cast<int>(surface.object)), sampler.next_2d());
    if (!(sample.weight > 0.0f)) return false;

    if (is_index_matched(eta) && path.has_direct_light) {
        // No boundary: lights that were chosen at the last vertex are seen as through air.
        path.scale(Rgb(sample.weight / odds));
    } else {
        path.pass_boundary();
        path.scatter({Rgb(0.0f), Rgb(0.0f), Rgb(sample.weight / odds), 0.0f}, surface.object);
        path.receive(surface, V3f(0.0f), LightUse::refraction);
        path.is_delta = true;
    }
    path.inside = crossing.beyond;
    // What overlays cover is not seen through; what they scatter the core does not get, so that its share grows.
    const float bare = 1.0f - surface.covering.covered;
    path.begin_piece(core, ice.volume * bare);
    path.core.is_entered = true;
    path.clear = ice.refraction * bare;
    path.core_share = 1.0f / std::max(1.0f - surface.covering.scattered, bare + 1e-6f);
    path.spread += lobe_spread(refraction_alpha(ice, surface));
    path.leave_from(surface.position, -surface.geometric_normal,
                    on_side(frame.to_world(sample.wi), surface.geometric_normal, -1.0f));
    return true;
}

// One piece of a path inside ice: what the core gives, what is scattered once, and what is left at its end.
bool PathTracer::cross_interior(Path& path, float length, Sampler& sampler, Tile& tile) const {
    const int body = interiors_.filling(path.inside);
    if (body == InsideOf::kNone) return true;
    constexpr float kFarAway = 1e18f;
    const float way = std::min(length, kFarAway);
    const Medium& medium = bodies_[std::size_t(body)]->material->medium;
    const Rgb unscattered = exp(medium.sigma_s_prime * -way) * path.clear;

    Rgb once(0.0f);
    if (path.volume > 0.0f && path.inner < kMaxVolumePieces) {
        const Segment segment{path.ray.origin, path.ray.direction, length, path.inside, shadow_footprint(path)};
        const OnceScattered scattered = single_scattering_.sample(segment, sampler, tile.rays);
        once = scattered.share * path.volume;
        if (scattered.light >= 0 && scattered.radiance != Rgb(0.0f)) {
            deliver(path, Component::volume, path.weights(), group_of_light_[std::size_t(scattered.light)],
                    scattered.radiance * path.volume, tile);
            add_lpes_beyond(path, LpeKind::volume, std::size_t(body), scattered.light, scattered.radiance * path.volume,
                            tile);
        }
    }
    request_gather(path, path.core, Rgb(1.0f) - (unscattered + once) * path.core_share, tile);

    path.scale(unscattered * exp(medium.sigma_a * -way));
    path.clear = path.core_share = 1.0f;
    const Scattering w = path.weights();
    const float left = std::max({max_component(w.diffuse), max_component(w.specular), max_component(w.refraction)});
    return left > 0.0f && path.survives(left / kFaint);
}

// The first fracture plane inside ice that stops the path: each in turn by the chance of its opacity.
bool PathTracer::find_sheet(const Path& path, float length, float& t, V3f& normal, Rgb& color) const {
    const int body = interiors_.filling(path.inside);
    if (body == InsideOf::kNone) return false;
    const IceMaterial& ice = *bodies_[std::size_t(body)]->material;
    if (!ice.has_sheets()) return false;
    // Nothing is seen through so much ice.
    const Rgb sigma = ice.medium.sigma_s_prime + ice.medium.sigma_a;
    const float reach = std::min(length, 8.0f / std::max(std::min(sigma.x, std::min(sigma.y, sigma.z)), 1e-6f));
    const auto object = static_cast<std::uint32_t>(body);
    const V3f origin = path.ray.origin * resolver_.world_to_rest(object);
    V3f direction;
    resolver_.world_to_rest(object).multDirMatrix(path.ray.direction, direction);
    Sampler coin = path.sampler;
    coin.set_dimension(kSheetDimensions + 32U * path.vertex);
    bool is_found = false;
    for (const Overlay& overlay : ice.overlays) {
        const float opacity = overlay.internal * age_weight(overlay, ice.age);
        if (overlay.pattern.kind != PatternKind::fracture || !(opacity > 0.0f)) continue;
        float begin = 0.5f * overlay.pattern.width + 1e-4f;
        for (int k = 0; k < kMaxSheets; ++k) {
            float met = 0.0f, mask = 0.0f;
            V3f met_normal;
            const float footprint = path.width + path.spread * begin;
            if (!next_fracture(overlay.pattern, origin, direction, begin, is_found ? t : reach, footprint, met, mask,
                               met_normal)) {
                break;
            }
            if (coin.next_1d() < mask * opacity) {
                t = met, color = overlay.color, is_found = true;
                resolver_.rest_to_world(object).multDirMatrix(met_normal, normal);
                break;
            }
            begin = met + 1e-4f * overlay.pattern.size;
        }
    }
    return is_found;
}

// A fracture plane: a thin diffuse sheet that sends half of its light to either side.
bool PathTracer::meet_sheet(Path& path, const V3f& position, const V3f& normal, const Rgb& color, Tile& tile) const {
    const int body = interiors_.filling(path.inside);
    const auto cosine_pdf = [&](const V3f& wi) { return 0.5f * kInvPi * std::abs(normal.dot(wi)); };
    if (!lights_.is_empty()) {
        const float u_pick = path.sampler.next_1d();
        const LightReceiver receiver{position, V3f(0.0f), static_cast<std::uint32_t>(body)};
        const LightSample sample = lights_.sample(receiver, u_pick, path.sampler.next_2d(), LightUse::refraction);
        const float value = cosine_pdf(sample.direction);
        if (sample.pdf > 0.0f && value > 0.0f) {
            bool is_straight = true;
            const Ray shadow{position, sample.direction, 0.0f, sample.distance * (1.0f - 1e-4f)};
            const Rgb visible = visibility(path, sample.light, shadow, path.inside, tile, is_straight);
            const float mis = sample.is_delta || !is_straight ? 1.0f : sample.pdf / (sample.pdf + value);
            const Light& light = lights_.lights()[std::size_t(sample.light)];
            const Rgb lobe = color * (value * multiplier(light, LightComponent::refraction));
            const Rgb arriving = sample.radiance * visible * (mis / sample.pdf);
            Scattering weights = path.weights();
            weights.scale(lobe);
            deliver(path, Component::refraction, weights, group_of_light_[std::size_t(sample.light)], arriving, tile);
            add_lpes_beyond(path, LpeKind::diffuse, std::size_t(body), sample.light, lobe * arriving, tile);
        }
    }
    if (path.scattered >= max_bounces_ || path.inner >= kMaxInnerBounces) {
        Core core = path.core;
        core.is_primary = false;
        core.position = position;
        request_gather(path, core, color, tile);
        return false;
    }
    ++path.scattered, ++path.inner;
    const float u_side = path.sampler.next_1d();
    const V3f local = cosine_hemisphere(path.sampler.next_2d());
    const V3f wi = Frame(u_side < 0.5f ? normal : -normal).to_world(local);
    path.scatter({color, Rgb(0.0f), Rgb(0.0f), cosine_pdf(wi)}, std::size_t(body));
    path.receiver = {position, V3f(0.0f), static_cast<std::uint32_t>(body)};
    path.use = LightUse::refraction;
    path.has_passed = false;
    path.is_delta = false;
    path.has_direct_light = path.sees_lamps = true;
    path.is_glossy = false;
    path.light_share = Rgb(1.0f);
    path.spread += kScatteredSpread;
    path.ray = {position, wi};
    Core core = path.core;
    core.is_primary = false;
    core.position = position;
    path.begin_piece(core, bodies_[std::size_t(body)]->material->volume);
    return true;
}

// From inside: light of the outside, then reflect or go through.
bool PathTracer::meet_boundary(Path& path, const Surface& surface, const Crossing& crossing, Sampler& sampler,
                               Tile& tile) const {
    const IceMaterial& ice = *bodies_[surface.object]->material;
    const float eta = interiors_.eta(crossing.to) / interiors_.eta(crossing.from);
    if (is_index_matched(eta)) {
        path.inside = crossing.beyond;
        path.ray.origin = offset_origin(surface.position, -surface.geometric_normal);
        ++path.straight;
        if (crossing.to != InsideOf::kNone) path.core = core_at(surface, crossing.to);
        return true;
    }
    if (path.inner >= kMaxInnerBounces) {
        request_gather(path, core_at(surface, crossing.from), Rgb(1.0f), tile);
        return false;
    }
    ++path.inner;
    // What lies on the boundary is seen from below as the core sees it.
    if (const float covered = surface.covering.covered; covered > kHiding) {
        request_gather(path, core_at(surface, crossing.from), Rgb(covered), tile);
        path.scale(Rgb(1.0f - covered));
        if (covered >= 1.0f) return false;
    }
    const float alpha = refraction_alpha(ice, surface);
    if (crossing.to == InsideOf::kNone) add_light_beyond(path, surface, crossing, alpha, sampler, tile);

    const Frame frame(surface.normal);
    const V3f wo = frame.to_local(-path.ray.direction);
    const float u_lobe = sampler.next_1d();
    const BoundarySample sample = sample_inner(wo, alpha, eta, u_lobe, sampler.next_2d());
    if (sample.is_reflection) {
        path.scatter({Rgb(0.0f), Rgb(0.0f), Rgb(1.0f), 0.0f}, surface.object, LpeKind::inner_reflection);
        path.receive(surface, V3f(0.0f), LightUse::refraction);
        path.has_direct_light = path.sees_lamps = false;
        path.light_share = Rgb(1.0f);
        path.is_delta = true;
        path.leave_from(surface.position, surface.geometric_normal,
                        on_side(frame.to_world(sample.wi), surface.geometric_normal, 1.0f));
    } else {
        path.pass_boundary();
        path.scatter({Rgb(0.0f), Rgb(0.0f), Rgb(1.0f), inner_transmission(wo, sample.wi, alpha, eta)}, surface.object);
        path.receive(surface, -surface.geometric_normal, LightUse::refraction);
        path.is_delta = crossing.to != InsideOf::kNone;
        path.inside = crossing.beyond;
        path.leave_from(surface.position, -surface.geometric_normal,
                        on_side(frame.to_world(sample.wi), surface.geometric_normal, -1.0f));
    }
    const int body = interiors_.filling(path.inside);
    path.spread += lobe_spread(alpha);
    if (body != InsideOf::kNone) path.begin_piece(core_at(surface, body), bodies_[std::size_t(body)]->material->volume);
    return true;
}

// One light of the outside, seen from inside through the rough boundary, weighted against the path that goes on.
void PathTracer::add_light_beyond(const Path& path, const Surface& surface, const Crossing& crossing, float alpha,
                                  Sampler& sampler, Tile& tile) const {
    const float u_pick = sampler.next_1d();
    const V2f u = sampler.next_2d();
    Path beyond = path;
    beyond.pass_boundary();
    if (lights_.is_empty() || beyond.light_share == Rgb(0.0f)) return;
    const LightReceiver receiver{surface.position, -surface.geometric_normal, surface.object};
    const LightSample sample = lights_.sample(receiver, u_pick, u, LightUse::refraction);
    if (!(sample.pdf > 0.0f) || sample.direction.dot(surface.geometric_normal) >= 0.0f) return;
    const Frame frame(surface.normal);
    const float eta = interiors_.eta(crossing.to) / interiors_.eta(crossing.from);
    const float value =
        inner_transmission(frame.to_local(-path.ray.direction), frame.to_local(sample.direction), alpha, eta);
    if (!(value > 0.0f)) return;

    const Ray shadow{offset_origin(surface.position, -surface.geometric_normal), sample.direction, 0.0f,
                     sample.distance * (1.0f - 1e-4f)};
    bool is_straight = true;
    const Rgb visible = visibility(path, sample.light, shadow, crossing.beyond, tile, is_straight);
    if (visible == Rgb(0.0f) || !is_straight) return;
    const float mis = sample.is_delta ? 1.0f : sample.pdf / (sample.pdf + value);
    const Light& light = lights_.lights()[std::size_t(sample.light)];
    if (!path.sees_lamps && !std::holds_alternative<DomeLight>(light.shape)) return;
    Scattering weights = path.weights();
    weights.scale(Rgb(value * multiplier(light, LightComponent::refraction)));
    // Before the first lobe the boundary itself is the first.
    const std::size_t group = group_of_light_[std::size_t(sample.light)];
    const Rgb radiance = sample.radiance * visible * beyond.light_share * (mis / sample.pdf);
    deliver(path, Component::refraction, weights, group, radiance, tile);
    add_lpes_beyond(path, LpeKind::refraction, surface.object, sample.light,
                    radiance * (value * multiplier(light, LightComponent::refraction)), tile);
}

void PathTracer::request_gather(const Path& path, const Core& core, const Rgb& share, Tile& tile) const {
    if (core.body == InsideOf::kNone) return;
    const Body& body = *bodies_[std::size_t(core.body)];
    if (!body.tree || body.material->translucency == 0.0f) return;

    GatherRequest request;
    request.object = static_cast<std::uint32_t>(core.body);
    request.pixel = path.pixel;
    request.subset = tile.subset;
    request.position = core.position;
    request.is_primary = core.is_primary;
    request.entering = core.entering;
    request.entering_group = core.entering_group;
    Scattering weights = path.weights();
    weights.scale(core.radiance_per_exitance * share * body.core_scale);
    request.diffuse = weights.diffuse;
    request.specular = weights.specular;
    (core.is_primary ? request.translucency : request.refraction) = weights.refraction;
    if (weights.sum() == Rgb(0.0f) && !core.is_primary) return;
    for (const LpeTracks::Track& track : path.lpe.tracks) {
        const auto seen_from = core.is_entered ? track.previous : track.state;
        const auto state = layout_.lpes[track.lpe].next(seen_from, LpeKind::translucency, request.object);
        if (state == LpeAutomaton::kDead) continue;
        request.lpes.push_back({track.lpe, state, track.sum() * core.radiance_per_exitance * share});
    }
    tile.requests.push_back(std::move(request));
}

void PathTracer::add_entering_light(Core& core, const Surface& surface, const Body& body, Sampler& sampler) const {
    const IceMaterial& ice = *body.material;
    const bool fills = ice.compensation.mode == CompensationMode::fill;
    if (!fills && !(core.is_primary && layout_.needs_fill())) return;
    Sampler copy = sampler;  // a layer that is asked for must not change the picture
    Sampler& own = fills ? sampler : copy;
    const float u_pick = own.next_1d();
    const LightReceiver receiver{surface.position, surface.geometric_normal, surface.object};
    const LightSample sample = lights_.sample(receiver, u_pick, own.next_2d(), LightUse::translucency);
    const float cosine = surface.normal.dot(sample.direction);
    const Ray shadow{offset_origin(surface.position, surface.geometric_normal), sample.direction, 0.0f,
                     sample.distance * (1.0f - 1e-4f)};
    if (!(sample.pdf > 0.0f) || cosine <= 0.0f || surface.geometric_normal.dot(sample.direction) <= 0.0f) return;
    const Light& light = lights_.lights()[std::size_t(sample.light)];
    const float entering = body.transmittance(cosine, surface.covering.roughness) * (1.0f - surface.covering.scattered);
    core.entering = sample.radiance * shadow_factor(ray_scene_, lights_, sample.light, shadow) *
                    (multiplier(light, LightComponent::translucency) * entering * cosine / sample.pdf);
    core.entering_group = static_cast<std::uint32_t>(group_of_light_[std::size_t(sample.light)]);
}

void PathTracer::gather(const GatherOptions& options, Tile& tile) const {
    // One gather per body: requests grouped by object, in their own order.
    std::stable_sort(tile.requests.begin(), tile.requests.end(),
                     [](const GatherRequest& a, const GatherRequest& b) { return a.object < b.object; });
    std::vector<V3f> positions;
    for (std::size_t begin = 0; begin < tile.requests.size();) {
        const Body& body = *bodies_[tile.requests[begin].object];
        positions.clear();
        std::size_t end = begin;
        for (; end < tile.requests.size() && tile.requests[end].object == tile.requests[begin].object; ++end) {
            positions.push_back(tile.requests[end].position);
        }
        GatherOptions with_layers = options;
        with_layers.ramp_layers = !layout_.knots.empty() && !body.material->ramp.is_empty();
        const Gathered gathered = body.tree->gather(positions.data(), positions.size(), with_layers);
        const std::vector<Rgb> thin =
            thickness_gains(body.thickness.get(), positions.data(), positions.size(), with_layers);

        for (std::size_t i = begin; i < end; ++i) {
            const GatherRequest& request = tile.requests[i];
            tile.subset = request.subset;
            const Rgb& coverage = gathered.coverage[i - begin];
            const Compensation& compensation = body.material->compensation;
            const Rgb* thin_gain = thin.empty() ? nullptr : &thin[i - begin];
            const Rgb gain = body.gain(compensation, coverage, thin_gain);
            const Rgb fill = fill_amount(compensation, coverage, body.total_reflectance) * request.entering;
            for (std::size_t group = 0; group < gathered.groups; ++group) {
                Rgb exitance = gathered.exitance[(i - begin) * gathered.groups + group] * gain;
                if (group == request.entering_group) exitance += fill;
                tile.add(request.pixel, Component::translucency, group, exitance * request.translucency);
                tile.add(request.pixel, Component::diffuse, group, exitance * request.diffuse);
                tile.add(request.pixel, Component::specular, group, exitance * request.specular);
                tile.add(request.pixel, Component::refraction, group, exitance * request.refraction);
                for (const auto& [lpe, state, weight] : request.lpes) {
                    if (!layout_.lpes[lpe].ends_in_group(state, group)) continue;
                    tile.add_lpe(request.pixel, lpe, exitance * weight);
                }
            }
            if (request.is_primary) {
                const Rgb& total = body.total_reflectance;
                Rgb lacking(0.0f);
                for (int c = 0; c < 3; ++c) lacking[c] = total[c] > 0.0f ? 1.0f - coverage[c] / total[c] : 0.0f;
                tile.add_coverage(request.pixel, coverage, lacking);
            }
            if (request.is_primary && layout_.plane_count() > 0)
                add_planes(request, gathered, i - begin, thin_gain, tile);
        }
        begin = end;
    }
    tile.requests.clear();
}

// Translucency once more, apart by ramp knot and as every compensation mode that was asked for would have it.
void PathTracer::add_planes(const GatherRequest& request, const Gathered& gathered, std::size_t row,
                            const Rgb* thin_gain, Tile& tile) const {
    const Body& body = *bodies_[request.object];
    const Compensation& rendered = body.material->compensation;
    const Rgb &coverage = gathered.coverage[row], &weight = request.translucency;
    const auto fill_of = [&](const Compensation& compensation) {
        return fill_amount(compensation, coverage, body.total_reflectance) * request.entering * weight;
    };
    if (!layout_.knots.empty()) {
        const Rgb scale = body.gain(rendered, coverage, thin_gain) * weight;
        const std::size_t first = layout_.first_knot[scene_.objects[request.object].material];
        for (std::size_t k = 0; k < std::max<std::size_t>(gathered.knots, 1); ++k) {
            const Rgb* light = gathered.knots > 0 ? &gathered.layers[(row * gathered.knots + k) * gathered.groups]
                                                  : &gathered.exitance[row * gathered.groups];
            for (std::size_t g = 0; g < gathered.groups; ++g) {
                tile.add_to_plane(request.pixel, first + k, g, light[g] * scale);
            }
        }
        if (layout_.fill_plane != FilmLayout::kNone) {
            tile.add_to_plane(request.pixel, layout_.fill_plane, request.entering_group, fill_of(rendered));
        }
    }
    for (std::size_t m = 0; m < layout_.modes.size(); ++m) {
        Compensation full = rendered;
        full.mode = layout_.modes[m];
        full.strength = 1.0f;
        const std::size_t plane = layout_.knots.size() + m;
        const Rgb scale = body.gain(full, coverage, full.mode == rendered.mode ? thin_gain : nullptr) * weight;
        for (std::size_t g = 0; g < gathered.groups; ++g) {
            tile.add_to_plane(request.pixel, plane, g, gathered.exitance[row * gathered.groups + g] * scale);
        }
        tile.add_to_plane(request.pixel, plane, request.entering_group, fill_of(full));
    }
}

}  // namespace frazil
