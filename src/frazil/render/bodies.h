// Translucent bodies: every object of ice with its boundary, its profile and the tree that sums the light of its points.
// Model: one tree per object, or per set of objects that share their light (translucency_sets.h), of the points and light
//   that were baked (bake.h).
// Units: metres, world space.
// Not: light that diffuses from one body into another that it touches.
#pragma once

#include <memory>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/material/microfacet.h"
#include "frazil/render/options.h"
#include "frazil/render/point_gathers.h"
#include "frazil/render/scene.h"
#include "frazil/render/shells.h"
#include "frazil/render/surface.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

struct Body {
    const IceMaterial* material = nullptr;
    std::shared_ptr<const DielectricAlbedo> boundary;
    Profile profile;
    Rgb total_reflectance = Rgb(0.0f);              // Rd_total
    std::shared_ptr<const PointTree> tree;          // none where the object has no surface; one for a translucency set
    std::shared_ptr<const PointTree> thickness;     // make_thickness_tree
    std::unique_ptr<const PointTree> overlay_tree;  // plant_overlay_trees, where such layers are asked for
    // Light of one scattering that rays trace and the profile leaves out: its plane albedo, over irradiance; and what the
    // core's radiance is scaled by, so that it averages to the exitance less what each ray finds to be scattered once.
    Rgb traced_once = Rgb(0.0f), core_scale = Rgb(1.0f);
    float spacing = 0.0f;                                     // of its points
    std::shared_ptr<const PointGathers> at_points = nullptr;  // where a render has a use for them

    // What exitance is scaled by where W is `coverage`; `thin` is one of thickness_gains(), null without.
    Rgb gain(const Compensation& compensation, const Rgb& coverage, const Rgb* thin) const;

    // What the boundary lets in (and out) at this angle; its mean over all directions; for one user roughness.
    float transmittance(float cos_theta, float roughness) const;
    float transmittance_average(float roughness) const;

    // Radiance over squared index, inside below the surface, per unit of exitance: what leaves before the boundary dims it.
    Rgb inner_radiance_per_exitance(const Surface& surface) const;
    // Radiance towards wo per unit of exitance: diffuse inside, then through the boundary, so that T/T_avg averages to one.
    Rgb radiance_per_exitance(const Surface& surface, const V3f& wo) const;
};

// A body's points and the light that enters them.
struct LitPoints {
    PointSet points;
    std::vector<Rgb> irradiance;    // (N, groups)
    std::vector<V3f> moments = {};  // (N, groups), as in Irradiance; empty where light was baked at the points alone
    std::shared_ptr<const Cells> cells = nullptr;  // of the points; made anew where they are wanted and not here
};

// The cells that an object's tree is made with; null where its light was baked at the points alone.
std::shared_ptr<const Cells> cells_of_body(const Scene& scene, std::size_t object, const LitPoints& lit);
// Whether trees are given the moments of light: they keep one centre of light a cell for all groups together, which would
// move when one group's light is changed after the render.
inline bool trees_take_moments(std::size_t groups) {
    return groups == 1;
}

// A tree that sums the gain of thin parts (thickness.h) over a body's points; none where it has no points.
std::unique_ptr<const PointTree> make_thickness_tree(const Body& body, const PointSet& points,
                                                     const RayScene& ray_scene, const Shells* shells = nullptr);
// The mean gain around each position, from such a tree; empty without one.
std::vector<Rgb> thickness_gains(const PointTree* thickness, const V3f* positions, std::size_t count,
                                 const GatherOptions& options);
// Scale the exitance that was gathered for bounces: by `depth` at full strength, whatever the material asks for where it is
// seen. So bounces keep energy, and a picture's compensation can be changed exactly after its render. `gains` as above.
void compensate_bounce(const Body& body, const std::vector<Rgb>& gains, Gathered& gathered);
// What each object lets through for shadow rays: ice what its boundary transmits and its medium neither scatters nor
// absorbs; others nothing.
std::vector<Passage> passages_of(const Scene& scene);

// One entry per object of the scene, without trees; null for those that are not ice.
std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene);

// Give every body the tree of its points, (N, groups) of light each, and that of its thickness where its compensation has a
// use for it or a layer `wants_depth`; and the gathers at its points, where the plan wants them. Fills points, nodes and
// seconds of the stats.
void plant_trees(const Scene& scene, const std::vector<LitPoints>& lit, std::size_t groups, const RayScene& ray_scene,
                 bool wants_depth, PointGatherPlan plan, std::vector<std::unique_ptr<Body>>& bodies,
                 RenderStats& stats);

}  // namespace frazil
