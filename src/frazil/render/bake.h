// What is baked once per shot and serves every camera: the points of each translucent body and the light that enters.
// Model: points -> irradiance -> bounces (bounces.h), per light group; a group's light does not depend on the others.
//   Objects that place the same mesh in the same size share one Poisson set, moved to each, and so do the frames in which
//   an object only moves; a mesh with a rest pose has its points from there.
// Units: metres, world space; irradiance in the lights' unit.
// Valid: for the scene and options that it was made with; the same bits for any number of threads.
// Not: files (the Python package's), the tree (bodies.h).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frazil/base/progress.h"
#include "frazil/render/bodies.h"

namespace frazil {

// The spacing of an object's points: the render's, else the material's, else half the shortest mean free path of a
// channel, but so that the object alone has about a thousand points at least and a million at most.
float point_spacing(const Body& body, double area, const RenderOptions& options);

struct Bake {
    std::vector<std::string> groups;  // the light groups, in the scene's order
    std::vector<LitPoints> bodies;    // one per object; empty for those that are not ice
};

// Bake `scene` for `bodies` (make_bodies). Of `known` what is there is taken over: points of objects that have some, and
// the light of groups that are named, where all of the objects have their points. Fills points, bake rays and seconds of
// the stats. ValueError names the object whose points would not fit into memory.
Bake make_bake(const Scene& scene, const RayScene& ray_scene, const std::vector<std::unique_ptr<Body>>& bodies,
               const RenderOptions& options, Bake known, RenderStats& stats, Progress* progress);

// ValueError where a bake cannot be of this scene: other objects, other light groups.
void check_bake(const Scene& scene, const Bake& bake);

}  // namespace frazil
