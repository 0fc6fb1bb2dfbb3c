// Translucent bodies: every object of ice with its points, the light that enters them and the tree that sums it.
// Model: points -> irradiance -> tree, once per render. Objects that place the same mesh in the same size share one
//   Poisson set, moved to each; light differs, so each has a tree of its own.
// Units: metres, world space.
// Not: light that passes from one body into another.
#pragma once

#include <memory>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/geometry/ray_scene.h"
#include "frazil/lighting/irradiance.h"
#include "frazil/material/microfacet.h"
#include "frazil/render/render.h"
#include "frazil/translucency/point_tree.h"

namespace frazil {

struct Body {
    const IceMaterial* material = nullptr;
    std::shared_ptr<const DielectricAlbedo> boundary;
    std::unique_ptr<const PointTree> tree;  // none where the object has no surface
    Rgb total_reflectance = Rgb(0.0f);      // Rd_total
};

// The spacing of an object's points: the render's, else the material's, else the shortest mean free path of a channel,
// but never so fine that the object alone needs more than about a million points.
float point_spacing(const IceMaterial& material, double area, const RenderOptions& options);

// One entry per object of the scene; null for those that are not ice. Fills points, nodes, bake rays and seconds of the
// stats. ValueError names the object whose points would not fit into memory.
std::vector<std::unique_ptr<Body>> make_bodies(const Scene& scene, const RayScene& ray_scene,
                                               const LightSampler& lights, const RenderOptions& options,
                                               RenderStats& stats, Progress* progress);

}  // namespace frazil
