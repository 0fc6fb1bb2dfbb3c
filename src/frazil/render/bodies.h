// Translucent bodies: every object of ice with its points, the light that enters them and the tree that sums it.
// Model: points -> irradiance -> bounces (bounces.h) -> tree, once per render. Objects that place the same mesh in the same
//   size share one Poisson set, moved to each; light differs, so each has a tree of its own.
// Units: metres, world space.
// Not: light that diffuses from one body into another that it touches.
#pragma once

#include <memory>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/material/microfacet.h"
#include "frazil/render/render.h"
#include "frazil/render/surface.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

struct Body {
    const IceMaterial* material = nullptr;
    std::shared_ptr<const DielectricAlbedo> boundary;
    Profile profile;
    Rgb total_reflectance = Rgb(0.0f);      // Rd_total
    std::unique_ptr<const PointTree> tree;  // none where the object has no surface

    // What the boundary lets in (and out) at this angle; its mean over all directions; for one user roughness.
    float transmittance(float cos_theta, float roughness) const;
    float transmittance_average(float roughness) const;

    // Radiance towards wo per unit of exitance: diffuse inside, then through the boundary, so that T/T_avg averages to one.
    Rgb radiance_per_exitance(const Surface& surface, const V3f& wo) const;
};

// A body's points and the light that enters them, needed until its tree is made.
struct LitPoints {
    PointSet points;
    std::vector<Rgb> irradiance;  // (N, groups)
};

// The spacing of an object's points: the render's, else the material's, else half the shortest mean free path of a
// channel, but so that the object alone has about a thousand points at least and a million at most.
float point_spacing(const IceMaterial& material, double area, const RenderOptions& options);

// One entry per object of the scene; null for those that are not ice. Fills points, nodes, bake rays and seconds of the
// stats. ValueError names the object whose points would not fit into memory.
std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene, const RayScene& ray_scene,
                                               const LightSampler& lights, const RenderOptions& options,
                                               RenderStats& stats, Progress* progress);

}  // namespace frazil
