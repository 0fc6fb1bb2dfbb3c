// Paths: entering ice, going on inside it, meeting its boundary from inside.
#include <algorithm>

#include "frazil/render/path.h"
#include "frazil/render/path_state.h"

namespace frazil {
namespace {

constexpr int kMaxVolumePieces = 2;  // of a path have their single scattering traced
// A refracted path that is worth less goes on by chance only: so much of its light the core gives, without noise. Before it
// comes to a boundary, where small bright lights may be seen through it, with care; more boldly once they were asked.
constexpr float kFaint = 0.05f, kFaintBeyond = 0.1f;
// Overlays that cover less than this are not seen from below.
constexpr float kHiding = 0.01f;

// The direction on the side of the plane that `sign` tells; one on the wrong side is mirrored at the plane.
V3f on_side(const V3f& direction, const V3f& normal, float sign) {
    const float cosine = direction.dot(normal) * sign;
    return cosine > 0.0f ? direction : (direction - normal * (2.0f * sign * (cosine - 1e-5f))).normalized();
}

// What goes through is blurred at least as the overlays blur the reflection.
float refraction_alpha(const IceMaterial& ice, const Surface& surface) {
    const float roughness = surface.covering.roughness;
    if (ice.refraction_roughness < 0.0f) return alpha_from_roughness(roughness);
    const float bare = surface.covering.bare_roughness;
    return alpha_from_roughness(ice.refraction_roughness + std::max(0.0f, roughness - bare));
}

}  // namespace

IceCore PathTracer::core_at(const Path& path, const Surface& surface, int body, bool from_inside) const {
    const Body& ice = *bodies_[std::size_t(body)];
    IceCore core;
    core.body = body;
    core.position = surface.position;
    core.normal = from_inside ? -surface.geometric_normal : surface.geometric_normal;
    core.depth = ice.depth();
    core.radiance_per_exitance = ice.inner_radiance_per_exitance(surface);
    if (!from_inside) {
        core.slant = ice.cosine_inside(std::abs(surface.normal.dot(path.ray.direction)));
        core.depth = core.slant / ice.sigma_t();
        core.drift = ice.drift(path.ray.direction, surface.normal);
    }
    return core;
}

// `odds` is the chance with which the path came here, over what the boundary lets through.
bool PathTracer::enter(Path& path, const Surface& surface, const Crossing& crossing, float odds, const IceCore& core,
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
    path.tint = ice.refraction_tint;
    path.core_share = 1.0f / std::max(1.0f - surface.covering.scattered, bare + 1e-6f);
    path.spread += lobe_spread(refraction_alpha(ice, surface));
    path.add_blur(refraction_alpha(ice, surface));
    path.leave_from(surface.position, -surface.geometric_normal,
                    on_side(frame.to_world(sample.wi), surface.geometric_normal, -1.0f));
    return true;
}

// One piece of a path inside ice: what the core gives, what is scattered once, and what is left at its end.
bool PathTracer::cross_interior(Path& path, float length, Sampler& sampler, Tile& tile) const {
    const int body = interiors_.filling(path.inside);
    if (body == InsideOf::kNone) return true;
    const Interiors::Depth through = interiors_.depth(body, path.ray, length);
    const Medium& medium = bodies_[std::size_t(body)]->material->medium;
    const Rgb unscattered = exp(medium.sigma_s_prime * -through.scattering) * path.clear;

    Rgb once(0.0f);
    if (path.volume > 0.0f && path.inner < kMaxVolumePieces) {
        const Segment segment{path.ray.origin, path.ray.direction, length, path.inside, path.shadow_footprint()};
        const OnceScattered scattered = single_scattering_.sample(segment, sampler, tile.rays);
        once = scattered.share * path.volume;
        if (scattered.light >= 0 && scattered.radiance != Rgb(0.0f)) {
            deliver(path, Component::volume, path.weights(), group_of_light_[std::size_t(scattered.light)],
                    scattered.radiance * path.volume, tile);
            add_lpes_beyond(path, LpeKind::volume, std::size_t(body), scattered.light, scattered.radiance * path.volume,
                            tile);
        }
    }
    const Rgb seen_through = unscattered * exp(medium.sigma_a * -through.absorption);
    path.core.stop_within(bodies_[std::size_t(body)]->drift_within(length));
    request_gather(path, path.core, Rgb(1.0f) - (seen_through + once) * path.core_share, tile);

    path.scale(seen_through * path.tint);
    path.clear = path.core_share = 1.0f;
    path.tint = Rgb(1.0f);
    const float left = path.worth();
    return left > 0.0f && path.survives(left / kFaint);
}

// From inside: light of the outside, then reflect or go through.
bool PathTracer::meet_boundary(Path& path, const Surface& surface, const Crossing& crossing, Sampler& sampler,
                               Tile& tile) const {
    const IceMaterial& ice = *bodies_[surface.object]->material;
    const float eta = interiors_.eta(crossing.to) / interiors_.eta(crossing.from);
    if (is_index_matched(eta)) {
        path.scale(ice.refraction_tint);
        path.inside = crossing.beyond;
        path.ray.origin = offset_origin(surface.position, -surface.geometric_normal);
        ++path.straight;
        if (crossing.to != InsideOf::kNone) path.core = core_at(path, surface, crossing.to, false);
        return true;
    }
    if (path.inner >= kMaxInnerBounces) {
        request_gather(path, core_at(path, surface, crossing.from, true), Rgb(1.0f), tile);
        return false;
    }
    if (path.inner >= kInnerBouncesBeforeRoulette && !path.survives(kInnerChance)) return false;
    ++path.inner;
    // What lies on the boundary is seen from below as the core sees it.
    if (const float covered = surface.covering.covered; covered > kHiding) {
        request_gather(path, core_at(path, surface, crossing.from, true), Rgb(covered), tile);
        path.scale(Rgb(1.0f - covered));
        if (covered >= 1.0f) return false;
    }
    const float alpha = refraction_alpha(ice, surface);
    if (crossing.to == InsideOf::kNone) add_light_beyond(path, surface, crossing, alpha, sampler, tile);
    if (!path.survives(path.worth() / kFaintBeyond)) return false;

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
        path.scatter({Rgb(0.0f), Rgb(0.0f), ice.refraction_tint, inner_transmission(wo, sample.wi, alpha, eta)},
                     surface.object);
        path.receive(surface, -surface.geometric_normal, LightUse::refraction);
        path.is_delta = crossing.to != InsideOf::kNone;
        path.inside = crossing.beyond;
        path.leave_from(surface.position, -surface.geometric_normal,
                        on_side(frame.to_world(sample.wi), surface.geometric_normal, -1.0f));
    }
    const int body = interiors_.filling(path.inside);
    path.spread += lobe_spread(alpha);
    path.add_blur(alpha);
    if (body != InsideOf::kNone) {
        path.begin_piece(core_at(path, surface, body, body == crossing.from),
                         bodies_[std::size_t(body)]->material->volume);
    }
    return true;
}

