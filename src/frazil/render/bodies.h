// Translucent bodies: every object of ice with its boundary, its profile and the tree that sums the light of its points.
// Model: one tree per object, of the points and light that were baked (bake.h).
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
#include "frazil/render/scene.h"
#include "frazil/render/surface.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

struct Body {
    const IceMaterial* material = nullptr;
    std::shared_ptr<const DielectricAlbedo> boundary;
    Profile profile;
    Rgb total_reflectance = Rgb(0.0f);      // Rd_total
    std::unique_ptr<const PointTree> tree;  // none where the object has no surface
    float spacing = 0.0f;                   // of its points

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
    std::vector<Rgb> irradiance;  // (N, groups)
};

// What each object lets through for shadow rays: ice what its boundary transmits and its medium neither scatters nor
// absorbs; others nothing.
std::vector<Passage> passages_of(const Scene& scene);

// One entry per object of the scene, without trees; null for those that are not ice.
std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene);

// Give every body the tree of its points, (N, groups) of light each. Fills points, nodes and seconds of the stats.
void plant_trees(const std::vector<LitPoints>& lit, std::size_t groups, std::vector<std::unique_ptr<Body>>& bodies,
                 RenderStats& stats);

}  // namespace frazil
