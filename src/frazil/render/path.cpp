#include "frazil/render/path.h"

#include <algorithm>
#include <tuple>

#include "frazil/lighting/shadow.h"
#include "frazil/material/microfacet.h"

namespace frazil {
namespace {

// Dimensions that one vertex may draw from the sampler, so that all vertices are stratified alike.
constexpr std::uint32_t kDimensionsPerVertex = 8;
constexpr std::uint32_t kTransparencyDimensions = 4096;
constexpr int kBouncesBeforeRoulette = 3;
constexpr int kMaxTransparentHits = 64;

float multiplier(const Light& light, LightComponent component) {
    return light.multipliers[static_cast<int>(component)];
}

}  // namespace

// The state of a path between two vertices.
struct PathTracer::Path {
    std::uint32_t pixel = 0;
    int bounce = 0;  // vertices that scattered so far
    Ray ray;
    // What light from the last vertex is worth to the camera, apart for paths whose first lobe was diffuse or specular.
    // Before the first vertex both are meaningless: `bounce` is 0.
    Rgb to_diffuse = Rgb(0.0f), to_specular = Rgb(0.0f);
    // The last vertex: lobe values over pdf, the pdf for MIS, and who receives light there (the camera: everything).
    Scattering last;
    LightReceiver receiver;
    bool has_passed = false;  // through something cut out, since the last vertex

