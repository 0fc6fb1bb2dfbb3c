// What a path from the camera knows between two vertices, and what its vertices share.
// Model: weights are kept by the layer of the first lobe; inside ice a path consists of pieces, each with the core that
//   answers for what it leaves behind.
// Units: metres, world space; weights are radiance to the camera per radiance; inside ice radiance over squared index.
// Not: how a path goes on (path.cpp, path_ice.cpp, path_sheets.cpp) and what lights give it (path_lights.cpp).
#pragma once

#include <limits>
#include <tuple>

#include "frazil/base/sampler.h"
#include "frazil/lighting/light_sampling.h"
#include "frazil/render/interior.h"
#include "frazil/render/lpe_tracks.h"
#include "frazil/render/overlay_layers.h"
#include "frazil/render/shading.h"
#include "frazil/render/surface.h"
#include "frazil/render/tile.h"

namespace frazil {

// Dimensions that one vertex may draw from the sampler, so that all vertices are stratified alike; a path that was split
// off has vertices of its own. Beyond them are those of surfaces and fracture planes that let a path through, of the
// light that enters where ice is seen, and of what is open there.
constexpr std::uint32_t kDimensionsPerVertex = 16;
constexpr std::uint32_t kSplitVertex = 64;
constexpr std::uint32_t kTransparencyDimensions = 4096, kSheetDimensions = 16384, kFillDimensions = 32768,
                        kOpennessDimensions = 49152;
// Surfaces that a path goes through without a lobe; meetings with the boundary from inside, after which the core answers
// for what is left, and those after which only some go on, each with that chance.
constexpr int kMaxTransparentHits = 64, kMaxInnerBounces = 24, kInnerBouncesBeforeRoulette = 8;
constexpr float kInnerChance = 0.75f;
// How much wider a diffuse lobe makes the cone that a path stands for, per metre: a sample stands for some percent of the
// hemisphere.
constexpr float kDiffuseSpread = 0.2f;
// The same for a glossy lobe.
inline float lobe_spread(float alpha) {
    return 0.5f * alpha;
}
// Lights that are asked at a first vertex, about: one that gives a third of the light or more is asked every time.
constexpr float kFirstPicks = 3.0f;

// What a diffuse lobe counts for in Path::blur.
constexpr float kDiffuseBlur = 0.3f;

inline float multiplier(const Light& light, LightComponent component) {
    return light.multipliers[static_cast<int>(component)];
}

// A point's frame of shading.
struct Frame {
    explicit Frame(const V3f& n) : normal(n) { std::tie(tangent, bitangent) = tangent_frame(n); }
    V3f to_local(const V3f& v) const { return {v.dot(tangent), v.dot(bitangent), v.dot(normal)}; }
    V3f to_world(const V3f& v) const { return tangent * v.x + bitangent * v.y + normal * v.z; }
    V3f normal, tangent, bitangent;
};

// Where a piece of a path inside ice begins, and what its core sends from there.
struct IceCore {
    int body = InsideOf::kNone;
    V3f position = V3f(0.0f);
    V3f normal = V3f(0.0f);  // outwards; 0 where the position lies inside, not on the surface
    // From there along the surface to where the light that is seen was scattered last, on the mean, in a body without another side.
    V3f drift = V3f(0.0f);
    float depth = 0.0f;                     // how far inwards that is
    float slant = -1.0f;                    // the cosine inside that it is seen at, < 0 where it is seen from inside
    float within = 1.0f;                    // what of the way to where light is scattered first the body has room for
    Rgb radiance_per_exitance = Rgb(0.0f);  // over squared index, averaged over angles
    bool is_primary = false;                // seen by the camera itself
    bool is_entered = false;                // its light leaves where the path went in: instead of the refraction there
    std::uint32_t entering_place = GatherRequest::kNowhere;

    // Where the body ends before light is scattered first: how far it goes there, of how far it would go.
    void stop_within(float part) {
        within = part;
        drift *= part;
        depth *= part;
    }
};

// The state of a path between two vertices.
struct Path {
    std::uint32_t pixel = 0, vertex = 0;
    float samples = 1.0f;  // of the camera that it stands for: its weights are so many times as large
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
    IceCore core;
    float clear = 1.0f, volume = 0.0f;  // how much of the next piece is seen through, and scattered once
    Rgb tint = Rgb(1.0f);               // of what is seen through, by the boundary where the piece begins
    float core_share = 1.0f;            // of what is seen through, how much the core leaves out for it
    // Slopes of the lobes so far, alphas added in quadrature: further lobes are at least as broad.
    float blur = 0.0f;
    float width = 0.0f, spread = 0.0f;   // of the cone that the path stands for: radius at the ray's origin, per metre
    LpeTracks lpe;                       // of the light path expressions that are asked for
    std::vector<OverlayShare> overlays;  // where the camera sees ice first, if their layers are asked for
    std::uint32_t first_material = 0;    // of that ice

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

    void add_blur(float alpha) { blur = std::min(1.0f, std::sqrt(blur * blur + alpha * alpha)); }

    void scale(const Rgb& factor) {
        last.scale(factor);
        lpe.scale(factor);
    }

    // What one of its samples may still bring, at most.
    float worth() const {
        const Scattering w = weights();
        return std::max({max_component(w.diffuse), max_component(w.specular), max_component(w.refraction)}) / samples;
    }

    // Go on with the given chance; false where the path ends.
    bool survives(float chance) {
        if (chance >= 1.0f) return true;
        if (!(sampler.next_1d() < chance)) return false;
        scale(Rgb(1.0f / chance));
        return true;
    }

    // What it leaves behind when it goes through a boundary: lights already served from the last opaque vertex.
    void pass_boundary() {
        light_share = light_share_beyond();
        has_direct_light = false;
    }
    Rgb light_share_beyond() const {
        Rgb share = light_share;
        for (int c = 0; has_direct_light && c < 3; ++c) {
            const float all = last.diffuse[c] + last.specular[c] + last.refraction[c];
            const float served = is_glossy ? last.diffuse[c] : last.diffuse[c] + last.specular[c];
            share[c] *= all > 0.0f ? 1.0f - served / all : 0.0f;
        }
        return share;
    }

    // How many lights are asked at the vertex that it has come to.
    float light_picks() const { return bounce == 0 ? kFirstPicks : 1.0f; }
    // `side` is that of the surface which receives.
    void receive(const Surface& surface, const V3f& side, LightUse wanted, float picks = 1.0f) {
        receiver = {surface.position, side, surface.object, picks};
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
    void begin_piece(const IceCore& from, float volume_weight) {
        core = from;
        clear = core_share = 1.0f;
        tint = Rgb(1.0f);
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

    // Overlays on the way of light need no detail.
    float shadow_footprint() const { return 4.0f * width; }

    void begin_vertex() { sampler.set_dimension(kDimensionsPerVertex * ++vertex); }
};

}  // namespace frazil
