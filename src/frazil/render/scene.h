// The whole scene, as plain data: what a USD stage (or Python) fills in and every stage reads.
// Model: meshes and materials are shared by index; objects place them. Nested instances arrive flattened.
// Units: metres, radiance; right-handed, any up axis (the reader turns it to +y).
// Not: time. A scene is one frame; where it goes from there is told for motion vectors alone.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "frazil/geometry/mesh.h"
#include "frazil/lighting/light.h"
#include "frazil/material/ice.h"
#include "frazil/material/standard.h"
#include "frazil/render/camera.h"

namespace frazil {

struct Material {
    std::string path;
    std::variant<StandardMaterial, IceMaterial> model;
};

struct Object {
    std::string path;
    std::uint32_t mesh = 0;
    std::uint32_t material = 0;
    M44f local_to_world;
    std::string asset;             // what it belongs to, for Cryptomatte; empty = the object itself
    std::string translucency_set;  // ice whose objects share their light as one body; empty = the object by itself
};

// How a scene goes on: its objects' transforms, the vertices of its meshes (empty where they stay) and its camera a frame
// later.
struct SceneMotion {
    std::vector<M44f> local_to_world;
    std::vector<std::vector<V3f>> positions;
    Camera camera;
};

struct Scene {
    std::vector<Mesh> meshes;
    std::vector<std::string> mesh_paths;  // for messages, one per mesh
    std::vector<Material> materials;
    std::vector<Object> objects;
    std::vector<Light> lights;
    Camera camera;
    std::optional<SceneMotion> motion;
};

// Check everything once before a render: ValueError with the path of the first thing that is wrong.
void check_scene(const Scene& scene);

}  // namespace frazil