void PathTracer::add_matte(const Path& path, std::size_t object, const Rgb& share, Tile& tile) const {
    if (layout_.mattes.empty() || path.bounce == 0 || path.scattered > 0) return;
    const float weight = luminance(path.weights().refraction * share);
    for (const std::uint32_t matte : layout_.mattes_of_object[object]) tile.add_matte(path.pixel, matte, true, weight);
}

void PathTracer::request_gather(const Path& path, const IceCore& core, const Rgb& share, Tile& tile) const {
    if (core.body == InsideOf::kNone) return;
    if (!core.is_primary && interiors_.is_open_to_rays(static_cast<std::uint32_t>(core.body))) {
        add_matte(path, std::size_t(core.body), share, tile);
    }
    const Body& body = *bodies_[std::size_t(core.body)];
    if (!body.trees.light || body.material->translucency == 0.0f) return;

    GatherRequest request;
    request.object = static_cast<std::uint32_t>(core.body);
    request.pixel = path.pixel;
    request.subset = tile.subset;
    request.position = core.position + core.drift;
    request.normal = core.normal;
    request.depth = core.depth;
    request.is_primary = core.is_primary;
    request.samples = path.samples;
    request.entering_place = core.entering_place;
    const Rgb leaving = core.slant < 0.0f ? Rgb(1.0f) : body.leaving_share(core.slant * core.within);
    const Rgb scale = core.radiance_per_exitance * leaving * share * body.core_scale;
    request.plane = body.thin->plane * leaving;
    const float cosine = core.slant < 0.0f ? kMeanCosine : core.slant * core.within;
    request.absorbed_at = body.absorbed_at(cosine);
    // Further along the ray than where light is scattered first.
    const float further = cosine > 0.0f ? mean_component(request.absorbed_at) / cosine : 1.0f;
    request.absorbing = core.position + (core.drift - core.normal * core.depth) * further;
    Scattering weights = path.weights();
    weights.scale(scale);
    request.diffuse = weights.diffuse;
    request.specular = weights.specular;
    (core.is_primary ? request.translucency : request.refraction) = weights.refraction;
    if (weights.sum() == Rgb(0.0f) && !core.is_primary) return;
    for (const LpeTracks::Track& track : path.lpe.tracks) {
        const auto seen_from = core.is_entered ? track.previous : track.state;
        const auto state = layout_.lpes[track.lpe].next(seen_from, LpeKind::translucency, request.object);
        if (state == LpeAutomaton::kDead) continue;
        request.lpes.push_back({track.lpe, state, track.sum() * scale});
    }
    request.first_overlay = static_cast<std::uint32_t>(tile.overlays.size());
    for (const OverlayShare& overlay : path.overlays) {
        const std::size_t plane = layout_.overlay_plane(layout_.overlay_of[path.first_material][overlay.overlay]);
        const Rgb of_core = core.is_entered ? change_of_core(overlay, share) : overlay.core;
        tile.overlays.push_back({plane, overlay.diffuse, of_core, overlay.seen_through});
    }
    request.overlay_count = static_cast<std::uint32_t>(path.overlays.size());
    tile.requests.push_back(std::move(request));
}

}  // namespace frazil
