#include "frazil/render/path.h"

#include <algorithm>
#include <cmath>

#include "frazil/render/path_state.h"

namespace frazil {
namespace {

constexpr int kBouncesBeforeRoulette = 3;

}  // namespace

PathTracer::PathTracer(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                       const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::size_t>& group_of_light,
                       const FilmLayout& layout, int max_bounces, const PixelCone& pixel, const MotionVectors* motion)
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
      pixel_(pixel),
      motion_(motion) {
    for (const Object& object : scene.objects) {
        const auto* standard = std::get_if<StandardMaterial>(&scene.materials[object.material].model);
        may_let_pass_.push_back(standard && (standard->opacity.lookup.texture || standard->opacity.value < 1.0f));
    }
}

void PathTracer::see(std::span<const Ray> camera_rays, std::vector<FirstHit>& seen, Tile& tile) const {
    thread_local std::vector<Hit> hits;
    hits.resize(camera_rays.size());
    ray_scene_.intersect(camera_rays, hits, nullptr, true);
    tile.rays += camera_rays.size();
    seen.assign(camera_rays.size(), {});
    for (std::size_t i = 0; i < seen.size(); ++i) {
        seen[i].ray = camera_rays[i];
        seen[i].is_hit = std::isfinite(hits[i].t);
        seen[i].hit = hits[i];
    }
}

void PathTracer::note_first(FirstHit& first, const V3f& view_axis, const Sampler& sampler, std::uint32_t pixel,
                            Tile& tile) const {
    if (!first.is_hit || !camera_inside_.is_empty() || may_let_pass_[first.hit.placement]) return;
    const Surface surface = resolver_.glimpse(first.hit, first.ray.direction);
    first.position = surface.position;
    first.normal = surface.normal;
    first.footprint = pixel_.radius + pixel_.spread * first.hit.t;
    note(first.hit, surface, (surface.position - first.ray.origin).dot(view_axis), sampler, pixel, tile);
    first.is_noted = true;
}

// What a sample shows first, as far as shading has no part in it.
void PathTracer::note(const Hit& hit, const Surface& surface, float depth, const Sampler& sampler, std::uint32_t pixel,
                      Tile& tile) const {
    if (tile.add_hit(pixel, depth)) {
        tile.set_nearest(pixel, {depth, surface.position, surface.object + 1, surface.st, surface.local_position,
                                 motion_ ? motion_->of_hit(hit) : V2f(0.0f)});
    }
    if (tile.keeps_places) {
        Sampler own = sampler;
        own.set_dimension(kOpennessDimensions);
        tile.places.push_back({pixel, surface.object, surface.position, surface.geometric_normal, own.next_2d()});
    }
    tile.add_object(pixel, surface.object, false);
    if (layout_.mattes.empty()) return;
    for (const std::uint32_t matte : layout_.mattes_of_object[surface.object])
        tile.add_matte(pixel, matte, false, 1.0f);
}

void PathTracer::trace(const FirstHit& first, float samples, const V3f& view_axis, Sampler sampler, std::uint32_t pixel,
                       Tile& tile) const {
    Path path;
    path.pixel = pixel;
    path.samples = samples;
    path.ray = first.ray;
    path.receiver.position = first.ray.origin;
    path.sampler = sampler;
    path.last.refraction = Rgb(samples);
    path.width = pixel_.radius;
    path.spread = pixel_.spread;
    if (!layout_.lpes.empty()) {
        path.lpe.begin(layout_.lpes);
        path.lpe.scale(Rgb(samples));
    }
    path.inside = camera_inside_;
    if (const int body = interiors_.filling(path.inside); body != InsideOf::kNone) {
        Surface camera;
        camera.position = first.ray.origin;
        path.core = core_at(path, camera, body, true);
        path.core.is_primary = true;
        path.volume = bodies_[std::size_t(body)]->material->volume;
    }
    Path refracted;
    bool has_split = false;
    follow(path, &first, &view_axis, &refracted, has_split, tile);
    bool has_none = false;
    if (has_split) follow(refracted, nullptr, nullptr, nullptr, has_none, tile);
}

void PathTracer::follow(Path& path, const FirstHit* first, const V3f* view_axis, Path* split, bool& has_split,
                        Tile& tile) const {
    const V3f eye = path.ray.origin;
    while (true) {
        Hit hit;
        bool is_hit = false, is_noted = false;
        if (first) {
            hit = first->hit, is_hit = first->is_hit, is_noted = first->is_noted;
            first = nullptr;
        } else {
            ++tile.rays;
            Ray ray = path.ray;
            ray.t_max = std::min(ray.t_max, sight(path));
            is_hit = ray_scene_.intersect(ray, hit);
        }
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
        if (!is_hit) {
            if (view_axis && motion_) tile.add_background(path.pixel, motion_->of_background(path.ray.direction));
            return;
        }

        const V3f wo = -path.ray.direction;
        path.width += path.spread * length;
        Surface surface = resolver_.resolve(hit, path.ray.direction, path.width, path.bounce == 0);
        const float blur = std::hypot(path.blur, surface.normal_spread);
        surface.covering.roughness = blurred_roughness(surface.covering.roughness, blur);
        const auto note_primary = [&](const Rgb& albedo) {
            if (!view_axis) return;
            if (!is_noted) {
                note(hit, surface, (surface.position - eye).dot(*view_axis), path.sampler, path.pixel, tile);
            }
            tile.add_shaded(path.pixel, surface.normal, albedo, path.samples);
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
        const Shader shader(surface, body, blur);
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
        if (!is_open || crossing.to == InsideOf::kNone) add_matte(path, surface.object, Rgb(1.0f), tile);
        if (path.bounce > 0 && path.scattered == 0 && !path.has_shown) {
            path.has_shown = true;
            tile.add_object(path.pixel, surface.object, true, path.samples);
        }

        add_own_light(path, surface, shader, tile);
        float reflection_odds = 1.0f;
        if (body) {
            if (path.bounce == 0 && !layout_.overlay_names.empty()) {
                path.overlays = overlay_shares(surface, resolver_.slopes(surface));
                path.first_material = scene_.objects[surface.object].material;
            }
            const float leaving = body->transmittance(surface.normal.dot(wo), surface.covering.roughness);
            IceCore core = core_at(path, surface, static_cast<int>(surface.object), false);
            core.is_primary = path.bounce == 0;
            note_entering(core, path, surface, *body, tile);
            if (!is_open || crossing.to == InsideOf::kNone) {
                if (core.is_primary) {
                    core.stop_within(body->drift_within(chord_behind(surface, path.ray.direction, tile)));
                } else {
                    core.drift = V3f(0.0f);
                }
                request_gather(path, core, Rgb(leaving), tile);
            } else if (split) {
                *split = path;
                split->vertex += kSplitVertex;
                split->begin_vertex();
                has_split = enter(*split, surface, crossing, 1.0f / leaving, core, split->sampler);
                split = nullptr;
            } else {
                // Either reflect or enter, by how much goes either way.
                const float reflected = 1.0f - leaving * (1.0f - luminance(surface.covering.reflectance));
                reflection_odds = shader.scatters() ? std::clamp(reflected, 0.05f, 0.95f) : 0.0f;
                if (path.sampler.next_1d() >= reflection_odds) {
                    // The light that comes straight from lights is the reflection's, whichever way the path goes.
                    if (shader.scatters()) add_direct_light(path, surface, shader, wo, path.sampler, tile);
                    if (!enter(path, surface, crossing, (1.0f - reflection_odds) / leaving, core, path.sampler)) return;
                    continue;
                }
            }
        }

        if (!shader.scatters()) return;
        add_direct_light(path, surface, shader, wo, path.sampler, tile);
        if (!reflect(path, surface, shader, wo, reflection_odds)) return;
        split = nullptr;
    }
}

// How far is worth looking for what the path meets next: light that is scattered before is the core's.
float PathTracer::sight(const Path& path) const {
    const int body = interiors_.filling(path.inside);
    if (body == InsideOf::kNone || path.volume > 0.0f || interiors_.density(body)) {
        return std::numeric_limits<float>::infinity();
    }
    return interiors_.scattering_depth(body);
}

// How far a ray goes straight on behind a surface.
float PathTracer::chord_behind(const Surface& surface, const V3f& direction, Tile& tile) const {
    ++tile.rays;
    Hit hit;
    const bool is_hit =
        ray_scene_.intersect({offset_origin(surface.position, -surface.geometric_normal), direction}, hit);
    return is_hit ? hit.t : std::numeric_limits<float>::infinity();
}

// What a surface itself gives: emission, where no mesh light stands for it.
void PathTracer::add_own_light(const Path& path, const Surface& surface, const Shader& shader, Tile& tile) const {
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
}

// Go on along one lobe of a surface that was met from outside; `odds` is the chance with which the path did not enter.
bool PathTracer::reflect(Path& path, const Surface& surface, const Shader& shader, const V3f& wo, float odds) const {
    if (path.scattered >= max_bounces_) return false;

    V3f wi;
    const float u_lobe = path.sampler.next_1d();
    if (!shader.sample(wo, u_lobe, path.sampler.next_2d(), wi)) return false;
    Scattering value = shader.eval(wo, wi);
    if (!(value.pdf > 0.0f)) return false;
    value.scale(Rgb(1.0f / (value.pdf * odds)));
    const bool is_diffuse = luminance(value.diffuse) > luminance(value.specular);
    path.add_blur(is_diffuse ? kDiffuseBlur : shader.alpha());
    path.spread += is_diffuse ? kDiffuseSpread : lobe_spread(shader.alpha());
    const float picks = path.light_picks();
    path.scatter(value, surface.object);
    path.receive(surface, surface.horizon, LightUse::surface, picks);
    ++path.scattered;
    path.is_delta = false;
    path.has_direct_light = path.sees_lamps = true;
    path.is_glossy = shader.is_glossy();
    path.light_share = Rgb(1.0f);

    // Russian roulette on what the path may still bring.
    if (path.scattered > kBouncesBeforeRoulette) {
        if (!path.survives(path.worth())) return false;
    }
    path.leave_from(surface.lifted, surface.geometric_normal, wi);
    if (const int filled = interiors_.filling(path.inside); filled != InsideOf::kNone) {
        path.begin_piece(core_at(path, surface, filled, true), bodies_[std::size_t(filled)]->material->volume);
    }
    return true;
}

}  // namespace frazil