    // Throughput to each of the two layers, with the last vertex's lobes weighted by a light's multipliers.
    std::pair<Rgb, Rgb> weights(float diffuse, float specular) const {
        if (bounce == 1) return {last.diffuse * diffuse, last.specular * specular};
        const Rgb lobes = last.diffuse * diffuse + last.specular * specular;
        return {to_diffuse * lobes, to_specular * lobes};
    }
};

PathTracer::PathTracer(const Scene& scene, const RayScene& ray_scene, const LightSampler& lights,
                       const std::vector<std::unique_ptr<Body>>& bodies, const std::vector<std::size_t>& group_of_light,
                       int max_bounces)
    : scene_(scene),
      ray_scene_(ray_scene),
      lights_(lights),
      bodies_(bodies),
      group_of_light_(group_of_light),
      resolver_(scene),
      max_bounces_(max_bounces) {}

void PathTracer::trace(const Ray& camera_ray, const V3f& view_axis, Sampler sampler, std::uint32_t pixel,
                       Tile& tile) const {
    Path path;
    path.pixel = pixel;
    path.ray = camera_ray;
    path.receiver.position = camera_ray.origin;
    bool has_primary = false;
    int transparent_hits = 0;

    while (true) {
        Hit hit;
        ++tile.rays;
        const bool is_hit = ray_scene_.intersect(path.ray, hit);
        add_lights_on_ray(path, is_hit ? &hit : nullptr, tile);
        if (!is_hit) return;

        const V3f wo = -path.ray.direction;
        const Surface surface = resolver_.resolve(hit, path.ray.direction);
        const Shader shader(surface, bodies_[surface.object].get());
        sampler.set_dimension(kDimensionsPerVertex * static_cast<std::uint32_t>(path.bounce + 1));

        // Go straight on where the surface is cut out; every hit in turn tosses its own coin.
        bool passes_through = false;
        const float opacity = shader.opacity();
        if (opacity < 1.0f) {
            Sampler coin = sampler;
            coin.set_dimension(kTransparencyDimensions + static_cast<std::uint32_t>(transparent_hits));
            if (++transparent_hits > kMaxTransparentHits) return;
            passes_through = coin.next_1d() >= opacity;
        }
        if (passes_through) {
            path.ray.origin = offset_origin(surface.position, -surface.geometric_normal);
            path.ray.t_max -= hit.t;
            path.ray.t_min = 0.0f;
            path.has_passed = true;
            continue;
        }
        if (!has_primary) {
            has_primary = true;
            const float depth = (surface.position - camera_ray.origin).dot(view_axis);
            tile.add_primary(pixel, {depth, surface.position, surface.normal, shader.albedo(wo), surface.object + 1});
        }

        // What the surface itself gives: emission where no mesh light stands for it, and light that diffused through ice.
        const int own_light = lights_.light_of_object(surface.object);
        const bool is_own = own_light < 0 || (path.bounce == 0 && lights_.is_material(own_light));
        if (const Rgb emission = shader.emission(); is_own && emission != Rgb(0.0f)) {
            if (path.bounce == 0) {
                tile.add(pixel, Component::emission, own_light < 0 ? 0 : group_of_light_[own_light], emission);
            } else {
                const auto [diffuse, specular] = path.weights(1.0f, 1.0f);
                tile.add(pixel, Component::diffuse, 0, diffuse * emission);
                tile.add(pixel, Component::specular, 0, specular * emission);
            }
        }
        request_gather(path, surface, wo, sampler, tile);

        add_direct_light(path, surface, shader, wo, sampler, tile);
        if (path.bounce >= max_bounces_) return;

        // Continue along one lobe.
        V3f wi;
        const float u_lobe = sampler.next_1d();
        if (!shader.sample(wo, u_lobe, sampler.next_2d(), wi)) return;
        Scattering value = shader.eval(wo, wi);
        if (!(value.pdf > 0.0f)) return;
        value.diffuse /= value.pdf;
        value.specular /= value.pdf;
        if (path.bounce > 0) std::tie(path.to_diffuse, path.to_specular) = path.weights(1.0f, 1.0f);
        path.last = value;
        path.receiver = {surface.position, surface.geometric_normal, surface.object};
        path.has_passed = false;
        ++path.bounce;

        // Russian roulette on what the path may still bring.
        if (path.bounce > kBouncesBeforeRoulette) {
            const auto [diffuse, specular] = path.weights(1.0f, 1.0f);
            const float survival = std::min(1.0f, std::max(max_component(diffuse), max_component(specular)));
            if (!(sampler.next_1d() < survival)) return;
            path.to_diffuse /= survival;
            path.to_specular /= survival;
        }
        path.ray.origin = offset_origin(surface.position, surface.geometric_normal);
        path.ray.direction = wi;
        path.ray.t_min = 0.0f;
        path.ray.t_max = std::numeric_limits<float>::infinity();
    }
}

// Light that the ray runs into: domes for camera rays, every light with an extent after that, weighted against
// add_direct_light's choice of the same direction.
void PathTracer::add_lights_on_ray(const Path& path, const Hit* surface, Tile& tile) const {
    thread_local std::vector<LightHit> hits;
    hits.clear();
    const float t_max = surface ? surface->t : std::numeric_limits<float>::infinity();
    lights_.intersect(path.receiver, path.ray.origin, path.ray.direction, t_max, hits);
    if (LightHit mesh; surface && lights_.hit_object(path.receiver, surface->placement, surface->triangle,
                                                     path.ray.direction, t_max, mesh)) {
        hits.push_back(mesh);
    }
    for (LightHit& hit : hits) {
        const Light& light = lights_.lights()[hit.light];
        const std::size_t group = group_of_light_[hit.light];
        if (path.bounce == 0) {
            if (t_max < hit.distance) continue;
            if (std::holds_alternative<DomeLight>(light.shape)) {
                tile.add(path.pixel, Component::background, group, hit.radiance);
            } else if (std::holds_alternative<MeshLight>(light.shape) && !lights_.is_material(hit.light)) {
                tile.add(path.pixel, Component::emission, group, hit.radiance);
            }
            continue;
        }
        // Lights whose shadows are not plain may shine through what the ray has met: they are asked once, from the vertex.
        if (!lights_.has_plain_shadow(hit.light) && !std::holds_alternative<MeshLight>(light.shape)) {
            if (path.has_passed) continue;
            const Ray shadow{path.ray.origin, path.ray.direction, 0.0f, hit.distance * (1.0f - 1e-4f)};
            hit.radiance *= shadow_factor(ray_scene_, lights_, hit.light, shadow);
        }
        const float mis = path.last.pdf / (path.last.pdf + hit.pdf);
        const auto [diffuse, specular] =
            path.weights(multiplier(light, LightComponent::diffuse), multiplier(light, LightComponent::specular));
        tile.add(path.pixel, Component::diffuse, group, diffuse * hit.radiance * mis);
        tile.add(path.pixel, Component::specular, group, specular * hit.radiance * mis);
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
    const Light& light = lights_.lights()[sample.light];
    const Rgb diffuse_lobe = value.diffuse * multiplier(light, LightComponent::diffuse);
    const Rgb specular_lobe = value.specular * multiplier(light, LightComponent::specular);
    if (diffuse_lobe == Rgb(0.0f) && specular_lobe == Rgb(0.0f)) return;

    Ray shadow;
    shadow.origin = offset_origin(surface.position, surface.geometric_normal);
    shadow.direction = sample.direction;
    shadow.t_max = sample.distance * (1.0f - 1e-4f);
    ++tile.rays;
    const Rgb arriving = sample.radiance * shadow_factor(ray_scene_, lights_, sample.light, shadow);
    if (arriving == Rgb(0.0f)) return;

    const float mis = sample.is_delta ? 1.0f : sample.pdf / (sample.pdf + value.pdf);
    const Rgb light_over_pdf = arriving * (mis / sample.pdf);
    const std::size_t group = group_of_light_[sample.light];
    Rgb diffuse = diffuse_lobe, specular = specular_lobe;
    if (path.bounce > 0) {
        const auto [to_diffuse, to_specular] = path.weights(1.0f, 1.0f);
        diffuse = to_diffuse * (diffuse_lobe + specular_lobe);
        specular = to_specular * (diffuse_lobe + specular_lobe);
    }
    tile.add(path.pixel, Component::diffuse, group, diffuse * light_over_pdf);
    tile.add(path.pixel, Component::specular, group, specular * light_over_pdf);
}

void PathTracer::request_gather(const Path& path, const Surface& surface, const V3f& wo, Sampler& sampler,
                                Tile& tile) const {
    const Body* body = bodies_[surface.object].get();
    if (!body || !body->tree || body->material->translucency == 0.0f) return;
    const IceMaterial& ice = *body->material;

    const Rgb weight = body->radiance_per_exitance(surface, wo);

    GatherRequest request;
    request.object = surface.object;
    request.pixel = path.pixel;
    request.subset = tile.subset;
    request.position = surface.position;
    request.is_primary = path.bounce == 0;
    if (request.is_primary) {
        request.weight = weight;
    } else {
        const auto [diffuse, specular] = path.weights(1.0f, 1.0f);
        request.weight = diffuse * weight;
        request.specular_weight = specular * weight;
    }

    if (ice.compensation.mode == CompensationMode::fill) {
        const float u_pick = sampler.next_1d();
        const LightReceiver receiver{surface.position, surface.geometric_normal, surface.object};
        const LightSample sample = lights_.sample(receiver, u_pick, sampler.next_2d(), LightUse::translucency);
        const float cosine = surface.normal.dot(sample.direction);
        Ray shadow{offset_origin(surface.position, surface.geometric_normal), sample.direction, 0.0f,
                   sample.distance * (1.0f - 1e-4f)};
        if (sample.pdf > 0.0f && cosine > 0.0f && surface.geometric_normal.dot(sample.direction) > 0.0f) {
            const Light& light = lights_.lights()[sample.light];
            const float entering = body->transmittance(cosine, eval_float(ice.roughness, surface.st));
            request.entering = sample.radiance * shadow_factor(ray_scene_, lights_, sample.light, shadow) *
                               (multiplier(light, LightComponent::translucency) * entering * cosine / sample.pdf);
            request.entering_group = static_cast<std::uint32_t>(group_of_light_[sample.light]);
        }
    }
    tile.requests.push_back(request);
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
        const Gathered gathered = body.tree->gather(positions.data(), positions.size(), options);

        for (std::size_t i = begin; i < end; ++i) {
            const GatherRequest& request = tile.requests[i];
            tile.subset = request.subset;
            const Rgb& coverage = gathered.coverage[i - begin];
            const Compensation& compensation = body.material->compensation;
            const Rgb gain = compensation_gain(compensation, coverage, body.total_reflectance);
            const Rgb fill = fill_amount(compensation, coverage, body.total_reflectance) * request.entering;
            for (std::size_t group = 0; group < gathered.groups; ++group) {
                Rgb exitance = gathered.exitance[(i - begin) * gathered.groups + group] * gain;
                if (group == request.entering_group) exitance += fill;
                if (request.is_primary) {
                    tile.add(request.pixel, Component::translucency, group, exitance * request.weight);
                } else {
                    tile.add(request.pixel, Component::diffuse, group, exitance * request.weight);
                    tile.add(request.pixel, Component::specular, group, exitance * request.specular_weight);
                }
            }
            if (request.is_primary) tile.add_coverage(request.pixel, coverage);
        }
        begin = end;
    }
    tile.requests.clear();
}

}  // namespace frazil
